"""Mechanical stops on both sides of each axis: a spring and a damper that only push, and only past the gap.

    F_q = -k e³/(e² + w²) - c q' d/de (e³/(e² + w²)),  e = q - min(max(q, -g), g),  w = g/64,  q = x, y

The spring-dashpot contact of G. Gilardi, I. Sharf, Literature survey of contact dynamics modelling, Mechanism and
Machine Theory 37, 2002. The two take hold over the depth w (asperities, tilt): the force is exactly zero before the
stop, twice continuously differentiable, and k e beyond. A stop softer than the suspension has that part of its damper.
"""

from sympy import Expr, Max, Min, Rational, Symbol, log

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import Grid, shape, size
from gyro_model.symbols import kxx, x, x_dot, y, y_dot

STIFFNESS = size("stop_stiffness", "N/m", "stiffness of the stops", low=0.0, nominal=1e5)
GAP = shape(
    "stop_gap",
    "m",
    2e-6,
    "displacement at which the mass meets a stop",
    low=1e-12,
    display="µm",
    search=Grid.log(0.5, 0.98, of="x"),
)
DAMPING = shape(
    "stop_damping",
    "N.s/m",
    0.0,
    "damping of the stops while they touch",
    low=0.0,
    nominal=1e-4,
    search=Grid.log(1, 1, of="dxx", points=1),
)
k, g, c = STIFFNESS.symbol, GAP.symbol, DAMPING.symbol

ENTRY = Rational(1, 64)
"""Depth over which a stop takes hold, over the gap."""
w = ENTRY * g


def _depth(q: Symbol) -> Expr:
    return q - Max(Min(q, g), -g)


def _pushed(e: Expr) -> Expr:
    return k * e**3 / (e**2 + w**2)


def _stored(e: Expr) -> Expr:
    return k * (e**2 - w**2 * log(1 + e**2 / w**2)) / 2


def _damping(e: Expr) -> Expr:
    # A stop softer than the suspension is none, and its damper goes with it.
    return c * Min(k / kxx, 1) * e**2 * (e**2 + 3 * w**2) / (e**2 + w**2) ** 2


EFFECT = Force(
    id="contact_stop",
    parameters=(STIFFNESS, GAP, DAMPING),
    force=(
        -_pushed(_depth(x)) - _damping(_depth(x)) * x_dot,
        -_pushed(_depth(y)) - _damping(_depth(y)) * y_dot,
    ),
    energy=Energy(
        stored=_stored(_depth(x)) + _stored(_depth(y)),
        dissipated=_damping(_depth(x)) * x_dot**2 + _damping(_depth(y)) * y_dot**2,
    ),
    signature="the amplitude stays at the gap however hard the drive; odd harmonics at once beyond it",
    host_experiment="drive level ramp to beyond the gap",
    limits=(
        Limit(
            why="64 w past it: 500 N/m · 2^-20 m · 4096/4097, and 4096 · 4099/4097² of 1e-3 N·s/m at 10 mm/s",
            at={
                "stop_stiffness": 500.0,
                "stop_gap": 2.0**-20,
                "stop_damping": 1e-3,
                "x": 2.0**-19,
                "x_dot": 1e-2,
                "y": 9e-7,
                "y_dot": 1.0,
            },
            gives={"force_x": -500 * 2.0**-20 * 4096 / 4097 - 1e-5 * 4096 * 4099 / 4097**2, "force_y": 0.0},
        ),
        Limit(
            why="y past its gap of 2^-14 m by w = 2^-20 m: half of 500 N/m · w, back; x is short of it",
            at={"stop_stiffness": 500.0, "stop_gap": 2.0**-14, "x": 5e-5, "y": -65 * 2.0**-20},
            gives={"force_x": 0.0, "force_y": 250 * 2.0**-20},
        ),
    ),
)
