"""A call of gyroparams, of MATLAB's Navigation Toolbox; NoiseDensity is two-sided, which is its default."""

from calibration.sensor.format import Format
from calibration.sensor.numbers import Sensor


def text(sensor: Sensor, sample_rate: float) -> str:
    """Three axes alike."""
    rows = (
        ("MeasurementRange", repr(sensor.full_scale), "rad/s"),
        ("ConstantBias", _three(sensor.bias), "rad/s"),
        ("NoiseDensity", _three(sensor.noise_density), "(rad/s)/sqrt(Hz)"),
        ("NoiseType", '"double-sided"', ""),
        ("BiasInstability", _three(sensor.instability), "rad/s"),
        ("RandomWalk", _three(sensor.random_walk), "(rad/s)*sqrt(Hz)"),
        ("TemperatureBias", _three(sensor.bias_slope), "(rad/s)/degC"),
        ("TemperatureScaleFactor", _three(100 * sensor.scale_factor_slope), "%/degC"),
        ("AccelerationBias", _three(sensor.acceleration), "(rad/s)/(m/s^2)"),
    )
    last = len(rows) - 1
    lines = "".join(
        f'    "{name}", {value}{", ..." if i < last else ");"} {"% " + unit if unit else ""}'.rstrip() + "\n"
        for i, (name, value, unit) in enumerate(rows)
    )
    return (
        f"% gyroscope {sensor.device}\nparams = gyroparams( ...\n{lines}"
        f'imu = imuSensor("accel-gyro", "SampleRate", {sample_rate!r}, "Gyroscope", params);\n'
    )


def _three(value: float) -> str:
    return f"[{value!r} {value!r} {value!r}]"


FORMAT = Format("m", text)
