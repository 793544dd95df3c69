"""The numbers of a rate-mode run's summary.json. None where a number does not exist, so that it is strict JSON."""

from collections.abc import Mapping
from math import degrees, pi, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from cosim.rate.allan import Allan, NoiseLimits, allan_deviation, noise_limits
from cosim.rate.courses import ZERO_CELSIUS
from cosim.rate.master import Result
from cosim.rate.run import RateRun
from cosim.rate.steady_state import Output, in_words, left_out, output_at
from cosim.rate.transfer import expected_transfer
from gyro_model.errors import InputError

Floats = NDArray[np.float64]
Summary = dict[str, Any]

PER_ROOT_HOUR = degrees(1) * 60
"""deg/sqrt(h) in 1 rad/sqrt(s)."""
PER_HOUR = degrees(1) * 3600
"""deg/h in 1 rad/s."""


def settled_rows(record: pl.DataFrame, run: RateRun) -> NDArray[np.bool_]:
    """Which rows no longer show the last step of the rate, shape (n,)."""
    true = record["rate_true"].to_numpy()
    used = np.ones(len(true), dtype=bool)
    for step in np.flatnonzero(np.diff(true) != 0):
        used[step : step + 2 + int(np.ceil(run.settling / run.interval))] = False
    return used


class Plateaus(NamedTuple):
    """Means over the stretches of constant rate, shape (n,): rate_true, rate [rad/s], temperature_structure [K]."""

    rate_true: Floats
    rate: Floats
    temperature: Floats

    def biases(self) -> tuple[Floats, Floats]:
        """Temperature [K] and bias [rad/s] of each stretch at rest."""
        rest = self.rate_true == 0
        return self.temperature[rest], self.rate[rest]

    def scale_factors(self) -> tuple[Floats, Floats]:
        """Temperature [K] and scale factor of each stretch at +R or -R, less the bias of its two neighbours at rest: a
        bias that drifts evenly drops out."""
        turning = np.flatnonzero(self.rate_true[1:-1] != 0) + 1
        bias = (self.rate[turning - 1] + self.rate[turning + 1]) / 2
        return self.temperature[turning], (self.rate[turning] - bias) / self.rate_true[turning]


def plateaus(record: pl.DataFrame, run: RateRun) -> Plateaus:
    """The settled stretches of a record under a rate step."""
    true, used = record["rate_true"].to_numpy(), settled_rows(record, run)
    edges = np.flatnonzero(np.diff(true) != 0) + 1
    parts = [part[used[part]] for part in np.split(np.arange(len(true)), edges)]
    parts = [part for part in parts if len(part)]
    columns = (record[name].to_numpy() for name in ("rate_true", "rate", "temperature_structure"))
    return Plateaus(*(np.array([column[part].mean() for part in parts]) for column in columns))


class Line(NamedTuple):
    """rate = scale_factor · rate_true + bias [rad/s], by least squares, with standard errors; residual: rms [rad/s].

    scale_factor is None where the rate stays, bias too where it stays elsewhere than at rest.
    """

    bias: float | None
    bias_error: float | None
    scale_factor: float | None
    scale_factor_error: float | None
    residual: float


def fit_line(record: pl.DataFrame, run: RateRun) -> Line | None:
    """Bias and scale factor of a record, over the rows where a step of the rate is no longer seen.

    A rate that moves all the time is the one that a gyroscope of the design would show. None where no row is settled.
    """
    true, rate = record["rate_true"].to_numpy(), record["rate"].to_numpy()
    moves = np.flatnonzero(np.diff(true) != 0)
    if len(moves) < 0.2 * len(true):
        used = settled_rows(record, run)
    else:
        true, used = shown_rate(run), record["t"].to_numpy() > run.settling
    if used.sum() < 3:
        return None
    turns = bool(np.ptp(true[used]) > 0)
    columns = [np.ones(used.sum())] + ([true[used]] if turns else [])
    design = np.stack(columns, axis=1)
    solution, *_ = np.linalg.lstsq(design, rate[used], rcond=None)
    residual = rate[used] - design @ solution
    rms = float(np.sqrt(np.mean(residual**2)))
    error = np.sqrt(np.diag(np.linalg.inv(design.T @ design)) * rms**2 * _repeats(residual, run))
    if turns:
        return Line(float(solution[0]), float(error[0]), float(solution[1]), float(error[1]), rms)
    if true[used][0] != 0:
        return Line(None, None, None, None, rms)
    return Line(float(solution[0]), float(error[0]), None, None, rms)


PARTS: Final = 20
"""Means over so many parts of a record tell how rows hang together; their scatter is then known to 16 %."""
FEWEST_PARTS: Final = 8
PART: Final = 10.0
"""Delays of the output in a part at least: neighbouring means then share 5 %."""


def _repeats(residual: Floats, run: RateRun) -> float:
    """How many rows, shape (n,), tell as much as one of white noise: the variance of means over what it would be."""
    parts = min(int(len(residual) * run.interval / (PART * run.delay)), PARTS, len(residual) // 2)
    variance = float(residual.var())
    if parts < FEWEST_PARTS or variance == 0.0:
        # Rows within the memory of the output filter repeat each other.
        return max(1.0, 1 / (2 * pi * run.settings.output_bandwidth * run.interval))
    means = np.array([part.mean() for part in np.array_split(residual, parts)])
    return float(means.var(ddof=1) * (len(residual) / parts) / variance)


FINE: Final = 0.02
"""A moving rate is looked at in steps of this over the bandwidth of the output: values in their middle for means are
0.04 % too large for a sine at 3/4 of the bandwidth; steps of 0.05 make 0.2 %."""
AT_ONCE: Final = 1_000_000
"""Values taken at once: hours at a fine step would fill the memory."""


def shown_rate(run: RateRun) -> Floats:
    """What a gyroscope of the design shows of the rate, means over the rows of the record [rad/s], shape (n,): filters
    and sense axis by their transfer function (transfer.py)."""
    per_row = max(int(np.ceil(run.interval * run.settings.output_bandwidth / FINE)), 1)
    step, lead = run.interval / per_row, int(np.ceil(run.settling / run.interval))
    count = max(AT_ONCE // per_row, 4 * lead)
    parts = []
    for first in range(0, run.rows, count):
        # Each piece begins earlier, by what the output remembers: what is before its begin is not known to it.
        begin, end = max(first - lead, 0), min(first + count, run.rows)
        true = run.rate.held(begin * per_row, (end - begin) * per_row, step)
        frequency = np.fft.rfftfreq(2 * len(true), step).astype(np.float64)
        # As much again, at the last value and back at the first, keeps the end out of the begin.
        padded = np.concatenate([true, np.full(len(true) - len(true) // 2, true[-1]), np.full(len(true) // 2, true[0])])
        shown = np.fft.irfft(np.fft.rfft(padded) * expected_transfer(run.known, run, frequency), len(padded))
        parts.append(shown[: len(true)].reshape(-1, per_row).mean(axis=1)[first - begin :])
    return np.concatenate(parts)


BEYOND: Final = 0.05
"""Share of a rate's power beyond the bandwidth of the output from which on a scale factor is no longer one."""


def power_beyond(run: RateRun) -> float:
    """Share of the power of a moving rate that lies beyond the bandwidth of the output; 0 for steps and rest."""
    if np.isfinite(run.rate.stays):
        return 0.0
    step = FINE / run.settings.output_bandwidth
    values = run.rate.held(0, max(min(int(run.duration / step), AT_ONCE), 2), step)
    power = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(len(values)))) ** 2
    beyond = np.fft.rfftfreq(len(values), step) > run.settings.output_bandwidth
    return float(power[beyond].sum() / max(power.sum(), 1e-300))


def warnings(run: RateRun, record: pl.DataFrame) -> list[str]:
    """What a reader of the numbers must know first."""
    told, true = [], record["rate_true"].to_numpy()
    share = power_beyond(run)
    if share > BEYOND:
        bandwidth = run.settings.output_bandwidth
        told.append(
            f"{100 * share:.0f} % of the power of {run.rate.text} lies beyond the output's {bandwidth:g} Hz: the gain "
            "to it is no scale factor, and none is given; take a slower profile, or a larger output_bandwidth"
        )
    if np.ptp(true) == 0 and true[0] != 0:
        told.append(
            f"the rate stays at {np.degrees(true[0]):.4g} °/s, where bias and scale factor can't be told apart: give "
            "one that changes, such as --rate-step"
        )
    settled = record["rate"].to_numpy()[record["t"].to_numpy() > run.settling]
    step = run.device.all_parameters["adc_lsb"]
    if step > 0.0 and len(settled) > 1 and np.ptp(settled) == 0:
        told.append(
            f"the output never moves: the converter's step, adc_lsb = {step:g} V, hides the sense signal; take a finer "
            "one"
        )
    return told


DEPARTS: Final = 1e-3
"""Bias over full scale and scale factor may be this far from the harmonic balance, or by ``SURE`` of their errors."""
SURE: Final = 4.0
STEADY: Final = 0.1
"""The balance is that of one temperature: the structure stays within this [K], 0.01 °/s at 366 °/h/°C."""


def departures(
    run: RateRun, record: pl.DataFrame, line: Line | None, expected: Output | None, missing: Mapping[str, str]
) -> list[str]:
    """What the effects that the harmonic balance leaves out, ``missing`` by id with the reason, have done to bias and
    scale factor: the calibration of the loops is made by that balance and does not know them either."""
    instants = np.linspace(0.0, run.duration, 100)
    steady = all(np.ptp(course.values(instants)) == 0 for course in run.others.values())
    steady &= bool(np.ptp(record["temperature_structure"].to_numpy()) <= STEADY)
    if line is None or expected is None or not missing or not steady:
        return []
    compared = (
        ("bias", degrees(1), " °/s", line.bias, line.bias_error, expected.bias, run.settings.full_scale),
        ("scale factor", 1.0, "", line.scale_factor, line.scale_factor_error, expected.scale_factor, 1.0),
    )
    found = [
        f"the {name} is {unit * value:.4g}{sign} where it says {unit * wanted:.4g}"
        for name, unit, sign, value, error, wanted, full in compared
        if value is not None and error is not None and abs(value - wanted) > max(DEPARTS * full, SURE * error)
    ]
    if not found:
        return []
    return [
        f"the harmonic balance, by which the rate is calibrated, does not know {in_words(missing)}: "
        f"{' and '.join(found)}; correct the output by what this run shows, as after a rate table"
    ]


ROUNDED: Final = 1e-2
"""Rows may come this much more or less often than asked, relative, before it is said."""


def rounding(run: RateRun) -> list[str]:
    """What became of the output rate that was asked for."""
    if abs(run.interval * run.output_rate - 1) <= ROUNDED:
        return []
    return [
        f"rows come {1 / run.interval:.6g} a second, not {run.output_rate:g}: each is a whole number of steps of "
        f"{run.period:.4g} s"
    ]


def allan_of(record: pl.DataFrame, run: RateRun) -> tuple[Allan, NoiseLimits] | None:
    """Allan deviation and limits of a record at rest and at one temperature; None for others, and for short ones."""
    at_rest = not record["rate_true"].to_numpy().any() and np.ptp(record["temperature"].to_numpy()) == 0
    if not at_rest:
        return None
    try:
        allan = allan_deviation(record["rate"].to_numpy(), run.interval, run.white_from)
    except InputError:
        return None
    return allan, noise_limits(run.nominal, float(record["temperature_structure"][0]), 1 / run.sample_rate)


def summarise(run: RateRun, result: Result) -> Summary:
    """Content of summary.json; angles in deg, temperatures in °C, else SI, as the names say."""
    record = result.record
    line, allan = fit_line(record, run), allan_of(record, run)
    calibration = run.nominal.calibration
    first = float(record["temperature_structure"][0])
    unsound = warnings(run, record)
    expected, unfound = _balanced(run, first)
    missing = left_out(run.device)
    told = unsound + unfound + departures(run, record, None if unsound else line, expected, missing) + rounding(run)
    return {
        "device": run.device.name,
        "design": None if run.design is None else run.design.name,
        "sense": "closed" if run.closed else "open",
        "plant": "envelope" if run.envelope else "full",
        "seed": run.seed,
        "duration": run.rows * run.interval,
        "output_rate": 1 / run.interval,
        "rate_course": run.rate.text,
        "temperature_course": run.temperature.text,
        "locked_at": result.locked_at,
        "started_at": result.started_at,
        "bias_deg_s": None if line is None or line.bias is None else degrees(line.bias),
        "bias_error_deg_s": None if line is None or line.bias_error is None else degrees(line.bias_error),
        "scale_factor": None if line is None or unsound else line.scale_factor,
        "scale_factor_error": None if line is None or unsound else line.scale_factor_error,
        "warnings": told,
        "residual_rms_deg_s": None if line is None else degrees(line.residual),
        "scale_factor_nominal": abs(calibration.scale),
        "scale_factor_nominal_unit": "N/(rad/s)" if run.closed else "V/(rad/s)",
        "quadrature_deg_s": degrees(float(record["quadrature"].to_numpy().mean())),
        "drive_frequency_hz": _range(record["drive_frequency"]),
        "drive_amplitude_v": _range(record["drive_amplitude"]),
        "drive_force_n": _range(record["drive_force"]),
        "temperature_deg_c": {
            name: _range(record[column] - ZERO_CELSIUS)
            for name, column in (
                ("ambient", "temperature"),
                ("structure", "temperature_structure"),
                ("circuit", "temperature_circuit"),
            )
        },
        "harmonic_balance": {
            "temperature_deg_c": first - ZERO_CELSIUS,
            **_settled(expected),
            "left_out": missing,
        },
        "allan": None if allan is None else _allan(*allan),
    }


def _balanced(run: RateRun, temperature: float) -> tuple[Output | None, list[str]]:
    """The settled output at ``temperature`` [K]; None, and why, where the balance finds none."""
    try:
        return output_at(run.device, run.nominal.calibration, temperature, run.held), []
    except InputError as why:
        return None, [f"harmonic balance: {why}"]


def _settled(expected: Output | None) -> dict[str, float | None]:
    names = ("bias_deg_s", "scale_factor", "quadrature_deg_s", "drive_frequency_hz", "drive_force_n")
    if expected is None:
        return dict.fromkeys(names)
    bias, quadrature = degrees(expected.bias), degrees(expected.quadrature)
    values = (bias, expected.scale_factor, quadrature, expected.drive_frequency, expected.drive_force)
    return dict(zip(names, values, strict=True))


def _range(column: pl.Series) -> dict[str, float]:
    values = column.to_numpy()
    return {"mean": float(values.mean()), "min": float(values.min()), "max": float(values.max())}


def _allan(allan: Allan, limits: NoiseLimits) -> Summary:
    return {
        "angle_random_walk_deg_rth": PER_ROOT_HOUR * allan.angle_random_walk,
        "angle_random_walk_error_deg_rth": PER_ROOT_HOUR * allan.angle_random_walk_error,
        "thermal_limit_deg_rth": PER_ROOT_HOUR * limits.thermal,
        "electronics_deg_rth": PER_ROOT_HOUR * sqrt(limits.electronics**2 + limits.reference**2),
        "expected_deg_rth": PER_ROOT_HOUR * limits.total,
        "bias_instability_deg_h": None if allan.bias_instability is None else PER_HOUR * allan.bias_instability,
        "bias_instability_tau_s": allan.instability_tau,
        "lowest_deviation_deg_h": PER_HOUR * float(allan.deviation.min()),
    }
