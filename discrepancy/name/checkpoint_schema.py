"""What a checkpoint may hold: every entry of a received file is checked here before anything is made of it."""

import re
from collections.abc import Callable, Collection, Mapping
from math import isfinite, isnan
from typing import Any, Final, get_args

from discrepancy.data.dataset import Dataset
from discrepancy.data.record import LEVELS, MINIMUM_SAMPLES, Hold
from discrepancy.fit.colour import ORDERS
from discrepancy.fit.defect import defects, distortion_names, quantity_of
from discrepancy.fit.openings import parts
from discrepancy.name.columns import STEEP
from discrepancy.terms.effect_file import UNITS, Term
from discrepancy.terms.formula import parse
from discrepancy.terms.library import SIGNALS, forms
from gyro_model.errors import InputError
from gyro_model.model import Model

MOST: Final = 1000
"""Entries of a list that has no length of its own: steps, stages, free parameters, terms."""
MOST_TRIALS: Final = 1_000_000
"""Points of one effect's grid."""

_ID: Final = re.compile(r"discovered_[1-9][0-9]{0,3}")

Check = Callable[[Any, str], None]


def term_state(term: Term) -> dict[str, Any]:
    """A term as plain data: its id, the products on x and y of each part, and where it was seen."""
    parts = [[str(product) for product in part] for part in term.form.parts]
    return {"id": term.id, "parts": parts, "peaks": dict(term.peaks)}


def term_from(state: Any, axes: int) -> Term:
    """The term of ``term_state``. Raises InputError where it is none of the library's."""
    _Table({"id": _text, "parts": _list_of(_pair), "peaks": _mapping(UNITS, _number(0.0))})(state, "term")
    if not _ID.fullmatch(state["id"]):
        raise InputError(f"term id {state['id'][:40]!r}: terms found are called discovered_1, discovered_2 ...")
    if set(state["peaks"]) != set(UNITS):
        raise InputError(f"term {state['id']}: peaks: give {', '.join(UNITS)}")
    names = {s.name: s for s in SIGNALS}
    parts = [tuple(parse(text, names) if text != "0" else 0 for text in part) for part in state["parts"]]
    for form in forms(axes):
        own = [form.parts.index(part) for part in parts if part in form.parts]
        if own and len(own) == len(parts) and len(set(own)) == len(own):
            found = form.only(own)
            return Term(type(form)(state["id"], found.parts), dict(state["peaks"]))
    raise InputError(f"term {state['id']}: the library has no force {state['parts']!r}"[:200])


def checked(state: Mapping[str, Any], model: Model, dataset: Dataset) -> None:
    """Raises InputError, naming the entry, unless ``state`` is one that a search of ``dataset`` by ``model`` may have
    written."""
    settable = {q.name for q in model.quantities if q.role not in ("input", "output")} | distortion_names()
    effects = {e.id for e in model.effects} | {d.id for d in defects()}
    longest = max(len(r.t) for r in dataset.fit)
    parameters = _parameters(model)
    free = _Table({"name": _one_of(settable), "step": _number(0.0, above=True), "low": _bound, "high": _bound,
                   "factor": _number(1.0, infinite=True), "against": _one_of({*settable, ""})})  # fmt: skip

    def candidate(value: Any, where: str) -> None:
        _Table({"effect": _one_of(effects), "probes": _list_of(_row(_one_of(settable), _number(), power)),
                "shapes": _mapping(settable, _number()), "searched": _list_of(_one_of(settable)),
                "trials": _whole(1, MOST_TRIALS), "partner": _optional(partner)})(value, where)  # fmt: skip

    def partner(value: Any, where: str) -> None:
        if not isinstance(value, dict) or value.get("partner") is not None:
            raise InputError(f"{where}: a partner has none of its own")
        candidate(value, where)

    power = _whole(1, STEEP)
    score = _Table({"statistic": _number(), "freedom": _whole(1, MOST), "share": _number(), "inflation": _number(0.0),
                    "apart": _number(0.0), "amplitudes": _list_of(_number()),
                    "deviations": _list_of(_number(infinite=True))})  # fmt: skip
    openings = parts(dataset.fit)

    def opening(value: Any, where: str) -> None:
        _whole(1, openings[0])(value, where)
        if value not in openings:
            raise InputError(f"{where}: {value}: give one of {', '.join(map(str, openings))}")

    spread = _row(_number(), _number(0.0, infinite=True))
    setting = _Table({"bandwidth": _number(0.0), "corner": _number(0.0), "colour": _list_of(_number(), max(ORDERS))})
    fit = _Table({
        "pieces": _whole(1, max(1, longest // MINIMUM_SAMPLES)),
        "parameters": parameters,
        "starts": _list_of(_mapping(settable | set(LEVELS), _number()), longest * len(dataset.fit)),
        "free": _list_of(free),
        "setting": setting,
        "square": _number(0.0),
    })  # fmt: skip
    _Table({
        "terms": _list_of(lambda *_: None),
        "refused": _list_of(_one_of(effects)),
        "clip": _optional(_number(0.0, above=True)),
        "hold": _one_of(get_args(Hold)),
        "without_first": _whole(0, 1),
        "begun": _whole(0, 1),
        "blemishes": _list_of(_row(_one_of(effects), _list_of(_list_of(_number(), longest)), _mapping(settable | {
            q.name for d in defects() for q in d.parameters}, _row(_number(), _number(), _number())))),
        "at": fit,
        "refitted": fit,
        "accepted": _list_of(_row(candidate, _number())),
        "dropped": _list_of(_row(candidate, _mapping(settable, spread), _number())),
        "steps": _list_of(_row(_mapping(effects, score), _optional(_one_of(effects)))),
        "stages": _list_of(_row(_one_of({"nominal", "refit", *effects}), parameters)),
        "shortest": opening,
        "opening": opening,
        "offered": _whole(0, 1),
        "probes": _list_of(_row(_one_of(settable), _one_of({"", *effects}), _number(), power, _number(0.0))),
        "columns": _columns({*settable, *LEVELS, *(d.id for d in defects())}),
    })(state, "state")  # fmt: skip
    for name in ("at", "refitted"):
        expected = len(dataset.fit) * state[name]["pieces"]
        if len(state[name]["starts"]) != expected:
            raise InputError(f"state: {name}: starts: {len(state[name]['starts'])} entries, give {expected}")


def _columns(names: Collection[str]) -> Check:
    own, alike = _one_of(names), _whole(0, 1)
    kind = _list_of(_row(own, _optional(_number(infinite=True))))
    return _Table({"kinds": _list_of(_row(kind, alike), MOST_TRIALS), "bases": _list_of(_row(_list_of(own), alike))})


class _Table:
    """A table with exactly these entries, each checked by its own rule."""

    def __init__(self, entries: Mapping[str, Check]) -> None:
        self.entries = entries

    def __call__(self, value: Any, where: str) -> None:
        if not isinstance(value, dict) or set(value) != set(self.entries):
            raise InputError(f"{where}: give a table of {', '.join(self.entries)}")
        for name, check in self.entries.items():
            check(value[name], f"{where}: {name}")


def _mapping(names: Collection[str], check: Check) -> Check:
    def rule(value: Any, where: str) -> None:
        if not isinstance(value, dict):
            raise InputError(f"{where}: give a table")
        for name, entry in value.items():
            if name not in names:
                raise InputError(f"{where}: {name[:40]!r} is unknown")
            check(entry, f"{where}: {name}")

    return rule


def _parameters(model: Model) -> Check:
    def rule(value: Any, where: str) -> None:
        if not isinstance(value, dict):
            raise InputError(f"{where}: give a table")
        for name, entry in value.items():
            try:
                quantity_of(model, name).check(entry)
            except InputError as error:
                raise InputError(f"{where}: {str(error)[:200]}") from None

    return rule


def _list_of(check: Check, most: int = MOST) -> Check:
    def rule(value: Any, where: str) -> None:
        if not isinstance(value, list) or len(value) > most:
            raise InputError(f"{where}: give a list of at most {most} entries")
        for number, entry in enumerate(value):
            check(entry, f"{where} {number}")

    return rule


def _row(*checks: Check) -> Check:
    def rule(value: Any, where: str) -> None:
        if not isinstance(value, list) or len(value) != len(checks):
            raise InputError(f"{where}: give a list of {len(checks)}")
        for check, entry in zip(checks, value, strict=True):
            check(entry, where)

    return rule


def _number(low: float = -float("inf"), *, above: bool = False, infinite: bool = False) -> Check:
    def rule(value: Any, where: str) -> None:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise InputError(f"{where}: give a number")
        try:
            number = float(value)
        except OverflowError:
            number = float("nan")
        if isnan(number) or not (infinite or isfinite(number)) or number < low or (above and number == low):
            raise InputError(f"{where}: give a finite number{'' if low == -float('inf') else f' from {low:g}'}")

    return rule


def _bound(value: Any, where: str) -> None:
    _number(infinite=True)(value, where)


def _whole(low: int, high: int) -> Check:
    def rule(value: Any, where: str) -> None:
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            raise InputError(f"{where}: give a whole number from {low} to {high}")

    return rule


def _text(value: Any, where: str) -> None:
    if not isinstance(value, str):
        raise InputError(f"{where}: give a text")


def _pair(value: Any, where: str) -> None:
    _row(_text, _text)(value, where)


def _one_of(names: Collection[str]) -> Check:
    def rule(value: Any, where: str) -> None:
        if not isinstance(value, str) or value not in names:
            raise InputError(f"{where}: {str(value)[:40]!r} is unknown")

    return rule


def _optional(check: Check) -> Check:
    def rule(value: Any, where: str) -> None:
        if value is not None:
            check(value, where)

    return rule
