"""What the estimators make of one record whose truth is known, and of many."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from benchmarks.report import Row, row
from calibration.mode_split import Question, VoltageRecord, correlations, find_split
from gyro_model.errors import InputError

TARGET: Final = 1.2
RIGHT: Final = 5.0
"""Half-widths within which an answer of the cross-correlation counts as the hump's."""


class Truth(NamedTuple):
    """f_x: what the estimator is told, f_y, bound: Cramér–Rao of f_y, half_width of the hump [Hz]."""

    f_x: float
    f_y: float
    bound: float
    half_width: float


class Outcome(NamedTuple):
    """Errors over the bound, NaN where there was no answer; whether the 95 % interval held the truth."""

    likelihood: float
    held: bool
    printed: float
    cut: float


def judge(record: VoltageRecord, truth: Truth, span: float | None = None) -> Outcome:
    """Likelihood, correlation as printed, correlation without the line. Q is given to none of them; span: half-width of
    the band searched [Hz]. A record that is refused, for whatever reason, has no answer."""
    try:
        analysis = find_split(record, Question(drive_frequency=truth.f_x, span=span))
    except InputError:
        return Outcome(np.nan, True, np.nan, np.nan)
    low, high = analysis.split.interval
    printed, cut = (_right(answer.f_y, truth) / truth.bound for answer, _ in correlations(analysis))
    error = (analysis.split.f_y - truth.f_y) / truth.bound
    return Outcome(error, low <= truth.f_y <= high, printed, cut)


def outcome_row(what: str, outcomes: Sequence[Outcome], judged: bool, note: str = "") -> Row:
    """Rms errors over the bound of the records that answered, their mean, and how many did."""
    answered = [o for o in outcomes if np.isfinite(o.likelihood)]
    values = {
        "likelihood": _rms([o.likelihood for o in outcomes]),
        "mean": float(np.mean([o.likelihood for o in answered])) if answered else np.nan,
        "found": len(answered) / len(outcomes),
        "in 95 %": sum(o.held for o in answered) / len(answered) if answered else np.nan,
        "cross-correlation": _rms([o.printed for o in outcomes]),
        "its share right": _share([o.printed for o in outcomes]),
        "line removed": _rms([o.cut for o in outcomes]),
        "share right": _share([o.cut for o in outcomes]),
    }
    return row(what, "σ/bound", values, limit=TARGET if judged else None, judged=("likelihood",), note=note)


def _right(f_y: float | None, truth: Truth) -> float:
    error = np.nan if f_y is None else f_y - truth.f_y
    return float(error) if abs(error) <= RIGHT * truth.half_width else np.nan


def _rms(values: Sequence[float]) -> float:
    finite = np.array([value for value in values if np.isfinite(value)])
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else np.inf


def _share(values: Sequence[float]) -> float:
    return float(np.isfinite(values).mean())
