"""The numbers of a sensor, in SI, from the content of a datasheet.json."""

from collections.abc import Mapping
from math import isfinite, radians
from typing import Any, Final, NamedTuple

from calibration.datasheet.allan_figures import SEEN
from cosim.rate.metrics import PER_HOUR
from gyro_model.errors import InputError
from gyro_model.units import STANDARD_GRAVITY

FORMAT: Final = 1
"""Format of datasheet.json."""
REMEDY: Final = "make it anew with `gyrotwin datasheet DEVICE`"


class Sensor(NamedTuple):
    """A rate gyroscope of one axis.

    device: its name; noise_density N [rad/s/√Hz], of the two-sided density, which is the angle random walk in
    rad/√s; random_walk K [rad/s²/√Hz] and instability B [rad/s], 0 where the datasheet does not see them,
    random_walk_error then says what it would have seen; bias [rad/s] at the reference temperature; turn_on: standard
    deviation of the bias from turn-on to turn-on [rad/s]; scale_factor [1]; full_scale [rad/s]; bias_slope [rad/s/K]
    and scale_factor_slope [1/K] over temperature; acceleration: of the bias [rad/s per m/s²], 0 where it was not
    tested; bandwidth [Hz], None where the gain does not fall.
    """

    device: str
    noise_density: float
    random_walk: float
    random_walk_error: float
    instability: float
    bias: float
    turn_on: float
    scale_factor: float
    full_scale: float
    bias_slope: float
    scale_factor_slope: float
    acceleration: float
    bandwidth: float | None


def sensor_of(summary: Mapping[str, Any]) -> Sensor:
    """The sensor of a datasheet's ``summary``, as in datasheet.json.

    Raises InputError where that is none, or lacks a figure that a sensor has.
    """
    if not isinstance(summary, Mapping) or summary.get("format") != FORMAT or "tests" not in summary:
        raise InputError("datasheet: not the content of a datasheet.json; make one with `gyrotwin datasheet DEVICE`")
    if summary.get("mode") == "whole-angle":
        raise InputError("datasheet: of whole-angle mode; a sensor of rate needs --mode rate-open or rate-closed")
    try:
        figures = {f["id"]: f for test in summary["tests"] for f in test["figures"]}
    except (TypeError, KeyError):
        raise InputError(f"datasheet: its tests hold no figures; {REMEDY}") from None

    undone = "; ".join(f"{t.get('title')}: {t['not_done']}" for t in summary["tests"] if t.get("not_done"))
    remedy = f"{REMEDY}; not done were: {undone}" if undone else REMEDY

    def value(name: str, key: str = "value") -> float:
        number = figures.get(name, {}).get(key)
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not isfinite(number):
            raise InputError(f"datasheet: {name} has no {key}; {remedy}")
        return float(number)

    def seen(name: str) -> float:
        return value(name) if value(name) > 2 * SEEN * value(name, "error") else 0.0

    accelerations = [value(name) for name in ("acceleration_x", "acceleration_y") if name in figures]
    edge = figures.get("bandwidth", {}).get("value")
    # °/h/√h
    walk = 1 / (60 * PER_HOUR)
    return Sensor(
        device=_one_line(str(summary.get("device", ""))),
        noise_density=radians(value("angle_random_walk")) / 60,
        random_walk=walk * seen("rate_random_walk"),
        random_walk_error=walk * value("rate_random_walk", "error"),
        instability=seen("flicker") / PER_HOUR,
        bias=radians(value("bias")),
        turn_on=value("bias_repeatability") / PER_HOUR,
        scale_factor=value("scale_factor"),
        full_scale=radians(value("full_scale")),
        bias_slope=value("bias_slope") / PER_HOUR,
        scale_factor_slope=1e-6 * value("scale_factor_slope"),
        acceleration=max(map(radians, map(abs, accelerations)), default=0.0) / STANDARD_GRAVITY,
        bandwidth=None if edge is None else value("bandwidth"),
    )


def _one_line(name: str) -> str:
    """A name that can't end a comment of any of the formats."""
    return "".join(c if c.isalnum() or c in " _.+" else "_" for c in name)[:80]
