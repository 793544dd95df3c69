"""Measures of a fitted model: misfit on held-out runs, where disagreement lies (SYSTEM.md section 9)."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import chi2

from discrepancy.linear_fit import mode_frequencies
from discrepancy.noise import Noise
from discrepancy.record import MINIMUM_SAMPLES, Floats, Record
from discrepancy.refit import Fitted, Fitter
from discrepancy.simulate import Simulator

START_TIME, START_SAMPLES = 5e-3, 50
"""Length of the start that gives the initial state: the longer of the two."""
FALSE_DISCOVERIES: Final = 0.01
"""Share of the places named that may be chance (Y. Benjamini, Y. Hochberg, J. Royal Statistical Society B 57, 1995)."""
TIME_BLOCKS: Final = 8


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


@dataclass(frozen=True)
class Place:
    """A place of disagreement: run, channel, t [s] and f [Hz] as (begin, end), share of all residual power."""

    run: str
    channel: str
    t: tuple[float, float]
    f: tuple[float, float]
    share: float


def located(
    residuals: Sequence[Floats], records: Sequence[Record], parameters: Mapping[str, float], noise: Noise
) -> tuple[Place, ...]:
    """Where residuals exceed the white noise, by channel, eighth of a run and band (below, about, above the modes,
    harmonics), largest share first; false discoveries at most 1 %."""
    modes = mode_frequencies(parameters, records[0].axes)
    edges = [0.0, 0.1 * modes[0], 0.85 * modes[0], 1.15 * modes[-1], 2.5 * modes[-1], 3.5 * modes[-1]]
    edges = [*[e for e in edges if e < 0.5 * records[0].sample_rate], 0.5 * records[0].sample_rate]
    found: list[tuple[float, Place, float]] = []
    total = sum(float(np.sum(r**2)) for r in residuals)
    for residual, record in zip(residuals, records, strict=True):
        for part in np.array_split(np.arange(len(residual)), TIME_BLOCKS):
            power = 2 * np.abs(np.fft.rfft(residual[part], axis=0)) ** 2 / len(part)
            f = np.fft.rfftfreq(len(part), 1 / record.sample_rate)
            span = float(record.t[part[0]]), float(record.t[part[-1]])
            for low, high in itertools.pairwise(edges):
                inside = (f >= low) & (f < high)
                for axis in range(record.axes):
                    square = float(power[inside, axis].sum())
                    chance = float(chi2.sf(square / noise.rms**2, 2 * max(int(inside.sum()), 1)))
                    place = Place(record.name, "v_" + "xy"[axis], span, (low, high), square / 2 * 2 / total)
                    found.append((chance, place, square))
    found.sort(key=lambda entry: entry[0])
    passed = [i for i, entry in enumerate(found) if entry[0] <= FALSE_DISCOVERIES * (i + 1) / len(found)]
    kept = [entry[1] for entry in found[: max(passed, default=-1) + 1]]
    return tuple(sorted(kept, key=lambda place: -place.share))
