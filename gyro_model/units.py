"""Units as exponents of SI base units, read from text such as ``N.s/m`` or ``N/m3``; and conversion to SI."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from functools import cache
from math import pi
from typing import Final, NamedTuple

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


def text_of(of: Dimension) -> str:
    """A unit of that dimension, as short as it goes, one that ``dimension`` reads."""
    written = []
    # People speak of N.s/m, not of kg/s: kilograms are the last choice.
    for name, dear in (("1", 0), ("N", 0), ("V", 0), ("kg", 2)):
        rest = of * UNITS[name] ** Fraction(-1)
        factors = [*([(name, Fraction(1))] if name != "1" else []), *zip(_BASES, rest.exponents, strict=True)]
        above = ".".join(_powered(base, power) for base, power in factors if power > 0)
        below = ".".join(_powered(base, -power) for base, power in factors if power < 0)
        cost = dear + 3 * abs(rest.kg) + sum(map(abs, rest.exponents))
        written.append((cost, (above or "1") + (f"/{_bracketed(below)}" if below else "")))
    return min(written)[1]


_BASES: Final = tuple(field.name for field in fields(Dimension))


def _powered(base: str, power: Fraction) -> str:
    return base if power == 1 else f"{base}{float(power):g}"


def _bracketed(text: str) -> str:
    return f"({text})" if re.search(r"\.(?!\d)", text) else text


def rate_unit(unit: str) -> str:
    """The unit of the time derivative of a quantity in ``unit``: m/s of m, m/s2 of m/s."""
    above, slash, below = unit.partition("/")
    if not slash:
        return f"{unit}/s"
    return f"{above}/s2" if below == "s" else f"{above}/({below}.s)"


class Conversion(NamedTuple):
    """SI = factor * value + offset."""

    factor: float
    offset: float = 0.0


STANDARD_GRAVITY: Final = 9.80665
"""m/s2, by definition (CGPM 1901)."""
ZERO_CELSIUS: Final = 273.15
"""0 °C in K, by definition."""
_PREFIX: Final = {"": 1.0, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3}
_LENGTHS: Final = {**_PREFIX, "c": 1e-2}
_DEGREE: Final = pi / 180

MEASURED: Final[Mapping[str, Mapping[str, Conversion]]] = {
    "s": {
        **{f"{p}s": Conversion(x) for p, x in _PREFIX.items() if p != "k"},
        **dict.fromkeys(("sec", "second", "seconds"), Conversion(1.0)),
        **dict.fromkeys(("min", "minute", "minutes"), Conversion(60.0)),
        **dict.fromkeys(("h", "hr", "hour", "hours"), Conversion(3600.0)),
    },
    "N": {f"{p}N": Conversion(x) for p, x in _PREFIX.items()},
    "N.m": {f"{p}N{dot}m": Conversion(x) for dot in (".", "", " ", "*", "·") for p, x in _PREFIX.items()},
    "V": {f"{p}V": Conversion(x) for p, x in _PREFIX.items()},
    "m": {"pm": Conversion(1e-12), **{f"{p}m": Conversion(x) for p, x in _LENGTHS.items()}},
    "m/s": {f"{p}m/s": Conversion(x) for p, x in _LENGTHS.items()},
    "rad": {
        "rad": Conversion(1.0),
        "mrad": Conversion(1e-3),
        **dict.fromkeys(("deg", "°", "degree", "degrees"), Conversion(_DEGREE)),
    },
    "rad/s2": {
        f"{angle}/s{two}": Conversion(x)
        for two in ("2", "^2", "²")
        for angle, x in (("rad", 1.0), ("deg", _DEGREE), ("°", _DEGREE))
    },
    "rad/s": {
        "deg/s": Conversion(_DEGREE),
        "rad/s": Conversion(1.0),
        **dict.fromkeys(("°/s", "dps", "deg/sec", "°/sec"), Conversion(_DEGREE)),
        **dict.fromkeys(("deg/h", "°/h", "deg/hr", "°/hr"), Conversion(_DEGREE / 3600)),
        **dict.fromkeys(("mdeg/s", "m°/s", "mdps"), Conversion(1e-3 * _DEGREE)),
        "mrad/s": Conversion(1e-3),
        "rad/sec": Conversion(1.0),
        "rpm": Conversion(pi / 30),
    },
    "K": {"K": Conversion(1.0), **dict.fromkeys(("degC", "°C", "C"), Conversion(1.0, ZERO_CELSIUS))},
    "m/s2": {
        **{f"{p}m/s{two}": Conversion(x) for p, x in _LENGTHS.items() for two in ("2", "^2", "²")},
        "Gal": Conversion(1e-2),
        "g": Conversion(STANDARD_GRAVITY),
        "mg": Conversion(1e-3 * STANDARD_GRAVITY),
    },
}
"""By SI unit: the units in which a table may give it."""


def conversion(unit: str, si: str) -> Conversion:
    """From ``unit`` to the SI unit ``si``. Raises InputError where ``unit`` is none of those of ``si`` in MEASURED."""
    known = MEASURED.get(si, {si: Conversion(1.0)})
    if unit not in known:
        raise InputError(f"unit {unit!r} is not known: use {' or '.join(known)}{nearest(unit, known)}")
    return known[unit]


DISPLAYED: Final[Mapping[str, Mapping[str, Conversion]]] = {
    "m": {"µm": Conversion(1e6)},
    "m/s": {"mm/s": Conversion(1e3)},
    "s": {"ms": Conversion(1e3), "µs": Conversion(1e6), "ns": Conversion(1e9)},
    "Hz": {"kHz": Conversion(1e-3)},
    "kg": {"µg": Conversion(1e9)},
    "N": {"µN": Conversion(1e6)},
    "V": {"mV": Conversion(1e3), "µV": Conversion(1e6)},
    "rad/s": {"deg/s": Conversion(1 / _DEGREE)},
    "K": {"degC": Conversion(1.0, -ZERO_CELSIUS)},
    "1/K": {"ppm/K": Conversion(1e6)},
    "m/s2": {"g": Conversion(1 / STANDARD_GRAVITY)},
}
"""By SI unit: the units in which a tool may show it; shown = factor * SI + offset."""
