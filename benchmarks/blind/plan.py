"""Which trials there are, by name, and how each is made. The list is fixed: the same names give the same data."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Final, NamedTuple

from benchmarks.blind.difficulties import CONFUSED, DIFFICULTIES
from benchmarks.blind.effects import EFFECTS, MORE
from benchmarks.blind.inseparable import SITUATIONS, make_inseparable
from benchmarks.blind.terms import TERMS
from benchmarks.blind.trial import NULLS, Trial, make_effects, make_null, make_unknown, rng_of
from gyro_model.errors import InputError, nearest

KINDS: Final = ("null", "single", "pair", "triple", "unknown", "inseparable", "difficulty")
NULL_COUNT, PAIRS, TRIPLES = 400, 60, 30
DIFFICULT_NULLS, DIFFICULT, UNKNOWN = 352, 200, 6
SEEDS: Final = {10.0: 20, 100.0: 3, 3.0: 10}
"""Draws of every single effect by its size, in detectable sizes; UNKNOWN: draws of every term in no file."""
MULTIPLES: Final = (10.0, 30.0)
"""Of the detectable sizes, of the effects in pairs and triples."""
DRAWS: Final = 12
"""Choices of effects before a pair or triple is given up: not all are separable or large enough together."""
APART: Final = frozenset({"actuator_delay", "drive_feedthrough", "amplifier_bandwidth", "thermal_phase"})
"""At most one of these in a set: lag and delay are the same to first order, and whether a delayed actuator
delays what feeds through differs from device to device."""


class Entry(NamedTuple):
    """A trial to be made: ``make()`` gives it, always the same."""

    kind: str
    name: str
    make: Callable[[], Trial]


def entries(kinds: tuple[str, ...], block: str) -> Iterator[Entry]:
    """All trials of some kinds. Raises InputError for an unknown kind."""
    makers: dict[str, Callable[[str], Iterator[Entry]]] = {
        "null": nulls,
        "single": singles,
        "pair": partial(several, count=2),
        "triple": partial(several, count=3),
        "unknown": unknowns,
        "inseparable": inseparables,
        "difficulty": difficulties,
    }
    for kind in kinds:
        if kind not in makers:
            raise InputError(f"kind {kind!r} is not known{nearest(kind, KINDS)} (kinds: {', '.join(KINDS)})")
        yield from makers[kind](block)


def nulls(block: str) -> Iterator[Entry]:
    """NULL_COUNT sets without anything hidden, the kinds in turn, then DIFFICULT_NULLS with a difficulty of the
    record."""
    for kinds, count in ((NULLS, NULL_COUNT), (tuple(DIFFICULTIES), DIFFICULT_NULLS)):
        for number in range(count):
            kind = kinds[number % len(kinds)]
            name = f"null-{kind}-{number // len(kinds):02}"
            yield Entry("null", name, partial(make_null, name, kind, block))


def singles(block: str) -> Iterator[Entry]:
    """Every effect at every level and seed; the partner of one that needs it is known but for the second seed."""
    for level, seeds in SEEDS.items():
        for seed in range(seeds):
            for effect in (*EFFECTS, *MORE):
                name = f"single-{effect.id}-{level:g}x-{seed}"
                make = partial(make_effects, name, [effect.id], level, block, partner_known=seed != 1)
                yield Entry("single", name, make)


def several(block: str, count: int) -> Iterator[Entry]:
    """Sets of ``count`` effects that the generator can tell from one another."""
    kind = {2: "pair", 3: "triple"}[count]
    for number in range({2: PAIRS, 3: TRIPLES}[count]):
        name = f"{kind}-{number:02}"
        yield Entry(kind, name, partial(_several, name, count, block))


def _several(name: str, count: int, block: str) -> Trial:
    rng = rng_of(block, f"{name} choice")
    usual = [effect.id for effect in EFFECTS if not effect.partner]
    for draw in range(DRAWS):
        ids = rng.choice(usual, count, replace=False).tolist()
        if len(APART & set(ids)) > 1:
            continue
        try:
            made = make_effects(f"{name}-{draw}", ids, MULTIPLES, block)
        except RuntimeError:
            continue
        return Trial(name, made.nominal, made.runs, made.measured, {**made.label, "id": name})
    raise RuntimeError(f"trial {name}: no set of {count} effects in {DRAWS} draws is separable")


def difficulties(block: str) -> Iterator[Entry]:
    """An effect and a difficulty of the record, both hidden: every effect in turn, with another difficulty each time
    round."""
    usual = [effect.id for effect in (*EFFECTS, *MORE) if not effect.partner]
    names = list(DIFFICULTIES)
    for number in range(DIFFICULT):
        effect, turn = usual[number % len(usual)], number + number // len(usual)
        free = [names[(turn + i) % len(names)] for i in range(len(names))]
        difficulty = next(d for d in free if effect not in CONFUSED.get(d, ()))
        name = f"difficulty-{number:03}-{effect}-{difficulty}"
        make = partial(make_effects, name, [effect], min(MULTIPLES), block, difficulty=difficulty)
        yield Entry("difficulty", name, make)


def unknowns(block: str) -> Iterator[Entry]:
    """Every term that stands in no file, on UNKNOWN devices."""
    for draw in range(UNKNOWN):
        for number, term in enumerate(TERMS, 1):
            name = f"unknown-{term.name}-{draw}"
            if not term.known:
                yield Entry("unknown", name, partial(make_unknown, name, number, block))


def inseparables(block: str) -> Iterator[Entry]:
    """Every situation, before and after the experiment that separates."""
    for number in range(len(SITUATIONS)):
        for stage in ("before", "after"):
            name = f"inseparable-{number}"
            yield Entry("inseparable", f"{name}-{stage}", partial(make_inseparable, name, number, stage, block))
