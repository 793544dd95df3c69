"""In which dialect a text table is written, decided from its own lines.

The lines in which every cell is a number are the table; what stands above is heading, units or preamble. The separator
and the decimal mark are those by which most cells are numbers.
"""

import codecs
import csv
import itertools
import re
from collections import Counter
from typing import Final, NamedTuple

LOOKED_AT: Final = 400
"""Lines: the longest preamble that instruments write has some hundred."""
SEPARATORS: Final = (",", ";", "\t", "|", " ")
"""A space stands for any white space."""
NUMBERS: Final = 0.7
"""Share of the cells of a table that must be numbers; a column of remarks among four is text."""
SHORTEST_BLOCK: Final = 0.1
"""Of the longest block of lines with numbers: shorter ones above it are preamble; remarks may part a table."""
_UNIT: Final = re.compile(r"[\[(]?\s*[A-Za-zµμ°/%²^0-9.·*-]{1,10}\s*[\])]?")


class Dialect(NamedTuple):
    """How a text table is written. separator: between cells; first: the line of the first numbers; headings: empty
    where there are none; decimal: "." or ","."""

    separator: str = ","
    first: int = 1
    headings: tuple[str, ...] = ()
    decimal: str = "."

    @property
    def plain(self) -> bool:
        """Whether it is commas below one heading line, as it stands."""
        return self.separator == "," and self.decimal == "." and self.first == 1 and bool(self.headings)


def decoded(content: bytes) -> str:
    """The text of a file: by its byte order mark, else UTF-8, else Windows' Latin."""
    marks = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
    for mark, encoding in marks:
        if content.startswith(mark):
            return content.decode(encoding)
    # UTF-16 without a mark: every second byte of plain text is zero.
    if len(content) > 3 and content[1::2][:100].count(0) > 0.9 * len(content[1::2][:100]):
        return content.decode("utf-16-le")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("cp1252", errors="replace")


def cells(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes and blanks about them."""
    if '"' in line and separator != " ":
        parts = next(csv.reader([line], delimiter=separator), [""])
    else:
        parts = line.split() if separator == " " else line.rstrip("\r").split(separator)
    return [part.strip().strip('"').strip() for part in parts]


def dialect_of(text: str) -> Dialect:
    """The dialect of the table in ``text``; the plain one where nothing speaks for another."""
    lines = list(itertools.islice((line for line in text.splitlines()), LOOKED_AT))
    best, found = 0.0, Dialect(headings=("",))
    for separator, decimal in itertools.product(SEPARATORS, ".,"):
        if separator == decimal == ",":
            continue
        rows = [cells(line, separator) for line in lines]
        shares = [_share(row, decimal) for row in rows]
        width = _width(rows, shares)
        if width == 0:
            continue
        table = [k for k, row in enumerate(rows) if len(row) == width and shares[k] >= NUMBERS / 2]
        share = sum(shares[k] for k in table) / max(sum(1 for row in rows if row != [""]), 1)
        if not table:
            continue
        first = _first(table)
        own = _headed(rows, first, width, separator, decimal)
        # Of two that read as many numbers, the one that makes more columns of them, then the one that has headings.
        worth = share + 1e-3 * min(width, 50) + 5e-4 * bool(own.headings)
        if worth > best + 1e-9:
            best, found = worth, own
    return found


def _first(table: list[int]) -> int:
    """The line with which a table begins whose lines are ``table``, rising: that of its first long block. A preamble
    may hold a line or a few with as many numbers (step and start of each channel), but not as long a block."""
    starts = [k for k in table if k - 1 not in table]
    lengths = [sum(start <= k < end for k in table) for start, end in itertools.pairwise([*starts, table[-1] + 1])]
    long = max(2, SHORTEST_BLOCK * max(lengths))
    return next((start for start, length in zip(starts, lengths, strict=True) if length >= long), table[0])


def _share(row: list[str], decimal: str) -> float:
    """The share of a row's cells that are numbers; an empty one is a missing number."""
    if row == [""]:
        return 0.0
    filled = [cell for cell in row if cell]
    return sum(is_number(cell, decimal) for cell in filled) / len(filled) if filled else 0.0


def _width(rows: list[list[str]], shares: list[float]) -> int:
    counts = Counter(len(row) for row, share in zip(rows, shares, strict=True) if share >= NUMBERS / 2)
    return counts.most_common(1)[0][0] if counts else 0


def is_number(cell: str, decimal: str = ".") -> bool:
    """Whether a cell is a number with this decimal mark."""
    if decimal == ",":
        if "." in cell:
            return False
        cell = cell.replace(",", ".")
    try:
        float(cell)
    except ValueError:
        return False
    return "_" not in cell


def _headed(rows: list[list[str]], first: int, width: int, separator: str, decimal: str) -> Dialect:
    """The dialect with the headings that stand above the first numbers."""
    above = [row for row in rows[:first] if row not in ([""], [])][-2:]
    # A comment mark stands before the headings, not in them.
    above = [[cell.lstrip("#%*").strip() for cell in row] for row in above]
    above = [row[1:] if len(row) == width + 1 and not row[0] else row for row in above]
    last = above[-1] if above else []
    if len(last) != width or all(is_number(cell, decimal) for cell in last if cell):
        return Dialect(separator, first, (), decimal)
    named = above[0] if len(above) == 2 else []
    if len(named) == width and all(not cell or _UNIT.fullmatch(cell) for cell in last) \
            and all(cell and not is_number(cell, decimal) for cell in named):  # fmt: skip
        units = [unit.strip("[]() ") for unit in last]
        last = [f"{name} [{unit}]" if unit else name for name, unit in zip(named, units, strict=True)]
    return Dialect(separator, first, tuple(last), decimal)
