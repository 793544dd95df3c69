"""What a finished search may claim: what is left beside noise, which names are in doubt, how probable each is."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import inf, isfinite, isnan
from typing import Any, Final, NamedTuple

import numpy as np

from discrepancy.criteria import Criteria
from discrepancy.data.repeats import repeated_noise
from discrepancy.fit.chaos import go_their_own_way
from discrepancy.fit.colour import gain
from discrepancy.fit.continuation import finest, unsprung
from discrepancy.fit.locate import noise_level
from discrepancy.fit.measures import misfit_by_pieces, misfits, start_fitted, start_known
from discrepancy.fit.noise import unlike_flicker
from discrepancy.fit.whitening import coloured_power
from discrepancy.name.accepted import Accepted
from discrepancy.name.more_modes import resonator_axis
from discrepancy.name.search import Search, asked
from discrepancy.tell.answer import Finding, Stage, Value

ROUNDS: Final = 8
"""Steps of a fit without an effect: enough to see whether held-out runs are better without it."""
FAR_OFF: Final = 100.0
"""Times the square that the fit leaves: a fit without an effect that can't come below it is not finished, since what is
ten times as far off on the runs to fit is no better on others."""

SLIGHT: Final = 0.25
"""Share of the way from the noise to where a gap is significant, that a stopped search may leave: a null under thermal
motion, whose level a run shows to some per cent, was left 1.05 times its noise, a tenth
of the way."""

FAR_FROM_THERMAL: Final = 1000.0
"""Times the thermal force beyond which by how much is not told."""

LOUDER: Final = 3.0
"""Times the noise of the runs to fit, in proportion to the motion where that is larger, that is still believed to be
noise of held-out runs. Chosen, not measured: one clipped run showed 36 times."""


class Remainder(NamedTuple):
    """What the final model leaves of the held-out runs: share of the refit's residual power, noise taken off; ratio of
    the final misfit to that of the noise; above: whether that is more than noise; significant: whether it is also
    enough to say that something is left, or more than a stopped search may leave and still stand by its names; piece:
    samples of the pieces over which that was judged, 0 where it was over whole runs."""

    share: float
    ratio: float
    above: bool
    significant: bool
    piece: int = 0


def sane(noises: Mapping[str, Value], search: Search) -> tuple[dict[str, Value], dict[str, str]]:
    """The noises that can be such, and of the others, by name, what they are not."""
    limits, absurd = search.criteria, {}
    thermal, clock = noises.get("thermal_force"), noises.get("sampling_jitter")
    rate = search.dataset.fit[0].sample_rate
    if thermal and thermal.low > limits.thermal:
        # Of a mass of grams and more any misfit is millions of times it: the number would say nothing.
        times = f"{thermal.value:.2g}" if thermal.value < FAR_FROM_THERMAL else f"over {FAR_FROM_THERMAL:.0f}"
        absurd["thermal_force"] = (
            f"the residual is no thermal noise, but {times} times as strong a force on the mass: one that is not in "
            "the record, or motion that the model lacks"
        )
    if clock and clock.low * rate > limits.jitter:
        absurd["sampling_jitter"] = (
            f"the residual is no jitter of a clock: {clock.value:.2g} s are {clock.value * rate:.2g} sample periods"
        )
    wrong = search.at.whiten.setting.corner and unlike_flicker(
        search.at, search.fitter.records, limits.noise_chance, limits.coloured
    )
    if wrong:
        absurd["flicker_noise"] = (
            f"the residual is no flicker noise: about {wrong[0]:.2g} Hz it has {wrong[1]:.2g} times the density of the "
            "flicker that comes nearest; look for hum, a drift, a temperature or a supply that wanders"
        )
    return {name: value for name, value in noises.items() if name not in absurd}, absurd


def _memory(search: Search, without: Mapping[str, Any]) -> float:
    """Power of flicker and motion over that of the noise beside, those set to 0 ``without`` left out."""
    at, run = search.at, search.dataset.held_out[0]
    setting = replace(at.whiten.setting, **without)
    return coloured_power(at.parameters, run.axes, 1 / run.sample_rate, setting, len(run.t))


def remainder(
    search: Search, stages: tuple[Stage, ...], gaps: Mapping[str, Any], absurd: Mapping[str, str]
) -> Remainder:
    """What the final model leaves. Noise is what is white, and what has a memory where it can be noise at all."""
    runs, last, limits = search.dataset.held_out, stages[-1], search.criteria
    rms = float(np.sqrt(np.mean(np.concatenate([run.v[run.valid].ravel() for run in runs]) ** 2)))
    floor = gaps["noise_floor"]
    if floor is None:
        setting = search.at.whiten.setting
        floor = noise_level([last.residuals[run.name] for run in runs], runs, last.parameters, setting) / rms
        floor *= gain(setting.colour) ** 0.5 if setting.colour else 1.0
    floor = min(floor, _at_most(search) / min(rms, search.fitter.signal))
    parts = {"bandwidth": "thermal_force", "corner": "flicker_noise"}
    without = {part: 0.0 for part, name in parts.items() if name in absurd}
    memory = _memory(search, without)
    if repeated_noise(search.dataset.records) is not None:
        # What repetitions leave has the noises with a memory in it.
        floor /= (1 + memory) ** 0.5
    noise, final, refit = floor * (1 + memory) ** 0.5, gaps["final"], gaps["refit"]
    if not np.isfinite(final):
        return Remainder(1.0, float("inf"), True, True)
    limit = limits.open_coloured if memory > 0 else limits.open_white
    piece = 0
    if final > limit * noise:
        final = min(final, _with_starts_known(search, last.parameters))
    if final > limit * noise and go_their_own_way(search.simulator, runs, last.parameters):
        piece = len(search.whole.records[0].t) // finest(search.whole, search.at)
        final = min(final, misfit_by_pieces(search.simulator, runs, piece, last.parameters))
    share = float(np.clip((final**2 - noise**2) / max(refit**2, 1e-300), 0.0, 1.0))
    ratio = final / max(noise, 1e-300)
    enough = share > limits.left or ratio > limits.far_above
    # What has the memory of a noise, and can be none, is there however little it stands out of the white noise.
    beyond = ratio > limit or bool(without)
    stopped = bool(search.undone or search.failed) and share > limits.left and ratio > 1 + SLIGHT * (limit - 1)
    # Beside runs that no model follows, others may be explained whole, and those of chaos piece by piece.
    significant = (beyond and enough) or stopped or (search.fitter is not search.whole and ratio > limit)
    return Remainder(share, float(ratio), ratio > limit, bool(significant), piece)


def _at_most(search: Search) -> float:
    """The most that noise [V rms] may be of runs as loud as those to fit: a model that lacks something which shows in
    louder ones alone leaves that over all frequencies, where it looks like noise."""
    at, fitter = search.at, search.fitter
    setting = at.whiten.setting
    level = noise_level(at.residuals, fitter.records, at.parameters, setting)
    level *= gain(setting.colour) ** 0.5 if setting.colour else 1.0
    return LOUDER * max(level, repeated_noise(search.dataset.records) or 0.0)


def _with_starts_known(search: Search, parameters: Mapping[str, float]) -> float:
    """The misfit on held-out runs whose initial states are fitted to all of them."""
    runs = search.dataset.held_out
    return misfits(runs, {run.name: start_known(search.simulator, run, parameters) for run in runs})[""]


def worse_without(search: Search, effects: Sequence[Finding], stages: tuple[Stage, ...], gaps: Mapping[str, Any]
                  ) -> tuple[Search, dict[str, str]]:  # fmt: skip
    """The search, with what there was no time for, and of the ``effects`` named those that make held-out runs worse,
    and by how much; each is refitted without. Where none does by itself and held-out runs are worse than with no
    effect, all of them do."""
    limit, worse, named = search.criteria.worse, {}, {finding.id for finding in effects}
    final = gaps["final"]
    steps = {b.name: b.misfit[""] > limit * a.misfit[""] for a, b in pairwise(stages)}
    for entry in search.accepted:
        if entry.id not in named or not (steps.get(entry.id) or final > limit * gaps["refit"]):
            continue
        search.progress(f"held-out runs without {entry.id}")
        compare = partial(_beside_without, entry=entry, final=final, parameters=stages[-1].parameters)
        search, beside = asked(search, f"held-out runs without {entry.id}", compare)
        if beside is not None:
            worse[entry.id] = f"{entry.id} makes the held-out runs worse: {_compared(beside, final)}"
    together: bool | None = bool(effects) and not worse and not final <= limit * gaps["refit"]
    if together:
        also = partial(_also_known, without=stages[1].parameters, final=stages[-1].parameters)
        search, together = asked(search, "held-out runs without any effect", also)
    if together:
        names = ", ".join(finding.id for finding in effects)
        said = f"the held-out runs are worse with {names} than without: {_compared(gaps['refit'], final)}"
        worse = {finding.id: said for finding in effects}
    return search, worse


def _compared(without: float, final: float) -> str:
    return f"misfit {without:.4g} without, {final:.4g} with, {final / without - 1:+.2g} of it"


def _beside_without(search: Search, entry: Accepted, final: float, parameters: Mapping[str, float]) -> float | None:
    """The held-out misfit without an effect, None where that is no better than ``final``, that of ``parameters``.
    Raises OutOfTime."""
    without = _without(search, entry)
    beside = _with_starts_found(search, without)
    worse = not final <= search.criteria.worse * beside and _also_known(search, without, parameters)
    return beside if worse else None


def _without(search: Search, entry: Accepted) -> Mapping[str, float]:
    """The parameters of the model refitted without an effect. Raises OutOfTime."""
    hopeless = FAR_OFF * search.at.cost
    return search.fitter.fit(search.without_effect(search.at, entry), ROUNDS, hopeless).parameters


def _with_starts_found(search: Search, parameters: Mapping[str, float]) -> float:
    """The misfit on held-out runs whose first samples give their initial states."""
    runs = search.dataset.held_out
    return misfits(runs, {run.name: start_fitted(search.simulator, run, parameters) for run in runs})[""]


def _also_known(search: Search, without: Mapping[str, float], final: Mapping[str, float]) -> bool:
    """Whether held-out runs are worse with the ``final`` parameters also where all of a run gives its initial state: of
    a mass that no spring holds the first samples tell the speed badly, which adds up beside any model."""
    if not unsprung(search.whole, search.at):
        return True
    limit = search.criteria.worse
    return not _with_starts_known(search, final) <= limit * _with_starts_known(search, without)


def shown(search: Search) -> set[str]:
    """Ids of resonators in the model, where the runs to fit show a mode for each beside one an axis."""
    found = {a.id for a in search.accepted if resonator_axis(a.candidate.effect) is not None}
    modes = sum(map(len, search.given.modes))
    return found if len(found) <= modes - search.whole.axes else set()


def probability(
    search: Search, finding: Finding, rest: Remainder, stages: tuple[Stage, ...], against: bool = False,
    *, shown: bool = False,
) -> float:  # fmt: skip
    """Of a name against its rivals, each weighed by the likelihood of its refit, and against none of them.

    Where the rivals were not tried, one as good as the name is reckoned with. What is left when all is named may be
    what the name only imitates, and one that unseen data or a better term speak ``against`` is likely wrong: both take
    from it, and so does a fit that is far from its minimum yet. Neither is so of a resonator whose mode is ``shown`` by
    the response itself, where nothing speaks against it, it has taken something away, and little is left.
    """
    shown = shown and not against and _brought(finding.id, rest, stages) >= search.criteria.believed
    shown = shown and rest.share <= search.criteria.half_left
    entry = next((a for a in search.accepted if a.id == finding.id), None)
    weights = list(_weights(entry).values()) if entry else []
    if entry and not (entry.asked or shown or entry.id in search.partners):
        weights.append(1.0)
    found = (1 - search.criteria.prior_none) / (1 + sum(weights))
    if rest.significant and not shown:
        found *= 1 - max(rest.share, 0.5)
    if rest.above and not rest.significant and search.criteria.unsettled < search.at.left < inf:
        found *= 0.5
    if (rest.above or rest.significant) and not shown:
        found *= _brought(finding.id, rest, stages)
    return 0.2 * found if against else found


def _weights(entry: Accepted) -> dict[str, float]:
    """Of each rival that was refitted, by id, how probable it is over the name."""
    # One whose refit has left all bounds is none.
    behind = {name: chi_square for name, chi_square in entry.behind.items() if not isnan(chi_square)}
    return {name: float(np.exp(-0.5 * max(chi_square, 0.0))) for name, chi_square in behind.items()}


def improbable(search: Search, effects: Sequence[Finding]) -> list[str]:
    """Of the names, with the probabilities that they have, those that are hardly what is missing, even together with
    those that the data can't tell from them: a line for each."""
    found = []
    for finding in effects:
        entry = next((a for a in search.accepted if a.id == finding.id), None)
        weights = _weights(entry) if entry else {}
        either = finding.probability * (1 + sum(weights.get(name, 0.0) for name in finding.either))
        if either < search.criteria.improbable:
            others = "".join(f" or {name}" for name in finding.either)
            said = "is hardly what is missing" if entry is None or entry.asked else "was not held against all others"
            found.append(f"{finding.id}{others} {said}: its probability is {either:.2g}")
    return found


def imitating(
    findings: Sequence[Finding], rest: Remainder, worse: Collection[str], criteria: Criteria
) -> tuple[Finding, ...]:
    """Of effects in the model those that are too improbable for a name where something is left or held-out runs get
    ``worse`` by them."""
    open_still = {f.id for f in findings if rest.above or rest.significant or f.id in worse}
    return tuple(f for f in findings if f.id in open_still and f.probability < criteria.believed)


def _brought(name: str, rest: Remainder, stages: tuple[Stage, ...]) -> float:
    """The share of what was no noise before an effect was named that the final model has taken away: one that brings
    little where much is left fits what another would fit better."""
    final = stages[-1].misfit[""]
    if not isfinite(final):
        # A model that leaves all bounds has taken nothing away.
        return 0.0
    noise = final / max(rest.ratio, 1.0)
    # One that came in the place of another has no stage of its own.
    before = next((a.misfit[""] for a, b in pairwise(stages) if b.name == name), stages[1].misfit[""])
    return float(np.clip(1 - (final**2 - noise**2) / max(before**2 - noise**2, 1e-300), 0.0, 1.0))
