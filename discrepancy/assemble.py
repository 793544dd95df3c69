"""What a finished search says: parameters with intervals, noise, misfit on held-out runs, what would have been seen."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from scipy.stats import chi2, norm

from discrepancy.answer import Diagnosis, Finding, Stage, Value, Verdict
from discrepancy.columns import Candidate, nameable
from discrepancy.experiment import next_experiment
from discrepancy.limits import SAME
from discrepancy.locate import located
from discrepancy.measures import misfits, start_fitted
from discrepancy.noise import Noise, converter_step, noise_of
from discrepancy.noise import noises as all_noises
from discrepancy.record import Floats
from discrepancy.refit import SETTLED
from discrepancy.scan import CHANCE, MATERIAL, best_of, sure
from discrepancy.score import Score
from gyro_model.anatomy import Effect, Force, Map

if TYPE_CHECKING:
    from discrepancy.search import Accepted, Search

CLIP: Final = "sampled clip"
"""The slot of the effect that such samples show."""
THERMAL: Final = 5.0
"""Times the physical thermal force: a motion stronger than that is no noise of a package at 300 K and its damping."""
POWER: Final = 0.95
WIDTH: Final = float(norm.ppf(0.975))
OPEN: Final = 1.5
"""Final misfit over the noise floor from which a gap stays open: noises other than white ones lie above the floor too,
and are told from a gap by what they are."""


def assemble(search: "Search") -> Diagnosis:
    """The answer of ``search``. Opens the held-out runs."""
    search.progress("held-out runs")
    noise = noise_of(search.at.residuals, search.fitter.records, search.at.parameters)
    clipped = _clipping(search)
    parameters = {**search.at.parameters, **{k: v.value for f in clipped for k, v in f.parameters.items()}}
    stages = _stages(search, parameters, [f.id for f in clipped])
    device = _device(search)
    effects = (*(_finding(search, entry, device, noise) for entry in search.accepted), *clipped)
    removed = _removed(search, effects, parameters)
    effects = tuple(sorted(effects, key=lambda finding: -_size(removed[finding.id])))
    gaps = _misfit(search, stages)
    refitted = search.refitted
    runs = search.dataset.fit
    whole = refitted.residuals if len(refitted.residuals) == len(runs) else \
        [start_fitted(search.simulator, run, refitted.parameters)[0] for run in runs]  # fmt: skip
    places = located(whole, runs, refitted.parameters, search.at.whiten.setting.corner)
    floor = gaps["noise_floor"]
    noises = _noises(search, noise)
    # Flicker lies above the floor by what it is; a motion that nothing drives may be thermal only as far as it is weak.
    above = floor is not None and gaps["final"] > OPEN * floor and not search.at.whiten.setting.corner
    unfinished = search.fitter is not search.whole or above or _driven(noises)
    verdict: Verdict = "nothing missing"
    if effects:
        verdict = "missing effects"
    elif unfinished:
        verdict = "unexplained"
    rivals = {entry.id: entry.rivals for entry in search.accepted if entry.rivals}
    return Diagnosis(
        verdict, effects, _immaterial(search), noises, gaps, places, _detectable(search), device,
        parameters, rivals, tuple(search.steps), stages, removed,
        _doubts(search, noises),
        model=search.simulator.model,
    )  # fmt: skip


def _device(search: "Search") -> dict[str, Value]:
    """Every fitted parameter with its interval."""
    result = {}
    for name, deviation in search.fitter.deviations(search.at).items():
        value, quantity = search.at.parameters[name], search.simulator.model.parameter(name)
        low, high = (float(np.clip(value + side * WIDTH * deviation, quantity.low, quantity.high)) for side in (-1, 1))
        result[name] = Value(value, low, high, quantity.unit)
    return result


def _finding(search: "Search", entry: "Accepted", device: Mapping[str, Value], noise: Noise | None) -> Finding:
    effect = entry.candidate.effect
    values = {q.name: device[q.name] for q in effect.parameters if q.name in device}
    experiment = _experiment(search, entry, noise)
    return Finding(effect.id, tuple(entry.rivals), values, forces(effect), entry.share, experiment)


def _experiment(search: "Search", entry: "Accepted", noise: Noise | None) -> str:
    """What would tell an effect from its rivals."""
    if not entry.rivals:
        return ""
    search.progress(f"experiment to tell {entry.id} from {', '.join(entry.rivals)}")
    level = noise.rms if noise else float(np.sqrt(search.at.variance))
    sets = {entry.id: search.at.parameters, **entry.rivals}
    return next_experiment(search.simulator, search.dataset.fit, sets, level).text


def forces(effect: Effect) -> dict[str, str]:
    """The terms of an effect that is a force, as sympy text by ``force_x``, ``force_y``; else none."""
    if not isinstance(effect, Force):
        return {}
    return {f"force_{axis}": str(term) for axis, term in zip("xy", effect.force, strict=True)}


def _clipping(search: "Search") -> list[Finding]:
    """The clip, if there is one: its level is exact but for the converter's step."""
    clips = [e for e in nameable(search.simulator.model, limits=True) if isinstance(e, Map) and e.slot == CLIP]
    if search.clip is None or not clips:
        return []
    (quantity,) = clips[0].sizes
    room = max(0.5 * converter_step(search.dataset.records), SAME * search.clip)
    value = Value(search.clip, search.clip - room, search.clip + room, quantity.unit)
    return [Finding(clips[0].id, (), {quantity.name: value})]


def _stages(search: "Search", final: Mapping[str, float], last: list[str]) -> tuple[Stage, ...]:
    """Every stage of the model on the held-out runs; the last one has the final parameters."""
    kept = {"nominal", "refit", *(a.id for a in search.accepted)}
    named = [(name, p) for name, p in search.stages if name in kept]
    named = (
        [*named[:-1], (named[-1][0], dict(final))] if not last else [*named, *((name, dict(final)) for name in last)]
    )
    stages = []
    for name, parameters in named:
        residuals = {r.name: start_fitted(search.simulator, r, parameters) for r in search.dataset.held_out}
        stages.append(Stage(name, parameters, misfits(search.dataset.held_out, residuals),
                            {run: residual for run, (residual, _) in residuals.items()}))  # fmt: skip
    return tuple(stages)


def _misfit(search: "Search", stages: tuple[Stage, ...]) -> dict[str, Any]:
    """The four numbers of each held-out run and of all; the floor by its own noise, which may grow with the motion."""
    runs, last = search.dataset.held_out, stages[-1]
    gaps = {"nominal": stages[0].misfit, "refit": stages[1].misfit, "final": last.misfit}
    table = {}
    for name, own in {"": runs, **{run.name: (run,) for run in runs}}.items():
        noise = noise_of([last.residuals[run.name] for run in own], own, last.parameters)
        rms = float(np.sqrt(np.mean(np.concatenate([run.v[run.valid].ravel() for run in own]) ** 2)))
        table[name] = {
            **{key: gap[name] for key, gap in gaps.items()},
            "noise_floor": noise.rms / rms if noise else None,
        }
    return {**table.pop(""), "runs": table}


def _removed(
    search: "Search", effects: tuple[Finding, ...], final: Mapping[str, float]
) -> dict[str, dict[str, Floats]]:
    """What taking each effect out of the final model changes in the output of the held-out runs."""
    result: dict[str, dict[str, Floats]] = {}
    for record in search.dataset.held_out:
        full, _ = start_fitted(search.simulator, record, final)
        for finding in effects:
            effect = search.simulator.model.effect(finding.id)
            less = {**final, **{q.name: q.start for q in effect.sizes}}
            changed, _ = start_fitted(search.simulator, record, less)
            result.setdefault(finding.id, {})[record.name] = full - changed
    return result


def _size(changes: Mapping[str, Floats]) -> float:
    """Rms of changes of several runs [V]; infinite where the motion leaves all bounds."""
    rms = np.sqrt(np.mean(np.concatenate([change.ravel() for change in changes.values()]) ** 2))
    return float(np.nan_to_num(rms, nan=np.inf))


def _immaterial(search: "Search") -> tuple[Finding, ...]:
    """Effects that are significant beside the final model but not worth a parameter."""
    return tuple(_slight(c, s) for c, s in best_of(search.scored)
                 if sure(c, s) and s.share < MATERIAL and c.effect.id not in search.present)  # fmt: skip


def _slight(candidate: Candidate, result: Score) -> Finding:
    values = {}
    for p, a, d in zip(candidate.all_probes, result.amplitudes, result.deviations, strict=True):
        if np.isfinite(d):
            ends = sorted((p.value(a - WIDTH * d), p.value(a + WIDTH * d)))
            values[p.quantity.name] = Value(p.value(a), ends[0], ends[1], p.quantity.unit)
    return Finding(candidate.effect.id, (), values, forces(candidate.effect), result.share)


def _driven(noises: Mapping[str, Value]) -> bool:
    """Whether the motion that nothing drives is stronger than a thermal one can be."""
    return "thermal_force" in noises and noises["thermal_force"].low > THERMAL


def _doubts(search: "Search", noises: Mapping[str, Value]) -> tuple[str, ...]:
    """What is wrong with the fit itself, and what it leaves open."""
    found = []
    if _driven(noises):
        times = noises["thermal_force"].value
        found.append(
            f"what is left shakes the mass {times:.2g} times as strongly as thermal motion: it is something else"
        )
    if search.full:
        rest = [(c.effect.id, s.share) for c, s in best_of(search.scored)
                if sure(c, s) and s.share >= MATERIAL and c.effect.id not in search.present]  # fmt: skip
        others = f"; {rest[0][0]} would take a further {rest[0][1]:.1%} of the residual's square" if rest else ""
        found.append(f"the search ended because --max-effects allows no more{others}")
    if search.fitter is not search.whole:
        number = len(search.fitter.records) // len(search.whole.records)
        found.append(f"no model stays in step with a whole run: the fit is one of pieces, {number} a run")
    if search.at.left > 10 * SETTLED:
        found.append(f"the fit stopped short of a minimum: a further step would gain {search.at.left:.2g} variances")
    for free in search.at.free:
        value = search.at.parameters[free.name]
        if value in (free.low, free.high):
            found.append(f"{free.name} = {value:.6g} stands at the bound of what it can be")
    return tuple(found)


def _detectable(search: "Search") -> dict[str, dict[str, float]]:
    """The size of each effect that this data would show with 95 % power at the threshold used."""
    sizes: dict[str, dict[str, float]] = {}
    for candidate, result in search.scored:
        if candidate.partner:
            continue
        reach = np.sqrt(chi2.isf(CHANCE / candidate.trials, max(result.freedom, 1))) + norm.ppf(POWER)
        for p, d in zip(candidate.probes, result.deviations, strict=False):
            if np.isfinite(d):
                own = sizes.setdefault(candidate.effect.id, {})
                value = abs(p.value(reach * d) - p.quantity.start)
                own[p.quantity.name] = min(own.get(p.quantity.name, np.inf), value)
    return sizes


def _noises(search: "Search", white: Noise | None) -> dict[str, Value]:
    """Those that the model has a name for, each with its unit."""
    names = {q.name: q.unit for e in search.simulator.model.effects if e.noise for q in e.sizes}
    found = all_noises(search.at, search.fitter.records, white)
    return {n: Value(x.value, x.low, x.high, names[n]) for n, x in found.items() if n in names}
