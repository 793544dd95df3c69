"""What a test gives: figures with their standard errors and the formula that they should meet, and curves."""

from collections.abc import Mapping, Sequence
from math import isfinite, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.rate.steady_state import in_words

Floats = NDArray[np.float64]

SURE: Final = 3.0
"""A value may differ from what is expected by this many standard errors: one in 370 does by chance."""
LEFT_OUT: Final = 0.01
"""And by this, relative: what the formulas leave out, such as the way of a demodulated signal back into the drive."""
ROUNDING: Final = 1e-9
EXPECTATIONS: Final = ("equals", "at least", "at most")
"""How a value is held against what is expected of it."""


class Figure(NamedTuple):
    """A figure of a datasheet.

    value in ``unit``, None where the test can't give one, with the reason in ``note``; error: its standard error;
    tests: how many values or records it is made of; expected: by ``rule``, a formula or bound, as ``how`` says.
    """

    id: str
    name: str
    value: float | None
    unit: str
    error: float | None = None
    tests: int = 1
    expected: float | None = None
    rule: str = ""
    how: str = "equals"
    note: str = ""

    @property
    def holds(self) -> bool | None:
        """Whether the value is what is expected, within SURE standard errors and LEFT_OUT of it; None where nothing is
        expected or measured."""
        if self.value is None or self.expected is None:
            return None
        allowed = SURE * (self.error or 0.0) + LEFT_OUT * abs(self.expected) + ROUNDING * abs(self.value)
        above = self.value - self.expected
        return bool({"equals": abs(above), "at least": -above, "at most": above}[self.how] <= allowed)

    def as_json(self) -> dict[str, Any]:
        """Strict JSON: what is no finite number is None."""
        return {**{name: _finite(value) for name, value in self._asdict().items()}, "holds": self.holds}


class Curve(NamedTuple):
    """A curve of a datasheet: ``columns`` by name with the unit at the end of it, all of one length."""

    id: str
    name: str
    columns: dict[str, Floats]

    def as_json(self) -> dict[str, Any]:
        """Strict JSON: what is no finite number is None."""
        columns = {name: [_finite(v) for v in values.tolist()] for name, values in self.columns.items()}
        return {"id": self.id, "name": self.name, "columns": columns}


class Outcome(NamedTuple):
    """What a procedure gives; reason: why it was not done, where it was not."""

    figures: Sequence[Figure] = ()
    curves: Sequence[Curve] = ()
    reason: str = ""


def _finite(value: Any) -> Any:
    plain = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(plain, float) and not isfinite(plain) else plain


def balanced(figures: Sequence[Figure], left_out: Mapping[str, str], rules: Sequence[str]) -> list[Figure]:
    """The figures, where ``left_out`` names effects, with the reason, without what one of ``rules`` would have them be:
    it does not know these effects."""
    if not left_out:
        return list(figures)
    note = f"nothing expected: the harmonic balance leaves out {in_words(left_out)}"
    return [
        f._replace(expected=None, rule="", note=f"{f.note}; {note}" if f.note else note) if f.rule in rules else f
        for f in figures
    ]


def mean(values: Sequence[float] | Floats, known: float = 0.0) -> tuple[float, float | None]:
    """Mean and its standard error by the scatter, None of a single value. known: standard deviation of a value that a
    formula of the noise gives at least; the scatter of two or three is often far less."""
    array = np.asarray(values, dtype=float)
    if len(array) < 2:
        return float(array.mean()), None
    return float(array.mean()), max(float(array.std(ddof=1)), known) / sqrt(len(array))


def spread(values: Sequence[float] | Floats) -> tuple[float, float]:
    """Standard deviation and its own standard error, s/√(2(n - 1)) of normal values."""
    array = np.asarray(values, dtype=float)
    deviation = float(array.std(ddof=1))
    return deviation, deviation / sqrt(2 * (len(array) - 1))
