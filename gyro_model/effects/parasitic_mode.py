"""A parasitic mode: another mass on its own spring, coupled to the x axis.

    q'' + (w/Q) (q' + ρ s x') + w² q = -(κ/m) x + σ s u_x/m,  s = κ/(m w²),  w = 2π · frequency
    F_x = -κ q - ρ s m (w/Q) (q' + ρ s x') - σ s u_x

The mode is scaled to the proof mass, so that the coupling is one symmetric spring κ and no energy appears from
nowhere. At rest the mode follows x by -s: ρ = 1 is a joint, whose damper lies along the spring between both masses,
ρ = 0 a damper to the ground. The drive acts at x + σ s (q - x): on the mass alone where σ = 0, on the mode alone where
σ s = 1. Where one force and one sensor are at two places of a structure, nothing they show tells σ: it is a gauge. A
model of one mode, linear, that does not follow the temperature.
"""

from sympy import Rational, Symbol, pi

from gyro_model.anatomy import Energy, Force, Limit, State
from gyro_model.quantities import Grid, shape, size, start
from gyro_model.symbols import m, u_x, x, x_dot

COUPLING = size("parasitic_coupling", "N/m", "spring that couples the parasitic mode to x", nominal=1.0)
FREQUENCY = shape(
    "parasitic_frequency",
    "Hz",
    5000.0,
    "frequency of the parasitic mode alone",
    low=1e-3,
    search=Grid.resonance(),
    display="kHz",
)
QUALITY = shape("parasitic_q", "1", 1000.0, "quality factor of the parasitic mode", low=1e-3, search=Grid.quality())
# Where damping goes as mass and stiffness do it is from 0 to 1. Far beyond, the damper of a mode is one of x: a stiff
# motion, of which no sample shows the mode.
JOINT = shape(
    "parasitic_joint",
    "1",
    0.0,
    "damping of the mode along its coupling, else to ground",
    low=-10.0,
    high=10.0,
    nominal=1.0,
    search=Grid.usual,
)
DRIVE = shape(
    "parasitic_drive",
    "1",
    0.0,
    "share of the drive on x that acts on the mode instead, over how far the mode follows x at rest",
    nominal=1.0,
    search=None,
)
START = start("parasitic_start", "m", "displacement of the parasitic mode at the start", nominal=1e-6, display="µm")
DOT_START = start("parasitic_dot_start", "m/s", "its velocity at the start", nominal=0.02, display="mm/s")

kappa = COUPLING.symbol
w = 2 * pi * FREQUENCY.symbol
q, q_dot = Symbol("parasitic", real=True), Symbol("parasitic_dot", real=True)
follows = kappa / (m * w**2)
along, driven = JOINT.symbol * follows, DRIVE.symbol * follows * u_x
damped = (w / QUALITY.symbol) * (q_dot + along * x_dot)

EFFECT = Force(
    id="parasitic_mode",
    parameters=(COUPLING, FREQUENCY, QUALITY, JOINT, DRIVE, START, DOT_START),
    states=(
        State(q, "m", "displacement of the parasitic mode", rate=q_dot, start=START),
        State(
            q_dot,
            "m/s",
            "its velocity",
            rate=-damped - w**2 * q - (kappa / m) * x + driven / m,
            start=DOT_START,
        ),
    ),
    force=(-kappa * q - along * m * damped - driven, 0),
    energy=Energy(
        stored=Rational(1, 2) * m * (q_dot**2 + w**2 * q**2) + kappa * q * x,
        dissipated=m * (w / QUALITY.symbol) * (q_dot + along * x_dot) ** 2,
    ),
    signature="a second resonance in x, with an antiresonance beside it",
    host_experiment="off-resonance drive near the parasitic frequency",
    limits=(
        Limit(
            why="2 N/m at 3 nm: 6 nN; x = 1 µm pulls with 2 N/m/(1e-7 kg) · 1 µm; w² q = (2π·1000)² · 3e-9",
            at={"parasitic_coupling": 2.0, "m": 1e-7, "x": 1e-6, "parasitic": 3e-9, "parasitic_frequency": 1000.0},
            gives={"force_x": -6e-9, "force_y": 0.0, "d_parasitic": 0.0, "d_parasitic_dot": -20.11843525281307},
        ),
        Limit(
            why="s = 1.9739208802178716/(1e-7 · (2π·1000)²) = 1/2, of 2 mm/s 1 mm/s: 2π·1000/100 · 1e-3 = 0.0628 m/s²",
            at={
                "parasitic_coupling": 1.9739208802178716,
                "parasitic_joint": 1.0,
                "m": 1e-7,
                "x_dot": 2e-3,
                "parasitic_frequency": 1000.0,
                "parasitic_q": 100.0,
            },
            gives={
                "force_x": -3.141592653589793e-9,
                "force_y": 0.0,
                "d_parasitic": 0.0,
                "d_parasitic_dot": -0.06283185307179587,
            },
        ),
        Limit(
            why="s = 1/2 as before, 0.5 · 1/2 of 2e-7 N: 5e-8 N from the mass to the mode, 5e-8/1e-7 = 0.5 m/s²",
            at={
                "parasitic_coupling": 1.9739208802178716,
                "parasitic_drive": 0.5,
                "m": 1e-7,
                "u_x": 2e-7,
                "parasitic_frequency": 1000.0,
            },
            gives={"force_x": -5e-8, "force_y": 0.0, "d_parasitic": 0.0, "d_parasitic_dot": 0.5},
        ),
    ),
)
