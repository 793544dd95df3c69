"""Searches the library of terms for what no effect file explains, and tells whether one does better than a name.

The library is a model: its terms are effects beside those of the device, in one FMU that is built once. So a term is
scored by what the FMU shows, as an effect is (``columns.py``, ``score.py``), exactly through the whole chain, and
refitted by the same fitter. The simplest term that fits wins: each coefficient has to earn what the Bayesian
information criterion asks (G. Schwarz, Annals of Statistics 6, 1978), and a higher degree a little more.
"""

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
from scipy.stats import chi2

from discrepancy.columns import Candidate, Probe
from discrepancy.continuation import started
from discrepancy.effect_file import peaks_of, scales_of, write_effect
from discrepancy.library import Form, forms, known, magnitude
from discrepancy.noise import noise_of
from discrepancy.record import Floats, Record
from discrepancy.refit import BLOCKS, Fitted, Fitter
from discrepancy.score import Score, score, without
from discrepancy.simulate import Simulator
from gyro_model.anatomy import Effect, Follow, Force
from gyro_model.model import Model

CHANCE: Final = 1e-8
"""Probability of one test by chance at which a term counts as significant: with some 300 tests a search, 400 null sets
make 0.001 false alarms."""
MATERIAL: Final = 3e-4
"""Share of the residual's square that a term has to take away."""
SHORTLIST, SHORT_SHARE = 6, 0.6
"""Terms refitted: at most so many, whose linear share is at least this of the best."""
DEGREE_PRICE: Final = 3.0
"""Chi-square that a term has to gain for each degree and magnitude in it: between two that fit evenly the plainer one
is named. An effect that has a file pays nothing: it is known to exist."""
EVEN: Final = 9.0
"""Chi-square by which one term has to fit better than another, or than a name, to be told from it: three standard
deviations."""
PROBE: Final = 1e-7
"""Force of a probe over the spring's: at Q = 1e5 it changes the motion by a hundredth, and always by 1e7 roundings."""
SCREENED, CHECKED = 32_000, 16_000
"""Samples on which the library is scored, shared by the runs: to find a term, and to check a name."""
NEARLY, CLOSEST = 0.05, 3
"""A name is checked against at most so many terms, which to first order take all but this share of what it takes."""
ASTRAY: Final = 0.02
"""Residual over signal from which the search goes over pieces of the runs."""
PIECES: Final = 8
"""Of each run in that case."""
CLOSE: Final = 2.0
"""Residual over the white noise up to which a fit counts as one to the noise: thermal force alone lies above it."""
BATCH: Final = 80
"""Columns held at a time."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Contestant:
    """A term with its probes and their amplitudes; ``known``: it is an effect of the model."""

    form: Form
    candidate: Candidate
    known: bool
    amplitudes: tuple[float, ...]
    score: Score = field(repr=False)

    @property
    def id(self) -> str:
        """Of the effect that it is."""
        return self.candidate.effect.id


@dataclass(frozen=True)
class Entry:
    """A contestant, refitted."""

    contestant: Contestant
    fitted: Fitted

    def price(self, variance: float) -> float:
        """What its misfit and its complexity come to, as a chi-square."""
        coefficients = len(self.contestant.candidate.probes)
        return (
            self.fitted.cost / variance
            + coefficients * float(np.log(self.fitted.count))
            + DEGREE_PRICE * (0 if self.contestant.known else self.contestant.form.complexity)
        )


@dataclass(frozen=True)
class Discovery:
    """The term that explains what was left. model: with the term as an effect; fitted: refit of all with it there;
    ``known``: the model had the effect already and no file was written; share of the residual's square that it takes
    away; deviations [SI] of its parameters; fits: whether little more than the sensor's white noise is left, None where
    the runs have no band that shows that noise alone; even: other terms that these runs can't tell from it."""

    effect: Effect
    model: Model
    fitted: Fitted
    known: bool
    share: float
    deviations: Mapping[str, float]
    fits: bool | None
    path: Path | None
    even: tuple[str, ...] = ()

    @property
    def forces(self) -> dict[str, str]:
        """Sympy text by axis, as report.json wants it."""
        return {name: str(term) for name, term in self.effect.terms().items() if name in ("force_x", "force_y")}


@dataclass
class Scan:
    """What terms take from the sum of squares [variances of an innovation] where effects are left out, and what those
    effects take themselves."""

    gain: float
    contestants: list[Contestant]


@dataclass(frozen=True)
class Rivals:
    """What speaks against names. instead: by the ids of the effects left out, the term that fits significantly better
    in their place; beside: terms that explain something significant and material besides."""

    instead: Mapping[tuple[str, ...], str]
    beside: Mapping[str, float]

    @property
    def refuted(self) -> bool:
        """Whether some name is wrong."""
        return bool(self.instead)

    @property
    def names(self) -> list[str]:
        """The wrong ones: each alone, or, where each stands alone, all together."""
        alone = [name for group in self.instead if len(group) == 1 for name in group]
        return alone or [name for group in self.instead for name in group]


class Library:
    """The model of a fitter with all terms of the library in it, as a context manager."""

    def __init__(self, fitter: Fitter, at: Fitted) -> None:
        """Builds the FMU where that has not been done. ``at``: a fit, which says how large the motion is."""
        model = fitter.simulator.model
        self.forms = forms(fitter.axes)
        self.known = known(model, self.forms)
        self.effects = {form.id: form.effect() for form in self.forms if form.id not in self.known}
        self.simulator = Simulator(joined(model, self.effects.values()))
        self.scales = scales_of(fitter, at)
        self.spring = at.parameters["kxx"] * self.scales["x"]

    def __enter__(self) -> "Library":
        return self

    def __exit__(self, *_: object) -> None:
        self.simulator.__exit__(None, None, None)

    def excerpt(self, fitter: Fitter, at: Fitted, samples: int) -> tuple[Fitter, Fitted]:
        """``at`` on a piece of each run, where it moves most, all together so many samples: what is missing shows
        most there. It is the first piece where an effect remembers what went before."""
        number = max(1, sum(len(r.t) for r in fitter.records) // samples)
        pieces = [self.simulator.cut(r, number)[: 1 if _remembers(fitter.simulator.model, at) else None]
                  for r in fitter.records]  # fmt: skip
        cut = [max(own, key=lambda p: float(np.mean(p.v**4))) for own in pieces]
        own = self.fitter(cut, fitter.blocks)
        return own, started(own, at)

    def fitter(self, records: Sequence[Record], blocks: int) -> Fitter:
        """One for ``records`` with the library's FMU."""
        return Fitter(self.simulator, records, blocks)

    def candidates(self, at: Fitted) -> list[tuple[Form, Candidate]]:
        """Every term that is not fitted in ``at`` already, with both of its parts where both can be seen."""
        fitted = {free.name for free in at.free}
        found = []
        for form in self.forms:
            effect, names = self.known.get(form.id) or (self.effects[form.id], ())
            named = names or tuple(q.name for q in self.effects[form.id].sizes)
            if fitted & set(named):
                continue
            sizes: dict[str, Probe] = {}
            for name, part in zip(named, form.parts, strict=True):
                force = magnitude(part, self.scales)
                if name and force > 0:
                    quantity = next(q for q in effect.sizes if q.name == name)
                    sizes.setdefault(name, Probe(quantity, PROBE * self.spring / force, 1))
            if sizes:
                found.append((form, Candidate(effect, tuple(sizes.values()), {})))
        return found

    def scored(self, fitter: Fitter, at: Fitted) -> list[Contestant]:
        """Every term, largest share first."""
        return self.scans(fitter, at, ())[0].contestants

    def scans(self, fitter: Fitter, at: Fitted, groups: Sequence[Sequence[str]]) -> list["Scan"]:
        """Every term beside the fit ``at``, and in the place of each of ``groups`` (ids of effects fitted in it), to
        first order."""
        own = [[q for name in group for q in self.simulator.model.effect(name).parameters] for group in groups]
        removals = [{q.name: q.start for q in sizes if q.role == "size"} for sizes in own]
        names = [set[str](), *({q.name for q in sizes} for sizes in own)]
        scans = [Scan(math.inf, []) for _ in names]
        left, n = self.candidates(at), len(at.free)
        while left:
            count = int(np.searchsorted(np.cumsum([len(c.probes) for _, c in left]), BATCH, side="right"))
            batch, left = left[:count], left[count:]
            linear = fitter.with_grams(at, [*removals, *(changes for _, c in batch for changes in c.changes())])
            assert linear.grams is not None
            for k, (scan, freed) in enumerate(zip(scans, names, strict=True)):
                grams = without(linear.grams, n + k - 1) if k else linear.grams
                beside = [i for i, f in enumerate(at.free) if f.name not in freed]
                if k:
                    scan.gain = score(grams, beside, [i for i in range(n) if i not in beside], at.count).gain
                scan.contestants += self._contestants(batch, grams, beside, n + len(removals), at.count)
        for scan in scans:
            scan.contestants.sort(key=lambda c: -c.score.share)
        return scans

    def _contestants(
        self, batch: Sequence[tuple[Form, Candidate]], grams: Floats, beside: Sequence[int], place: int, count: int
    ) -> list[Contestant]:
        found = []
        for form, candidate in batch:
            columns = range(place, place + len(candidate.probes))
            place += len(columns)
            result = score(grams, beside, columns, count)
            if result.amplitudes:
                found.append(Contestant(form, candidate, form.id in self.known, result.amplitudes, result))
        return found

    def pruned(self, fitter: Fitter, at: Fitted, entry: Entry) -> Entry:
        """The term without those of its parts that do not earn their coefficient; ``at``: the fit before it."""
        while len(entry.contestant.candidate.probes) > 1 and np.isfinite(entry.fitted.cost):
            candidate, parameters = entry.contestant.candidate, entry.fitted.parameters
            deviation = fitter.deviations(entry.fitted)
            surety = {p: abs(parameters[p.quantity.name]) / deviation[p.quantity.name] for p in candidate.probes}
            kept = tuple(p for p in candidate.probes if p != min(surety, key=lambda p: surety[p]))
            sizes = tuple(parameters[p.quantity.name] / p.step for p in kept)
            fewer = replace(entry.contestant, candidate=replace(candidate, probes=kept), amplitudes=sizes)
            less = self.refitted(fitter, at, fewer)
            variance = entry.fitted.variance
            if less.price(variance) >= entry.price(variance):
                break
            entry = less
        return entry

    def refitted(self, fitter: Fitter, at: Fitted, contestant: Contestant) -> Entry:
        """``at`` with the term in it."""
        candidate = contestant.candidate
        sizes = zip(candidate.probes, contestant.amplitudes, strict=True)
        values = {p.quantity.name: p.value(a) for p, a in sizes}
        free = (*at.free, *candidate.free(fitter.period))
        begun = replace(at, parameters={**at.parameters, **values}, free=free)
        return Entry(contestant, fitter.fit(fitter.evaluated(begun)))

    def contest(self, fitter: Fitter, at: Fitted, least: float = 0.0, number: int = SHORTLIST) -> list[Entry]:
        """The best ``number`` terms refitted, lowest price first; ``least``: share that a term must have."""
        scored = self.scored(fitter, at)
        worth = [c for c in scored if c.score.probability < CHANCE and c.score.share >= max(MATERIAL, least)]
        short = [c for c in worth if c.score.share >= SHORT_SHARE * worth[0].score.share][:number]
        entries = _ranked([self.refitted(fitter, at, c) for c in short])
        # A part that earns nothing costs its term about a dozen: more than two terms are seldom so close.
        return _ranked([self.pruned(fitter, at, e) for e in entries[:2]]) + entries[2:]

    def contest_in_pieces(self, records: Sequence[Record], at: Fitted) -> list[Entry]:
        """``contest`` where the simulation strays from the motion: over pieces of the runs, each with a start of its
        own, and the best of them over the whole."""
        cut = [piece for record in records for piece in self.simulator.cut(record, PIECES)]
        fitter = self.fitter(cut, max(2, BLOCKS // PIECES))
        begun = fitter.evaluated(replace(at, starts=fitter.at_rest))
        entries = self.contest(fitter, fitter.whitened(fitter.fit(begun, rounds=3)))[:2]
        whole = self.fitter(records, BLOCKS)
        again = []
        for entry in entries:
            begun = whole.evaluated(replace(entry.fitted, starts=at.starts, whiten=at.whiten))
            again.append(replace(entry, fitted=whole.fit(begun)))
        return _ranked(again)


def _ranked(entries: Sequence[Entry]) -> list[Entry]:
    variance = min((e.fitted.variance for e in entries), default=0.0)
    return sorted(entries, key=lambda e: e.price(variance))


def discover(fitter: Fitter, at: Fitted, folder: Path, progress: Progress | None = None) -> Discovery | None:
    """The term that explains best what is left of ``at``; None where none is significant and material.

    A new one is written to ``folder``, which holds nothing but effect files, as ``discovered_1`` or the first number
    that the model does not have, built into the FMU and refitted there. Raises InputError where the FMU can't be built
    or the folder not written.
    """
    tell = progress or (lambda _: None)
    tell("search for a term that is in no file")
    with Library(fitter, at) as library:
        short, before = library.excerpt(fitter, at, SCREENED)
        astray = strays(short, before)
        entries = library.contest_in_pieces(short.records, before) if astray else library.contest(short, before)
    if not entries:
        return None
    best = entries[0]
    coefficients = len(best.contestant.candidate.probes)
    if not before.cost - best.fitted.cost > chi2.isf(CHANCE, coefficients) * best.fitted.variance:
        return None
    share = 1 - best.fitted.cost / before.cost
    tell(f"found {best.contestant.form.text}")
    if best.contestant.known:
        effect = best.contestant.candidate.effect
        found = _settled(fitter, fitter.evaluated(replace(best.fitted, starts=at.starts)), effect, share, None)
    else:
        peaks = peaks_of(short.records, best.fitted)
        found = _made(fitter, at, best, folder, peaks, share)
    limit = best.fitted.cost + EVEN * best.fitted.variance
    return replace(found, even=tuple(e.contestant.form.text for e in entries[1:] if e.fitted.cost < limit))


def _free_name(model: Model) -> str:
    taken = {effect.id for effect in model.effects}
    return next(name for name in (f"discovered_{n}" for n in itertools.count(1)) if name not in taken)


def _made(
    fitter: Fitter, at: Fitted, entry: Entry, folder: Path, peaks: Mapping[str, float], share: float
) -> Discovery:
    """The term as an effect file, in the FMU, refitted to all samples; its range is where it competed."""
    contestant = entry.contestant
    old = [q.name for q in contestant.candidate.effect.sizes]
    kept = {p.quantity.name for p in contestant.candidate.probes}
    form = replace(
        contestant.form.only([i for i, n in enumerate(old) if n in kept]), id=_free_name(fitter.simulator.model)
    )
    effect, path = write_effect(form, folder, peaks)
    model = joined(fitter.simulator.model, [effect])
    renamed = dict(zip((n for n in old if n in kept), (q.name for q in effect.sizes), strict=True))
    parameters = {renamed.get(n, n): v for n, v in entry.fitted.parameters.items()}
    free = tuple(replace(f, name=renamed.get(f.name, f.name)) for f in entry.fitted.free)
    with Simulator(model) as simulator:
        exact = Fitter(simulator, fitter.records, fitter.blocks)
        begun = exact.evaluated(replace(entry.fitted, parameters=parameters, free=free, starts=at.starts))
        return _settled(exact, begun, effect, share, path)


def _settled(fitter: Fitter, at: Fitted, effect: Effect, share: float, path: Path | None) -> Discovery:
    """The answer, fitted under the whitening that its residuals ask for."""
    at = fitter.fit(fitter.whitened(at))
    names = {q.name for q in effect.parameters}
    deviations = {name: value for name, value in fitter.deviations(at).items() if name in names}
    noise = noise_of(at.residuals, fitter.records, at.parameters)
    squares = [r[run.valid] ** 2 for r, run in zip(at.residuals, fitter.records, strict=True)]
    left = float(np.mean(np.concatenate(squares)))
    fits = None if noise is None else left < CLOSE**2 * noise.rms**2
    return Discovery(effect, fitter.simulator.model, at, path is None, share, deviations, fits, path)


def rivals(fitter: Fitter, at: Fitted, named: Sequence[str], progress: Progress | None = None) -> Rivals:
    """Whether terms of the library speak against the effects ``named`` (ids) that are fitted in ``at``.

    Each effect alone, and all together, are left out, the rest is refitted, and the library's terms compete for their
    place. To be called when no further effect is found: what is missing besides may look like anything.
    """
    tell = progress or (lambda _: None)
    tell("terms against names")
    instead: dict[tuple[str, ...], str] = {}
    groups = [(name,) for name in named] + ([tuple(named)] if len(named) > 1 else [])
    with Library(fitter, at) as library:
        short, begun = library.excerpt(fitter, at, CHECKED)
        full = short.fit(begun, rounds=3)
        rest, *scans = library.scans(short, full, groups)
        beside = {c.form.text: c.score.share for c in rest.contestants
                  if c.score.probability < CHANCE and c.score.share >= MATERIAL}  # fmt: skip
        for group, scan in zip(groups, scans, strict=True):
            best = _in_place(library, short, full, group, scan)
            if best is not None:
                instead[group] = best
    return Rivals(instead, beside)


def _in_place(library: Library, fitter: Fitter, full: Fitted, group: Sequence[str], scan: Scan) -> str | None:
    """The term that fits better than the effects of ``group``, refitted."""
    close = [c for c in scan.contestants if c.id not in group and c.score.gain > (1 - NEARLY) * scan.gain]
    if not close:
        return None
    own = [q for name in group for q in library.simulator.model.effect(name).parameters]
    names = {q.name for q in own}
    parameters = {**full.parameters, **{q.name: q.start for q in own if q.role == "size"}}
    free = tuple(f for f in full.free if f.name not in names)
    less = fitter.fit(fitter.evaluated(replace(full, parameters=parameters, free=free)))
    best = _ranked([library.refitted(fitter, less, c) for c in close[:CLOSEST]])[0]
    variance = best.fitted.variance
    fitted = sum(1 for f in full.free if f.name in names)
    if best.price(variance) + EVEN < full.cost / variance + fitted * float(np.log(full.count)):
        return best.contestant.form.text
    return None


def _remembers(model: Model, at: Fitted) -> bool:
    """Whether an effect that is fitted in ``at`` has states of its own, which no piece has free."""
    fitted = {free.name for free in at.free}
    stateful = (e for e in model.effects if isinstance(e, Follow) or (isinstance(e, Force) and e.states))
    return any(fitted & {q.name for q in e.parameters} for e in stateful)


def strays(fitter: Fitter, at: Fitted) -> bool:
    """Whether the residual is so large that a test linear in what is missing may mislead."""
    error = sum(float(np.sum(residual**2)) for residual in at.residuals)
    return error > ASTRAY**2 * sum(float(np.sum(record.v**2)) for record in fitter.records)


def joined(model: Model, effects: Iterable[Effect]) -> Model:
    """The model with further effects, in the order of ``load_model``."""
    return Model(tuple(sorted((*model.effects, *effects), key=lambda e: (not e.nominal, e.id))))
