"""The force is other than recorded by a factor: the converter's range, the constant of a drive.

F = (1 + s) u. With m, k and d free no sample shows it: all of them come out smaller by that factor. It is never named;
where m and k all come out off nominal by one factor that is said as a doubt.
"""

from collections.abc import Mapping

from discrepancy.data.record import Floats
from discrepancy.fit.defect import Distortion
from gyro_model.quantities import size

SCALE = size("force_scale", "1", "relative error of the recorded force", low=-0.9)


def force(u: Floats, step: float, p: Mapping[str, float]) -> Floats:
    """What acted."""
    return (1 + p["force_scale"]) * u


DEFECT = Distortion(
    id="force_scale",
    parameters=(SCALE,),
    signature="mass, stiffness and damping off nominal by one factor",
    source="K. Glover, J. C. Willems, IEEE Trans. Automatic Control 19, 1974: what a transfer function leaves open",
    force=force,
    gauge=True,
)
