"""The damping of the axes against one another creeps with the logarithm of time: the device ages.

    dxy → dxy + ageing log(1 + t/t_a) √(dxx dyy)

What relaxes over activation energies that are spread evenly goes with the logarithm (W. Primak, Kinetics of processes
distributed in activation energy, Physical Review 100, 1955). In the cross damping it is a bias of the rate gyroscope.
"""

from sympy import log, sqrt

from gyro_model.anatomy import Law, Limit
from gyro_model.quantities import Grid, shape, size
from gyro_model.symbols import dxx, dxy, dyy, t

AGEING = size("ageing", "1", "cross damping that comes with each e-fold of time, over √(dxx dyy)", nominal=1e-4)
TIME = shape("ageing_time", "s", 3600.0, "age at the start", low=1e-6, search=Grid.log(0.03, 3, of="duration"))

EFFECT = Law(
    id="ageing",
    parameters=(AGEING, TIME),
    changes={dxy: dxy + AGEING.symbol * log(1 + t / TIME.symbol) * sqrt(dxx * dyy)},
    signature="the pattern's drift, or the bias of the rate, falls off like 1/t",
    host_experiment="a record much longer than the age at its start",
    limits=(
        Limit(
            why="after e - 1 ages the logarithm is 1: 0.002 of √(1e-6 · 4e-6) more",
            at={
                "ageing": 0.002,
                "ageing_time": 1.0,
                "t": 1.718281828459045,
                "dxx": 1e-6,
                "dyy": 4e-6,
                "dxy": 3e-7,
            },
            gives={"dxy": 3.04e-7},
        ),
    ),
)
