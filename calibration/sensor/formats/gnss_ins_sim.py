"""The gyroscope's part of the IMU error dictionary of gnss-ins-sim (README, "Define the IMU errors")."""

from math import degrees

from calibration.sensor.format import Format
from calibration.sensor.numbers import Sensor

CORRELATION = 100.0
"""Correlation time of the bias [s]: that of the program's own examples."""


def text(sensor: Sensor, sample_rate: float) -> str:
    """A dictionary of literals, three axes alike."""
    del sample_rate
    rows = (
        ("gyro_b", degrees(sensor.bias) * 3600, "bias, deg/hr"),
        ("gyro_arw", degrees(sensor.noise_density) * 60, "angle random walk, deg/rt-hr"),
        ("gyro_b_stability", degrees(sensor.instability) * 3600, "bias instability, deg/hr"),
        ("gyro_b_corr", CORRELATION, "its correlation time, s"),
    )
    lines = "".join(f"    {name!r}: [{value!r}, {value!r}, {value!r}],  # {unit}\n" for name, value, unit in rows)
    return f"# gyroscope {sensor.device}; add those of the accelerometer\nimu_err = {{\n{lines}}}\n"


FORMAT = Format("py", text)
