"""Dry friction: a force against the velocity that does not grow with it, higher near rest (Stribeck).

    F_q = -f_q s(q'),  s(w) = tanh(w/v) (1 + stribeck exp(-(w/v_s)²)),  q = x, y

Coulomb friction f, smoothed over the speed v; ``stribeck`` is by how much breakaway exceeds it (S. Andersson, A.
Söderberg, S. Björklund, Friction models for sliding dry, boundary and mixed lubricated contacts, Tribology
International 40, 2007, the combined model without its viscous part). The integrator shortens its steps where the
force changes its sign, so that a small v costs time there and nothing else.
"""

from sympy import Expr, Symbol, exp, tanh

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import Grid, shape, size
from gyro_model.symbols import x_dot, y_dot

FRICTION_X = size("friction_x", "N", "dry friction, x axis", low=0.0, nominal=1e-8, display="µN")
FRICTION_Y = size("friction_y", "N", "dry friction, y axis", low=0.0, nominal=1e-8, display="µN")
SPEED = shape(
    "friction_speed",
    "m/s",
    1e-3,
    "speed over which the friction changes its sign",
    low=1e-12,
    # What rests creeps all the same: to stay for a hundred periods where it stopped it needs a millionth.
    search=Grid.log(1e-3, 1, of="x_dot", below=1e3),
)
STRIBECK = shape(
    "stribeck",
    "1",
    0.0,
    "by how much friction near rest exceeds that at speed, relative",
    low=0.0,
    nominal=0.3,
    search=Grid.log(1, 1, points=1),
)
STRIBECK_SPEED = shape(
    "stribeck_speed",
    "m/s",
    5e-3,
    "speed at which that excess has faded",
    low=1e-12,
    search=Grid.log(0.2, 0.2, of="x_dot", points=1),
)
f_x, f_y = FRICTION_X.symbol, FRICTION_Y.symbol


def _course(speed: Symbol) -> Expr:
    # Not as a product, so that what no device but a few has costs nothing.
    course = tanh(speed / SPEED.symbol)
    return course + STRIBECK.symbol * exp(-((speed / STRIBECK_SPEED.symbol) ** 2)) * course


EFFECT = Force(
    id="dry_friction",
    parameters=(FRICTION_X, FRICTION_Y, SPEED, STRIBECK, STRIBECK_SPEED),
    force=(-f_x * _course(x_dot), -f_y * _course(y_dot)),
    energy=Energy(dissipated=f_x * _course(x_dot) * x_dot + f_y * _course(y_dot) * y_dot),
    signature="the amplitude of a ring-down falls in a straight line; small motions are damped most; third harmonic",
    host_experiment="ring-down to small amplitudes, drive level ramp",
    limits=(
        Limit(
            why="at the friction speed tanh 1 = 0.76159...; y at rest feels none",
            at={"friction_x": 1e-7, "friction_y": 2e-7, "x_dot": 1e-3, "y_dot": 0.0, "friction_speed": 1e-3},
            gives={"force_x": -7.615941559557649e-08, "force_y": 0.0},
        ),
        Limit(
            why="forty friction speeds on tanh is 1; at the Stribeck speed the excess of one half is down to 0.5/e",
            at={
                "friction_x": 1e-7,
                "friction_y": 2e-7,
                "x_dot": 4e-2,
                "y_dot": -4e-2,
                "friction_speed": 1e-3,
                "stribeck": 0.5,
                "stribeck_speed": 4e-2,
            },
            gives={"force_x": -1.1839397205857213e-07, "force_y": 2.3678794411714426e-07},
        ),
    ),
)
