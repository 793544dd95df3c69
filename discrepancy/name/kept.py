"""What a search hands out, so that an interrupted one goes on from there, and how it does."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any

from discrepancy.data.dataset import Dataset
from discrepancy.fit.defect import Blemish, Found, Level, effect_of
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import checkpoint as store
from discrepancy.name.accepted import Accepted
from discrepancy.name.search import Given, Search, begun, cleaned, clipped
from discrepancy.terms.effect_file import Term
from gyro_model.errors import InputError
from gyro_model.model import Model


def saved(search: Search) -> Search:
    """Hands the state out, and goes on from what a resumed search would have."""
    if search.given.keep is None:
        return search
    clock = search.simulator.clock
    until, clock.until = clock.until, inf
    state = _state(search)
    search.given.keep(state)
    search = _restored(search, state)
    clock.until = until
    return search


def resumed(given: Given, simulator: Simulator, terms: Sequence[tuple[Term, ...]], state: Mapping[str, Any]) -> Search:
    """The search that has handed out ``state``, whose entries are checked. Raises InputError where its fit is not one
    of these runs."""
    dataset, blemishes = _record(given.dataset, simulator.model, state)
    whole = Fitter(simulator, dataset.fit, criteria=given.criteria)
    store.columns_into(simulator.seen, state["columns"])
    search = Search.of(given, dataset, whole, store.fit_from(whole, state["at"])[1])
    return _restored(replace(search, terms=tuple(terms), blemishes=blemishes, clip=state["clip"]), state)


def _state(search: Search) -> dict[str, Any]:
    """As plain Python."""
    found = search.blemishes
    return {
        "terms": store.terms_state(search.terms),
        "refused": sorted(search.refused),
        "clip": search.clip,
        "hold": search.dataset.hold,
        "without_first": int(search.without_first),
        "begun": int(any(record.begun for record in search.dataset.records)),
        "blemishes": [[b.id, list(map(list, f.data)), {k: list(v) for k, v in f.levels.items()}] for b, f in found],
        "at": store.fit_state(search.whole, search.fitter, search.at),
        "refitted": search.refitted_state or store.fit_state(search.whole, search.fitter, search.refitted),
        "accepted": [[store.candidate_state(a.candidate), a.share] for a in search.accepted],
        "dropped": [store.dropped_state(own) for own in search.dropped],
        "steps": [store.step_state(step) for step in search.steps],
        "stages": [[name, dict(parameters)] for name, parameters in search.stages],
        "shortest": search.shortest,
        "opening": search.number,
        "offered": int(search.offered),
        "probes": store.probes_state(search.probes),
        "columns": store.columns_state(search.simulator.seen),
    }


def _restored(search: Search, state: Mapping[str, Any]) -> Search:
    """A search of the same runs with what ``state`` says of it."""
    model, whole = search.simulator.model, search.whole
    store.columns_into(search.simulator.seen, state["columns"])
    fitter, at = store.fit_from(whole, state["at"])
    return replace(
        search,
        fitter=fitter,
        at=at,
        refused=frozenset(state["refused"]),
        refitted=store.fit_from(whole, state["refitted"])[1],
        refitted_state=state["refitted"],
        accepted=tuple(Accepted(store.candidate_from(model, c), share, {}) for c, share in state["accepted"]),
        dropped=tuple(store.dropped_from(model, own) for own in state["dropped"]),
        steps=tuple(store.step_from(step) for step in state["steps"]),
        stages=tuple((name, dict(parameters)) for name, parameters in state["stages"]),
        shortest=state["shortest"],
        offered=bool(state["offered"]),
        without_first=bool(state["without_first"]),
        probes=store.probes_from(model, state["probes"]),
    ).opened(state["opening"])


def _record(
    dataset: Dataset, model: Model, state: Mapping[str, Any]
) -> tuple[Dataset, tuple[tuple[Blemish, Found], ...]]:
    """The runs without what ``state`` has found to be the record's, and that."""
    if state["hold"] != dataset.hold:
        dataset = dataset.held(state["hold"])
    if state["without_first"]:
        dataset = dataset.since_start()
    if state["begun"]:
        dataset = begun(dataset)
    if state["clip"] is not None:
        dataset = clipped(dataset, state["clip"])
    blemishes = []
    for name, data, levels in state["blemishes"]:
        blemish = effect_of(model, name)
        if not isinstance(blemish, Blemish) or len(data) != len(dataset.fit):
            raise InputError(f"blemish {name}: give numbers for each of {len(dataset.fit)} runs")
        found = Found(tuple(map(tuple, data)), {k: Level(*v) for k, v in levels.items()})
        dataset = cleaned(dataset, blemish, found.data)
        blemishes.append((blemish, found))
    return dataset, tuple(blemishes)
