"""A data set on disk: a folder with ``dataset.toml`` and one table a run (docs/theory/records.md)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import ceil, inf
from pathlib import Path
from typing import Any, Final, NamedTuple, get_args

import numpy as np

from discrepancy.data.blow import windowed
from discrepancy.data.courses import leave_as_little
from discrepancy.data.hold import RUNS_ON, better_hold
from discrepancy.data.late import synchronised
from discrepancy.data.linear_fit import is_held
from discrepancy.data.linear_start import linear_start, one_an_axis, sensor_gains
from discrepancy.data.modes import Mode
from discrepancy.data.offset import levelled
from discrepancy.data.record import Floats, Hold, Record, Role, Senses, is_driven, make_record
from discrepancy.data.resisted import alternatives, moves_alone
from discrepancy.data.table import SUFFIXES, read_columns
from discrepancy.data.thinning import spare, thinned
from discrepancy.data.wander import steadied
from discrepancy.data.weak_modes import all_modes
from gyro_model.anatomy import Delay
from gyro_model.device import check_passive
from gyro_model.errors import InputError, nearest
from gyro_model.model import Model, load_model
from gyro_model.toml_text import read_toml_file

__all__ = ["Dataset", "Record", "load_dataset", "make_record"]

FORMAT: Final = 1
FILE: Final = "dataset.toml"
RUN_KEYS: Final = ("file", "sample_rate", "role", "hold", "senses")

LATEST, FIRST = 1e-3, 8
"""Time [s] by which forces and voltages may be late, and samples that are left out at most for it: a hundredth of a run
and more is too much of what says how it begins."""

NEEDED: Final = {1: ("m", "kxx", "dxx", "sense_gain_x"),
                 2: ("m", "kxx", "kyy", "dxx", "dyy", "sense_gain_x", "sense_gain_y")}  # fmt: skip
"""Nominal values without which a record of so many axes can't be compared with a model."""
CROSS: Final = ("kxy", "dxy")
"""Zero where the lab names none: it believes its axes aligned."""
Y_ONLY: Final = ("kyy", "kxy", "dyy", "dxy", "sense_gain_y", "y_start", "y_dot_start")
"""Parameters that drop out of a one-axis record."""


@dataclass(frozen=True)
class Dataset:
    """What a lab measured and believes. nominal: by FMU parameter name, SI, complete for the axes measured; notes:
    what was assumed, for the reader; model: whose parameters ``nominal`` may name; unknown: names of gains that no one
    states, to be fitted beside mass, stiffness and damping; estimated: names of nominal values that the lab does not
    state, from the record's own response; hold_stated: whether they say how forces run
    between samples; sampled: the runs as measured, where ``records`` have but one of ``every`` samples of each.

    Raises InputError where runs differ in axes, one holds no motion, none is left to fit, or a nominal value is missing
    or impossible.
    """

    folder: Path
    nominal: Mapping[str, float]
    records: tuple[Record, ...]
    notes: tuple[str, ...] = ()
    model: Model = field(default_factory=load_model, repr=False, compare=False)
    unknown: tuple[str, ...] = ()
    estimated: tuple[str, ...] = ()
    hold_stated: bool = False
    sampled: tuple[Record, ...] = ()
    every: int = 1

    def __post_init__(self) -> None:
        if not self.records:
            raise InputError("no run: add a [[run]] with file and sample_rate")
        for record in self.records:
            # A part of a run may well stand still.
            if not (record.u.any() or record.v.any()):
                raise InputError(f"run {record.name}: u and v are zero throughout, which is no motion; leave it out")
            if record.axes != self.axes:
                first = self.records[0].name
                raise InputError(
                    f"run {record.name} has {record.axes} axes and {first} has {self.axes}: "
                    "make a data set of each kind"
                )
            if record.order != self.records[0].order:
                raise InputError(f"run {record.name} has senses = {record.senses!r} and {self.records[0].name} "
                                 f"{self.records[0].senses!r}: make a data set of each kind")  # fmt: skip
        if not self.fit:
            raise InputError("no run to fit: every run is held out; add one, or cut the last into two files")
        self._check_nominal()

    @property
    def axes(self) -> int:
        """1 (x alone) or 2."""
        return self.records[0].axes

    @property
    def fit(self) -> tuple[Record, ...]:
        """The runs that a fit may use."""
        return tuple(record for record in self.records if record.role == "fit")

    @property
    def held_out(self) -> tuple[Record, ...]:
        """The runs that no fit or choice sees."""
        return tuple(record for record in self.records if record.role == "held-out")

    @property
    def measured(self) -> tuple[Record, ...]:
        """The runs with every sample that was measured."""
        return self.sampled or self.records

    @property
    def hold(self) -> Hold:
        """How the forces are taken to run between the samples that were measured."""
        return self.measured[0].hold

    def held(self, hold: Hold) -> "Dataset":
        """With forces that ran so between samples."""
        return self._of(tuple(replace(record, hold=hold) for record in self.measured))

    def since_start(self) -> "Dataset":
        """Without the first samples of driven runs, in which what acted before them, and is in no record, still acts
        where the force comes late."""
        return replace(self, records=tuple(map(_since_start, self.records)))

    def thinned(self, every: int) -> "Dataset":
        """With one of ``every`` samples."""
        return replace(self, every=every)._of(self.measured)

    def _of(self, measured: tuple[Record, ...]) -> "Dataset":
        if self.every == 1:
            return replace(self, records=measured)
        fewer = (
            replace(thinned(record, self.every), begun=own.begun)
            for record, own in zip(measured, self.records, strict=True)
        )
        return replace(self, records=tuple(fewer), sampled=measured)

    @cached_property
    def shown(self) -> "Dataset":
        """With forces that ran on between samples where nobody has said that they were held, and the response shows
        it."""
        # Where samples were left out it has been looked for among all of them.
        better = None if self.hold_stated or self.sampled else better_hold(self.fit, self.nominal)
        return self.held(RUNS_ON) if better and better.hold != "zero" else self

    @cached_property
    def modes(self) -> tuple[list[Mode], list[Mode]]:
        """The modes that the runs to fit show, one an axis and further ones."""
        if not is_held(self.fit, self.nominal) and moves_alone(alternatives(self.fit, self.nominal["sense_gain_x"])):
            return [], []
        first, further = all_modes(self.fit)
        alone = one_an_axis(self.fit, self.nominal) if further else None
        return (alone, []) if alone and leave_as_little(self.fit, alone, [*first, *further]) else (first, further)

    def _check_nominal(self) -> None:
        model = self.model
        for name in NEEDED[self.axes]:
            if name not in self.nominal:
                unit = model.parameter(name).unit
                raise InputError(f"[nominal] lacks {name} [{unit}]: add it, or name the device that has it")
        for name, value in self.nominal.items():
            model.parameter(name).check(value)
        for name in ("kxx", "kyy", "sense_gain_x", "sense_gain_y"):
            if self.nominal.get(name) == 0:
                raise InputError(f"nominal {name} = 0: give what the lab believes, in {model.parameter(name).unit}")
        if self.axes == 2:
            check_passive(self.nominal)


def load_dataset(path: Path, device: Mapping[str, float] | None = None, model: Model | None = None) -> Dataset:
    """Reads the data set in the folder ``path`` (or its dataset.toml). ``device``: parameters that stand where
    [nominal] names none; ``model``: whose parameters it may name, by default the packaged effects'. Raises InputError,
    one line with the remedy, for anything wrong in it."""
    file = path / FILE if path.is_dir() else path
    if not file.is_file():
        raise InputError(f"data set {path}: there is no {FILE}; `gyrotwin dataset init` writes one")
    try:
        content = read_toml_file(file)
        return _thinned(_dataset(file.parent, content, dict(device or {}), model or load_model()))
    except InputError as error:
        raise InputError(f"data set {file}: {error}") from None


def _dataset(folder: Path, content: Mapping[str, Any], device: dict[str, float], model: Model) -> Dataset:
    _refuse_unknown(content, ("format", "nominal", "run"), "key")
    if content.get("format") != FORMAT or isinstance(content["format"], bool):
        raise InputError(f"format = {content.get('format')!r}: this program reads format = {FORMAT}")
    nominal, runs = content.get("nominal", {}), content.get("run", [])
    if not isinstance(nominal, dict):
        raise InputError(f"nominal = {nominal!r}: make it a table [nominal]")
    for name, value in nominal.items():
        model.parameter(name).check(value)
    if not (isinstance(runs, list) and all(isinstance(run, dict) for run in runs)):
        raise InputError("run is no list of tables: write [[run]] with double brackets")
    entries, notes = _with_roles([_entry(number, run) for number, run in enumerate(runs, 1)])
    read = [_read_run(folder, entry) for entry in entries]
    records, blows = windowed([record for record, _ in read])
    if records:
        records = tuple(replace(record, reference=records[0].reference) for record in records)
    records, offset, offsets = levelled(records, device | nominal, model)
    records, drifts = steadied(records)
    axes = records[0].axes if records else 2
    stated, sensed = _as_position(device | nominal, records)
    believed, found = _believed(stated, records)
    complete, more = _completed(believed | offset, axes)
    records, late = _in_time(records, complete, model)
    if late:
        believed, found = _believed(stated, records)
        complete, more = _completed(believed | offset, axes)
    more = [*sensed, *offsets, *drifts, *late, *found, *more]
    unknown = _unknown_gains(stated, records) if axes == 2 and "m" in complete else ()
    estimated = tuple(name for name in believed if name not in stated)
    notes = [*notes, *more, *(note for _, note in read if note), *blows]
    return Dataset(folder, complete, records, tuple(notes), model, unknown, estimated,
                   any("hold" in run for run in runs))  # fmt: skip


def _in_time(
    records: tuple[Record, ...], nominal: Mapping[str, float], model: Model
) -> tuple[tuple[Record, ...], tuple[str, ...]]:
    """The runs without a delay that no device of the ``model`` has, and what to say; as they are where ``nominal`` or
    the runs are not such as a data set may have."""
    axes = {record.axes for record in records}
    if len(axes) != 1 or not nominal.keys() >= {*NEEDED[axes.pop()]}:
        return records, ()
    delays = [q.high for effect in model.effects if isinstance(effect, Delay) for q in effect.parameters]
    return synchronised(records, nominal, max(delays, default=inf))


def _since_start(record: Record) -> Record:
    late = min(ceil(LATEST * record.sample_rate), FIRST, len(record.t) // 100) if record.u.any() else 0
    return replace(record, valid=record.valid & (np.arange(len(record.t)) >= late))


def _thinned(data: Dataset) -> Dataset:
    """With no more samples than what moves asks for, and a note that says so where that leaves samples out."""
    number = spare(data.records)
    if number == 1:
        return data
    # Half a sample of the record is less than a step of what is left, and is looked for before.
    better = None if data.hold_stated else better_hold(data.fit, data.nominal)
    rate = data.records[0].sample_rate / number
    note = (
        f"sampled far more often than anything moves: one of {number} samples is taken, {rate:.6g} Hz, forces as means"
    )
    own = replace(data, notes=(*data.notes, note)).thinned(number)
    return own.held(better.hold) if better else own


class _Entry(NamedTuple):
    """One [[run]] as written."""

    file: str
    sample_rate: float
    role: str
    hold: str
    senses: str


def _entry(number: int, run: Mapping[str, Any]) -> _Entry:
    """A [[run]], its keys and types checked; a wrong word is found before any table, which may be large, is read."""
    where = f"[[run]] {number}"
    _refuse_unknown(run, RUN_KEYS, f"{where}: key")
    file, rate = run.get("file"), run.get("sample_rate")
    if not isinstance(file, str):
        raise InputError(f'{where}: file = {file!r}: add file = "run.csv"')
    if "\0" in file or Path(file).is_absolute() or ".." in Path(file).parts:
        raise InputError(f"{where}: file = {file!r}: lies outside the data set's folder; copy it in and give its name")
    if isinstance(rate, bool) or not isinstance(rate, (int, float)) or not 0 < rate < inf:
        raise InputError(f"{where} ({file}): sample_rate = {rate!r}: add sample_rate = ... in Hz")
    if not file.lower().endswith(SUFFIXES):
        raise InputError(f"{where}: file = {file!r}: name one that ends in {', '.join(SUFFIXES)}")
    choices = {"role": get_args(Role), "hold": get_args(Hold), "senses": get_args(Senses)}
    for key, valid in choices.items():
        value = run.get(key, valid[0])
        if value not in valid:
            raise InputError(f"{where} ({file}): {key} = {value!r}: use {', '.join(valid)}{nearest(str(value), valid)}")
    chosen = {key: run.get(key, valid[0]) for key, valid in choices.items()}
    return _Entry(file, float(rate), **chosen)


def _with_roles(entries: list[_Entry]) -> tuple[list[_Entry], list[str]]:
    """The runs with the last held out where none is named; and the note that says so."""
    files = [entry.file for entry in entries]
    for file in files:
        if files.count(file) > 1:
            raise InputError(f"run {file} is listed twice: a run held out must not be fitted; remove one")
    if not entries or any(entry.role == "held-out" for entry in entries):
        return entries, []
    if len(entries) == 1:
        raise InputError(
            f"no run to fit: the only run, {files[0]}, is the one held out; add a run, or cut it into two files "
            "(`gyrotwin dataset init` does)"
        )
    note = f"no run is named held-out: the last, {files[-1]}, is held out"
    return [*entries[:-1], entries[-1]._replace(role="held-out")], [note]


def _read_run(folder: Path, entry: _Entry) -> tuple[Record, str]:
    """The record of one [[run]], and a note on columns left aside."""
    try:
        columns, ignored = read_columns(folder / entry.file)
    except InputError as error:
        raise InputError(f"run {entry.file}: {error}") from None
    t, u, v = (_taken(columns, kind) for kind in "tuv")
    record = make_record(
        entry.file, t[:, 0], u, v, sample_rate=entry.sample_rate, role=entry.role, hold=entry.hold, senses=entry.senses,
        conditions=columns,
    )  # fmt: skip
    return record, f"run {entry.file}: columns {', '.join(ignored)} are not used" if ignored else ""


def _taken(columns: dict[str, Floats], kind: str) -> Floats:
    """The columns t, or u_x and u_y, or v_x and v_y, taken out, shape (n, 1 or 2)."""
    names = [name for name in (kind, f"{kind}_x", f"{kind}_y") if name in columns]
    return np.stack([columns.pop(name) for name in names], axis=1)


def _as_position(stated: dict[str, float], records: Sequence[Record]) -> tuple[dict[str, float], list[str]]:
    """What is stated with gains as those of a position, and a note that says so where the sensors sense another."""
    if not records or records[0].order == 0:
        return stated, []
    first = records[0]
    gains = {n: g * first.reference**first.order for n, g in stated.items() if n in ("sense_gain_x", "sense_gain_y")}
    hertz = first.reference / (2 * np.pi)
    note = (
        f"v is a{'n' if first.order == 2 else ''} {first.senses}: gains are those that a position has at {hertz:.6g} Hz"
    )
    return stated | gains, [note]


def _believed(nominal: dict[str, float], records: tuple[Record, ...]) -> tuple[dict[str, float], list[str]]:
    """The nominal values; where no more than gains is given, or all but gains, those of the record's own response
    beside, and a note that says so."""
    fit = [record for record in records if record.role == "fit"]
    if not fit:
        return nominal, []
    needed, gains = NEEDED[fit[0].axes], [f"sense_gain_{axis}" for axis in "xy"[: fit[0].axes]]
    given, driven = {name for name in needed if name in nominal}, bool(fit[0].u.any())
    known = [nominal[name] for name in gains if name in given]
    if given and given - set(gains) and (known or not driven or "m" not in given):
        return nominal, []
    stated = [nominal.get(name, known[0] if known else 1.0) for name in gains]
    turned = [-gain for gain in stated] if known and driven and "m" not in given else stated
    tried = [stated, turned] if known else [sensor_gains(fit), stated]
    found = next((own for assumed in tried if (own := linear_start(fit, assumed))), None)
    if found is None:
        absent = ", ".join(name for name in needed if name not in given)
        why = "is v the answer to u" if driven else "do the runs ring for some ten periods at a small amplitude"
        raise InputError(f"[nominal] lacks {absent}, and no linear model of the runs gives them: {why}? "
                         "Fill them in, or name the device that has them")  # fmt: skip
    said = ""
    if "m" in given:
        # In a sensor of another gain, all of mass, stiffness and damping are larger by it.
        gain = nominal["m"] / found["m"]
        found = {name: gain * value for name, value in found.items()}
        said = f"{_gains_text(found, gains)}, of which the response is that of the mass given"
    elif not known or found[gains[0]] != stated[0]:
        said = _gains_text(found, gains)
        # A unit says how large a sensor's gain is, and not which way a record counts it.
        nominal = {name: value for name, value in nominal.items() if name not in gains}
    said += "" if driven else "; the mass is taken as 1 kg"
    values = ", ".join(f"{name} = {found[name]:.4g}" for name in needed if name not in given and name not in gains)
    from_record = f"from the record's own response {values} (SI)" if values else ""
    parts = "; ".join(part for part in (from_record, said.removeprefix("; ")) if part)
    return found | nominal, [f"[nominal] is {'short' if given else 'empty'}: {parts}"]


def _unknown_gains(stated: Mapping[str, float], records: Sequence[Record]) -> tuple[str, ...]:
    """Gains of two sensors that are not stated: both axes move one mass, which fixes their ratio under a force; where
    neither is stated, that of x is the unit of length."""
    absent = [name for name in ("sense_gain_x", "sense_gain_y") if name not in stated]
    return tuple(absent[-1:]) if is_driven(records) else ()


def _gains_text(found: Mapping[str, float], names: Sequence[str]) -> str:
    values = [found[name] for name in names]
    each = [values[0]] if len(set(values)) == 1 else values
    turned = ": it is connected the other way round, as the phase of the response shows" if min(values) < 0 else ""
    return f"the gain of the sensors is taken as {' and '.join(f'{value:.4g}' for value in each)} V/m{turned}"


def _completed(nominal: dict[str, float], axes: int) -> tuple[dict[str, float], list[str]]:
    """The nominal values for these axes, and a note on what was assumed."""
    if axes == 1:
        return {name: value for name, value in nominal.items() if name not in Y_ONLY}, []
    absent = [name for name in CROSS if name not in nominal]
    note = f"nominal {' and '.join(absent)} not given: taken as 0"
    return nominal | dict.fromkeys(absent, 0.0), [note] if absent else []


def _refuse_unknown(table: Mapping[str, Any], known: tuple[str, ...], what: str) -> None:
    for key in table:
        if key not in known:
            raise InputError(f"{what} {key!r} is unknown{nearest(key, known)}; there are {', '.join(known)}")
