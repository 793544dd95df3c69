"""A lab's own tables become a data set: columns mapped and scaled to SI, runs cut where a hole is, one held out."""

import os
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from discrepancy.data.dataset import FILE, FORMAT, load_dataset
from discrepancy.data.hold import Better, better_hold
from discrepancy.data.pieces import FRAGMENT, NONE, Piece, cut, let_go, moving_until, triggered
from discrepancy.data.record import MINIMUM_SAMPLES, SENSES, Floats, Senses, measured_rate
from discrepancy.data.table import COLUMNS, numbers, read_table
from gyro_model.errors import InputError, nearest
from gyro_model.model import load_model
from gyro_model.tables import SUFFIXES as LAB_SUFFIXES
from gyro_model.units import MEASURED

SI: Final = {"t": "s", "u_x": "N", "u_y": "N", "v_x": "V", "v_y": "V", "omega_z": "rad/s", "temperature": "K",
             "a_x": "m/s2", "a_y": "m/s2", "v_bias": "V"}  # fmt: skip

ALIASES: Final[Mapping[str, tuple[str, ...]]] = {
    "t": (
        "t",
        "time",
        "zeit",
        "timestamp",
        "zeitstempel",
        "uhrzeit",
        "datetime",
        "x_value",
        "elapsed_time",
        "sampling_time",
        *MEASURED["s"],
    ),
    "u_x": ("u_x", "ux", "fx", "f_x", "force_x", "drive_x", "u1", "u", "force", "input", "v1", "torque", "tau"),
    "u_y": ("u_y", "uy", "fy", "f_y", "force_y", "drive_y", "u2"),
    "v_x": ("v_x", "vx", "sense_x", "out_x", "y1", "output", "v2", "position", "displacement", "angle", "theta", "pos"),
    "v_y": ("v_y", "vy", "sense_y", "out_y", "y2"),
    "omega_z": ("omega_z", "omega", "wz", "rate", "rate_z", "gyro_z"),
    "temperature": ("temperature", "temp", "t_amb"),
    "a_x": ("a_x", "ax", "acc_x", "accel_x"),
    "a_y": ("a_y", "ay", "acc_y", "accel_y"),
    "v_bias": ("v_bias", "vbias", "bias", "v_dc"),
}
"""Headings, without unit and case, that are taken for a column; V1 in and V2 out as in the Silverbox record."""

OF_TWO_AXES: Final = ("omega", "rate")
"""Names of a turn rate in a table of two axes; in one of a single axis it is as likely the motion's own speed."""

FORCES, MOTIONS = ("u_x", "u_y"), ("v_x", "v_y")

HELD_OUT: Final = 0.2
"""Share of a single run that is cut off its end and held out."""

_HEADING: Final = re.compile(r"\s*(.*?)\s*(?:[\[(]\s*([^\])]*?)\s*[\])])?\s*")


SENSED: Final[Mapping[str, Senses]] = {"m": "position", "m/s": "velocity", "m/s2": "acceleration",
                                      "rad": "position", "rad/s": "velocity", "rad/s2": "acceleration"}  # fmt: skip
"""What a sensor senses whose voltage is given in such a unit."""
TORQUE: Final = "N.m"
TURNING: Final = (TORQUE, *(unit for unit in SENSED if unit.startswith("rad")))
"""Units of what turns: the equations are those of what slides, with a moment of inertia for the mass."""

BY_UNIT: Final[Mapping[str, frozenset[str]]] = {
    "u_x": frozenset(unit for si in ("N", TORQUE) for unit in MEASURED[si]),
    "v_x": frozenset(unit for si in ("V", *SENSED) for unit in MEASURED[si]),
    "omega_z": frozenset(MEASURED["rad/s"]),
}
"""Where no heading tells a force, the voltage of a single axis or the turn rate of two, the only column left with such
a unit is taken for it."""


class Source(NamedTuple):
    """Where a column comes from: the heading in the lab's table, empty for a force that did not act, and
    SI = factor * value + offset, in ``unit``: that of the column, or one of SENSED where a sensor's voltage is given as
    the motion that it stands for."""

    heading: str
    factor: float
    offset: float
    unit: str


@dataclass(frozen=True)
class Request:
    """What is asked for. maps: column to heading, or to its number from 1; scales: column to a number or a unit;
    sample_rate [Hz] where the tables have no time; hold and senses as in dataset.toml, empty for what the response and
    the units say; nominal by FMU name; held_out: one of ``files``."""

    files: tuple[Path, ...]
    out: Path
    maps: Mapping[str, str] = field(default_factory=dict)
    scales: Mapping[str, str] = field(default_factory=dict)
    sample_rate: float | None = None
    hold: str = ""
    senses: str = ""
    nominal: Mapping[str, float] = field(default_factory=dict)
    held_out: Path | None = None
    force: bool = False


def read_lab_table(path: Path) -> pl.DataFrame:
    """A lab's table in any dialect; columns without heading and without content are left out. Raises InputError where
    it can't be read."""
    if not path.name.lower().endswith(LAB_SUFFIXES):
        raise InputError(f"{path}: can't tell its kind; give a table that ends in {', '.join(LAB_SUFFIXES)}")
    table = read_table(path)
    return table.select([name for name in table.columns if table[name].null_count() < len(table)])


def guess_sources(headings: Sequence[str], request: Request) -> dict[str, Source]:
    """The source of every column that is mapped by hand or has a heading or a unit that tells it, and of the voltage
    where that is what a single heading is left for. Raises InputError for a heading or a column that does not exist,
    two headings for one column, and a unit that does not fit."""
    for option, given in (("--map", request.maps), ("--scale", request.scales)):
        for column in given:
            if column not in COLUMNS:
                raise InputError(f"{option} {column}: no such column{nearest(column, COLUMNS)}")
    sources: dict[str, Source] = {}
    maps = {column: _numbered(heading, headings) for column, heading in request.maps.items()}
    for column in COLUMNS:
        heading = maps.get(column)
        if heading is None:
            taken = set(maps.values())
            fitting = [h for h in headings if h not in taken and _is_called(h, column)]
            # The column's own name goes before its other names.
            fitting = [h for h in fitting if _bare(h, column) == column] or fitting
            if not _two_axes(sources):
                fitting = [h for h in fitting if _bare(h, column) not in OF_TWO_AXES]
            if len(fitting) > 1:
                raise InputError(f"{column} may be {' or '.join(map(repr, fitting))}: choose by --map {column}=HEADING")
            if not fitting:
                continue
            heading = fitting[0]
        elif heading == NONE and heading not in headings:
            # Of other columns the table has a heading that only looks like one.
            if column in FORCES:
                sources[column] = Source("", 0.0, 0.0, SI[column])
            continue
        elif heading not in headings:
            raise InputError(
                f"--map {column}={heading!r}: no such heading{nearest(heading, headings)} ({_all(headings)})"
            )
        sources[column] = Source(heading, *_scale(column, heading, request.scales.get(column)))
    for column, units in BY_UNIT.items():
        # Of one axis a rate of turn is the motion itself.
        asked = {"v_x": not _two_axes(sources), "omega_z": _two_axes(sources)}.get(column, True)
        if column in {*sources, *request.maps} or not asked:
            continue
        left = [h for h in _left(headings, sources) if _parts(h, column)[1] in units]
        if len(left) == 1:
            sources[column] = Source(left[0], *_scale(column, left[0], request.scales.get(column)))
    left = _left(headings, sources)
    if missing_columns(sources, request.sample_rate) == ["v_x"] and "v_x" not in request.maps and len(left) == 1:
        sources["v_x"] = Source(left[0], *_scale("v_x", left[0], request.scales.get("v_x")))
    return sources


def _numbered(heading: str, headings: Sequence[str]) -> str:
    """A heading that is given, by its number from 1 where none is called so: of tables whose headings differ."""
    if heading in headings or not heading.isdecimal() or not 1 <= int(heading) <= len(headings):
        return heading
    return headings[int(heading) - 1]


def _left(headings: Sequence[str], sources: Mapping[str, Source]) -> list[str]:
    used = {source.heading for source in sources.values()}
    return [heading for heading in headings if heading not in used]


def _two_axes(sources: Mapping[str, Source]) -> bool:
    return bool({"u_y", "v_y"} & set(sources))


def missing_columns(sources: Mapping[str, Source], sample_rate: float | None) -> list[str]:
    """What must still be named: u_x and v_x, both of y if one is there, and t unless the sample rate is given."""
    needed = ["u_x", "v_x"] if sample_rate else ["t", "u_x", "v_x"]
    if _two_axes(sources):
        needed += ["u_y", "v_y"]
    return [column for column in needed if column not in sources]


def write_dataset(request: Request) -> tuple[Path, list[str]]:
    """Writes the data set: everything beside, then moved in place. Gives the path of its dataset.toml and what was
    decided, in lines. Raises InputError where anything is missing, and where files exist and force is not set."""
    pieces: list[Piece] = []
    said: list[str] = []
    for path in request.files:
        found, lines = _pieces(path, request)
        pieces += found
        said += lines
    _refuse_twins([piece.name for piece in pieces])
    pieces, held_out, line = _held_out(pieces, request)
    rates = {piece.name: measured_rate(piece.columns["t"]) for piece in pieces}
    text = _toml(pieces, rates, held_out, request)
    targets = [request.out / FILE, *(request.out / piece.name for piece in pieces)]
    existing = [target for target in targets if target.exists()]
    if existing and not request.force:
        raise InputError(f"{existing[0]} exists: name another folder with --out, or replace it with --force")
    _write(request.out, pieces, text)
    seen = None if request.hold else _seen_hold(request.out)
    if seen:
        said.append(
            f'hold = "{seen.hold}": the force ran on between samples, as the response shows (it leaves '
            f"{seen.left:.2g} unexplained, held {seen.given:.2g}); --hold zero says otherwise"
        )
        (request.out / FILE).write_text(_toml(pieces, rates, held_out, replace(request, hold=seen.hold)), "utf-8")
    return request.out / FILE, [*dict.fromkeys(said), line]


def _seen_hold(folder: Path) -> Better | None:
    """The hold that the runs of a data set show instead of samples that are held; None where they show none."""
    try:
        data = load_dataset(folder)
    except InputError:
        # What is wrong with it is told when it is diagnosed.
        return None
    return better_hold(data.fit, data.nominal)


def _pieces(path: Path, request: Request) -> tuple[list[Piece], list[str]]:
    """The runs in one table, cut at holes, and what was decided."""
    table = read_lab_table(path)
    sources = guess_sources(table.columns, request)
    missing = missing_columns(sources, request.sample_rate)
    if missing:
        raise InputError(f"{path}: {_which(missing)} ({_all(table.columns)})")
    said = [
        f"{column} = 0: no force acted" if not source.heading else
        f"{column} = {source.heading!r}" + (f" * {source.factor:g}" if source.factor != 1 else "")
        + (f" + {source.offset:g}" if source.offset else "") + f" [{source.unit}]"
        + (f": a sensor of 1 V for 1 {source.unit}, sense_gain_{column[-1]} = 1"
           if column in MOTIONS and source.unit in SENSED else "")
        for column, source in sources.items()
    ]  # fmt: skip
    if any(sources[column].unit in TURNING for column in (*FORCES, *MOTIONS) if column in sources):
        said.append("it turns: read m as a moment of inertia [kg.m2], k in N.m/rad, d in N.m.s/rad, forces in N.m")
    unused = _left(table.columns, sources)
    if unused:
        said.append(f"not used: {', '.join(map(repr, unused))}; --map COLUMN=HEADING takes one in")
    columns = {column: source.factor * _numbers(table, source.heading, path) + source.offset
               if source.heading else np.zeros(len(table)) for column, source in sources.items()}  # fmt: skip
    if "t" not in columns:
        columns = {"t": np.arange(len(table)) / float(request.sample_rate or 1.0)} | columns
    pieces, said = cut(path, columns, said)
    if not any(sources[column].heading for column in FORCES if column in sources):
        pieces, said = let_go(pieces, said)
    else:
        senses = SENSED.get(sources["v_x"].unit, request.senses or "position")
        pieces, said = triggered(pieces, said, SENSES.index(senses))
    moved = {c: source.unit for c, source in sources.items() if c in MOTIONS and source.unit in SENSED}
    return [piece._replace(moved=moved) for piece in pieces], said


def _which(missing: Sequence[str]) -> str:
    """The question which headings are the columns that are ``missing``, all at once, and how to answer it."""
    given = " ".join(f"--map {column}=HEADING" for column in missing)
    others = [f"--map {column}={NONE} if no force acted" for column in missing if column in FORCES]
    others += ["--sample-rate HZ"] if "t" in missing else []
    which = "which heading is" if len(missing) == 1 else "which headings are"
    return f"{which} {', '.join(missing)}? Give {', or '.join([given, *others])}"


def _numbers(table: pl.DataFrame, heading: str, path: Path) -> Floats:
    try:
        return numbers(table, heading)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _held_out(pieces: list[Piece], request: Request) -> tuple[list[Piece], set[str], str]:
    """The runs, the names of those held out, and the line that says so; a single run is cut in two."""
    if request.held_out is not None:
        chosen = {piece.name for piece in pieces if piece.source == request.held_out}
        if not chosen:
            raise InputError(f"--held-out {request.held_out}: is none of the files given ({_all(request.files)})")
        if len(chosen) == len(pieces):
            raise InputError(f"--held-out {request.held_out}: leaves no run to fit; give a further file")
        return pieces, chosen, f"held out: {', '.join(sorted(chosen))}"
    if len(pieces) > 1:
        # The last that is long enough to judge by.
        total = sum(len(piece.columns["t"]) for piece in pieces)
        long = [piece for piece in pieces if len(piece.columns["t"]) >= FRAGMENT * total] or pieces
        last = "the last" if long[-1] is pieces[-1] else "the last that is long enough"
        return pieces, {long[-1].name}, f"held out: {long[-1].name}, {last}"
    [single] = pieces
    n = len(single.columns["t"])
    moving = moving_until(single)
    border = round((1 - HELD_OUT) * moving)
    if n - border < MINIMUM_SAMPLES:
        raise InputError(f"{single.source}: {n} rows are too few to hold out a fifth; give a second file")
    stem = single.name.removesuffix(".parquet")
    parts = [single._replace(name=f"{stem}-{word}.parquet", columns={c: v[rows] for c, v in single.columns.items()})
             for word, rows in (("fit", slice(None, border)), ("held-out", slice(border, None)))]  # fmt: skip
    what = "the only run" if moving == n else "what moves of the only run, and the rest after it"
    return parts, {parts[1].name}, f"held out: the last fifth of {what}, {parts[1].name}"


def _toml(pieces: list[Piece], rates: Mapping[str, float], held_out: set[str], request: Request) -> str:
    lines = [f"format = {FORMAT}", "", "[nominal]"]
    model = load_model()
    moved = _moved(pieces)
    senses = next((SENSED[unit] for unit in moved.values()), request.senses or "position")
    gains = {f"sense_gain_{column[-1]}": 1.0 for column in moved}
    nominal = {**request.nominal, **gains}
    lines += [f"{name} = {float(value)!r} # {model.parameter(name).unit}" for name, value in nominal.items()]
    if not request.nominal:
        lines += ["# What you believe of the device, SI; what is not here comes from the record's own response.",
                  "# m = 1.8e-7", "# kxx = 63.955", "# dxx = 1.8e-6", "# sense_gain_x = 1e6"]  # fmt: skip
    for piece in pieces:
        rate = request.sample_rate or float(f"{rates[piece.name]:.6g}")
        lines += ["", "[[run]]", f'file = "{piece.name}"', f"sample_rate = {float(rate)!r}"]
        lines += ['role = "held-out"'] if piece.name in held_out else []
        lines += [f'hold = "{request.hold}"'] if request.hold else []
        lines += [f'senses = "{senses}"'] if senses != "position" else []
    return "\n".join(lines) + "\n"


def _moved(pieces: Sequence[Piece]) -> Mapping[str, str]:
    """Unit of the columns of v that hold a motion. Raises InputError where runs or axes differ."""
    for piece in pieces:
        if piece.moved != pieces[0].moved or len(set(piece.moved.values())) > 1:
            raise InputError(
                f"{piece.source} and {pieces[0].source}: v is {_units(piece)} and {_units(pieces[0])}: "
                "name one unit by --scale, or make a data set of each"
            )
    return pieces[0].moved


def _units(piece: Piece) -> str:
    return ", ".join(f"in {piece.moved.get(c, 'V')}" for c in MOTIONS if c in piece.columns)


def _write(folder: Path, pieces: list[Piece], text: str) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        beside = Path(tempfile.mkdtemp(prefix=".dataset-", dir=folder))
    except OSError as error:
        raise InputError(f"--out {folder}: can't be written: {error.strerror}") from None
    try:
        for piece in pieces:
            table = pl.DataFrame({c: piece.columns[c] for c in COLUMNS if c in piece.columns})
            table.fill_nan(None).write_parquet(beside / piece.name)
        (beside / FILE).write_text(text, encoding="utf-8")
        # dataset.toml last: where it stands, its tables do.
        for name in [*(piece.name for piece in pieces), FILE]:
            os.replace(beside / name, folder / name)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _is_called(heading: str, column: str) -> bool:
    """Whether a heading is one of the column's names; x and y alone are those of a sensor where the unit is a
    motion's."""
    name, unit = _bare(heading, column), _parts(heading, column)[1]
    moves = column in MOTIONS and name == column[-1] and any(unit in MEASURED[si] for si in SENSED)
    return name in ALIASES[column] or moves


def _bare(heading: str, column: str) -> str:
    """A heading without unit: lower case, with _ for space and dash."""
    return re.sub(r"[\s\-]+", "_", _parts(heading, column)[0].strip().lower())


def _parts(heading: str, column: str) -> tuple[str, str | None]:
    """Name and unit in a heading: in brackets, or one of the column's behind a slash, as in t/ms, or an underscore."""
    match = _HEADING.fullmatch(heading)
    if match and match[2]:
        return match[1], match[2]
    units = _units_of(column)
    if heading in units:
        return heading, heading
    name, slash, unit = heading.partition("/")
    if slash and name.strip() and unit.strip() in units:
        return name, unit.strip()
    name, _, unit = heading.strip().rpartition("_")
    # Another single letter is more often a name, as in v_m.
    if name and unit in units and (len(unit) > 1 or unit == "s" == SI[column]):
        return name, unit
    return heading, None


def _units_of(column: str) -> dict[str, tuple[float, float, str]]:
    """(factor, offset, SI unit) by each unit in which a column may be given."""
    choices: tuple[str, ...] = (SI[column],)
    if column in MOTIONS:
        choices = (SI[column], *SENSED)
    elif column in FORCES:
        choices = (SI[column], TORQUE)
    return {name: (*factors, si) for si in choices for name, factors in MEASURED[si].items()}


def _scale(column: str, heading: str, given: str | None) -> tuple[float, float, str]:
    """(factor, offset, unit) by --scale, else by the unit in the heading, else SI."""
    units = _units_of(column)
    if given is not None:
        if given in units:
            return units[given]
        try:
            factor = float(given)
        except ValueError:
            factor = 0.0
        if factor == 0 or not np.isfinite(factor):
            raise InputError(f"--scale {column}={given}: give a number or one of {', '.join(units)}")
        return factor, 0.0, SI[column]
    unit = _parts(heading, column)[1]
    if not unit:
        return 1.0, 0.0, SI[column]
    if unit not in units:
        drive = f"; --scale {column}=1 takes what drives for a force of {column}'s size" if column in FORCES else ""
        raise InputError(
            f"{column} = {heading!r}: {unit!r} is no unit of it; "
            f"give --scale {column}=NUMBER or one of {', '.join(units)}{drive}"
        )
    return units[unit]


def _refuse_twins(names: list[str]) -> None:
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two files would both become {name}: rename one")


def _all(names: Sequence[object]) -> str:
    return "there are " + ", ".join(repr(str(name)) for name in names)


__all__ = ["Request", "guess_sources", "missing_columns", "read_lab_table", "write_dataset"]
