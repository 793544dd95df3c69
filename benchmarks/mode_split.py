"""Split from noise: errors of the likelihood over its bound, the source's cross-correlation beside it, both loops."""

from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import Final, NamedTuple
from zlib import crc32

import numpy as np

from benchmarks import split_loops
from benchmarks.report import Options, Report, Row, Table, row
from benchmarks.split_envelope import envelope_rows, matching_rows
from benchmarks.split_fmu import fmu_rows
from benchmarks.split_loops import masking_rows, tracking_rows
from benchmarks.split_records import SenseAxis, make_envelope, make_record
from cosim.mode_split import (
    NothingFoundError,
    Question,
    correlations,
    find_split,
    frequency_bound,
)

RECORDS_A_SEED: Final = 10
"""Records of every point, times the seeds asked for: 100 by default."""
TARGET: Final = 1.2
LOOP_RUNS: Final = 1
"""Runs of a track and of the matching loop at most: one is 80 minutes of record in 480 blocks."""
NARROW: Final = 5000.0
"""Q from which the records are made as envelopes."""
RIGHT: Final = 5.0
"""Half-widths within which an answer of the cross-correlation counts as the hump's."""


class Point(NamedTuple):
    """Q, hump over the floor [dB], split [line widths f/Q], length [decay times Q/(π f)], line [°/s]."""

    q: float
    hump_db: float
    widths: float
    decays: float = 150.0
    line_deg: float = 300.0

    @property
    def axis(self) -> SenseAxis:
        """The sense axis of this point."""
        return SenseAxis(
            q=self.q, hump_db=self.hump_db, f_y=3000.0 + self.widths * 3000.0 / self.q, line_deg=self.line_deg
        )

    @property
    def duration(self) -> float:
        """Length of a record [s]."""
        return self.decays / self.axis.decay

    @property
    def bound(self) -> float:
        """Cramér–Rao bound of f_y [Hz], all else known."""
        return frequency_bound(
            self.axis.f_y, self.q, self.duration, 10 ** (self.hump_db / 10) / (1 + self.axis.flicker)
        )

    def seed(self, number: int) -> int:
        """Of the ``number``-th record: no two points share their noise, which scales with the line width."""
        return crc32(self.name.encode()) + number

    @property
    def name(self) -> str:
        """As a row's text."""
        return (
            f"Q {self.q:g}, hump {self.hump_db:g} dB, split {self.widths:g} line widths, "
            f"T = {self.decays:g} Q/(πf), line {self.line_deg:g} °/s"
        )


GRID: Final = [
    *(Point(q, db, 5) for q in (500, 5000, 50000) for db in (6, 20, 40)),
    *(Point(q, 20, 50) for q in (500, 5000, 50000)),
]
BREAKS: Final = [
    *(Point(NARROW, 20, widths) for widths in (0.0, 0.25, 1, 300)),
    *(Point(NARROW, 20, widths, line_deg=1.0) for widths in (1, 5, 50)),
    *(Point(NARROW, db, 5) for db in (0, -6, -10)),
    *(Point(NARROW, 20, 5, decays) for decays in (75, 40, 26)),
]


class Outcome(NamedTuple):
    """Errors over the bound, NaN where there was no answer; whether the 95 % interval held the truth."""

    likelihood: float
    held: bool
    printed: float
    cut: float


def measure(point: Point, seed: int) -> Outcome:
    """One record: likelihood, correlation as printed, correlation without the line. Q is given to none of them."""
    axis = point.axis
    make = make_envelope if point.q >= NARROW else make_record
    record = make(axis, point.duration, point.seed(seed))
    try:
        analysis = find_split(record, Question(drive_frequency=axis.f_x))
    except NothingFoundError:
        return Outcome(np.nan, True, np.nan, np.nan)
    low, high = analysis.split.interval
    printed, cut = (_right(answer.f_y, axis) / point.bound for answer, _ in correlations(analysis))
    return Outcome((analysis.split.f_y - axis.f_y) / point.bound, low <= axis.f_y <= high, printed, cut)


def false_alarm(q: float | None, seed: int) -> bool:
    """Whether a record without thermal motion gives a number."""
    axis = Point(NARROW, 20, 5).axis
    record = make_envelope(axis, 150 / axis.decay, 10_000 + seed, hot=False)
    try:
        find_split(record, Question(q=q, drive_frequency=axis.f_x))
    except NothingFoundError:
        return False
    return True


def likelihood_rows(points: Sequence[Point], count: int, jobs: int, judged: bool) -> list[Row]:
    """Of every point: rms errors over the bound of those that answered, and how many did."""
    rows = []
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for point in points:
            outcomes = list(pool.map(partial(measure, point), range(count), chunksize=4))
            answered = [o for o in outcomes if np.isfinite(o.likelihood)]
            values = {
                "likelihood": _rms([o.likelihood for o in outcomes]),
                "found": len(answered) / count,
                "in 95 %": sum(o.held for o in answered) / max(len(answered), 1),
                "cross-correlation": _rms([o.printed for o in outcomes]),
                "its share right": sum(np.isfinite(o.printed) for o in outcomes) / count,
                "line removed": _rms([o.cut for o in outcomes]),
                "share right": sum(np.isfinite(o.cut) for o in outcomes) / count,
            }
            limit = TARGET if judged else None
            rows.append(row(point.name, "σ/bound", values, limit=limit, judged=("likelihood",)))
    return rows


def false_alarm_rows(count: int, jobs: int) -> list[Row]:
    """How many records of floor and line alone give a number."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        shares = {
            name: sum(pool.map(partial(false_alarm, q), range(count), chunksize=8)) / count
            for name, q in (("Q found", None), ("Q given", NARROW))
        }
    return [row(f"records without a hump that give a number, of {count}", "1", shares, limit=0.01)]


def run(options: Options) -> Report:
    """All tables."""
    count = RECORDS_A_SEED * options.seeds
    runs = min(options.seeds, LOOP_RUNS)
    tables = [
        Table("Error of f_y over its Cramér–Rao bound", likelihood_rows(GRID, count, options.jobs, True)),
        Table(
            f"Where it breaks, {count // 5} records a point", likelihood_rows(BREAKS, count // 5, options.jobs, False)
        ),
        Table("False alarms", false_alarm_rows(2 * count, options.jobs)),
        Table("What the mask leaves where the line sits on the hump", masking_rows()),
        Table("Split followed through a ramp", tracking_rows(runs)),
        Table("Mode matching by bias", [*matching_rows(runs), *split_loops.matching_rows(runs)]),
        Table("Records of the envelope FMU", envelope_rows(3 * count // 10, options.jobs)),
        Table("Records of the full FMU", fmu_rows(count // 5, options.jobs)),
    ]
    notes = [
        "Bound: σ_f = √(Γ/(T g))/2π, Γ = πf/Q, with all but f_y known; Q, hump and floor are found by the fit.",
        "A line of 300 °/s at 1 µm of drive is some 60 dB above the power of the hump at 50 Hz of split. An answer of "
        f"the cross-correlation is right within {RIGHT:g} half-widths of f_y; errors are of the right ones. It was "
        "given the Q that the likelihood found.",
        f"Records: exact second-order process at 12 kHz below Q = {NARROW:g}, exact envelope process from there on.",
    ]
    return Report("mode_split", f"Mode split from noise, {count} records a point", tables, notes)


def _right(f_y: float | None, axis: SenseAxis) -> float:
    error = np.nan if f_y is None else f_y - axis.f_y
    return float(error) if abs(error) <= RIGHT * axis.half_width else np.nan


def _rms(values: Sequence[float]) -> float:
    finite = np.array([value for value in values if np.isfinite(value)])
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else np.inf
