"""Measures of a fitted model: misfit on held-out runs (docs/theory/records.md, eqs. 1 and 2)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy.data.record import MINIMUM_SAMPLES, Floats, Record
from discrepancy.fit.continuation import with_starts
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import LINEAR, Fitter
from discrepancy.fit.simulate import Simulator

START_TIME, START_SAMPLES = 5e-3, 50
"""Length of the start that gives the initial state: the longer of the two."""
START_SHARE: Final = 0.25
"""Of a run, that its start is at most: of a fast device 5 ms may be all there is."""
START_ROUNDS: Final = 12
"""Steps of its fit at most. A linear device is exact after one; beside a dry friction, which changes the slopes from
rest on, 4 left a speed 2e-3 off, and 12 are as good as 20."""

TOLD: Final = 0.01
"""Of the signal, that initial states may move a run by within what the first samples leave open of them."""
UNTOLD: Final = 0.3
"""The same of what the first samples leave: what is left of the run grows by less than a twentieth."""
TWICE: Final = 0.5
"""Of what a run is off by, that twice as many samples for its start leave at most where the first were too few."""
OFF_LEVEL: Final = 0.03
"""Mean of a residual over its deviation, above which the mean that was taken out of a run was the motion's in part: as
much as a thousand independent samples leave."""
TINY: Final = 1e-300


def start_fitted(
    simulator: Simulator, record: Record, parameters: Mapping[str, float], start: int | None = None
) -> tuple[Floats, int]:
    """The residual (n, axes) [V] of a run whose first samples gave the initial state, and how many those were:
    ``start`` where that is known, else as many as it takes, where effects have states of their own. Where a mean was
    taken out of the run that was the motion's, or a drift, the whole run says how it begins: its first samples don't
    tell a level from a speed."""
    if record.drift:
        return start_known(simulator, record, parameters)
    begun, n = _start_fitted(simulator, replace(record, centred=False), parameters, start)
    [residual] = begun.residuals
    left = residual[record.valid]
    if record.centred and (np.abs(left.mean(axis=0)) > OFF_LEVEL * left.std(axis=0)).any():
        return start_known(simulator, record, parameters)
    return residual, n


def started(simulator: Simulator, record: Record, parameters: Mapping[str, float]) -> Mapping[str, float]:
    """The initial state that the first samples of a run give."""
    return _start_fitted(simulator, replace(record, centred=False), parameters, None)[0].starts[0]


def _start_fitted(
    simulator: Simulator, record: Record, parameters: Mapping[str, float], start: int | None
) -> tuple[Fitted, int]:
    """A run as it is, with the initial state that its first samples give, and how many these were."""
    n, run = start or _unscored(record), Fitter(simulator, [record])
    begun, tells = _begun_by(run, parameters, n)
    stateful = not start and len(run.state_names(begun)) > 2 * record.axes
    while stateful and 2 * n <= len(record.t) // 2:
        later, tell_later = _begun_by(run, parameters, 2 * n)
        # Beside a friction, which holds what is at rest, no slope says what the first samples leave open.
        if run.off(later) > TWICE * run.off(begun) and tells():
            break
        begun, tells, n = later, tell_later, 2 * n
    return begun, n


def _begun_by(run: Fitter, parameters: Mapping[str, float], n: int) -> tuple[Fitted, Callable[[], bool]]:
    """The run with the initial state that its first ``n`` samples give, and what says whether these tell it."""
    head = Fitter(run.simulator, [_head(run.records[0], n)])
    begun = _begun(head, parameters)
    at = run.evaluated(replace(begun, whiten=run.plain(parameters)))

    def tells() -> bool:
        told = _tells(head, begun, run, at)
        run.simulator.forget(head.records)
        return told

    run.simulator.forget(head.records)
    return at, tells


def _head(record: Record, n: int) -> Record:
    """The first samples of a run, of which n count: a record has a least length."""
    own = slice(0, max(n, MINIMUM_SAMPLES))
    held = {name: values[own] for name, values in record.conditions.items()}
    counted = record.valid[own] & (np.arange(len(record.t))[own] < n)
    return replace(
        record, t=record.t[own], u=record.u[own], v=record.v[own], conditions=held, valid=counted, drift=None
    )


def _tells(head: Fitter, begun: Fitted, run: Fitter, at: Fitted) -> bool:
    """Whether the first samples tell how a run began: what they leave open of the initial states, each of which may be
    as large as the motion, moves the run by little."""
    valid = head.records[0].valid
    shown = head.by_states(begun, 0)[:, valid].reshape(-1, int(valid.sum()) * head.axes)
    moved = run.by_states(at, 0).reshape(len(shown), -1)
    left = max(begun.cost / begun.count, TINY)
    told = shown @ shown.T / left + LINEAR**2 * np.eye(len(shown))
    spread = np.trace(np.linalg.solve(told, moved @ moved.T)) / moved.shape[1]
    return bool(spread < min((TOLD * run.signal) ** 2, UNTOLD**2 * left))


def start_known(simulator: Simulator, record: Record, parameters: Mapping[str, float]) -> tuple[Floats, int]:
    """As ``start_fitted``, the initial state fitted to the whole run: of a slow device the first samples tell its speed
    badly, and what comes of that is not the model's fault."""
    return record.v - simulator.run(record, {**parameters, **_start(simulator, record, parameters)}), _unscored(record)


def misfit_by_pieces(
    simulator: Simulator, records: Sequence[Record], length: int, parameters: Mapping[str, float]
) -> float:
    """rms(v - v_sim)/rms(v) over pieces of about so many samples of runs whose motion no model follows whole, each from
    the initial state that fits it best: farther on nobody can say where it goes."""
    pieces = [piece for run in records for piece in simulator.cut(run, max(len(run.t) // length, 1))]
    fitter = Fitter(simulator, pieces)
    found = fitter.off(_begun(fitter, parameters))
    simulator.forget(pieces)
    return found


def _unscored(record: Record) -> int:
    duration = min(START_TIME, START_SHARE * len(record.t) / record.sample_rate)
    return max(START_SAMPLES, round(duration * record.sample_rate))


def _start(simulator: Simulator, record: Record, parameters: Mapping[str, float]) -> Mapping[str, float]:
    """The initial state that fits a record best."""
    return _begun(Fitter(simulator, [record]), parameters).starts[0]


def _begun(fitter: Fitter, parameters: Mapping[str, float]) -> Fitted:
    """The initial states that fit the runs of ``fitter`` best."""
    at = Fitted(dict(parameters), fitter.starts(parameters), (), fitter.plain(parameters), ())
    return with_starts(fitter, at, START_ROUNDS)


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
