"""Bias and scale factor over temperature, settled at each."""

import numpy as np

from calibration.analysis.regression import least_squares
from calibration.analysis.staircase import PPM
from calibration.datasheet.figure import Curve, Figure, Outcome, balanced
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import Bench, Record, steps
from cosim.rate.metrics import PER_HOUR
from gyro_model.units import ZERO_CELSIUS

SHARE = 0.5
"""Rate over full scale."""


def measure(bench: Bench) -> Outcome:
    """At each temperature a turn-on there, rest, and a rate either way."""
    celsius = np.array(bench.plan.temperatures)
    stays = bench.stays(bench.plan.plateau)
    rate = SHARE * bench.full_scale
    course = steps([0.0, rate, 0.0, -rate], stays)
    found, expected = [], []
    for temperature in (celsius + ZERO_CELSIUS).tolist():
        one = bench.record(4 * stays, rate=course, temperature=temperature, output_rate=50.0)
        found.append(_bias_and_scale(one, bench.settled(one, stays), stays, rate))
        balance = bench.expected(temperature)
        expected.append((balance.bias, balance.scale_factor, balance.drive_frequency))
    bias, scale, frequency, error, wander = np.array(found).T
    bias_true, scale_true, frequency_true = np.array(expected).T
    rule = "harmonic balance of the settled device"
    hour = f"largest less smallest over {celsius[0]:g} to {celsius[-1]:g} °C"
    slope_note = "slope of a line; the curve is below"
    figures = []
    for key, title, unit, values, true, noise in (
        ("bias", "bias", "°/h/°C", PER_HOUR * bias, PER_HOUR * bias_true, PER_HOUR * error),
        ("scale_factor", "scale factor", "ppm/°C", PPM * scale, PPM * scale_true, PPM * error / rate),
        (
            "drive_frequency",
            "drive frequency",
            "ppm/°C",
            PPM * frequency / frequency_true.mean(),
            PPM * frequency_true / frequency_true.mean(),
            PPM * wander / frequency_true.mean(),
        ),
    ):
        span = float(np.ptp(celsius))
        wide = float(np.ptp(values)) / span
        white = float(np.sqrt(2) * noise.mean() / span)
        figures.append(
            Figure(
                f"{key}_temperature",
                f"{title} over temperature",
                wide,
                unit,
                white,
                len(celsius),
                float(np.ptp(true)) / span,
                rule,
                note=hour,
            )
        )
        line = np.stack([celsius - celsius.mean(), np.ones_like(celsius)], axis=1)
        fit, fit_true = least_squares(line, values), least_squares(line, true)
        # The error is by noise: what is no line is no error of its slope.
        white = float(noise.mean() / np.sqrt((line[:, 0] ** 2).sum()))
        figures.append(
            Figure(
                f"{key}_slope",
                f"{title}, slope over temperature",
                float(fit.values[0]),
                unit,
                white,
                len(celsius),
                float(fit_true.values[0]),
                rule,
                note=slope_note,
            )
        )
    curve = Curve(
        "temperature",
        "Bias and scale factor over temperature",
        {
            "temperature [°C]": celsius,
            "bias [°/s]": np.degrees(bias),
            "bias error [°/s]": np.degrees(error),
            "expected bias [°/s]": np.degrees(bias_true),
            "scale factor [1]": scale,
            "scale factor error [1]": error / rate,
            "expected scale factor [1]": scale_true,
            "drive frequency [Hz]": frequency,
        },
    )
    if bench.left_out:
        curve = curve._replace(columns={n: v for n, v in curve.columns.items() if not n.startswith("expected")})
    return Outcome(balanced(figures, bench.left_out, [rule]), [curve])


def _bias_and_scale(one: Record, settled: np.ndarray, stays: float, rate: float) -> tuple[float, ...]:
    """Bias [rad/s], scale factor, drive frequency [Hz], standard errors of a plateau's mean [rad/s] and
    of the frequency [Hz]."""
    index = np.minimum((one.t - 1e-9) // stays, 3).astype(int)
    parts = [one.rate[settled & (index == k)] for k in range(4)]
    means = [float(part.mean()) for part in parts]
    # Blocks of a tenth of the plateau are longer than the output filter remembers.
    error = float(np.mean([np.std([b.mean() for b in np.array_split(part, 10)], ddof=1) for part in parts])) / 10**0.5
    frequency = np.array([one.frequency[settled & (index == k)].mean() for k in range(4)])
    bias, scale = (means[0] + means[2]) / 2, (means[1] - means[3]) / (2 * rate)
    return bias, scale, float(frequency.mean()), error, float(frequency.std(ddof=1)) / 2


PROCEDURE = Procedure("Operating temperature", "12.8", RATE, measure, 3)
