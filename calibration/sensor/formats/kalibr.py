"""Kalibr's IMU configuration: continuous-time densities (Kalibr wiki, IMU noise model)."""

from calibration.sensor.format import Format
from calibration.sensor.numbers import Sensor


def text(sensor: Sensor, sample_rate: float) -> str:
    """Kalibr takes no random walk of zero, so one that is not seen is its standard error."""
    seen = sensor.random_walk > 0
    walk = sensor.random_walk if seen else sensor.random_walk_error
    remark = "" if seen else ", not seen in the datasheet: its standard error"
    return f"""# gyroscope {sensor.device}; the accelerometer's numbers are those of yours
#accelerometer_noise_density:  # m/s^2/sqrt(Hz)
#accelerometer_random_walk:    # m/s^3/sqrt(Hz)
gyroscope_noise_density: {sensor.noise_density:.6e}  # rad/s/sqrt(Hz)
gyroscope_random_walk: {walk:.6e}  # rad/s^2/sqrt(Hz){remark}
rostopic: /imu0
update_rate: {sample_rate!r}  # Hz
"""


FORMAT = Format("yaml", text)
