"""Scenario files: TOML in, a checked scenario out. Nothing in a file is ever executed.

format = 1, name, description, duration, optional angle_unit, optional [parameters], and by input one course or several:
a number, a table, or an array of tables.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.rate_profile import check_holes
from cosim.scenarios.courses import Constant, Course, Part, Record, Sine, Square, curve, ramps, steps
from cosim.scenarios.scenario import INPUT_NAMES, QUANTITIES, Scenario
from gyro_model.errors import InputError, nearest
from gyro_model.tables import read_table, stated_unit
from gyro_model.toml_text import read_toml_file
from gyro_model.units import Conversion, conversion

Floats = NDArray[np.float64]

FOLDER: Final = Path(__file__).parent
FORMAT: Final = 1
LARGEST: Final = 1e150
"""A number beyond this is a slip; its square would overflow."""
_KEYS: Final = ("format", "name", "description", "duration", "angle_unit", "parameters", *INPUT_NAMES)
COMMON_KEYS: Final = ("kind", "unit", "from", "until")


@dataclass(frozen=True)
class Entry:
    """One course as typed. table: its keys; si: unit of the input; folder: of the file, where relative paths begin."""

    table: Mapping[str, Any]
    si: str
    folder: Path

    def number(self, key: str, default: float | None = None) -> float:
        """A finite number. Raises InputError where it is none."""
        value = self.table.get(key, default)
        if not _is_number(value):
            raise InputError(f"{key} = {value!r}: give a number")
        return float(value)

    def numbers(self, key: str) -> Floats:
        """A list of finite numbers, shape (n,). Raises InputError where it is none."""
        values = self.table[key]
        if not (isinstance(values, list) and values and all(map(_is_number, values))):
            raise InputError(f"{key} = {values!r}: give a list of numbers")
        return np.array(values, dtype=np.float64)

    def text(self, key: str, default: str | None = None) -> str:
        """A text. Raises InputError where it is none."""
        value = self.table.get(key, default)
        if not (isinstance(value, str) and value):
            raise InputError(f"{key} = {value!r}: give a text")
        return value

    def choice(self, key: str, valid: Sequence[str], default: str) -> str:
        """One of ``valid``. Raises InputError, with the nearest, where it is none."""
        value = self.text(key, default)
        if value not in valid:
            raise InputError(f"{key} = {value!r}: give {' or '.join(valid)}{nearest(value, valid)}")
        return value

    @property
    def conversion(self) -> Conversion:
        """From the unit of the values to SI."""
        return conversion(self.text("unit", self.si), self.si)

    @property
    def shifted(self) -> bool:
        """Whether the unit, typed or of the heading, has another zero than SI."""
        unit = self.table.get("unit") or stated_unit(str(self.table.get("column", "")), self.si)
        return unit is not None and conversion(unit, self.si).offset != 0

    @property
    def begin(self) -> float:
        """When the course begins [s]."""
        return self.number("from", 0.0)

    def points(self) -> tuple[Floats, Floats]:
        """The points (times [s], values in SI) of steps or ramps. Raises InputError where they leave a gap."""
        times, values = self.numbers("times"), self.numbers("values")
        if times[0] != self.begin:
            raise InputError(f"times begins at {times[0]:g} s: let it begin at {self.begin:g} s, as the course does")
        factor, offset = self.conversion
        return times, factor * values + offset

    def wave(self) -> tuple[float, float, float]:
        """Amplitude in SI, frequency [Hz], phase [deg]. Raises InputError for a unit with a zero of its own."""
        factor, offset = self.conversion
        if offset:
            raise InputError(
                f"unit = {self.text('unit')!r}: a wave swings about zero; give its amplitude in {self.si} "
                "and add a constant"
            )
        return factor * self.number("amplitude"), self.number("frequency"), self.number("phase", 0.0)


class Kind(NamedTuple):
    """A kind of course: keys that it needs, keys that it may have, and how it is built."""

    needed: tuple[str, ...]
    optional: tuple[str, ...]
    build: Callable[[Entry], Course]


def _constant(entry: Entry) -> Course:
    factor, offset = entry.conversion
    return Constant(factor * entry.number("value") + offset)


def _column(entry: Entry) -> Course:
    # Joined to an absolute path, the folder drops out.
    path = entry.folder / entry.text("file")
    table = read_table(path)
    heading = table.heading(entry.text("column"))
    values = table.quantity(heading, entry.si, entry.text("unit") if "unit" in entry.table else None)
    if len(table) < 2:
        raise InputError(f"{path} is too short: {len(table)} rows; give two or more")
    t = table.times(entry.text("time") if "time" in entry.table else None)
    between = entry.choice("between", tuple(BETWEEN), "curve")
    if between == "curve":
        check_holes(path, t)
    # Time from the first reading: an epoch time would cost the curve its digits.
    course = BETWEEN[between](t - t[0], values)
    name = f"record {path.name}:{heading}"
    return Record(name, float(t[-1] - t[0]), course, entry.number("start", 0.0), entry.begin)


BETWEEN: Final[Mapping[str, Callable[[Floats, Floats], Course]]] = {"curve": curve, "lines": ramps, "steps": steps}
"""What runs between the rows of a record."""

KINDS: Final[Mapping[str, Kind]] = {
    "constant": Kind(("value",), (), _constant),
    "steps": Kind(("times", "values"), (), lambda entry: steps(*entry.points())),
    "ramps": Kind(("times", "values"), (), lambda entry: ramps(*entry.points())),
    "square": Kind(("amplitude", "frequency"), ("phase",), lambda entry: Square(*entry.wave())),
    "sine": Kind(("amplitude", "frequency"), ("phase",), lambda entry: Sine(*entry.wave())),
    "column": Kind(("file", "column"), ("time", "start", "between"), _column),
}


def packaged_scenarios() -> dict[str, Path]:
    """The scenario files that come with the package, by name."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}


def scenario_names() -> list[str]:
    """Names of the packaged scenarios."""
    return list(packaged_scenarios())


def load_scenario(name: str) -> Scenario:
    """The scenario of a packaged name, or of the TOML file at that path. Raises InputError where there is none or it
    is wrong."""
    packaged = packaged_scenarios()
    path = packaged.get(name, Path(name))
    if not path.is_file():
        if path.suffix == ".toml":
            raise InputError(f"scenario file {name} does not exist: check the path")
        hint = nearest(name, packaged)
        raise InputError(
            f"scenario {name!r} is not known{hint} (scenarios: {', '.join(packaged)}, or a file NAME.toml)"
        )
    try:
        return _scenario(_read(path), path.parent)
    except InputError as error:
        raise InputError(f"scenario file {path}: {error}") from None


def descriptions() -> dict[str, str]:
    """What the packaged scenarios do, by name."""
    return {name: str(_read(path)["description"]) for name, path in packaged_scenarios().items()}


def _read(path: Path) -> dict[str, Any]:
    return read_toml_file(path)


def _scenario(data: Mapping[str, Any], folder: Path) -> Scenario:
    for key in data:
        if key not in _KEYS:
            raise InputError(f"key {key!r} is unknown{nearest(key, _KEYS)} (keys: {', '.join(_KEYS)})")
    if data.get("format") != FORMAT:
        raise InputError(f"format = {data.get('format')!r}: this program reads format = {FORMAT}")
    for key in ("name", "description"):
        if not isinstance(data.get(key), str):
            raise InputError(f'{key} is missing: add {key} = "..."')
    duration = data.get("duration")
    if not _is_number(duration):
        raise InputError(f"duration = {duration!r}: give a time in s")
    parameters = data.get("parameters", {})
    if not isinstance(parameters, dict):
        raise InputError(f"parameters = {parameters!r}: make it a table [parameters]")
    for name, value in parameters.items():
        if not _is_number(value):
            raise InputError(f"parameter {name} = {value!r}: give a number, SI")
    unit = data.get("angle_unit", "C")
    return Scenario(
        name=data["name"],
        description=data["description"],
        duration=float(duration),  # type: ignore[arg-type]
        courses={name: _courses(name, data[name], folder) for name in INPUT_NAMES if name in data},
        parameters={name: float(value) for name, value in parameters.items()},
        angle_unit=unit,
    )


def _courses(name: str, given: object, folder: Path) -> tuple[Course, ...]:
    """The courses of one input."""
    if _is_number(given):
        return (Constant(float(given)),)  # type: ignore[arg-type]
    tables = given if isinstance(given, list) else [given]
    if not tables or not all(isinstance(table, dict) for table in tables):
        raise InputError(f"{name} = {given!r}: give a number, a table [{name}] or tables [[{name}]]")
    courses: list[Course] = []
    # Windows of the courses given in a unit whose zero is not that of SI.
    shifted: list[tuple[float, float]] = []
    for number, table in enumerate(tables, 1):
        where = name if len(tables) == 1 else f"{name}, course {number}"
        entry = Entry(table, QUANTITIES[name].unit, folder)
        try:
            course = _course(entry)
            if entry.shifted:
                window = (course.begin, course.until) if isinstance(course, Part) else (0.0, inf)
                if any(window[0] < until and begin < window[1] for begin, until in shifted):
                    raise InputError("the sum of two temperatures in degrees Celsius is none; give this one in K")
                shifted.append(window)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        courses.append(course)
    return tuple(courses)


def _course(entry: Entry) -> Course:
    if "kind" not in entry.table:
        raise InputError(f"kind is missing: give {', '.join(KINDS)}")
    name = entry.choice("kind", tuple(KINDS), "")
    kind = KINDS[name]
    known = (*COMMON_KEYS, *kind.needed, *kind.optional)
    for key in entry.table:
        if key not in known:
            raise InputError(f"key {key!r} is unknown to kind {name!r}{nearest(key, known)} (keys: {', '.join(known)})")
    for key in kind.needed:
        if key not in entry.table:
            raise InputError(f"{key} is missing: kind {name!r} needs {', '.join(kind.needed)}")
    course = kind.build(entry)
    whole = "from" not in entry.table and "until" not in entry.table
    until = entry.number("until") if "until" in entry.table else inf
    return course if whole else Part(course, entry.begin, until)


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    # TOML has whole numbers beyond all floats.
    return abs(value) <= LARGEST
