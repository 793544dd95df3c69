"""Searches the library of terms for what no effect file explains, and writes what it finds as effect files."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from scipy.stats import chi2

from discrepancy.discover.contest import Entry, Terms, ranked
from discrepancy.fit.continuation import IN_STEP, settled, started
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.locate import no_noise
from discrepancy.fit.refit import Fitter
from discrepancy.terms.effect_file import Term, peaks_of
from discrepancy.terms.library import Form
from gyro_model.anatomy import Effect
from gyro_model.model import Model
from gyro_model.progress import Steps

SCREENED, GLANCED = 32_000, 12_000
"""Samples on which the library is scored, shared by the runs; and where only a term that takes much is asked for."""
AGAIN: Final = 2
"""Terms found over pieces that are compared over the whole: those without needless parts."""
ALIKE: Final = 3
"""Terms kept beside the best at most, that it can't be told from."""


@dataclass(frozen=True)
class Discovery:
    """The term that explains best what was left: an effect that the model had already (``known``), or a new one.

    share: of the residual's square that it takes away; either: ids of other terms that the samples compared can't tell
    from it; terms: the new ones, the best first, then those of ``either``; empty where it is known.
    """

    effect: Effect
    known: bool
    share: float
    either: tuple[str, ...] = ()
    terms: tuple[Term, ...] = ()

    @property
    def forces(self) -> dict[str, str]:
        """Sympy text by axis, as report.json wants it."""
        return {name: str(term) for name, term in self.effect.terms().items() if name in ("force_x", "force_y")}


def discover(
    fitter: Fitter, at: Fitted, folder: Path, progress: Steps | None = None, least: float = 0.0
) -> Discovery | None:
    """The term that explains best what is left of ``at``; None where none is significant and material, or none takes
    at least the share ``least`` of what is surely no noise.

    New ones are written to ``folder``, which holds nothing but effect files, as ``discovered_1`` or the first numbers
    that the model does not have. Raises InputError where the FMU can't be built or the folder not written.
    """
    tell = progress or (lambda _: None)
    tell("search for a term that is in no file")
    with Terms(fitter, at) as terms:
        short, before = terms.excerpt(fitter, at, GLANCED if least else SCREENED)
        before, entries = _contest(terms, short, before)
    if not entries:
        return None
    best = entries[0]
    coefficients, variance = len(best.contestant.candidate.probes), best.fitted.variance
    if not before.cost - best.fitted.cost > chi2.isf(fitter.criteria.term_chance, coefficients) * variance:
        return None
    if before.cost - best.fitted.cost < least * no_noise(before, short.records):
        return None
    share = 1 - best.fitted.cost / before.cost
    tell(f"found {best.contestant.form.text}")
    # By price: a term that holds the best one as a special case fits it always, and is no other.
    alike = [e for e in entries[1:] if e.price(variance) < best.price(variance) + fitter.criteria.even][:ALIKE]
    had = tuple(e.contestant.id for e in alike if e.contestant.known)
    if best.contestant.known:
        return Discovery(fitter.simulator.model.effect(best.contestant.id), True, share, had)
    peaks = peaks_of(short.records, best.fitted)
    new = [best, *(e for e in alike if not e.contestant.known)]
    found = tuple(Term(form, peaks) for form in _named(fitter.simulator.model, new))
    for term in found:
        term.write(folder)
    return Discovery(found[0].effect, False, share, (*had, *(term.id for term in found[1:])), found)


def _contest(terms: Terms, fitter: Fitter, at: Fitted) -> tuple[Fitted, list[Entry]]:
    """The fit before, and the best terms beside it, lowest price first.

    Where the simulation is out of step with the motion, a test linear in what is missing misleads: there the terms
    compete over pieces that stay in step, and the best of them again over the whole.
    """
    if fitter.off(at) < IN_STEP:
        return at, terms.contest(fitter, at)
    pieces, close = settled(fitter, at, IN_STEP)
    entries = terms.contest(pieces, close)
    if pieces is fitter:
        return close, entries
    whole = [fitter.evaluated(replace(started(fitter, e.fitted), whiten=at.whiten)) for e in entries[:AGAIN]]
    return at, ranked([replace(e, fitted=fitter.fit(w)) for e, w in zip(entries, whole, strict=False)])


def _named(model: Model, entries: Sequence[Entry]) -> list[Form]:
    """The forms of ``entries``, without the parts that they do without, each with an id that is free."""
    taken = {effect.id for effect in model.effects}
    free = (name for name in (f"discovered_{n}" for n in itertools.count(1)) if name not in taken)
    named = []
    for entry, name in zip(entries, free, strict=False):
        candidate = entry.contestant.candidate
        kept = {p.quantity.name for p in candidate.probes}
        parts = [i for i, q in enumerate(candidate.effect.sizes) if q.name in kept]
        named.append(replace(entry.contestant.form.only(parts), id=name))
    return named
