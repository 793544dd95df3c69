"""The Coriolis coupling of a real structure is a part of that of a point mass.

    2 m Ω → 2 λ m Ω, so that F_x = 2 (λ - 1) m Ω y', F_y = -2 (λ - 1) m Ω x' is added

A ring has λ = 0.4 or less, a mass that moves whole has 1 (D. D. Lynch, Coriolis vibratory gyroscopes, IEEE Std
1431-2004, annex B). The pattern turns by -λ∫Ω dt.
"""

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import m, omega_z, x_dot, y_dot

GAIN = size("angular_gain", "1", "Coriolis coupling relative to that of a point mass", neutral=1.0)
missing = GAIN.symbol - 1

EFFECT = Force(
    id="angular_gain",
    parameters=(GAIN,),
    force=(2 * missing * m * omega_z * y_dot, -2 * missing * m * omega_z * x_dot),
    energy=Energy(),
    signature="scale factor: the response to rate is λ times that expected",
    host_experiment="rate step",
    limits=(
        Limit(
            why="λ = 0.75 takes a quarter of 2 · 2e-7 kg · 5 rad/s · 1 cm/s = 2e-8 N away",
            at={"angular_gain": 0.75, "m": 2e-7, "omega_z": 5.0, "x_dot": 0.01, "y_dot": -0.01},
            gives={"force_x": 5e-9, "force_y": 5e-9},
        ),
    ),
)
