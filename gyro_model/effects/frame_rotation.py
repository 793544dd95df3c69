"""The frame of the package turns: the centrifugal force, and the Euler force where the rate changes.

    F_x = m Ω² x, F_y = m Ω² y; at each change ΔΩ of the held rate x' += ΔΩ y, y' -= ΔΩ x

With the Coriolis force this is Newton's law seen from a turning frame, -2 Ω×v - Ω×(Ω×r) - Ω'×r (H. Goldstein, Classical
Mechanics, 1950, section 4-9); a rate held in steps makes Ω' a pulse, of which the velocity jump is the integral.
"""

from sympy import Rational

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import m, omega_z, omega_z_change, x, y

SWITCH = size("frame_rotation", "1", "centrifugal and Euler force times this (1: physical)", nominal=1.0)
part = SWITCH.symbol

EFFECT = Force(
    id="frame_rotation",
    parameters=(SWITCH,),
    force=(part * m * omega_z**2 * x, part * m * omega_z**2 * y),
    impulse=(part * m * omega_z_change * y, -part * m * omega_z_change * x),
    energy=Energy(stored=-Rational(1, 2) * part * m * omega_z**2 * (x**2 + y**2)),
    signature="both resonances fall by Ω²/2ω; the velocities jump where the rate does",
    host_experiment="rate step, large rates",
    limits=(
        Limit(
            why="2e-7 kg at 100 rad/s and 1 µm: 2e-9 N; a step of 50 rad/s at 1 µm and -2 µm: 2e-7 kg · 5e-5, 1e-4 m/s",
            at={
                "frame_rotation": 1.0,
                "m": 2e-7,
                "omega_z": 100.0,
                "omega_z_change": 50.0,
                "x": 1e-6,
                "y": -2e-6,
            },
            gives={"force_x": 2e-9, "force_y": -4e-9, "impulse_x": -2e-11, "impulse_y": -1e-11},
        ),
    ),
)
