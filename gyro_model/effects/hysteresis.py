"""Hysteresis of the suspension: a force that depends on the way there, not on the speed (Bouc-Wen).

    F_q = -h_q z_q,  L z_q' = q' - β |q'| |z_q|^(n-1) z_q - γ q' |z_q|^n,  q = x, y

Y. K. Wen, Method for random vibration of hysteretic systems, ASCE Journal of the Engineering Mechanics Division 102,
1976. Small motions see a spring h/L; far from a turning point z is 1 where β + γ = 1, and h is a friction that
remembers. It feeds no energy where β ≥ |γ|.
"""

from sympy import Abs, Expr, Symbol

from gyro_model.anatomy import BoucWen, Energy, Force, Limit, State
from gyro_model.quantities import Grid, shape, size
from gyro_model.symbols import x, x_dot, y, y_dot

H_X = size("hysteresis_x", "N", "largest hysteretic force, x axis", low=0.0, nominal=1e-7, display="µN")
H_Y = size("hysteresis_y", "N", "largest hysteretic force, y axis", low=0.0, nominal=1e-7, display="µN")
LENGTH = shape(
    "hysteresis_length", "m", 1e-6, "way on which the force builds up", low=1e-12, search=Grid.log(0.03, 3, of="x")
)
BETA = shape("hysteresis_beta", "1", 0.5, "share of the limit that dissipates", search=Grid.usual)
# Of h, L, β and γ one is a scale of z that no sample shows: β + γ = 1 makes h the largest force.
# Where β + γ is negative there is no limit, and no scale makes it 1: z grows ever faster. Beyond γ = -2 β it is hardly
# more than a stiff spring without loss, which it would imitate.
GAMMA = shape(
    "hysteresis_gamma",
    "1",
    0.5,
    "share of the limit that bends",
    search=Grid.rest("hysteresis_beta", alone=(-1.0, -0.5)),
)
SHARPNESS = shape("hysteresis_n", "1", 1.0, "sharpness of the limit", low=1.0, high=100.0, search=Grid.usual)
beta, gamma, n = BETA.symbol, GAMMA.symbol, SHARPNESS.symbol
z_x, z_y = Symbol("hysteresis_z_x", real=True), Symbol("hysteresis_z_y", real=True)

# The smallest normal double keeps the power of no force, and its derivative, a number.
TINY = 2.2250738585072014e-308


def _power(z: Symbol, exponent: Expr) -> Expr:
    """|z|^exponent."""
    return (Abs(z) + TINY) ** exponent


def _bend(z: Symbol, speed: Symbol) -> Expr:
    # Both powers of |z| by one: a power costs as much as all the rest.
    return _power(z, n - 1) * (beta * Abs(speed) * z + gamma * speed * Abs(z))


def _rate(z: Symbol, speed: Symbol) -> Expr:
    return (speed - _bend(z, speed)) / LENGTH.symbol


def _follows(displacement: Symbol) -> BoucWen:
    return BoucWen(displacement, LENGTH.symbol, beta, gamma, n)


def _loss(h: Symbol, z: Symbol, speed: Symbol) -> Expr:
    return h * z * _bend(z, speed)


EFFECT = Force(
    id="hysteresis",
    parameters=(H_X, H_Y, LENGTH, BETA, GAMMA, SHARPNESS),
    states=(
        State(z_x, "1", "hysteretic force of x over its limit", rate=_rate(z_x, x_dot), follows=_follows(x)),
        State(z_y, "1", "hysteretic force of y over its limit", rate=_rate(z_y, y_dot), follows=_follows(y)),
    ),
    force=(-H_X.symbol * z_x, -H_Y.symbol * z_y),
    energy=Energy(
        stored=LENGTH.symbol * (H_X.symbol * z_x**2 + H_Y.symbol * z_y**2) / 2,
        dissipated=_loss(H_X.symbol, z_x, x_dot) + _loss(H_Y.symbol, z_y, y_dot),
    ),
    signature="loss and stiffness depend on the amplitude, not on the frequency; odd harmonics; the mean keeps a trace",
    host_experiment="drive level ramp",
    limits=(
        Limit(
            why="half way on, n = 2: 0.9 · ½² + 0.4 · ½² = 0.325 are bent off 20 mm/s over 1 µm; y likewise, backwards",
            at={
                "hysteresis_x": 2e-6,
                "hysteresis_y": 4e-6,
                "hysteresis_length": 1e-6,
                "hysteresis_beta": 0.9,
                "hysteresis_gamma": 0.4,
                "hysteresis_n": 2.0,
                "hysteresis_z_x": 0.5,
                "hysteresis_z_y": -0.5,
                "x_dot": 2e-2,
                "y_dot": -1e-2,
            },
            gives={"force_x": -1e-6, "force_y": 2e-6, "d_hysteresis_z_x": 13500.0, "d_hysteresis_z_y": -6750.0},
        ),
    ),
)
