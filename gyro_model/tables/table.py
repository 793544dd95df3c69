"""A table as read, and its columns as checked numbers in SI."""

import re
from dataclasses import dataclass
from typing import Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from gyro_model.errors import InputError, nearest
from gyro_model.units import MEASURED, conversion

Floats = NDArray[np.float64]

_IN_BRACKETS: Final = re.compile(r"[\[(]\s*([^\])]*?)\s*[\])]\s*$")


@dataclass(frozen=True)
class Table:
    """A table. name: where it comes from, for messages; frame: its cells as read."""

    name: str
    frame: pl.DataFrame

    def __len__(self) -> int:
        return len(self.frame)

    @property
    def headings(self) -> list[str]:
        """The headings in order."""
        return list(self.frame.columns)

    def heading(self, name: str) -> str:
        """The heading that ``name`` means: itself, or the only one that is it with a unit in brackets."""
        bare = [heading for heading in self.headings if _IN_BRACKETS.sub("", heading).strip() == name]
        return bare[0] if name not in self.headings and len(bare) == 1 else name

    def numbers(self, heading: str) -> Floats:
        """One column as it stands, shape (n,). Raises InputError where it is missing or a cell holds no finite
        number."""
        if heading not in self.headings:
            raise InputError(
                f"{self.name} has no column {heading!r}{nearest(heading, self.headings)} "
                f"(columns: {', '.join(self.headings)})"
            )
        column = self.frame[heading]
        if not (column.dtype.is_numeric() or column.dtype in (pl.String, pl.Null)):
            raise InputError(f"{self.name}: column {heading!r} is of type {column.dtype}: give plain numbers")
        values = column.cast(pl.Float64, strict=False).fill_null(np.nan).to_numpy()
        finite = np.isfinite(values)
        if not finite.all():
            row = int(np.argmin(finite))
            raise InputError(
                f"{self.name}: column {heading!r} is {column[row]!r} in row {row + 1}, "
                "not a finite number: remove or mend the row"
            )
        return values

    def quantity(self, heading: str, si: str, unit: str | None = None) -> Floats:
        """One column in the SI unit ``si``, shape (n,); in the file it is in ``unit``, or in the unit of its heading.

        Raises InputError as ``numbers`` does, for a unit that is none of ``si``, for one that the heading contradicts,
        and where neither names one: nothing is guessed.
        """
        values = self.numbers(heading)
        stated = stated_unit(heading, si)
        if unit is None and stated is None:
            units = ", ".join(MEASURED.get(si, (si,)))
            raise InputError(f"{self.name}: column {heading!r} names no unit: give one of {units}")
        factor, offset = conversion(unit or stated or si, si)
        if unit is not None and stated is not None and conversion(stated, si) != (factor, offset):
            raise InputError(
                f"{self.name}: column {heading!r} is in {stated} by its heading, not in {unit}: "
                f"give the unit as {stated}"
            )
        if factor != 1:
            values = values * factor
        return values + offset if offset else values

    def times(self, heading: str | None = None) -> Floats:
        """The column of times [s], shape (n,): the first, unless ``heading`` names another; in the unit of its heading,
        else in seconds. Raises InputError as ``numbers`` does, for another unit in brackets, and where time does not
        increase."""
        heading = heading or self.headings[0]
        stated, match = stated_unit(heading, "s"), _IN_BRACKETS.search(heading)
        if stated is None and match is not None and match[1].isalpha():
            raise InputError(
                f"{self.name}: time {heading!r} is in {match[1]!r}, which is no unit of time: use one of "
                f"{', '.join(MEASURED['s'])} in the heading"
            )
        t = self.quantity(heading, "s", stated or "s")
        step = np.diff(t)
        if not (step > 0).all():
            row = int(np.argmax(step <= 0)) + 1
            raise InputError(
                f"{self.name}: time {heading!r} does not increase at row {row + 1} "
                f"({t[row - 1]:.9g} then {t[row]:.9g} s): sort the rows and remove repeated ones"
            )
        return t


def stated_unit(heading: str, si: str) -> str | None:
    """The unit in a heading, of those of ``si``: in brackets at its end, or one of two letters and more behind an
    underscore, as in t_ms; one such as deg/s may stand free."""
    known = MEASURED.get(si, {})
    match = _IN_BRACKETS.search(heading)
    if match is not None and match[1] in known:
        return match[1]
    _, underscore, end = heading.strip().rpartition("_")
    # A single letter is more often a name: T_C of a circuit.
    if underscore and len(end) > 1 and end in known:
        return end
    free = [unit for unit in known if "/" in unit and _stands_free(unit, heading)]
    # m/s2 before m/s, were there one: the longest is meant.
    return max(free, key=len, default=None)


def _stands_free(unit: str, heading: str) -> bool:
    """Whether ``unit`` is in ``heading`` and no part of a longer one: no rad/s in krad/s, no deg/s in deg/s2."""
    return re.search(rf"(?<![^\W\d_]){re.escape(unit)}(?![\w^²/])", heading) is not None
