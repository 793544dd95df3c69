"""The gyroscope's parameters of the IMU plugin in PX4's simulation for Gazebo Classic: two-sided densities."""

from calibration.sensor.format import Format
from calibration.sensor.numbers import Sensor

CORRELATION = 1000.0
"""Correlation time of the bias [s]: the plugin's own for the ADIS16448."""


def text(sensor: Sensor, sample_rate: float) -> str:
    """The element plugin without the accelerometer's entries."""
    del sample_rate
    values = (
        ("gyroscopeNoiseDensity", sensor.noise_density),
        ("gyroscopeRandomWalk", sensor.random_walk),
        ("gyroscopeBiasCorrelationTime", CORRELATION),
        ("gyroscopeTurnOnBiasSigma", sensor.turn_on),
    )
    lines = "".join(f"  <{name}>{value!r}</{name}>\n" for name, value in values)
    return (
        f"<!-- gyroscope {sensor.device}; add linkName, imuTopic and the accelerometer's entries -->\n"
        f'<plugin name="gazebo_imu_plugin" filename="libgazebo_imu_plugin.so">\n{lines}</plugin>\n'
    )


FORMAT = Format("sdf", text)
