"""Measures of a fitted model: noise of the sensor and misfit on held-out runs (SYSTEM.md section 9)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from discrepancy.linear_fit import mode_frequencies
from discrepancy.record import MINIMUM_SAMPLES, Floats, Record
from discrepancy.refit import Fitted, Fitter
from discrepancy.simulate import Simulator

START_TIME, START_SAMPLES = 5e-3, 50
"""Length of the start that gives the initial state: the longer of the two."""


@dataclass(frozen=True)
class Noise:
    """density: deviation of the white noise, rms a sample [V], with its 95 % interval; lsb: step of the converter [V]
    or 0."""

    rms: float
    low: float
    high: float
    lsb: float


def noise_of(residuals: Sequence[Floats], records: Sequence[Record], parameters: Mapping[str, float]) -> Noise | None:
    """From the residual's density above five times the highest mode and below 0.45 of the rate; None without such a
    band."""
    rate = records[0].sample_rate
    low, high = 5 * mode_frequencies(parameters, records[0].axes)[-1], 0.45 * rate
    square, count = 0.0, 0
    for residual in residuals:
        n = len(residual)
        window = np.hanning(n)[:, None]
        power = np.abs(np.fft.rfft(residual * window, axis=0)) ** 2 / np.sum(window**2)
        f = np.fft.rfftfreq(n, 1 / rate)
        inside = power[(f > low) & (f < high)]
        square, count = square + float(inside.sum()), count + inside.size
    if count < 20:
        return None
    # Two degrees a bin; neighbours under a Hann window share half of what they hold.
    bounds = chi2.ppf([0.975, 0.025], count) / count
    mean = square / count
    lows = float(np.sqrt(mean / bounds[0])), float(np.sqrt(mean / bounds[1]))
    return Noise(float(np.sqrt(mean)), *lows, lsb=converter_step(records))


def converter_step(records: Sequence[Record]) -> float:
    """The step [V] of which every sample is a whole multiple, 0 where there is none."""
    v = np.concatenate([r.v.ravel() for r in records])
    levels = np.unique(v)
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-9 * np.abs(v).max()]
    if len(gaps) < 10:
        return 0.0
    step = float(gaps.min())
    whole = v / step
    # Printed digits leave gaps of one unit too; they count as the converter's where no finer one is seen.
    return step if np.abs(whole - np.rint(whole)).max() < 0.01 else 0.0


def start_fitted(simulator: Simulator, record: Record, parameters: Mapping[str, float]) -> tuple[Floats, int]:
    """The residual (n, axes) [V] of a run whose first samples gave the initial state, and how many those were."""
    n = max(START_SAMPLES, round(START_TIME * record.sample_rate))
    # A record has a least length, so the head may be longer than what counts of it.
    own = slice(0, max(n, MINIMUM_SAMPLES))
    held = {name: values[own] for name, values in record.conditions.items()}
    counted = record.valid[own] & (np.arange(len(record.t))[own] < n)
    head = replace(record, t=record.t[own], u=record.u[own], v=record.v[own], conditions=held, valid=counted)
    fitter = Fitter(simulator, [head])
    at = fitter.fit(fitter.evaluated(Fitted(dict(parameters), fitter.at_rest, (), fitter.plain(parameters), ())), 4)
    simulator.forget([head])
    return record.v - simulator.run(record, {**parameters, **at.starts[0]}), n


def misfits(records: Sequence[Record], residuals: Mapping[str, tuple[Floats, int]]) -> dict[str, float]:
    """rms(v - v_sim)/rms(v) of each run by name and of all as ``""``; residuals as ``start_fitted`` gives them."""
    result, errors, signals = {}, 0.0, 0.0
    for record in records:
        residual, n = residuals[record.name]
        usable = record.valid & (np.arange(len(record.t)) >= n)
        error, signal = float(np.sum(residual[usable] ** 2)), float(np.sum(record.v[usable] ** 2))
        result[record.name] = float(np.sqrt(error / signal))
        errors, signals = errors + error, signals + signal
    return result | {"": float(np.sqrt(errors / signals))}
