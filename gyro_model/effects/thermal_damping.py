"""All damping changes with the temperature of the structure: the gas of a sealed cavity becomes more viscous.

    d → d (1 + tcd ΔT), ΔT = T_structure - t_ref

A first-order model. Q falls as T rises at constant P/T (X. Liu et al., Chinese Journal of Sensors and Actuators 27,
2014, eq. 6).
"""

from gyro_model.anatomy import Law, Limit
from gyro_model.effects.thermal_stiffness import difference
from gyro_model.quantities import size
from gyro_model.symbols import dxx, dxy, dyy

TCD = size("tcd", "1/K", "temperature coefficient of damping", nominal=1e-3, display="ppm/K")

EFFECT = Law(
    id="thermal_damping",
    parameters=(TCD,),
    changes={d: d * (1 + TCD.symbol * difference) for d in (dxx, dyy, dxy)},
    signature="decay rates change with temperature",
    host_experiment="temperature step",
    limits=(
        Limit(
            why="20 K above at 0.5 %/K: 10 % more",
            at={"tcd": 5e-3, "t_ref": 300.0, "temperature_structure": 320.0, "dxx": 1e-6, "dyy": 2e-6, "dxy": -1e-7},
            gives={"dxx": 1.1e-6, "dyy": 2.2e-6, "dxy": -1.1e-7},
        ),
    ),
)
