"""Bias through a cycle of the ambient temperature: what hot and cold leave behind, and the course that says how late."""

from math import degrees

import numpy as np

from calibration.datasheet.figure import Curve, Figure, Outcome
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import Bench
from cosim.rate.courses import Course
from cosim.rate.metrics import PER_HOUR
from gyro_model.units import ZERO_CELSIUS

RAMP = 20.0
"""How fast the ambient temperature moves [K/min]: a change that the structure does not follow tells how late it is."""
ROW = 5.0
"""Means of the output over so long [s]."""
LAST = 20
"""Rows at the end of a stay that are its value."""


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
    cooled, warmed = (bias[int(times[i] / ROW) - LAST : int(times[i] / ROW)] for i in (5, 9))
    left = PER_HOUR * float(warmed.mean() - cooled.mean())
    noise = PER_HOUR * float(np.sqrt(sum(part.var(ddof=1) / len(part) for part in (cooled, warmed))))
    figure = Figure(
        "bias_hysteresis",
        "bias after cold less bias after heat",
        left,
        "°/h",
        noise,
        1,
        note=f"at the reference temperature, {hold:g} s after it is reached, through {values[2] - ZERO_CELSIUS:g} and "
        f"{values[6] - ZERO_CELSIUS:g} °C at {RAMP:g} °C/min; what walks and relaxes meanwhile is in it",
    )
    columns = {
        "t [s]": t,
        "ambient [°C]": np.interp(t, times, values) - ZERO_CELSIUS,
        "bias [°/s]": np.array([degrees(value) for value in bias]),
    }
    return Outcome([figure], [Curve("temperature_cycle", "Bias through a cycle of temperature", columns)])


PROCEDURE = Procedure("Operating temperature: cycle", "12.8", RATE, measure, 5)
