"""How near the floor of a measured set every effect and every term together could come, to first order."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from discrepancy.data.dataset import Dataset
from discrepancy.data.record import Floats
from discrepancy.discover.contest import Terms
from discrepancy.fit.continuation import LAST_ROUNDS, started
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name.columns import Library
from gyro_model.device import load_device
from gyro_model.model import Model

SAME: Final = 1e-10
"""Share of the largest eigenvalue below which columns are one to the accuracy of difference quotients."""


def at_once(folder: Path, model: Model, data: Dataset, effects: Sequence[Mapping[str, Any]]) -> dict[str, Floats]:
    """By run what is left [V] where the columns of all effects, at every point of their grids, and of all terms are
    taken from the residual together, by least squares on the run to fit; initial states are each run's own.

    folder: of a diagnosis; model: with the effects that it wrote; effects: those of its report.
    """
    p = load_device(str(folder / "device.toml"), model).parameters
    named = [name for effect in effects for name in effect["parameters"]]
    with Simulator(model) as simulator:
        fitter = Fitter(simulator, data.fit)
        begun = fitter.begin(data.nominal)
        own = {q.name: q for effect in model.effects for q in effect.parameters if q.name in named}
        free = (*begun.free, *(Free(n, 1e-6 * abs(p[n]), q.low, q.high) for n, q in own.items()))
        kept = {name: value for name, value in p.items() if name in begun.parameters or name in own}
        at = fitter.fit(fitter.evaluated(replace(begun, parameters=kept, free=free)), LAST_ROUNDS)
        with Terms(fitter, at) as terms:
            fitter = Fitter(terms.simulator, data.fit)
            at = fitter.evaluated(at)
            found = Library(fitter).candidates(fitter, at, [effect["id"] for effect in effects])
            changes = [change for c in found for change in c.changes()]
            changes += [change for _, c in terms.candidates(at) for change in c.changes()]
            [fitted] = _columns(fitter, at, at.free, changes)
            amplitudes = _least(fitted, at.residuals[0].ravel())
            left = {}
            for run in data.held_out:
                unseen = Fitter(terms.simulator, (run,))
                there = started(unseen, replace(at, residuals=(), whiten=unseen.plain(at.parameters)))
                [columns] = _columns(unseen, there, at.free, changes)
                states = len(unseen.state_names(there))
                rest = there.residuals[0].ravel() - amplitudes[states:] @ columns[states:]
                left[run.name] = rest - _least(columns[:states], rest) @ columns[:states]
            left[""] = at.residuals[0].ravel() - amplitudes @ fitted
    return left


def _columns(fitter: Fitter, at: Fitted, free: Sequence[Free], changes: Sequence[Mapping[str, float]]) -> list[Floats]:
    """Of each run what initial states, ``free`` parameters and ``changes`` do to it, a row each."""
    found = []
    for run, start in enumerate(at.starts):
        here = {**at.parameters, **start}
        size = 1e-5 * fitter.signal / abs(here["sense_gain_x"])
        speed = size * float(np.sqrt(here["kxx"] / here["m"]))
        steps = {name: speed if "dot" in name else size for name in fitter.state_names(at)}
        steps |= {f.name: f.step for f in free}
        probes = [*({name: here[name] + step} for name, step in steps.items()), *changes]
        found.append(fitter.columns(at, run, probes).reshape(len(probes), -1))
    return found


def _least(columns: Floats, rest: Floats) -> Floats:
    """The amplitudes of ``columns`` (p, n) that leave the least of ``rest``, none along what columns share."""
    size = np.maximum(np.linalg.norm(columns, axis=1), 1e-300)
    gram = columns @ columns.T / np.outer(size, size)
    values, vectors = np.linalg.eigh(gram)
    used = values > SAME * values[-1]
    inner = vectors[:, used].T @ (columns @ rest / size)
    return np.asarray(vectors[:, used] @ (inner / values[used]) / size)
