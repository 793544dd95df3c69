"""How the gap shrank: the held-out runs simulated with the nominal values, after the refit, after each effect, and
without each."""

from dataclasses import replace

import numpy as np

from discrepancy.dataset import Dataset
from discrepancy.measures import start_fitted
from discrepancy.naming import Diagnosis, Stage
from discrepancy.simulate import Simulator


def staged(found: Diagnosis, dataset: Dataset, simulator: Simulator) -> Diagnosis:
    """``found`` with its stages and what each effect does; each run's initial state is fitted to its start (SYSTEM.md
    section 9)."""
    named = [finding.id for finding in found.effects]
    sets = {"nominal": dict(dataset.nominal)}
    if found.steps:
        sets["refit"] = dict(found.steps[0].parameters)
    for step, after in zip(found.steps, found.steps[1:], strict=False):
        if step.accepted in named:
            sets[step.accepted] = dict(after.parameters)
    # Backward deletion and a last refit come after the last step.
    sets[list(sets)[-1] if len(sets) > 1 else "refit"] = dict(found.parameters)
    stages = tuple(_stage(name, parameters, dataset, simulator) for name, parameters in sets.items())
    removed = {}
    for name in named:
        less = {**found.parameters, **{q.name: q.start for q in simulator.model.effect(name).sizes}}
        without = {r.name: start_fitted(simulator, r, less)[0] for r in dataset.held_out}
        removed[name] = {run: stages[-1].residuals[run] - residual for run, residual in without.items()}
    return replace(found, stages=stages, removed=removed)


def _stage(name: str, parameters: dict[str, float], dataset: Dataset, simulator: Simulator) -> Stage:
    residuals, misfit = {}, {}
    errors, signals = 0.0, 0.0
    for record in dataset.held_out:
        residual, n = start_fitted(simulator, record, parameters)
        usable = record.valid & (np.arange(len(record.t)) >= n)
        error, signal = float(np.sum(residual[usable] ** 2)), float(np.sum(record.v[usable] ** 2))
        residuals[record.name], misfit[record.name] = residual, (error / signal) ** 0.5
        errors, signals = errors + error, signals + signal
    return Stage(name, parameters, {**misfit, "": (errors / signals) ** 0.5}, residuals)
