"""Formulas received as text, read by a parser of their own: nothing of them is ever evaluated as code.

    product = ["-"] factor {"*" factor}
    factor  = integer | base ["**" integer]
    base    = name | "Abs(" name ")"

That is every term that the library of terms writes. Brackets do not nest, so neither does the parser.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Final

from sympy import Abs, Expr, Integer, Symbol

from gyro_model.errors import InputError, nearest

LONGEST: Final = 120
"""Characters; the longest term of the library has 26."""
HIGHEST: Final = 9
"""Power; the library ends at 5."""
LARGEST: Final = 1000
"""Integer factor; derivatives of the library's potentials have 1 to 3."""

_TOKEN: Final = re.compile(r"\s*(?:(?P<name>[A-Za-z_]\w*)|(?P<integer>\d+)|(?P<sign>\*\*|[*()-]))")


def parse(text: str, names: Mapping[str, Symbol]) -> Expr:
    """The product that ``text`` writes in ``names``. Raises InputError for anything that the grammar does not have."""
    if not isinstance(text, str) or len(text) > LONGEST:
        raise InputError(f"formula {str(text)[:40]!r}: give a text of at most {LONGEST} characters")
    try:
        return _Parser(text, names).product()
    except InputError as error:
        raise InputError(f"formula {text[:LONGEST]!r}: {error}") from None


class _Parser:
    def __init__(self, text: str, names: Mapping[str, Symbol]) -> None:
        self.tokens = [*_tokens(text), ("end", "")]
        self.at, self.names = 0, names

    def product(self) -> Expr:
        result: Expr = Integer(-1) if self._taken("-") else Integer(1)
        while True:
            result *= self._factor()
            if not self._taken("*"):
                break
        kind, text = self.tokens[self.at]
        if kind != "end":
            raise InputError(f"{text!r} is not expected there: write products such as -2*x**2*Abs(y)")
        return result

    def _factor(self) -> Expr:
        kind, text = self._next()
        if kind == "integer":
            return Integer(_bounded(text, LARGEST))
        if kind != "name":
            raise InputError(f"{text or 'the end'!r} stands where a factor must: write a name or an integer")
        if text == "Abs":
            self._expect("(")
            base = Abs(self._symbol(*self._next()))
            self._expect(")")
        else:
            base = self._symbol(kind, text)
        if not self._taken("**"):
            return base
        kind, power = self._next()
        if kind != "integer":
            raise InputError(f"power {power!r}: give an integer")
        return base ** Integer(_bounded(power, HIGHEST))

    def _symbol(self, kind: str, name: str) -> Symbol:
        if kind != "name" or name not in self.names:
            raise InputError(f"name {name!r} is unknown{nearest(name, self.names)}")
        return self.names[name]

    def _next(self) -> tuple[str, str]:
        token = self.tokens[self.at]
        self.at = min(self.at + 1, len(self.tokens) - 1)
        return token

    def _taken(self, sign: str) -> bool:
        found = self.tokens[self.at] == ("sign", sign)
        self.at += found
        return found

    def _expect(self, sign: str) -> None:
        if not self._taken(sign):
            raise InputError(f"{sign!r} is missing: write Abs(x)")


def _tokens(text: str) -> Iterator[tuple[str, str]]:
    place, end = 0, len(text.rstrip())
    while place < end:
        match = _TOKEN.match(text, place)
        if match is None or not text.isascii():
            raise InputError(f"{text[place : place + 8]!r} can't be read: write products such as -2*x**2*Abs(y)")
        yield str(match.lastgroup), match[str(match.lastgroup)]
        place = match.end()


def _bounded(digits: str, most: int) -> int:
    value = int(digits) if len(digits) <= 4 else most + 1
    if not 1 <= value <= most:
        raise InputError(f"{digits[:8]}: give an integer from 1 to {most}")
    return value
