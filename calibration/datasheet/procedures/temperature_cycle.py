"""Bias through a cycle of the ambient temperature: how late it follows, and what hot and cold leave behind."""

import numpy as np

from calibration.analysis.thermal_course import thermal_course
from calibration.datasheet.figure import Curve, Figure, Outcome
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import Bench
from cosim.rate.courses import Course
from cosim.rate.metrics import PER_HOUR
from gyro_model.sensor import KNOTS, WIDTHS
from gyro_model.units import ZERO_CELSIUS

RAMP = 20.0
"""How fast the ambient temperature moves [K/min]: a change that the structure does not follow tells how late it is."""
ROW = 5.0
"""Means of the output over so long [s]."""


def measure(bench: Bench) -> Outcome:
    """From the reference to the hottest temperature, back, to the coldest, and back, the rate at rest."""
    hold = bench.plan.soak
    if not hold:
        return Outcome(reason="half an hour of simulated time: measure without --quick")
    if not bench.envelope:
        return Outcome(reason="an hour of the full FMU, since envelope and full FMU disagree")
    t_ref = bench.reference_temperature
    low, high = (t + ZERO_CELSIUS for t in (min(bench.plan.temperatures), max(bench.plan.temperatures)))
    times, values = [0.0, hold / 3], [t_ref, t_ref]
    for target in (high, t_ref, low, t_ref):
        times += [times[-1] + abs(target - values[-1]) / RAMP * 60]
        times += [times[-1] + hold]
        values += [target, target]
    duration = ROW * np.floor(times[-1] / ROW)
    course = Course(lambda t: np.interp(t, times, values), np.inf, "cycle of the ambient temperature")
    one = bench.record(float(duration), temperature=course, output_rate=1.0)
    rows = int(ROW)
    bias = one.rate[: len(one.rate) // rows * rows].reshape(-1, rows).mean(axis=1)
    t = ROW * (np.arange(len(bias)) + 0.5)
    ambient = np.interp(t, times, values)
    none = np.array([]), np.array([])
    found = thermal_course(ambient, bias, ROW, none, np.linspace(low, high, KNOTS), [width.start for width in WIDTHS])
    turned = f"{values[2] - ZERO_CELSIUS:g} and {values[6] - ZERO_CELSIUS:g} °C"
    way = f"ambient temperature through {turned} at {RAMP:g} °C/min"
    figures = [
        Figure("bias_lag", "time constant of the bias behind the ambient temperature", found.lag, "s", note=way),
        Figure(
            "bias_hysteresis",
            "bias after warming less that after cooling",
            2 * PER_HOUR * found.hysteresis,
            "°/h",
            2 * PER_HOUR * found.hysteresis_error,
            1,
            note=f"by play operators; {PER_HOUR * found.residual:.3g} °/h rms are neither curve nor lag nor hysteresis",
        ),
    ]
    columns = {
        "t [s]": t,
        "ambient [°C]": ambient - ZERO_CELSIUS,
        "bias [°/s]": np.degrees(bias),
    }
    return Outcome(figures, [Curve("temperature_cycle", "Bias through a cycle of temperature", columns)])


PROCEDURE = Procedure("Operating temperature: cycle", "12.8", RATE, measure, 5)
