"""How a search begins: the nominal model fitted, with what it needs before anything else is scored."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any, Final

from discrepancy.data.dataset import Dataset
from discrepancy.data.late import lateness
from discrepancy.data.setting_out import contradicted
from discrepancy.fit.continuation import roughly_settled, settled, unsprung
from discrepancy.fit.fitted import Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import checkpoint as store
from discrepancy.name.accepted import Accepted, Taken
from discrepancy.name.bending import bending
from discrepancy.name.carrying import carrying
from discrepancy.name.cleaning import clean, mask_clipped
from discrepancy.name.columns import nameable
from discrepancy.name.holding import let_run_on
from discrepancy.name.kept import resumed, saved
from discrepancy.name.resisting import resisting
from discrepancy.name.resonating import resonating
from discrepancy.name.score import Step
from discrepancy.name.search import Given, Search, asked, attempt, nominal_of
from discrepancy.terms.effect_file import Term
from gyro_model.anatomy import Delay
from gyro_model.model import Model

BEGIN, NAME = 0.35, 0.8
"""Shares of the time after which the nominal model is left as it is, and nothing further is named."""

FIRST: Final = "effects without which a linear fit goes astray"


def begin(given: Given, simulator: Simulator) -> Search:
    """The search with the nominal model fitted, and blemishes of the record taken out."""
    given.progress("nominal parameters and initial states")
    data = given.dataset.shown
    if data is not given.dataset:
        given.progress("the force ran on between samples")
    whole = Fitter(simulator, data.fit, criteria=given.criteria)
    nominal = nominal_of(simulator.model, data)
    late = lateness(data.fit, nominal)
    at = whole.begin(nominal, believed(simulator.model, data, nominal), late.records if late else None)
    search = Search.of(given, data, whole, at)
    search.until(BEGIN)
    search = _with_delay(search, late.delay) if late else _with_first(search)
    # Long runs are fitted once more before they are looked at as a whole.
    early, settle = bool(search.accepted), roughly_settled if search.shortest > 1 else settled
    search = search.fitted_or_kept(search.at, settle)
    search.until(NAME)
    search = attempt(search, "defects of single samples", tidy)
    search = search if early else replace(search, refitted=search.at)
    return saved(search.staged(search.accepted[-1].id if early else "refit"))


def resume(given: Given, simulator: Simulator, terms: Sequence[tuple[Term, ...]], state: Mapping[str, Any]) -> Search:
    """The search that has handed out ``state``, whose entries are checked. Raises InputError where its fit is not one
    of these runs."""
    search = resumed(given, simulator, terms, state)
    search.until(NAME)
    search.progress(f"resumed with {', '.join(a.id for a in search.accepted) or 'nominal parameters fitted'}")
    return search


def believed(model: Model, dataset: Dataset, nominal: Mapping[str, float]) -> list[Free]:
    """Sizes of effects that the nominal model has, and gains that no one knows: fitted with it."""
    sizes = [q for e in nameable(model) for q in e.sizes]
    own = [Free(q.name, 1e-6 * abs(nominal[q.name] - q.start), q.low, q.high) for q in sizes
           if nominal.get(q.name, q.start) != q.start]  # fmt: skip
    gains = [(name, nominal[name]) for name in dataset.unknown]
    signs = [(0.0, inf) if gain > 0 else (-inf, 0.0) for _, gain in gains]
    return [*own, *(Free(name, 1e-6 * abs(gain), *sign) for (name, gain), sign in zip(gains, signs, strict=True))]


def tidy(search: Search) -> Search:
    """Takes out of the record what the present model shows to be none of the device's."""
    return clean(mask_clipped(let_run_on(search)))


def _with_delay(search: Search, delay: float) -> Search:
    """With a delay [s] in the model before anything is fitted: nothing would stay in step without it."""
    whole, plain = search.whole, search.at
    search = _beside(search.staged("refit"))
    [candidate] = search.library.candidates(whole, plain, search.present, lambda e: isinstance(e, Delay))
    [probe] = candidate.probes
    own = {**plain.parameters, probe.quantity.name: min(delay, probe.quantity.high)}
    delayed = whole.evaluated(replace(plain, parameters=own, free=(*plain.free, *candidate.free(whole.period))))
    search.progress(f"accepted {candidate.effect.id}: without it no model stays in step")
    accepted = Accepted(candidate, 1 - delayed.cost / plain.cost, {})
    return replace(search, accepted=(accepted,), steps=(Step({}, candidate.effect.id),), at=delayed)


def _with_first(search: Search) -> Search:
    """With effects in the model before anything else is scored, without which the linear parameters go astray, so that
    all else would imitate what they do."""
    kinds: Sequence[Callable[[Search], Taken | None]] = (
        (resonating, resisting, carrying) if unsprung(search.whole, search.at) else (resonating, bending)
    )
    for kind in kinds:
        search, found = asked(search, FIRST, kind)
        if found and kind is resisting and _begun_elsewhere(search, found):
            # From starts that never were a fit goes another way.
            search, found = asked(search.begun(), FIRST, kind)
        if found:
            return _taken(search, found)
    return search


def _begun_elsewhere(search: Search, found: Taken) -> bool:
    return contradicted(search.dataset.fit, found.at.starts, found.at.parameters["sense_gain_x"])


def _taken(search: Search, found: Taken) -> Search:
    for own in found.taken:
        search.progress(f"accepted {own.effect.id}: without it the linear model goes astray")
    share = max(1 - found.at.cost / found.plain.cost, 0.0)
    search = _beside(replace(search, at=found.plain, refitted=found.plain).staged("refit"))
    accepted = tuple(Accepted(own, share, {}) for own in found.taken)
    return replace(search, accepted=accepted, steps=tuple(Step({}, a.id) for a in accepted), at=found.at)


def _beside(search: Search) -> Search:
    """With the refit kept beside which effects stand from the start."""
    return replace(search, refitted_state=store.fit_state(search.whole, search.whole, search.refitted))
