"""Stiffness changes with the temperature of the structure, y by another rate than x.

    kxx, kxy → (1 + tck ΔT), kyy → (1 + (tck + tck_split) ΔT), ΔT = T_structure - t_ref

k(T) = k0 [1 - α (T - T0)], so that f(T) ≈ f0 [1 - ½ α (T - T0)]: tck = -α (X. Liu et al., Chinese
Journal of Sensors and Actuators 27, 2014, eqs. 4 and 5). For silicon tck is about -6e-5 /K.
"""

from gyro_model.anatomy import Law, Limit
from gyro_model.quantities import shape, size
from gyro_model.symbols import kxx, kxy, kyy, temperature_structure

TCK = size("tck", "1/K", "temperature coefficient of stiffness", nominal=1e-4, display="ppm/K")
SPLIT = size("tck_split", "1/K", "what the y axis has beyond tck", nominal=1e-5, display="ppm/K")
REFERENCE = shape("t_ref", "K", 298.15, "temperature at which parameters are as given", display="degC", search=None)
difference = temperature_structure - REFERENCE.symbol

EFFECT = Law(
    id="thermal_stiffness",
    parameters=(TCK, SPLIT, REFERENCE),
    changes={
        kxx: kxx * (1 + TCK.symbol * difference),
        kxy: kxy * (1 + TCK.symbol * difference),
        kyy: kyy * (1 + (TCK.symbol + SPLIT.symbol) * difference),
    },
    signature="both resonances move with temperature, by half tck relative; the split by half tck_split",
    host_experiment="temperature step",
    limits=(
        Limit(
            why="10 K above: -6e-4 of kxx and kxy, -6e-4 + 1e-4 of kyy",
            at={
                "tck": -6e-5,
                "tck_split": 1e-5,
                "t_ref": 300.0,
                "temperature_structure": 310.0,
                "kxx": 1.0,
                "kyy": 2.0,
                "kxy": 0.5,
            },
            gives={"kxx": 0.9994, "kxy": 0.4997, "kyy": 1.999},
        ),
    ),
)
