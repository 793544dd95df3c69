"""Terms of force that no effect file states: the library of the search for unknown ones, and each term as an effect.

A form is a product of x, y, x', y', u_x, u_y and of their magnitudes, the same on both axes with the axes' roles
exchanged, each axis with its own coefficient; or the two forces of one coupling potential, which share one. As an
effect of the model it is scored, refitted and simulated by the FMU as any other.
"""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from math import prod
from typing import Final

from sympy import Abs, Expr, Integer, Rational, Symbol, simplify

from gyro_model import symbols
from gyro_model.anatomy import Effect, Energy, Force, Limit, Map, Pair
from gyro_model.model import Model
from gyro_model.quantities import Quantity, size

X, Y, X_DOT, Y_DOT, U_X, U_Y = (symbols.x, symbols.y, symbols.x_dot, symbols.y_dot, symbols.u_x, symbols.u_y)
SIGNALS: Final = (X, Y, X_DOT, Y_DOT, U_X, U_Y)
OTHER: Final = {X: Y, Y: X, X_DOT: Y_DOT, Y_DOT: X_DOT, U_X: U_Y, U_Y: U_X}
"""Each signal's counterpart on the other axis."""
DEGREE: Final = 5

_EXAMPLE: Final = {X: "2e-6", Y: "-1e-6", X_DOT: "0.02", Y_DOT: "-0.01", U_X: "3e-5", U_Y: "-2e-5"}
"""Values of a limit case: what is usual in a gyroscope, on both sides of zero."""


@dataclass(frozen=True)
class Form:
    """A force -Σ c_i part_i; each part is a pair (on x, on y) without its coefficient c_i."""

    id: str
    parts: tuple[Pair, ...]

    @property
    def complexity(self) -> int:
        """The degree of the product, a magnitude counted once more."""
        product = next(e for e in self.parts[0] if e != 0)
        return _degree(product) + sum(isinstance(base, Abs) for base in _powers(product))

    @property
    def text(self) -> str:
        """For a reader: ``x**5 on x, y**5 on y``."""
        return ", ".join(_text(part) for part in self.parts)

    def only(self, chosen: Sequence[int]) -> "Form":
        """The form with some of its parts."""
        return Form(self.id, tuple(self.parts[i] for i in chosen))

    def quantities(self) -> tuple[Quantity, ...]:
        """The coefficients: ``<id>_x`` and ``<id>_y`` by the axis pushed, ``<id>_xy`` where both are."""
        return tuple(size(f"{self.id}_{_axes(part)}", _unit(part), f"coefficient of {_text(part)}")
                     for part in self.parts)  # fmt: skip

    def effect(self, energy: Energy | None = None) -> Force:
        """The form as an effect of the model; ``energy``: its balance where that matters."""
        coefficients = self.quantities()
        force = tuple(sum((-q.symbol * p[axis] for q, p in zip(coefficients, self.parts, strict=True)), Integer(0))
                      for axis in (0, 1))  # fmt: skip
        return Force(
            id=self.id,
            parameters=coefficients,
            force=force,
            energy=energy,
            signature=f"what a force {_text((force[0], force[1]))} does",
            host_experiment="drive level step",
            limits=(self._limit(),),
            doc="A term of the library.",
        )

    def energy(self) -> Energy | None:
        """What the force stores, or what it dissipates where it never feeds; None where it may do neither alone."""
        return _energy(self.quantities(), self.parts)

    def _limit(self) -> Limit:
        at: dict[str, Decimal] = {s.name: Decimal(_EXAMPLE[s]) for s in SIGNALS if s in _symbols(self.parts)}
        total = [Decimal(0), Decimal(0)]
        for q, part in zip(self.quantities(), self.parts, strict=True):
            values = [_decimal(e) for e in part]
            largest = max(abs(v) for v in values)
            # A power of ten that makes the force some tens of nanonewton.
            at[q.name] = Decimal(1).scaleb(-8 - largest.adjusted())
            total = [t - at[q.name] * v for t, v in zip(total, values, strict=True)]
        told = ", ".join(f"{name} = {float(value):g}" for name, value in at.items())
        gives = {f"force_{axis}": float(value) for axis, value in zip("xy", total, strict=True)}
        return Limit(why=f"in decimal arithmetic at {told}, SI", at={k: float(v) for k, v in at.items()}, gives=gives)


@cache
def forms(axes: int) -> tuple[Form, ...]:
    """The library for records of 1 (x alone) or 2 axes: simplest first."""
    found: dict[Pair, None] = {}
    for product in sorted(_products(), key=lambda e: (_degree(e), len(e.free_symbols), str(e))):
        found[product, product.xreplace(OTHER)] = None
    pairs = [((a, Integer(0)), (Integer(0), b)) for a, b in found]
    parts: list[tuple[Pair, ...]] = [*pairs, *_potentials()]
    if axes == 1:
        alone = {X, X_DOT, U_X}
        parts = [(p[0],) for p in pairs if p[0][0].free_symbols <= alone]
    return tuple(Form(f"term_{number}", part) for number, part in enumerate(parts, 1))


def _products() -> Iterable[Expr]:
    """Forces on the x axis."""
    states = (X, Y, X_DOT, Y_DOT)
    for degree in range(2, DEGREE + 1):
        for chosen in itertools.combinations_with_replacement(states, degree):
            # From the fourth degree on two signals at most: 91 products more would be fitted to each other.
            if degree <= 3 or len(set(chosen)) <= 2:
                yield _product(chosen)
    for a, b in itertools.product(states, repeat=2):
        yield Abs(a) * b
        yield a**2 * Abs(b) * b
    for a in states:
        yield Abs(a)
        yield Abs(a) ** 3
        yield U_X * a
        yield U_Y * a
        yield U_X * Abs(a)
    for chosen in itertools.combinations_with_replacement(states, 2):
        yield U_X * _product(chosen)
    yield from (U_X**2, U_X * U_Y, U_Y**2, U_X**3, U_X * Abs(U_X), X * U_X**2)


def _potentials() -> Iterable[tuple[Pair, ...]]:
    """Couplings of the axes by one spring: the forces of the potential x^a y^b."""
    for a, b in ((2, 1), (1, 2), (2, 2), (3, 1), (1, 3)):
        potential = X**a * Y**b
        yield ((potential.diff(X), potential.diff(Y)),)


def _product(factors: Iterable[Expr]) -> Expr:
    result = Integer(1)
    for factor in factors:
        result *= factor
    return result


Known = tuple[Effect, tuple[str | None, ...]]
"""An effect, and the size that is the coefficient of each part of a form (None: none is)."""


def known(model: Model, library: Iterable[Form]) -> dict[str, Known]:
    """Of the forms that an effect of ``model`` is to first order in its sizes, by the form's id: the effect."""
    effects = [(e, _slopes(e)) for e in model.effects if not (e.nominal or e.noise) and _acts_as_force(e)]
    found = {}
    for form in library:
        both = tuple(sum(part[axis] for part in form.parts) for axis in (0, 1))
        for effect, slopes in effects:
            sizes = tuple(_size_of(part, both, slopes) for part in form.parts)
            if any(sizes):
                found[form.id] = effect, sizes
    return found


def apart(form: Form, sizes: Sequence[str | None]) -> Form | None:
    """The form with a coefficient of each axis' own, where an effect has one size for both; else None."""
    return Form(f"{form.id}_apart", form.parts) if len(set(sizes)) < len(sizes) else None


def _acts_as_force(effect: Effect) -> bool:
    return isinstance(effect, Force) or (isinstance(effect, Map) and effect.slot == "actuator curve")


def _slopes(effect: Effect) -> dict[str, tuple[Expr, ...]]:
    """What each size adds on x and on y, to first order."""
    terms = tuple(effect.terms().values())[:2]
    neutral = {q.symbol: Rational(q.start) for q in effect.sizes}
    return {q.name: tuple(e.diff(q.symbol).subs(neutral) for e in terms) for q in effect.sizes}


def _size_of(part: Pair, both: Sequence[Expr], slopes: Mapping[str, Sequence[Expr]]) -> str | None:
    """One size may stand for the parts of ``both`` axes, as that of an actuator curve does."""
    return next((name for name, slope in slopes.items() if _parallel(slope, part) or _parallel(slope, both)), None)


def _parallel(a: Sequence[Expr], b: Sequence[Expr]) -> bool:
    # A quotient that is a number has the same symbols above and below: most pairs end here, and a quotient is dear.
    if any((p == 0) != (q == 0) or p.free_symbols != q.free_symbols for p, q in zip(a, b, strict=True)):
        return False
    ratios = {p / q for p, q in zip(a, b, strict=True) if q != 0}
    return len(ratios) == 1 and next(iter(ratios)).is_number


def magnitude(part: Pair, scale: Mapping[str, float]) -> float:
    """The force of a part with coefficient 1 where every signal is at ``scale`` (by name, SI) [N]."""
    return max(_size(e, scale) for e in part)


def _size(product: Expr, scale: Mapping[str, float]) -> float:
    signals = ((base.args[0] if isinstance(base, Abs) else base, power) for base, power in _powers(product).items())
    return abs(float(product.as_coeff_Mul()[0])) * prod(abs(scale[s.name]) ** power for s, power in signals)


def _symbols(parts: Iterable[Pair]) -> set[Symbol]:
    return {s for part in parts for e in part for s in e.free_symbols}


def _powers(product: Expr) -> dict[Expr, int]:
    """Exponents of x, |x| ... in a product."""
    return {base: int(power) for base, power in product.as_powers_dict().items() if not base.is_number}


def _degree(product: Expr) -> int:
    return sum(_powers(product).values())


def _decimal(product: Expr) -> Decimal:
    value = Decimal(str(product.as_coeff_Mul()[0]))
    for base, power in _powers(product).items():
        signal = Decimal(_EXAMPLE[base.args[0] if isinstance(base, Abs) else base])
        value *= (abs(signal) if isinstance(base, Abs) else signal) ** power
    return value


def _axes(part: Pair) -> str:
    return "".join(axis for axis, e in zip("xy", part, strict=True) if e != 0)


def _text(part: Pair) -> str:
    return ", ".join(f"{e} on {axis}" for axis, e in zip("xy", part, strict=True) if e != 0)


def _unit(part: Pair) -> str:
    counts = {"m": 0, "s": 0, "N": 1}
    for base, power in _powers(next(e for e in part if e != 0)).items():
        signal = base.args[0] if isinstance(base, Abs) else base
        if signal in (U_X, U_Y):
            counts["N"] -= power
        else:
            counts["m"] -= power
            counts["s"] += power if signal in (X_DOT, Y_DOT) else 0
    above = [_factor(name, counts[name]) for name in ("N", "s") if counts[name] > 0]
    below = [_factor(name, -counts[name]) for name in ("N", "m") if counts[name] < 0]
    return (".".join(above) or "1") + ("/" + ".".join(below) if below else "")


def _factor(name: str, power: int) -> str:
    return name if power == 1 else f"{name}{power}"


def _energy(coefficients: Sequence[Quantity], parts: Sequence[Pair]) -> Energy | None:
    signals = _symbols(parts)
    if signals & {U_X, U_Y}:
        return None
    if not signals & {X_DOT, Y_DOT}:
        return _stored(coefficients, parts)
    lost = [p[0] * X_DOT + p[1] * Y_DOT for p in parts]
    if all(_never_negative(e) for e in lost):
        return Energy(dissipated=sum(q.symbol * e for q, e in zip(coefficients, lost, strict=True)))
    return None


def _stored(coefficients: Sequence[Quantity], parts: Sequence[Pair]) -> Energy | None:
    stored = Integer(0)
    for q, part in zip(coefficients, parts, strict=True):
        index = 0 if part[0] != 0 else 1
        along, force = (X, Y)[index], part[index]
        powers = _powers(force)
        potential = force * along / (powers.get(along, 0) + powers.get(Abs(along), 0) + 1)
        if any(simplify(potential.diff(s) - e) != 0 for s, e in zip((X, Y), part, strict=True)):
            return None
        stored += q.symbol * potential
    return Energy(stored=stored)


def _never_negative(product: Expr) -> bool:
    return all(isinstance(base, Abs) or power % 2 == 0 for base, power in _powers(product).items())
