"""What a finished search says: parameters with intervals, noise, misfit on held-out runs, what would have been seen."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import inf
from typing import Any, Final

import numpy as np
from scipy.stats import chi2, norm

from discrepancy.data.checks import modes
from discrepancy.data.linear_fit import mode_frequencies
from discrepancy.data.record import Floats, is_driven
from discrepancy.data.repeats import repeated_noise
from discrepancy.fit.colour import gain
from discrepancy.fit.continuation import LAST_ROUNDS, unsprung
from discrepancy.fit.defect import Defect, Left, distortion_names, disturbances, effect_of, quantity_of
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.limits import SAME
from discrepancy.fit.locate import located
from discrepancy.fit.measures import misfits, start_fitted, started
from discrepancy.fit.noise import Noise, converter_step, noise_of
from discrepancy.fit.noise import noises as all_noises
from discrepancy.fit.refit import SETTLED
from discrepancy.name.accepted import Accepted, Dropped
from discrepancy.name.columns import Candidate, nameable
from discrepancy.name.question import unasked
from discrepancy.name.scan import best_of, sure
from discrepancy.name.score import Score
from discrepancy.name.search import Search
from discrepancy.tell.answer import Diagnosis, Finding, Stage, Value, Verdict
from discrepancy.tell.backbone import bent
from discrepancy.tell.experiment import Experiment, next_experiment
from discrepancy.tell.intervals import WIDTH, intervals
from discrepancy.tell.left_modes import left_modes
from discrepancy.tell.limits import Limits
from discrepancy.tell.unlike_runs import unlike_runs
from discrepancy.tell.verdict import (
    Remainder,
    imitating,
    improbable,
    probability,
    remainder,
    sane,
    shown,
    worse_without,
)
from gyro_model.anatomy import Effect, Force, Map

TRACE: Final = 1e12
"""Steps of a probe, each of which the voltage shows well, from which an effect has no trace in these runs."""
CLIP: Final = "sampled clip"
"""The slot of the effect that such samples show."""
SCALED, ONE_FACTOR = 5e-3, 0.05
"""Mass and stiffness off nominal by more than a mass is known to, and all by one factor, to this share of it: three
values of 2 % each agree so by chance once in a thousand times."""
POWER: Final = 0.95


def assemble(search: Search, limits: Limits) -> Diagnosis:
    """The answer of ``search``, with experiments within ``limits``. Opens the held-out runs."""
    search.progress("held-out runs")
    search.until(inf)
    search = _with_clean_held_out(search)
    setting = search.at.whiten.setting
    noise = noise_of(search.at.residuals, search.fitter.records, search.at.parameters, setting)
    clipped = _clipping(search)
    parameters = {**search.at.parameters, **{k: v.value for f in clipped for k, v in f.parameters.items()}}
    stages = _stages(search, parameters, [f.id for f in clipped])
    search, device = intervals(search)
    experiments = _experiments(search, noise, limits)
    weak = unasked(search)
    named = [
        _finding(search, entry, device, experiments)
        for entry in search.accepted
        if not (entry.of_record or entry.id in weak)
    ]
    effects = (*named, *clipped)
    removed = _removed(search, effects, stages[-1])
    effects = tuple(sorted(effects, key=lambda finding: -_size(removed[finding.id])))
    gaps = _misfit(search, stages)
    refitted = search.refitted
    runs = search.dataset.fit
    whole, last = (_whole(search, at) for at in (refitted, search.at))
    places = located(whole, runs, refitted.parameters, setting)
    known = _disturbances(search)
    noises, absurd = sane(_noises(search, noise, known), search)
    search.until(1.0)
    search, worse = worse_without(search, effects, stages, gaps)
    search.until(inf)
    rest = remainder(search, stages, gaps, absurd)
    against = search.refuted | worse.keys()
    modes = shown(search)
    effects = tuple(
        replace(f, probability=probability(search, f, rest, stages, f.id in against, shown=f.id in modes))
        for f in effects
    )
    # A clip is seen in the samples themselves, and takes nothing away.
    seen = {f.id for f in clipped}
    parts = imitating([f for f in effects if f.id not in seen], rest, worse, search.criteria)
    effects = tuple(f for f in effects if f not in parts)
    hardly = improbable(search, [f for f in effects if f.id not in seen])
    doubts = (*absurd.values(), *dict.fromkeys(worse.values()), *map(_imitates, parts), *hardly,
              *_doubts(search, rest, last))  # fmt: skip
    verdict: Verdict = "missing effects" if effects else "nothing missing"
    # What was not tested is not said: neither that a name stands nor, while something may be, that nothing is missing.
    untested = not search.scored or search.unsure
    if rest.significant or untested or worse or parts or hardly:
        verdict = "partly explained" if effects else "unexplained"
    final = search.at.parameters
    withdrawn = {f.id for f in parts} | weak.keys()
    if withdrawn:
        search, device = intervals(_without(search, withdrawn))
        parameters = {**search.at.parameters, **{k: v.value for f in clipped for k, v in f.parameters.items()}}
        # What stands is as large as the improved device has it.
        effects = tuple(replace(f, parameters={n: device.get(n, own) for n, own in f.parameters.items()})
                        for f in effects)  # fmt: skip
    rivals = {entry.id: entry.rivals for entry in search.accepted
              if entry.rivals and entry.id in {f.id for f in effects}}  # fmt: skip
    return Diagnosis(
        verdict, effects, (*_immaterial(search, weak), *parts), noises, gaps, places, _detectable(search),
        {name: value for name, value in device.items() if name not in distortion_names()},
        {name: value for name, value in parameters.items() if name not in distortion_names()},
        rivals, tuple(search.steps), stages, removed, _absent(search), doubts, rest.share,
        (*_record(search, device), *known), search.criteria, bent(runs, whole, last, final), experiments,
        model=search.simulator.model,
    )  # fmt: skip


def _without(search: Search, ids: Collection[str]) -> Search:
    """Without effects that are no names, the rest refitted: the improved device holds nothing that the answer does not
    stand by. What others need to act stays with them."""
    staying = {a.candidate.partner.effect.id for a in search.accepted if a.candidate.partner and a.id not in ids}
    gone = [a for a in search.accepted if a.id in ids and a.id not in staying]
    for entry in gone:
        search = replace(search.lacking(entry), at=search.without_effect(search.at, entry))
    if not gone:
        return search
    search.beyond()
    search = replace(search, at=search.fitter.fit(search.at, LAST_ROUNDS))
    search.until(inf)
    return search


def _imitates(finding: Finding) -> str:
    """That what was taken into the model is no name for what is missing."""
    return (
        f"{finding.id} was taken into the model, but is hardly what is missing "
        f"(probability {finding.probability:.2g}): it may imitate a part of that, and the improved device is without it"
    )


def _whole(search: Search, at: Fitted) -> Sequence[Floats]:
    """The residuals of a fit, maybe one of pieces, over whole runs."""
    runs = search.dataset.fit
    if [len(residual) for residual in at.residuals] == [len(run.t) for run in runs]:
        return at.residuals
    return [start_fitted(search.simulator, run, at.parameters)[0] for run in runs]


def _with_clean_held_out(search: Search) -> Search:
    """With the blemishes that the runs to fit had taken out of the held-out runs, by their own residuals."""
    for blemish, known in search.blemishes:
        runs = search.dataset.held_out
        residuals = [start_fitted(search.simulator, run, search.at.parameters)[0] for run in runs]
        if not all(np.isfinite(residual).all() for residual in residuals):
            return search
        if blemish.again is not None:
            data = [blemish.again(known, run, residual) for run, residual in zip(runs, residuals, strict=True)]
        else:
            found = blemish.find(Left(runs, residuals, partial(_between, search)), search.criteria)
            data = [*found.data] if found is not None else []
        if data:
            cleaned = {run.name: blemish.without(run, own) for run, own in zip(runs, data, strict=True) if own}
            records = tuple(cleaned.get(record.name, record) for record in search.dataset.records)
            search = replace(search, dataset=replace(search.dataset, records=records))
    return search


def _between(search: Search, run: int) -> Floats | None:
    """What the model gives between the samples of a held-out run."""
    record, parameters = search.dataset.held_out[run], search.at.parameters
    start = started(search.simulator, record, parameters)
    return search.simulator.between_samples(record, {**parameters, **start})


def _record(search: Search, device: Mapping[str, Value]) -> tuple[Finding, ...]:
    """The defects of the record, as fitted or as found."""
    fitted = [
        Finding(a.id, tuple(a.rivals), _values(search, a.candidate.effect, device), {}, a.share)
        for a in search.accepted
        if a.of_record
    ]
    taken: dict[str, dict[str, Value]] = {}
    for blemish, found in search.blemishes:
        values = {q.name: Value(*found.levels[q.name], q.unit) for q in blemish.parameters}
        before = taken.setdefault(blemish.id, values)
        # The first time a level is found it is whole; what a better model shows of it later is a rest.
        if before is not values and blemish.counted:
            taken[blemish.id] = {name: _sum(before[name], value) for name, value in values.items()}
    return (*fitted, *(Finding(name, (), values) for name, values in taken.items()))


def _sum(first: Value, second: Value) -> Value:
    return Value(first.value + second.value, first.low + second.low, first.high + second.high, first.unit)


def _values(search: Search, effect: Effect | Defect, device: Mapping[str, Value]) -> dict[str, Value]:
    """The parameters of an effect; a whole number is tried, not fitted, and has no interval."""
    now = search.at.parameters
    return {
        q.name: device.get(q.name) or Value(now[q.name], now[q.name], now[q.name], q.unit) for q in effect.parameters
    }


def _disturbances(search: Search) -> tuple[Finding, ...]:
    """What the likelihood of the final fit knows of the record beside its samples."""
    found = []
    for own in disturbances():
        levels = own.find(search.at, search.fitter.records, search.criteria)
        if levels is not None:
            found.append(Finding(own.id, (), {q.name: Value(*levels[q.name], q.unit) for q in own.parameters}))
    return tuple(found)


def _total(search: Search, white: float) -> float:
    """Rms of a noise [V] whose white part is known."""
    colour = search.at.whiten.setting.colour
    return white * gain(colour) ** 0.5 if colour else white


def _finding(
    search: Search, entry: Accepted, device: Mapping[str, Value], experiments: Mapping[str, Experiment]
) -> Finding:
    effect, now = entry.candidate.effect, search.at.parameters
    # A shape that no fit moves says what the effect is all the same, where it is not the usual one.
    held = {
        q.name: Value(now[q.name], now[q.name], now[q.name], q.unit)
        for q in effect.parameters
        if q.role == "shape" and q.search is None and now.get(q.name, q.start) != q.start
    }
    told = {**held, **device}
    values = {q.name: told[q.name] for q in effect.parameters if q.name in told}
    text = experiments[entry.id].text if entry.id in experiments else ""
    return Finding(effect.id, tuple(entry.rivals), values, forces(effect), entry.share, text)


def _of_record(search: Search, name: str) -> bool:
    """Whether an id is that of a defect of the record."""
    return isinstance(effect_of(search.simulator.model, name), Defect)


def _experiments(search: Search, noise: Noise | None, limits: Limits) -> dict[str, Experiment]:
    """By effect, what would tell it from its rivals."""
    asked = [
        entry
        for entry in search.accepted
        if entry.rivals and not entry.of_record and not (search.undone or search.failed)
    ]
    level = _total(search, noise.rms) if noise else float(np.sqrt(search.at.variance))
    found = {}
    for entry in asked:
        search.progress(f"experiment to tell {entry.id} from {', '.join(entry.rivals)}")
        sets = {entry.id: search.at.parameters, **entry.rivals}
        # Fitted to pieces of a motion that no model follows, one may leave all bounds over a whole run.
        sets = {name: own for name, own in sets.items() if _stays_bounded(search, own)}
        if len(sets) < 2 or entry.id not in sets:
            continue
        seconds = search.criteria.design_time / len(asked)
        experiment = next_experiment(search.simulator, search.dataset.fit, sets, level, limits, seconds)
        if experiment is not None:
            found[entry.id] = experiment
    return found


def _stays_bounded(search: Search, parameters: Mapping[str, float]) -> bool:
    jobs = [(run, parameters) for run in search.dataset.fit]
    return all(v is not None for v in search.simulator.try_all(jobs))


def forces(effect: Effect | Defect) -> dict[str, str]:
    """The terms of an effect that is a force, as sympy text by ``force_x``, ``force_y``; else none."""
    if not isinstance(effect, Force):
        return {}
    return {f"force_{axis}": str(term) for axis, term in zip("xy", effect.force, strict=True)}


def _clipping(search: Search) -> list[Finding]:
    """The clip, if there is one: its level is exact but for the converter's step."""
    clips = [e for e in nameable(search.simulator.model, limits=True) if isinstance(e, Map) and e.slot == CLIP]
    if search.clip is None or not clips:
        return []
    (quantity,) = clips[0].sizes
    room = max(0.5 * converter_step(search.dataset.records), SAME * search.clip)
    value = Value(search.clip, search.clip - room, search.clip + room, quantity.unit)
    return [Finding(clips[0].id, (), {quantity.name: value})]


def _stages(search: Search, final: Mapping[str, float], last: list[str]) -> tuple[Stage, ...]:
    """Every stage of the model on the held-out runs; the last one has the final parameters."""
    kept = {"nominal", "refit", *(a.id for a in search.accepted)}
    # Where what came in went again at once, a stage bears the name of the one before: it is that one, fitted further.
    further = [later for later, _ in search.stages[1:]]
    named = [(name, p) for i, (name, p) in enumerate(search.stages) if name in kept and name not in further[i:]]
    if search.accepted and named[-1][0] == "refit":
        # The stage in which an effect came in may have had the name of another that went.
        named.append((search.accepted[-1].id, dict(final)))
    named = (
        [*named[:-1], (named[-1][0], dict(final))] if not last else [*named, *((name, dict(final)) for name in last)]
    )
    stages = []
    for name, parameters in named:
        residuals = {r.name: start_fitted(search.simulator, r, parameters) for r in search.dataset.held_out}
        stages.append(Stage(name, parameters, misfits(search.dataset.held_out, residuals),
                            {run: residual for run, (residual, _) in residuals.items()},
                            {run: start for run, (_, start) in residuals.items()}))  # fmt: skip
    return tuple(stages)


def _misfit(search: Search, stages: tuple[Stage, ...]) -> dict[str, Any]:
    """The four numbers of each held-out run and of all; the floor by its own noise, which may grow with the motion."""
    runs, last = search.dataset.held_out, stages[-1]
    gaps = {"nominal": stages[0].misfit, "refit": stages[1].misfit, "final": last.misfit}
    table = {}
    # A floor without a model goes before one from the residual's density.
    general = repeated_noise(search.dataset.records)
    for name, own in {"": runs, **{run.name: (run,) for run in runs}}.items():
        noise = noise_of([last.residuals[run.name] for run in own], own, last.parameters, search.at.whiten.setting)
        level = repeated_noise(own) or general or (_total(search, noise.rms) if noise else None)
        rms = float(np.sqrt(np.mean(np.concatenate([run.v[run.valid].ravel() for run in own]) ** 2)))
        table[name] = {
            **{key: gap[name] for key, gap in gaps.items()},
            "noise_floor": level / rms if level else None,
        }
    return {**table.pop(""), "runs": table}


def _removed(search: Search, effects: tuple[Finding, ...], final: Stage) -> dict[str, dict[str, Floats]]:
    """What taking each effect out of the final model changes in the output of the held-out runs."""
    result: dict[str, dict[str, Floats]] = {}
    for record in search.dataset.held_out:
        full, start = final.residuals[record.name], final.starts[record.name]
        for finding in effects:
            effect = search.simulator.model.effect(finding.id)
            less = {**final.parameters, **{q.name: q.start for q in effect.sizes}}
            changed, _ = start_fitted(search.simulator, record, less, start)
            result.setdefault(finding.id, {})[record.name] = full - changed
    return result


def _size(changes: Mapping[str, Floats]) -> float:
    """Rms of changes of several runs [V]; infinite where the motion leaves all bounds."""
    rms = np.sqrt(np.mean(np.concatenate([change.ravel() for change in changes.values()]) ** 2))
    return float(np.nan_to_num(rms, nan=np.inf))


def _immaterial(search: Search, weak: Mapping[str, Dropped]) -> tuple[Finding, ...]:
    """Effects that are significant beside the final model but not worth a parameter, those taken out again, and those
    that are in it though their interval holds neutral (``weak``)."""
    slight = [_slight(c, s) for c, s in best_of(search.scored, search.criteria)
              if sure(c, s, search.criteria) and s.share < search.criteria.material
              and c.effect.id not in search.present and not isinstance(c.effect, Defect)]  # fmt: skip
    # What was taken out again and again is listed as it was last.
    taken_out = {entry.candidate.effect.id: entry for entry in (*search.dropped, *weak.values())}
    dropped = [_dropped(entry) for entry in taken_out.values() if not isinstance(entry.candidate.effect, Defect)]
    return (*(f for f in slight if f.id not in {d.id for d in dropped}), *dropped)


def _dropped(entry: Dropped) -> Finding:
    effect, values = entry.candidate.effect, {}
    for q in effect.sizes:
        if q.name in entry.sizes:
            value, deviation = entry.sizes[q.name]
            low, high = (float(np.clip(value + side * WIDTH * deviation, q.low, q.high)) for side in (-1, 1))
            values[q.name] = Value(value, low, high, q.unit)
    return Finding(effect.id, (), values, forces(effect), entry.share)


def _slight(candidate: Candidate, result: Score) -> Finding:
    values = {}
    for p, a, d in zip(candidate.all_probes, result.amplitudes, result.deviations, strict=True):
        if np.isfinite(d):
            ends = sorted((p.value(a - WIDTH * d), p.value(a + WIDTH * d)))
            values[p.quantity.name] = Value(p.value(a), ends[0], ends[1], p.quantity.unit)
    return Finding(candidate.effect.id, (), values, forces(candidate.effect), result.share)


def _doubts(search: Search, rest: Remainder, residuals: Sequence[Floats]) -> tuple[str, ...]:
    """What is wrong with the fit itself, and what it leaves open; residuals: of the whole runs to fit."""
    found = []
    for entry in search.accepted:
        instead = [name for name in entry.rivals if _of_record(search, name)]
        if instead and not entry.of_record:
            found.append(f"{entry.id} may also be the record's: {', '.join(instead)} fits as well in its place")
    found += [
        f"another term fits better in the place of {name}, and there was no time to take it in"
        for name in sorted(search.refuted)
    ]
    found += _scaled(search)
    if not is_driven(search.dataset.fit):
        found += [
            f"{entry.id}: its values are those of states at rest at the start of each decay, since no free decay tells "
            "how they began; a run under a known force tells both"
            for entry in search.accepted
            if isinstance(entry.candidate.effect, Effect) and entry.candidate.effect.starts
        ]
    hold = search.dataset.hold
    if hold != search.given.dataset.hold:
        found.append(
            f'the force ran on between samples, as the motion shows: taken with hold = "{hold}"; '
            'state that in dataset.toml, or hold = "zero" where it was held'
        )
    if rest.share > search.criteria.left:
        found += [str(finding) for finding in modes(*search.given.modes)]
    if rest.significant:
        known = list(mode_frequencies(search.at.parameters, search.dataset.axes))
        said = unlike_runs(search.dataset.fit, residuals), left_modes(search.dataset.fit, residuals, known)
        found += [text for text in said if text]
    if rest.above or rest.significant:
        found.append(
            f"{rest.share:.2g} of the refit's residual power is left: {rest.ratio:.3g} times the noise on held-out runs"
        )
    if not search.questioned:
        found += [f"{a.id} of the record was not held against data that no fit saw" for a in search.accepted
                  if a.of_record]  # fmt: skip
    if search.undone:
        limit, not_done = search.criteria.time_limit, "; ".join(dict.fromkeys(search.undone))
        found.append(f"stopped within the {limit:g} s of time_limit, not done: {not_done}; --criteria FILE allows more")
    if search.failed:
        failed = "; ".join(dict.fromkeys(search.failed))
        found.append(f"given up, since its numbers ran out of all bounds: {failed}")
    more = [(c.effect.id, s.share) for c, s in search.significant() if c.effect.id not in search.present]
    if search.full and (more or rest.above or rest.significant):
        others = f"; {more[0][0]} would take a further {more[0][1]:.1%} of the residual's square" if more else ""
        found.append(f"the search ended because --max-effects allows no more{others}")
    if search.fitter is not search.whole:
        number = len(search.fitter.records) // len(search.whole.records)
        found.append(f"no model stays in step with a whole run: the fit is one of pieces, {number} a run")
    if rest.piece:
        found.append("held-out runs go their own way after the least change, so that no model follows them whole: what "
                     f"is left of them was judged over pieces of {rest.piece} samples, each from a state of its own"
                     )  # fmt: skip
    if search.at.left > 10 * SETTLED:
        gain = f": a further step would gain {search.at.left:.2g} variances" if np.isfinite(search.at.left) else ""
        found.append(f"the fit stopped short of a minimum{gain}")
    for free in search.at.free:
        value = search.at.parameters[free.name]
        # At zero a part of an effect is not there, as friction of the other axis: nothing is wrong with that. Nor is it
        # with a spring that is none.
        none = value == 0.0 or (free.name in ("kxx", "kyy") and unsprung(search.whole, search.at))
        if value in (free.low, free.high) and not none:
            found.append(_at_bound(search, free, value))
    return tuple(found)


def _at_bound(search: Search, free: Free, value: float) -> str:
    """What it means that a parameter stands at a bound: of a shape that of its search."""
    if quantity_of(search.simulator.model, free.name).role != "shape":
        return f"{free.name} = {value:.6g} stands at the bound of what it can be"
    tried, more = ("least", "less") if value == free.low else ("most", "more")
    return f"{free.name} = {value:.6g} is the {tried} that was tried: it may be {more}"


def _scaled(search: Search) -> list[str]:
    """That the force may be other than recorded, where stated mass and stiffness all came out off by one factor."""
    # What the record itself gave first says nothing of its scale.
    stated = search.dataset.nominal.keys() - set(search.dataset.estimated)
    names = [name for name in ("m", "kxx", "kyy") if name in stated and name in search.at.parameters]
    if len(names) < 2:
        return []
    logs = np.log([search.dataset.nominal[name] / search.at.parameters[name] for name in names])
    mean = float(np.mean(logs))
    if abs(mean) < SCALED or float(np.abs(logs - mean).max()) > ONE_FACTOR * abs(mean):
        return []
    off = f"{', '.join(names)} all came out {np.expm1(-mean):+.2%} off nominal"
    return [f"{off}: as if the record's force_scale were {np.expm1(mean):+.2%}, which no sample tells from a sensor's "
            "gain that is off, or from nominal values that are"]  # fmt: skip


def _detectable(search: Search) -> dict[str, dict[str, float]]:
    """The size of each effect that this data would show with 95 % power at the threshold used."""
    sizes: dict[str, dict[str, float]] = {}
    for candidate, result in search.scored:
        if candidate.partner or isinstance(candidate.effect, Defect):
            continue
        reach = np.sqrt(chi2.isf(search.criteria.effect_chance / candidate.trials, max(result.freedom, 1))) + norm.ppf(
            POWER
        )
        for p, d in zip(candidate.probes, result.deviations, strict=False):
            if reach * d < TRACE:
                own = sizes.setdefault(candidate.effect.id, {})
                value = abs(p.value(reach * d) - p.quantity.start)
                own[p.quantity.name] = min(own.get(p.quantity.name, np.inf), value)
    return sizes


def _absent(search: Search) -> dict[str, dict[str, Value]]:
    """The linear estimate of every size that acts in proportion, of effects without a search over shapes: with one,
    the best of many points is no fair estimate."""
    sizes: dict[str, dict[str, Value]] = {}
    for candidate, result in best_of(search.scored, search.criteria):
        alone = candidate.partner is None and candidate.trials == 1 and not isinstance(candidate.effect, Defect)
        for p, a, d in zip(candidate.probes, result.amplitudes, result.deviations, strict=False):
            if alone and p.power == 1 and np.isfinite(d) and candidate.effect.id not in search.present:
                value, reach = p.quantity.start + p.step * a, WIDTH * abs(p.step) * d
                own = sizes.setdefault(candidate.effect.id, {})
                own[p.quantity.name] = Value(value, value - reach, value + reach, p.quantity.unit)
    return sizes


def _noises(search: Search, white: Noise | None, known: Sequence[Finding]) -> dict[str, Value]:
    """Those that the model has a name for, each with its unit, but for what is the record's."""
    names = {q.name: q.unit for e in search.simulator.model.effects if e.noise for q in e.sizes}
    found = all_noises(search.at, search.fitter.records, white)
    own = {noise for d in disturbances() if d.id in {k.id for k in known} for noise in d.instead}
    return {n: Value(x.value, x.low, x.high, names[n]) for n, x in found.items() if n in names and n not in own}
