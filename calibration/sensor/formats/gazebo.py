"""The noise of an IMU sensor in SDF (sdformat 1.6 on), as gz-sensors and gazebo-classic take it.

stddev is of a sample, N √rate. dynamic_bias_stddev is the density that drives the bias, K, in the recursion of
GaussianNoiseModel.cc, σ² = K² τ/2 (1 - e^(-2dt/τ)).
"""

from calibration.sensor.format import Format
from calibration.sensor.numbers import Sensor

CORRELATION = 3600.0
"""Correlation time of the bias [s]: the typical value of the description of SDF, far beyond an Allan record."""


def text(sensor: Sensor, sample_rate: float) -> str:
    """The element angular_velocity, three axes alike."""
    values = (
        ("mean", 0.0),
        ("stddev", sensor.noise_density * sample_rate**0.5),
        ("bias_mean", sensor.bias),
        ("bias_stddev", sensor.turn_on),
        ("dynamic_bias_stddev", sensor.random_walk),
        ("dynamic_bias_correlation_time", CORRELATION),
    )
    noise = "".join(f"      <{name}>{value!r}</{name}>\n" for name, value in values)
    axes = "".join(
        f'  <{axis}>\n    <noise type="gaussian">\n{noise}    </noise>\n  </{axis}>\n' for axis in ("x", "y", "z")
    )
    head = f"gyroscope {sensor.device}, rad/s, read at {sample_rate:g} Hz"
    return f"<!-- {head} -->\n<angular_velocity>\n{axes}</angular_velocity>\n"


FORMAT = Format("sdf", text)
