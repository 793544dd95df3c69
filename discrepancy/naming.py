"""Names the effects that a model lacks: score all, refit the best, accept, repeat, delete what has become needless."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.stats import chi2, norm

from discrepancy.columns import Candidate, candidates, nameable
from discrepancy.dataset import Dataset
from discrepancy.locate import Place, located
from discrepancy.measures import Noise, misfit, noise_of
from discrepancy.record import Floats
from discrepancy.refit import BLOCKS, Fitted, Fitter, pieces
from discrepancy.score import Score, score
from discrepancy.simulate import Simulator
from gyro_model.anatomy import Force
from gyro_model.model import Model

CHANCE: Final = 1e-6
"""Probability of one test by chance at which an effect counts as significant: 60 columns and 400 null sets make 0.02
false alarms."""
MATERIAL: Final = 3e-4
"""Share of the residual's square that an effect has to take away to be worth a parameter."""
RIVALS, RIVAL_SHARE = 4, 0.5
"""Refitted before one is named: at most so many effects, whose linear share is at least this of the best."""
EVEN: Final = 9.0
"""Chi-square by which a rival may fit worse and still count as not told apart: three standard deviations."""
POWER: Final = 0.95
ASTRAY: Final = 0.02
"""Residual over signal from which a simulation may be too far off for a test that is linear in what it lacks."""
PIECES: Final = 8
"""Cuts of a run in that case."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Value:
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Finding:
    """An effect that is missing; ``either``: others that fit as well. forces: sympy text by axis, empty where it is no
    force."""

    id: str
    either: tuple[str, ...]
    parameters: Mapping[str, Value]
    forces: Mapping[str, str] = field(default_factory=dict)
    share: float = 0.0


@dataclass(frozen=True)
class Step:
    """One step of the search: the best score of every effect (by id), what was accepted, and the parameters [SI] at
    which they were scored."""

    scores: Mapping[str, Score]
    accepted: str | None
    parameters: Mapping[str, float]


@dataclass(frozen=True)
class Stage:
    """The model at one stage ("nominal", "refit", then an effect's id) on the held-out runs.

    parameters: all of them; misfit by run, ``""`` for all; residuals by run, (n, axes) [V].
    """

    name: str
    parameters: Mapping[str, float]
    misfit: Mapping[str, float]
    residuals: Mapping[str, Floats] = field(repr=False)


@dataclass(frozen=True)
class Diagnosis:
    """The answer. device: every fitted parameter of the improved model with its interval; parameters: all its values.

    removed: by effect, what taking it out changes in the output of each held-out run, (n, axes) [V]; steps: how it was
    found; doubts: what the reader should know about the fit, one line each.
    """

    verdict: str
    effects: tuple[Finding, ...]
    immaterial: tuple[Finding, ...]
    noise: Mapping[str, Value]
    misfit: Mapping[str, Any]
    located: tuple[Place, ...]
    detectable: Mapping[str, Mapping[str, float]]
    device: Mapping[str, Value]
    parameters: Mapping[str, float] = field(default_factory=dict)
    steps: tuple[Step, ...] = field(repr=False, default=())
    stages: tuple[Stage, ...] = field(repr=False, default=())
    removed: Mapping[str, Mapping[str, Floats]] = field(repr=False, default_factory=dict)
    doubts: tuple[str, ...] = ()

    def report(self) -> dict[str, Any]:
        """The contents of report.json (SYSTEM.md section 9)."""
        return {
            "verdict": self.verdict,
            "effects": [_listed(f) for f in self.effects],
            "immaterial": [_listed(f) for f in self.immaterial],
            "noise": {name: asdict(value) for name, value in self.noise.items()},
            "misfit": dict(self.misfit),
            "located": [asdict(place) for place in self.located],
            "detectable": {name: dict(sizes) for name, sizes in self.detectable.items()},
        }


def _listed(finding: Finding) -> dict[str, Any]:
    values = {name: asdict(value) for name, value in finding.parameters.items()}
    return {"id": finding.id, "either": list(finding.either), "parameters": values, **finding.forces}


def diagnose(
    dataset: Dataset,
    model: Model,
    *,
    max_effects: int = 4,
    jobs: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
) -> Diagnosis:
    """Finds what ``model`` lacks to explain ``dataset``; held-out runs are simulated once, at the end.

    max_effects: at most so many are named; jobs: threads; progress: called with one line a step. Raises InputError
    where the FMU can't be built or refuses the nominal values.
    """
    with Simulator(model, jobs) as simulator:
        return _Search(simulator, dataset, progress or (lambda _: None)).run(max_effects)


class _Search:
    def __init__(self, simulator: Simulator, dataset: Dataset, progress: Progress) -> None:
        self.simulator, self.dataset, self.progress = simulator, dataset, progress
        self.fitter = Fitter(simulator, dataset.fit)
        self.accepted: list[tuple[Candidate, tuple[str, ...], float]] = []
        self.immaterial: list[Finding] = []
        self.steps: list[Step] = []

    def run(self, max_effects: int) -> Diagnosis:
        self.progress("nominal parameters and initial states")
        refitted = at = self._settled(self.fitter.begin(self.dataset.nominal))
        scored: list[tuple[Candidate, Score]] = []
        for _ in range(max_effects + 1):
            scored = self._scored(at)
            self.immaterial = [self._slight(c, s) for c, s in _best(scored) if _sure(s) and s.share < MATERIAL]
            found = self._accepted(at, scored) if len(self.accepted) < max_effects else None
            if found is None and len(self.accepted) < max_effects and _misses(at, self.fitter) > ASTRAY:
                found = self._accepted_in_pieces(at)
            if found is None:
                self.steps.append(Step({c.effect.id: s for c, s in _best(scored)}, None, at.parameters))
                break
            at = self._settled(found)
        at = self._pruned(at)
        return self._answer(refitted, at, scored)

    def _settled(self, at: Fitted) -> Fitted:
        """``at`` fitted under the whitening that its own residuals ask for."""
        for _ in range(3):
            bandwidth = at.whiten.bandwidth
            at = self.fitter.whitened(self.fitter.fit(at))
            if at.whiten.bandwidth == bandwidth:
                break
        return at

    def _scored(self, at: Fitted) -> list[tuple[Candidate, Score]]:
        found = candidates(self.fitter, at, [c.effect.id for c, _, _ in self.accepted])
        linear = self.fitter.with_grams(at, [changes for c in found for changes in c.changes()])
        assert linear.grams is not None
        known = place = len(at.free) + len(self.fitter.state_names) * len(self.fitter.records)
        scored = []
        for candidate in found:
            columns = tuple(range(place, place + len(candidate.probes)))
            place += len(columns)
            result = score(linear.grams, known, columns, at.count)
            if not _impossible(candidate, result):
                scored.append((candidate, result))
        return scored

    def _accepted(self, at: Fitted, scored: list[tuple[Candidate, Score]]) -> Fitted | None:
        """The fit with the best effect in, None where none is both significant and material."""
        worth = [(c, s) for c, s in _best(scored) if _sure(s) and s.share >= MATERIAL]
        if not worth:
            return None
        rivals = [(c, s) for c, s in worth if s.share >= RIVAL_SHARE * worth[0][1].share][:RIVALS]
        self.progress("refit with " + ", ".join(c.effect.id for c, _ in rivals))
        fits = [(self.fitter.fit(self._with(at, c, s)), c, s) for c, s in rivals]
        fits.sort(key=lambda entry: entry[0].cost)
        best, chosen, result = fits[0]
        if not at.cost - best.cost > chi2.isf(CHANCE, result.freedom) * best.variance:
            return None
        even = tuple(c.effect.id for f, c, _ in fits[1:] if f.cost - best.cost < EVEN * best.variance)
        self.steps.append(Step({c.effect.id: s for c, s in _best(scored)}, chosen.effect.id, at.parameters))
        self.accepted.append((chosen, even, 1 - best.cost / at.cost))
        self.progress(f"accepted {chosen.effect.id}")
        return best

    def _accepted_in_pieces(self, at: Fitted) -> Fitted | None:
        """As ``_accepted``, over pieces of the runs: a simulation out of step with the motion by a radian says nothing
        about what it lacks, one restarted often does."""
        whole = self.fitter
        cut = pieces(whole.records, PIECES)
        self.fitter = Fitter(self.simulator, cut, blocks=max(2, BLOCKS // PIECES))
        try:
            starts = tuple(dict.fromkeys(whole.state_names, 0.0) for _ in cut)
            begun = self.fitter.evaluated(replace(at, starts=starts, grams=None))
            settled = self.fitter.whitened(self.fitter.fit(begun, rounds=2))
            found = self._accepted(settled, self._scored(settled))
        finally:
            self.fitter = whole
        if found is None:
            return None
        self.steps[-1] = replace(self.steps[-1], parameters=at.parameters)
        return whole.whitened(whole.evaluated(replace(found, starts=at.starts, grams=None)))

    def _with(self, at: Fitted, candidate: Candidate, result: Score) -> Fitted:
        values = {p.quantity.name: p.value(a) for p, a in zip(candidate.probes, result.amplitudes, strict=True)}
        free = (*at.free, *candidate.free(self.fitter.period))
        parameters = {**at.parameters, **candidate.shapes, **values}
        return self.fitter.evaluated(replace(at, parameters=parameters, free=free, grams=None))

    def _pruned(self, at: Fitted) -> Fitted:
        """Backward deletion: without each effect that the others have made needless."""
        for entry in list(self.accepted):
            names = {q.name for q in entry[0].effect.parameters}
            if len(self.accepted) < 2:
                break
            neutral = {p.quantity.name: p.quantity.start for p in entry[0].probes}
            free = tuple(f for f in at.free if f.name not in names)
            without = self.fitter.evaluated(replace(at, parameters={**at.parameters, **neutral}, free=free))
            without = self.fitter.fit(without)
            gain = without.cost - at.cost
            if gain < chi2.isf(CHANCE, len(entry[0].probes)) * at.variance or gain < MATERIAL * without.cost:
                self.progress(f"deleted {entry[0].effect.id}")
                self.accepted.remove(entry)
                at = self._settled(without)
        return at

    def _slight(self, candidate: Candidate, result: Score) -> Finding:
        values = {}
        for p, a, d in zip(candidate.probes, result.amplitudes, result.deviations, strict=True):
            if np.isfinite(d):
                ends = sorted((p.value(a - 1.96 * d), p.value(a + 1.96 * d)))
                values[p.quantity.name] = Value(p.value(a), ends[0], ends[1], p.quantity.unit)
        return Finding(candidate.effect.id, (), values, _forces(candidate), result.share)

    def _answer(self, refitted: Fitted, at: Fitted, scored: list[tuple[Candidate, Score]]) -> Diagnosis:
        self.progress("held-out runs")
        device = self._device(at)
        effects = []
        for candidate, even, share in self.accepted:
            values = {q.name: device[q.name] for q in candidate.effect.parameters if q.name in device}
            effects.append(Finding(candidate.effect.id, even, values, _forces(candidate), share))
        noise = noise_of(at.residuals, self.fitter.records, at.parameters)
        gaps = self._misfit(refitted, at, noise)
        places = located(refitted.residuals, self.fitter.records, refitted.parameters)
        floor = gaps["noise_floor"]
        # Twice the floor: a coloured noise alone, which is no missing effect, may lie well above the floor.
        open_gap = not effects and floor is not None and gaps["final"] > 2 * floor
        verdict = "missing effects" if effects else "unexplained" if open_gap else "nothing missing"
        detectable = self._detectable(scored)
        noises = _noises(noise)
        return Diagnosis(verdict, tuple(effects), tuple(self.immaterial), noises, gaps, places, detectable, device,
                         at.parameters, tuple(self.steps))  # fmt: skip

    def _device(self, at: Fitted) -> dict[str, Value]:
        width = norm.ppf(0.975)
        result = {}
        for name, deviation in self.fitter.deviations(at).items():
            value, unit = at.parameters[name], self.simulator.model.parameter(name).unit
            result[name] = Value(value, value - width * deviation, value + width * deviation, unit)
        return result

    def _misfit(self, refitted: Fitted, at: Fitted, noise: Noise | None) -> dict[str, Any]:
        runs = self.dataset.held_out
        names = {"nominal": dict(self.dataset.nominal), "refit": refitted.parameters, "final": at.parameters}
        gaps = {key: misfit(self.simulator, runs, values) for key, values in names.items()}
        signal = {r.name: float(np.sqrt(np.mean(r.v[r.valid] ** 2))) for r in runs}
        signal[""] = float(np.sqrt(np.mean(np.concatenate([r.v[r.valid].ravel() for r in runs]) ** 2)))
        table = {run: {**{key: gaps[key][run] for key in gaps}, "noise_floor": noise.rms / rms if noise else None}
                 for run, rms in signal.items()}  # fmt: skip
        return {**table.pop(""), "runs": table}

    def _detectable(self, scored: list[tuple[Candidate, Score]]) -> dict[str, dict[str, float]]:
        sizes: dict[str, dict[str, float]] = {}
        for candidate, result in scored:
            reach = np.sqrt(chi2.isf(CHANCE, max(result.freedom, 1))) + norm.ppf(POWER)
            for p, d in zip(candidate.probes, result.deviations, strict=False):
                if np.isfinite(d):
                    own = sizes.setdefault(candidate.effect.id, {})
                    value = abs(p.value(reach * d) - p.quantity.start)
                    own[p.quantity.name] = min(own.get(p.quantity.name, np.inf), value)
        return sizes


def _misses(at: Fitted, fitter: Fitter) -> float:
    error = sum(float(np.sum(residual**2)) for residual in at.residuals)
    return float(np.sqrt(error / sum(float(np.sum(record.v**2)) for record in fitter.records)))


def _best(scored: list[tuple[Candidate, Score]]) -> list[tuple[Candidate, Score]]:
    """Of each effect the best point of its grid, largest share first."""
    best: dict[str, tuple[Candidate, Score]] = {}
    for candidate, result in scored:
        before = best.get(candidate.effect.id)
        if before is None or result.share > before[1].share:
            best[candidate.effect.id] = (candidate, result)
    return sorted(best.values(), key=lambda entry: -entry[1].share)


def _sure(result: Score) -> bool:
    return result.probability < CHANCE


def _impossible(candidate: Candidate, result: Score) -> bool:
    """Whether a size would have to lie on the side that it can't take."""
    pairs = zip(candidate.probes, result.amplitudes, strict=False)
    return any(p.one_sided and a < 0 for p, a in pairs)


def _forces(candidate: Candidate) -> dict[str, str]:
    if not isinstance(candidate.effect, Force):
        return {}
    return {f"force_{axis}": str(term) for axis, term in zip("xy", candidate.effect.force, strict=True)}


def _noises(noise: Noise | None) -> dict[str, Value]:
    if noise is None:
        return {}
    rounding = noise.lsb**2 / 12
    white = [float(np.sqrt(max(value**2 - rounding, 0.0))) for value in (noise.rms, noise.low, noise.high)]
    result = {"sense_noise": Value(white[0], white[1], white[2], "V")}
    if noise.lsb:
        result["adc_lsb"] = Value(noise.lsb, noise.lsb, noise.lsb, "V")
    return result


__all__ = ["Diagnosis", "Finding", "Value", "diagnose", "nameable"]
