"""The runs in a lab's table: cut at its holes, begun where a free decay begins, force and voltage together in time."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import make_interp_spline

from discrepancy.data.record import MINIMUM_SAMPLES, MOST_MISSING, Floats, measured_rate
from discrepancy.data.release import cut_off, released
from discrepancy.data.stretches import stretches
from discrepancy.data.trigger import late_by
from gyro_model.errors import InputError
from gyro_model.tables import SUFFIXES as LAB_SUFFIXES

LONGEST_HOLE: Final = 20
"""Rows missing at once that are masked; a longer hole, over which the force is not known, cuts the run."""
LEFT_OUT: Final = 7
"""Every such row is left out to see how well a rule fills it from those beside: further apart than a spline reaches."""
NONE: Final = "none"
"""In the place of a heading: no force acted, as in a free decay, or on the axis that is only sensed; of other columns
that the table has none."""
OFF_GRID, UNEVEN = 0.25, 0.05
"""Of a sample period, beyond which a step between samples is no multiple of it, and share of all steps that are such
from which on the stamps are uneven: lost rows leave multiples, and the jitter of a timer is less. Also of a sample
period, how far (rms) stamps may stand off an even grid where small steps have added up."""
WITHIN, FAR = 0.99, 3.0
"""Share of the steps that are at most the even one put in their place, and times that one, from which on no sample lies
near."""
ENDED: Final = 0.02
"""Of the largest motion of a free decay, below which nothing is left to judge a model by."""
FRAGMENT: Final = 0.05
"""Share of the longest run below which what a hole leaves is no run of its own, and of all rows to be held out."""

Rule = Callable[[Floats, Floats, Floats], Floats]
"""Values at rows from those that are given at others."""


class Piece(NamedTuple):
    """One run to be written: columns (n,) in SI; moved: unit of those of v that hold a motion."""

    name: str
    source: Path
    columns: Mapping[str, Floats]
    moved: Mapping[str, str] = MappingProxyType({})


def triggered(pieces: Sequence[Piece], said: list[str], order: int) -> tuple[list[Piece], list[str]]:
    """Runs whose voltage begins where the force does, and by how much it was moved."""
    found = []
    for piece in pieces:
        t, late = piece.columns["t"], late_by(piece.columns["u_x"], piece.columns["v_x"], order)
        if late and len(t) - abs(late) >= MINIMUM_SAMPLES:
            since, how = abs(late) / measured_rate(t), "later" if late > 0 else "earlier"
            said = [*said, f"{piece.name}: v was recorded {since:.4g} s {how} than u, as the response shows: moved"]
            shown = {c: slice(late, None) if late > 0 else slice(0, late) for c in ("v_x", "v_y")}
            rest = slice(0, len(t) - late) if late > 0 else slice(-late, None)
            piece = piece._replace(columns={c: own[shown.get(c, rest)] for c, own in piece.columns.items()})
        found.append(piece)
    return found, said


def let_go(pieces: Sequence[Piece], said: list[str]) -> tuple[list[Piece], list[str]]:
    """Free decays from where they were let go, and where that was; what is too short then stays as it was."""
    found = []
    for piece in pieces:
        shown = [values for column, values in piece.columns.items() if column in ("v_x", "v_y")]
        begin, how = released(shown), "let go"
        if not begin:
            begin, how = cut_off(shown), "left alone by a drive"
        if 0 < begin <= len(piece.columns["t"]) - MINIMUM_SAMPLES:
            since = piece.columns["t"][begin] - piece.columns["t"][0]
            said = [
                *said,
                f"{piece.name}: begins {since:.4g} s later, where it was {how}: no force is recorded before",
            ]
            piece = piece._replace(columns={column: values[begin:] for column, values in piece.columns.items()})
        found.append(piece)
    return found, said


def moving_until(piece: Piece) -> int:
    """The number of samples until the motion of a free decay has ended; all of a run under a force."""
    n = len(piece.columns["t"])
    if any(np.any(piece.columns[c]) for c in ("u_x", "u_y") if c in piece.columns):
        return n
    last = MINIMUM_SAMPLES
    for values in (piece.columns[c] for c in ("v_x", "v_y") if c in piece.columns):
        known = np.flatnonzero(np.isfinite(values))
        size = np.abs(values[known] - np.median(values[known[-MINIMUM_SAMPLES:]]))
        last = max(last, int(known[np.flatnonzero(size >= ENDED * size.max())[-1]]) + 1)
    return last


def cut(path: Path, columns: Mapping[str, Floats], said: list[str]) -> tuple[list[Piece], list[str]]:
    """The runs between holes of t and rows that hold no number; those too short are left out, and it is said."""
    columns, said = _filled(path, *_even(path, *_once(path, columns, said)))
    t = columns["t"]
    # A sample of v that is missing is masked later; anything else that is missing ends a run.
    needed = [values for column, values in columns.items() if not column.startswith("v_") or column == "v_bias"]
    whole = np.all([np.isfinite(values) for values in needed], axis=0)
    whole &= ~_long_gaps(columns)
    rows = np.flatnonzero(whole)
    if len(rows) < MINIMUM_SAMPLES:
        raise InputError(f"{path}: {len(rows)} rows hold numbers in every column; a run needs {MINIMUM_SAMPLES}")
    step = np.diff(t[rows])
    anew = _restarts(t[rows])
    if not (step[~anew] > 0).all():
        step = np.where(anew, 1.0, step)
        raise InputError(
            f"{path}: time does not increase after {t[rows][int(np.argmax(step <= 0))]:.9g} s: sort the rows, or, of "
            f"stamps that are rounded, give --map t={NONE} and --sample-rate HZ"
        )
    borders = np.flatnonzero((step > 1.5 * np.median(step)) | anew) + 1
    parts = np.split(rows, borders)
    least = max(MINIMUM_SAMPLES, FRAGMENT * max(map(len, parts)))
    parts = [part for part in parts if len(part) >= least]
    if not parts:
        raise InputError(f"{path}: holes leave no stretch of {MINIMUM_SAMPLES} rows")
    stem = path.name
    for suffix in sorted(LAB_SUFFIXES, key=len, reverse=True):
        stem = stem.removesuffix(suffix)
    names = [f"{stem}.parquet"] if len(parts) == 1 else [f"{stem}-{i}.parquet" for i in range(1, len(parts) + 1)]
    lost = len(t) - sum(map(len, parts))
    if len(borders) or lost:
        where = "where its time begins anew" if anew.any() else "at holes of its time"
        cut = f"cut into {len(parts)} runs {where}; " if len(parts) > 1 else ""
        said = [*said, f"{path.name}: {cut}{lost} of {len(t)} rows left out"]
    pieces = [Piece(n, path, {c: v[part] for c, v in columns.items()}) for n, part in zip(names, parts, strict=True)]
    return pieces, said


def _restarts(t: Floats) -> np.ndarray:
    """Whether a step of the time (n - 1,) is a fall from one run to the begin of the next, as of several runs in one
    table: by half of the run before at least, after which time rises as long as a run must be."""
    anew = np.diff(t) < 0
    borders = [0, *(np.flatnonzero(anew) + 1), len(t)]
    for begin, end, after in zip(borders, borders[1:], borders[2:], strict=False):
        long = min(end - begin, after - end) >= MINIMUM_SAMPLES
        anew[end - 1] = long and t[end - 1] - t[end] > 0.5 * (t[end - 1] - t[begin])
    return np.asarray(anew)


def _once(path: Path, columns: Mapping[str, Floats], said: list[str]) -> tuple[Mapping[str, Floats], list[str]]:
    """The columns without rows that repeat the one before in time and all else: a logger wrote them twice."""
    twice = np.concatenate(([False], np.all([np.diff(values) == 0 for values in columns.values()], axis=0)))
    if not twice.any():
        return columns, said
    said = [*said, f"{path.name}: {int(twice.sum())} rows left out that repeat the row before, its time too"]
    return {column: values[~twice] for column, values in columns.items()}, said


def _even(path: Path, columns: Mapping[str, Floats], said: list[str]) -> tuple[Mapping[str, Floats], list[str]]:
    """The columns at even times where a logger stamped samples as they came: by the rule that gives each best; v is
    missing where no sample lies near."""
    t = columns["t"]
    step = np.diff(t)
    if not (len(t) > 2 * LEFT_OUT * MINIMUM_SAMPLES and np.isfinite(t).all() and (step > 0).all()):
        return columns, said
    if _near_grid(t, step):
        return columns, said
    period = float(f"{np.quantile(step, WITHIN):.3g}")
    even = t[0] + period * np.arange(int((t[-1] - t[0]) / period) + 1)
    after = np.clip(np.searchsorted(t, even), 1, len(t) - 1)
    far = t[after] - t[after - 1] > FAR * period
    resampled = {"t": even}
    for column, values in columns.items():
        whole = np.isfinite(values)
        if column == "t" or whole.sum() < MINIMUM_SAMPLES:
            continue
        own = _best_rule(t[whole], values[whole])(t[whole], values[whole], even)
        resampled[column] = np.where(far, np.nan, own) if column in ("v_x", "v_y") else own
    return resampled, [*said, f"{path.name}: its stamps are uneven, {step.min():.3g} to {step.max():.3g} s apart: "
                              f"interpolated to every {period:g} s"]  # fmt: skip


def _near_grid(t: Floats, step: Floats) -> bool:
    """Whether the stamps lie near an even grid, of which rows may be missing."""
    periods = step / np.median(step)
    if np.mean(np.abs(periods - np.rint(periods)) > OFF_GRID) >= UNEVEN:
        return False
    places = np.concatenate(([0.0], np.cumsum(np.rint(periods))))
    straight = np.polynomial.Polynomial.fit(places, t, 1)
    return float(np.std(t - straight(places))) <= OFF_GRID * float(np.median(step))


def _filled(path: Path, columns: Mapping[str, Floats], said: list[str]) -> tuple[Mapping[str, Floats], list[str]]:
    """The columns with rows put in where a few are missing from the time: v is missing there, the rest goes on."""
    t = columns["t"]
    step = np.diff(t)
    if not (np.isfinite(t).all() and (step[~_restarts(t)] > 0).all() and len(t) > 2):
        return columns, said
    period = float(np.median(step))
    counts = np.maximum(np.rint(step / period).astype(int) - 1, 0)
    counts[counts > LONGEST_HOLE] = 0
    if not 0 < counts.sum() <= MOST_MISSING * len(t):
        return columns, said
    place = np.repeat(np.arange(len(step)) + 1, counts)
    known = np.insert(np.ones(len(t), np.bool_), place, False)
    k = np.arange(len(known), dtype=np.float64)
    filled = {column: np.insert(values, place, np.nan) if column in ("v_x", "v_y") else _between(k, known, values)
              for column, values in columns.items()}  # fmt: skip
    return filled, [*said, f"{path.name}: {len(place)} missing rows are put in with v masked"]


def _between(k: Floats, known: np.ndarray, values: Floats) -> Floats:
    """A column at rows ``k`` of which some are ``known``, by the rule that gives known rows best from those beside."""
    whole = np.isfinite(values)
    if whole.sum() < MINIMUM_SAMPLES:
        return np.insert(values, np.flatnonzero(~known) - np.arange((~known).sum()), np.nan)
    at, given = k[known][whole], values[whole]
    between = _best_rule(at, given)(at, given, k)
    between[known] = values
    return between


def _best_rule(at: Floats, given: Floats) -> Rule:
    """The rule that gives values, left out in turn, best from those beside."""
    left_out = np.zeros(len(at), np.bool_)
    left_out[LEFT_OUT:-LEFT_OUT:LEFT_OUT] = True

    def error(rule: Rule) -> float:
        return float(np.sum((rule(at[~left_out], given[~left_out], at[left_out]) - given[left_out]) ** 2))

    return min((_held, _straight, _smooth), key=error)


def _held(at: Floats, given: Floats, k: Floats) -> Floats:
    return given[np.maximum(np.searchsorted(at, k, side="right") - 1, 0)]


def _straight(at: Floats, given: Floats, k: Floats) -> Floats:
    return np.interp(k, at, given)


def _smooth(at: Floats, given: Floats, k: Floats) -> Floats:
    return np.asarray(make_interp_spline(at, given, k=5)(np.clip(k, at[0], at[-1])))


def _long_gaps(columns: Mapping[str, Floats]) -> np.ndarray:
    """Rows in stretches without v that are too long to mask."""
    gaps = ~np.all([np.isfinite(columns[c]) for c in ("v_x", "v_y") if c in columns], axis=0)
    if gaps.mean() > MOST_MISSING:
        return np.asarray(gaps)
    for begin, end in stretches(gaps):
        if end - begin <= LONGEST_HOLE:
            gaps[begin:end] = False
    return np.asarray(gaps)
