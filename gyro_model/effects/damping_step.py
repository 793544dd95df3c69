"""All damping multiplies by a factor at one instant: a seal that leaks, a part that ages at once.

    d → d · factor for t ≥ time

As in TW 201137310, second embodiment (figs. 8 and 10), where all damping changes at 0.45 s. The integrator stops at the
instant, on the grid or off it.
"""

from gyro_model.anatomy import Law, Limit
from gyro_model.quantities import Grid, shape, size
from gyro_model.symbols import after, dxx, dxy, dyy

FACTOR = size("damping_step_factor", "1", "all damping multiplies by this", neutral=1.0, low=0.0)
TIME = shape("damping_step_time", "s", 0.0, "instant at which the damping steps", nominal=1.0, search=Grid.instant)
factor = FACTOR.symbol

EFFECT = Law(
    id="damping_step",
    parameters=(FACTOR, TIME),
    changes={d: d * (1 + (factor - 1) * after) for d in (dxx, dyy, dxy)},
    event=TIME.symbol,
    signature="decay rates change at one instant",
    host_experiment="any record across the instant",
    limits=(
        Limit(
            why="before the instant nothing changes",
            at={"damping_step_factor": 2.0, "dxx": 1e-6, "dyy": 2e-6, "dxy": 3e-7, "after": 0.0},
            gives={"dxx": 1e-6, "dyy": 2e-6, "dxy": 3e-7},
        ),
        Limit(
            why="after it everything doubles",
            at={"damping_step_factor": 2.0, "dxx": 1e-6, "dyy": 2e-6, "dxy": 3e-7, "after": 1.0},
            gives={"dxx": 2e-6, "dyy": 4e-6, "dxy": 6e-7},
        ),
    ),
)
