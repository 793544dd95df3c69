"""The parameters of GyroscopeSensor.fmu from the content of a datasheet.json."""

from collections.abc import Mapping
from math import radians
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.analysis.staircase import PPM
from calibration.analysis.thermal_course import curve_through, thermal_course
from calibration.datasheet.procedures.temperature import SHARE
from calibration.sensor.bandwidth import Section, fit_noise_lead, fit_sections
from calibration.sensor.numbers import REMEDY, sensor_of
from cosim.rate.metrics import PER_HOUR
from gyro_model.errors import InputError
from gyro_model.sensor import KNOTS, WIDTHS
from gyro_model.units import STANDARD_GRAVITY, ZERO_CELSIUS

Floats = NDArray[np.float64]

DRAWS: Final = 10.0
"""Noise is drawn so many times in a period of the bandwidth, at least."""
SLOWEST_DRAW: Final = 1e-3
"""And at least so often [s]."""


BEYOND: Final = 1.5
"""The spectrum of the noise counts up to so many bandwidths."""


class Curves(NamedTuple):
    """The curves of a datasheet by name."""

    content: Mapping[str, Any]

    def column(self, curve: str, name: str) -> Floats:
        """Raises InputError where there is none, or where it holds no numbers."""
        try:
            values = np.array(self.content[curve]["columns"][name], dtype=float)
        except (KeyError, TypeError, ValueError):
            raise InputError(f"datasheet: curve {curve!r} has no column {name!r}; {REMEDY}") from None
        if values.ndim != 1 or len(values) < 2 or not np.isfinite(values).all():
            raise InputError(f"datasheet: column {name!r} of curve {curve!r} is no list of numbers; {REMEDY}")
        return values


class Fitted(NamedTuple):
    """parameters by name [SI]; filter_error: largest difference of the filter's gain from the measured one, over the
    gain at rest, or over its own where that is larger."""

    parameters: dict[str, float]
    filter_error: float


def sensor_parameters(content: Mapping[str, Any], sample_rate: float) -> dict[str, float]:
    """Parameters by name [SI] of ``fitted_sensor``."""
    return fitted_sensor(content, sample_rate).parameters


def fitted_sensor(content: Mapping[str, Any], sample_rate: float) -> Fitted:
    """The sensor of a datasheet that is read ``sample_rate`` [Hz] times a second.

    Raises InputError where the datasheet is none, or lacks a figure or curve that a sensor has.
    """
    numbers = sensor_of(content)
    curves = Curves(content.get("curves", {}))
    figures = {f["id"]: f for test in content["tests"] for f in test["figures"]}
    frequency = curves.column("transfer", "frequency [Hz]")
    edge = numbers.bandwidth or float(frequency[-1])
    scatter = figures["bias_repeatability"]
    found = {
        "angle_random_walk": numbers.noise_density,
        "bias_instability": numbers.instability,
        "rate_random_walk": numbers.random_walk,
        # What white noise does to means is not of the turn-on.
        "turn_on": max(numbers.turn_on**2 - (float(scatter.get("expected") or 0.0) / PER_HOUR) ** 2, 0.0) ** 0.5,
        "full_scale": numbers.full_scale,
        "start_up_time": float(figures.get("turn_on_output", {}).get("value") or 0.0),
        "sample_period": 1 / sample_rate,
        "internal_step": SLOWEST_DRAW / max(np.ceil(edge * SLOWEST_DRAW * DRAWS), 1.0),
    }
    for axis in "xy":
        sensitivity = figures.get(f"acceleration_{axis}", {}).get("value")
        found[f"acceleration_sensitivity_{axis}"] = radians(sensitivity or 0.0) / STANDARD_GRAVITY
    bent = _nonlinearity(curves)
    # The scale factor over temperature is that at a part of full scale, with what the rate does to it there.
    excess = bent["nonlinearity_3"] * (SHARE * numbers.full_scale) ** 2
    left = figures.get("scale_factor_hysteresis", {}).get("value")
    found["scale_factor_hysteresis"] = (left or 0.0) / PPM / 2
    filtered, off = _bandwidth(curves, frequency, edge)
    return Fitted(found | filtered | bent | _thermal(curves, excess), off)


def _bandwidth(curves: Curves, frequency: Floats, edge: float) -> tuple[dict[str, float], float]:
    phase = np.radians(curves.column("transfer", "phase [°]"))
    gain = np.asarray(curves.column("transfer", "gain [1]") * np.exp(1j * phase), dtype=complex)
    sections, off = fit_sections(frequency, gain)
    found = {f"filter_{name}_{k}": value for k, one in enumerate(sections, 1) for name, value in one._asdict().items()}
    return found | {"noise_lead": _noise_lead(curves, sections, edge)}, off


def _noise_lead(curves: Curves, sections: tuple[Section, ...], edge: float) -> float:
    """As the spectrum at rest has it up to some way beyond the bandwidth [Hz]; as the rate's where there is none."""
    if "noise_spectrum" not in curves.content:
        return sections[0].lead
    frequency = curves.column("noise_spectrum", "frequency [Hz]")
    density = np.radians(curves.column("noise_spectrum", "density [°/s/√Hz]")) ** 2
    used = (frequency > 0) & (frequency <= BEYOND * edge) & (density > 0)
    return fit_noise_lead(sections, frequency[used], density[used], 1 / (2 * frequency[-1]))


def _nonlinearity(curves: Curves) -> dict[str, float]:
    """Square and cube of the rate in what the line of the scale factor's test leaves."""
    rate = np.radians(curves.column("scale_factor", "rate [°/s]"))
    residual = 1e-6 * np.abs(rate).max() * curves.column("scale_factor", "residual [ppm of full scale]")
    _, _, square, cube = np.linalg.lstsq(np.vander(rate, 4, increasing=True), residual, rcond=None)[0]
    return {"nonlinearity_2": float(square), "nonlinearity_3": float(cube)}


def _thermal(curves: Curves, excess: float) -> dict[str, float]:
    """Bias over temperature, settled and through a cycle where that was measured; scale factor over temperature less
    ``excess``."""
    settled = curves.column("temperature", "temperature [°C]") + ZERO_CELSIUS
    bias = np.radians(curves.column("temperature", "bias [°/s]"))
    scale = curves.column("temperature", "scale factor [1]") - excess
    knots = np.linspace(settled[0], settled[-1], KNOTS)
    found = {"temperature_low": float(settled[0]), "temperature_high": float(settled[-1])}
    if "temperature_cycle" in curves.content:
        t = curves.column("temperature_cycle", "t [s]")
        ambient = curves.column("temperature_cycle", "ambient [°C]") + ZERO_CELSIUS
        record = np.radians(curves.column("temperature_cycle", "bias [°/s]"))
        widths = [width.start for width in WIDTHS]
        course = thermal_course(ambient, record, float(t[1] - t[0]), (settled, bias), knots, widths)
        biases = course.curve
        found |= {"structure_lag": course.lag, "thermal_hysteresis": course.hysteresis}
    else:
        biases = curve_through(knots, settled, bias)
    for name, values in (("bias", biases), ("scale_factor", curve_through(knots, settled, scale))):
        found[name] = float(np.mean(values))
        found |= {f"{name}_temperature_{k}": float(value) - found[name] for k, value in enumerate(values)}
    return found
