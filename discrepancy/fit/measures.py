"""Measures of a fitted model: misfit on held-out runs (docs/theory/records.md, eqs. 1 and 2)."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy.data.record import MINIMUM_SAMPLES, Floats, Record
from discrepancy.fit.continuation import with_starts
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator

START_TIME, START_SAMPLES = 5e-3, 50
"""Length of the start that gives the initial state: the longer of the two."""
START_ROUNDS: Final = 12
"""Steps of its fit at most. A linear device is exact after one; beside a dry friction, which changes the slopes from
rest on, 4 left a speed 2e-3 off, and 12 are as good as 20."""


def start_fitted(simulator: Simulator, record: Record, parameters: Mapping[str, float]) -> tuple[Floats, int]:
    """The residual (n, axes) [V] of a run whose first samples gave the initial state, and how many those were."""
    n = _unscored(record)
    # A record has a least length, so the head may be longer than what counts of it.
    own = slice(0, max(n, MINIMUM_SAMPLES))
    held = {name: values[own] for name, values in record.conditions.items()}
    counted = record.valid[own] & (np.arange(len(record.t))[own] < n)
    head = replace(record, t=record.t[own], u=record.u[own], v=record.v[own], conditions=held, valid=counted)
    start = _start(simulator, head, parameters)
    simulator.forget([head])
    return record.v - simulator.run(record, {**parameters, **start}), n


def start_known(simulator: Simulator, record: Record, parameters: Mapping[str, float]) -> tuple[Floats, int]:
    """As ``start_fitted``, the initial state fitted to the whole run: of a slow device the first samples tell its speed
    badly, and what comes of that is not the model's fault."""
    return record.v - simulator.run(record, {**parameters, **_start(simulator, record, parameters)}), _unscored(record)


def _unscored(record: Record) -> int:
    return max(START_SAMPLES, round(START_TIME * record.sample_rate))


def _start(simulator: Simulator, record: Record, parameters: Mapping[str, float]) -> Mapping[str, float]:
    """The initial state that fits a record best."""
    fitter = Fitter(simulator, [record])
    at = Fitted(dict(parameters), fitter.at_rest, (), fitter.plain(parameters), ())
    return with_starts(fitter, at, START_ROUNDS).starts[0]


def misfits(records: Sequence[Record], residuals: Mapping[str, tuple[Floats, int]]) -> dict[str, float]:
    """rms(v - v_sim)/rms(v) of each run by name and of all as ``""``; residuals as ``start_fitted`` gives them. Where
    nothing moves after the start, as of a decay that has ended by then, v of the start counts in."""
    result, errors, signals = {}, 0.0, 0.0
    for record in records:
        residual, n = residuals[record.name]
        usable = record.valid & (np.arange(len(record.t)) >= n)
        error, signal = float(np.sum(residual[usable] ** 2)), float(np.sum(record.v[usable] ** 2))
        # No run is still throughout (Dataset).
        signal = signal or float(np.sum(record.v[record.valid] ** 2))
        result[record.name] = float(np.sqrt(error / signal))
        errors, signals = errors + error, signals + signal
    return result | {"": float(np.sqrt(errors / signals))}
