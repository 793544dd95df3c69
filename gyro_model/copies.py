"""Copies of a force: a second one of its kind, or one that acts on the other axis."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from sympy import Expr, Symbol, sympify

from gyro_model import symbols
from gyro_model.anatomy import Energy, Force, Limit, Pair
from gyro_model.errors import InputError

ACROSS: Final = ((symbols.x, symbols.y), (symbols.x_dot, symbols.y_dot), (symbols.u_x, symbols.u_y))
"""What changes places where the axes do."""
TERMS: Final = {"force_x": "force_y", "force_y": "force_x", "impulse_x": "impulse_y", "impulse_y": "impulse_x"}


def copied(effect: Force, suffix: str, *, turned: bool = False) -> Force:
    """A force like ``effect``, whose id, parameters and states end in ``suffix``; ``turned``: with x and y in one
    another's place.

    Raises InputError where a force is to be turned that depends on more than motion, force and mass: a rate or an
    acceleration has a sense of its own.
    """
    names = {q.symbol: Symbol(q.name + suffix, **q.symbol.assumptions0) for q in effect.parameters}
    names |= {s.symbol: Symbol(s.symbol.name + suffix, **s.symbol.assumptions0) for s in effect.states}
    exchanged = {a: b for pair in ACROSS for a, b in (pair, pair[::-1])} if turned else {}
    foreign = effect.symbols - names.keys() - exchanged.keys() - {symbols.m}
    if turned and foreign:
        others = ", ".join(sorted(s.name for s in foreign))
        raise InputError(f"effect {effect.id}: can't act on the other axis as it is, since it depends on {others}")
    new = names | exchanged
    text = {old.name: symbol.name for old, symbol in new.items()}
    text |= {f"d_{s.symbol.name}": f"d_{s.symbol.name}{suffix}" for s in effect.states} | (TERMS if turned else {})
    beside = ", x and y exchanged" if turned else ", a further one"
    own = {q: replace(q, name=q.name + suffix, description=q.description + beside) for q in effect.parameters}
    return replace(
        effect,
        id=effect.id + suffix,
        parameters=tuple(own.values()),
        states=tuple(
            replace(
                s,
                symbol=names[s.symbol],
                description=s.description + beside,
                rate=_in(s.rate, new),
                start=own[s.start] if s.start else None,
            )
            for s in effect.states
        ),
        force=_pair(effect.force, new, turned),
        impulse=_pair(effect.impulse, new, turned) if effect.impulse else None,
        energy=Energy(_in(effect.energy.stored, new), _in(effect.energy.dissipated, new)) if effect.energy else None,
        limits=tuple(Limit(c.why, _named(c.at, text), _named(c.gives, text)) for c in effect.limits),
    )


def _in(expr: Expr, new: Mapping[Symbol, Symbol]) -> Expr:
    return sympify(expr).xreplace(dict(new))


def _pair(pair: Pair, new: Mapping[Symbol, Symbol], turned: bool) -> Pair:
    first, second = _in(pair[0], new), _in(pair[1], new)
    return (second, first) if turned else (first, second)


def _named(values: Mapping[str, float], text: Mapping[str, str]) -> dict[str, float]:
    return {text.get(name, name): value for name, value in values.items()}
