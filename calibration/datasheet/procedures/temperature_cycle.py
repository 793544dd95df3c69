"""Bias and scale factor through cycles of the ambient temperature: how late they are, what hot and cold leave."""

from math import inf
from typing import Final

import numpy as np

from calibration.analysis.returns import Side, settled_value, side
from calibration.analysis.staircase import PPM
from calibration.analysis.thermal_course import thermal_course
from calibration.datasheet.figure import Curve, Figure, Outcome
from calibration.datasheet.procedure import RATE, Procedure
from calibration.datasheet.procedures.temperature import SHARE
from cosim.rate.bench import Bench
from cosim.rate.courses import Course
from cosim.rate.metrics import PER_HOUR
from gyro_model.sensor import KNOTS, WIDTHS
from gyro_model.units import ZERO_CELSIUS

RAMP: Final = 20.0
"""How fast the ambient temperature moves [K/min]: a change that the structure does not follow tells how late it is."""
ROW: Final = 5.0
"""Means of the output over so long [s]."""
CYCLES: Final = 3
"""Cycles through hot and cold with a rate."""
STAY: Final = 6.0
"""Time constants of each stay at the reference temperature."""
USED: Final = 3.0
"""Of which the last are used: after three, 3 K away, two powers leave 0.1 °/h of a bias that moves by 300 °/h/K."""
LEAST_STAY: Final = 120.0
"""And at least so long [s], where the device follows at once."""
SHORTEST_LAG: Final = 10.0
"""Time constants below it are over in no time [s]."""

PAIRS = 8
"""Forth and back at least in what a settled value is fitted to: it has three unknowns."""


class Legs:
    """An ambient temperature [K] in straight lines; times [s]."""

    def __init__(self, temperature: float, stay: float) -> None:
        self.times, self.values = [0.0, stay], [temperature, temperature]

    def go(self, target: float, stay: float) -> float:
        """To ``target`` at RAMP, and stays there; returns when it arrives."""
        arrived = self.times[-1] + abs(target - self.values[-1]) / RAMP * 60
        self.times += [arrived, arrived + stay]
        self.values += [target, target]
        return arrived

    @property
    def course(self) -> Course:
        """What the bench takes."""
        times, values = np.array(self.times), np.array(self.values)
        return Course(lambda t: np.interp(t, times, values), inf, "cycle of the ambient temperature")


def measure(bench: Bench) -> Outcome:
    """From the reference to the hottest temperature, back, to the coldest, and back: once at rest, then again and again
    with a rate either way."""
    hold = bench.plan.soak
    if not hold:
        return Outcome(reason="some hours of simulated time: measure without --quick")
    if not bench.envelope:
        return Outcome(reason="some hours of the full FMU, since envelope and full FMU disagree")
    low, high = (t + ZERO_CELSIUS for t in (min(bench.plan.temperatures), max(bench.plan.temperatures)))
    curve, lag = _at_rest(bench, low, high, hold)
    bias, scale, stay = _returned(bench, low, high, hold, lag)
    turned = f"{high - ZERO_CELSIUS:g} and {low - ZERO_CELSIUS:g} °C"
    at = f"at {bench.reference_temperature - ZERO_CELSIUS:g} °C, {stay:.4g} s after the ambient temperature came back"
    back = f"{at} from {turned}, in turns"
    figures = [
        Figure(
            "bias_lag",
            "time constant of the bias behind the ambient temperature",
            lag,
            "s",
            note=f"ambient temperature through {turned} at {RAMP:g} °C/min",
        ),
        Figure(
            "bias_hysteresis",
            "bias after warming less that after cooling",
            PER_HOUR * bias.difference,
            "°/h",
            PER_HOUR * bias.error,
            2 * CYCLES,
            note=back,
        ),
        Figure(
            "scale_factor_hysteresis",
            "scale factor after warming less that after cooling",
            PPM * scale.difference,
            "ppm",
            PPM * scale.error,
            2 * CYCLES,
            note=back,
        ),
    ]
    return Outcome(figures, [curve])


def _at_rest(bench: Bench, low: float, high: float, hold: float) -> tuple[Curve, float]:
    """The bias through one cycle, and its time constant behind the ambient temperature [s]."""
    t_ref = bench.reference_temperature
    legs = Legs(t_ref, hold / 3)
    for target in (high, t_ref, low, t_ref):
        legs.go(target, hold)
    duration = float(ROW * np.floor(legs.times[-1] / ROW))
    one = bench.record(duration, temperature=legs.course, output_rate=1.0)
    bias = one.rate[: len(one.rate) // int(ROW) * int(ROW)].reshape(-1, int(ROW)).mean(axis=1)
    t = ROW * (np.arange(len(bias)) + 0.5)
    ambient = np.interp(t, legs.times, legs.values)
    none = np.array([]), np.array([])
    found = thermal_course(ambient, bias, ROW, none, np.linspace(low, high, KNOTS), [width.start for width in WIDTHS])
    columns = {"t [s]": t, "ambient [°C]": ambient - ZERO_CELSIUS, "bias [°/s]": np.degrees(bias)}
    return Curve("temperature_cycle", "Bias through a cycle of temperature", columns), found.lag


def _returned(bench: Bench, low: float, high: float, hold: float, lag: float) -> tuple[Side, Side, float]:
    """What the side leaves of bias [rad/s] and scale factor at the reference temperature, and how long each stay is
    [s]."""
    # Forth and back in two rows; the bias is their mean, so that no even nonlinearity is in it.
    half = float(np.ceil(max(ROW, 2 * bench.settling)))
    lag, t_ref = max(lag, SHORTEST_LAG, PAIRS * 2 * half / USED), bench.reference_temperature
    stay = max(STAY * lag, LEAST_STAY)
    legs, begins = Legs(t_ref, ROW), []
    for end in CYCLES * (high, low):
        legs.go(end, hold)
        begins.append(legs.go(t_ref, stay))
    rate = SHARE * bench.full_scale
    course = Course(lambda t: rate * np.where(t % (2 * half) < half, 1.0, -1.0), np.inf, "forth and back", half)
    duration = float(2 * half * np.floor(legs.times[-1] / (2 * half)))
    one = bench.record(duration, rate=course, temperature=legs.course, output_rate=10.0, seed=bench.seed + 1)
    into = (one.t - one.interval + 1e-9) % half
    kept = np.where(into > bench.settling, one.rate, np.nan)
    halves = np.nanmean(kept.reshape(-1, round(half / one.interval)), axis=1).reshape(-1, 2)
    t = np.float64(half) * (2 * np.arange(len(halves)) + 1)
    biases, scales = [], []
    for begin in begins:
        used = (t > begin + (stay - USED * lag)) & (t < begin + stay)
        biases.append(settled_value(t[used] - begin, halves[used].mean(axis=1), lag))
        scales.append(settled_value(t[used] - begin, (halves[used, 0] - halves[used, 1]) / (2 * rate), lag))
    bias, scale = (side(*np.array(found).T) for found in (biases, scales))
    return bias, scale, stay


PROCEDURE = Procedure("Operating temperature: cycle", "12.8", RATE, measure, 12)
