"""How the gap shrank: the held-out runs simulated with the nominal values, after the refit, after each effect, and
without each."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from discrepancy.dataset import Dataset
from discrepancy.measures import start_fitted
from discrepancy.naming import Diagnosis
from discrepancy.record import Bools, Floats, Record
from discrepancy.simulate import Simulator


@dataclass(frozen=True)
class Stage:
    """A step of the improvement. name: "nominal", "refit" or the effect that came in; parameters [SI]; of each
    held-out run by name: misfit, residual (n, axes) [V]."""

    name: str
    parameters: Mapping[str, float]
    misfit: Mapping[str, float]
    residuals: Mapping[str, Floats] = field(repr=False)


class Evidence(NamedTuple):
    """stages: in order; removed: by effect and run, how the output of the improved model changes without it (n, axes)
    [V]; scored: by run, which samples count (n,)."""

    stages: tuple[Stage, ...]
    removed: Mapping[str, Mapping[str, Floats]]
    scored: Mapping[str, Bools]


def evidence(found: Diagnosis, dataset: Dataset, simulator: Simulator) -> Evidence:
    """The stages of a diagnosis, each run's initial state fitted to its start (SYSTEM.md section 9)."""
    runs = dataset.held_out
    final = {**dataset.nominal, **{name: value.value for name, value in found.device.items()}}
    named = [finding.id for finding in found.effects]
    sets = {"nominal": dict(dataset.nominal)}
    if found.steps:
        sets["refit"] = dict(found.steps[0].parameters)
    for step, after in zip(found.steps, found.steps[1:], strict=False):
        if step.accepted in named:
            sets[step.accepted] = dict(after.parameters)
    # Backward deletion and a last refit come after the last step.
    sets[list(sets)[-1] if len(sets) > 1 else "refit"] = final
    stages, scored = [], {}
    for name, parameters in sets.items():
        residuals, gaps = {}, {}
        for record in runs:
            residuals[record.name], n = start_fitted(simulator, record, parameters)
            usable = record.valid & (np.arange(len(record.t)) >= n)
            scored[record.name] = usable
            gaps[record.name] = _misfit(record, residuals[record.name], usable)
        stages.append(Stage(name, parameters, gaps, residuals))
    removed = {}
    for finding in found.effects:
        effect = simulator.model.effect(finding.id)
        without = {**final, **{q.name: q.start for q in effect.sizes}}
        removed[finding.id] = {
            r.name: stages[-1].residuals[r.name] - start_fitted(simulator, r, without)[0] for r in runs
        }
    return Evidence(tuple(stages), removed, scored)


def whole_misfit(dataset: Dataset, shown: Evidence, stage: Stage) -> float:
    """The misfit of all held-out runs together at a stage."""
    pairs = [(stage.residuals[r.name][shown.scored[r.name]], r.v[shown.scored[r.name]]) for r in dataset.held_out]
    return float(np.sqrt(sum(np.sum(e**2) for e, _ in pairs) / sum(np.sum(v**2) for _, v in pairs)))


def _misfit(record: Record, residual: Floats, usable: Bools) -> float:
    return float(np.sqrt(np.sum(residual[usable] ** 2) / np.sum(record.v[usable] ** 2)))
