"""Units as exponents of SI base units, read from text such as ``N.s/m`` or ``N/m3``."""

import re
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cache

from gyro_model.errors import InputError, nearest


@dataclass(frozen=True)
class Dimension:
    """Exponents of the SI base units; ``rad`` is kept for display and counts as 1 in products."""

    kg: Fraction = Fraction(0)
    m: Fraction = Fraction(0)
    s: Fraction = Fraction(0)
    A: Fraction = Fraction(0)
    K: Fraction = Fraction(0)
    rad: Fraction = Fraction(0)

    def __mul__(self, other: "Dimension") -> "Dimension":
        return Dimension(*(a + b for a, b in zip(self.exponents, other.exponents, strict=True)))

    def __pow__(self, power: Fraction) -> "Dimension":
        return Dimension(*(a * power for a in self.exponents))

    @property
    def exponents(self) -> tuple[Fraction, ...]:
        """The exponents in the order kg, m, s, A, K, rad."""
        return tuple(getattr(self, field.name) for field in fields(self))


def _base(**exponents: int) -> Dimension:
    return Dimension(**{name: Fraction(value) for name, value in exponents.items()})


UNITS = {
    "1": Dimension(),
    "kg": _base(kg=1),
    "m": _base(m=1),
    "s": _base(s=1),
    "A": _base(A=1),
    "K": _base(K=1),
    "rad": _base(rad=1),
    "Hz": _base(s=-1),
    "N": _base(kg=1, m=1, s=-2),
    "J": _base(kg=1, m=2, s=-2),
    "V": _base(kg=1, m=2, s=-3, A=-1),
}

_FACTOR = re.compile(r"(1|[A-Za-z]+)(-?\d+(?:\.\d+)?)?")


@cache
def dimension(unit: str) -> Dimension:
    """The dimension of ``unit``: factors joined by ``.``, at most one ``/``, exponents as trailing digits.

    Raises InputError where a factor is not a unit of the table ``UNITS``.
    """
    numerator, slash, denominator = unit.partition("/")
    result = _product(numerator, unit)
    if slash:
        result = result * _product(denominator.strip("()"), unit) ** Fraction(-1)
    return result


def _product(text: str, unit: str) -> Dimension:
    result = Dimension()
    # A dot before a digit is a decimal point, as in Hz0.5.
    for factor in re.split(r"\.(?!\d)", text):
        match = _FACTOR.fullmatch(factor)
        if match is None or match[1] not in UNITS:
            raise InputError(f"unit {unit!r}: factor {factor!r} is unknown{nearest(factor, UNITS)}")
        result = result * UNITS[match[1]] ** Fraction(match[2] or 1)
    return result
