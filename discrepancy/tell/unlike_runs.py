"""Runs that differ by a gain, as after a range was switched, or by a delay, as where each was triggered by itself: one
model can not have them all."""

from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

from discrepancy.data.record import Floats, Record

MOST: Final = 0.5
"""Of what is left, by which a number of each run must take it to be spoken of."""


class _Kind(NamedTuple):
    """By what runs may differ: how that shows in a voltage (n, axes) of so many samples a second, and what is said of
    its size in each run."""

    shows: Callable[[Floats, float], Floats]
    text: Callable[[float], str]
    said: str


_KINDS: Final = (
    _Kind(
        lambda v, _: v,
        lambda size: f"{1 + size:.5g}",
        "the runs differ by a gain, which takes {share:.0%} of what is left: {each} times what the model says; state "
        "each run's gain, or look for what changed between them (a range, a supply, a temperature)",
    ),
    _Kind(
        lambda v, rate: -np.gradient(v, axis=0) * rate,
        lambda size: f"{size:+.3g} s",
        "the runs differ by a delay, which takes {share:.0%} of what is left: {each} later than the model says; move "
        "each run's force against its voltage, or look for what triggered them",
    ),
)


def unlike_runs(runs: Sequence[Record], residuals: Sequence[Floats]) -> str | None:
    """What to say where a gain or a delay of each run takes most of what a fit leaves, that which takes more; None
    where neither does.

    runs, residuals: of a fit of two runs or more, voltages and what is left of them (n, axes) [V].
    """
    if len(runs) < 2:
        return None
    found = [own for kind in _KINDS if (own := _taken(kind, runs, residuals))]
    return max(found)[1] if found else None


def _taken(kind: _Kind, runs: Sequence[Record], residuals: Sequence[Floats]) -> tuple[float, str] | None:
    """The share that it takes, and what to say."""
    shown = [kind.shows(run.v - own, run.sample_rate)[run.valid] for run, own in zip(runs, residuals, strict=True)]
    rests = [own[run.valid] for run, own in zip(runs, residuals, strict=True)]
    squares = np.array([float(np.sum(own**2)) for own in shown])
    products = np.array([float(np.sum(own * rest)) for own, rest in zip(shown, rests, strict=True)])
    if not np.isfinite(products).all() or not (squares > 0).all():
        return None
    sizes = products / squares
    # What all runs share is no difference.
    left = sum(float(np.sum(rest**2)) for rest in rests) - float(products.sum() ** 2 / squares.sum())
    after = left + float(products.sum() ** 2 / squares.sum() - products @ sizes)
    if not 0 < left < np.inf or after > (1 - MOST) * left:
        return None
    share = 1 - after / left
    each = ", ".join(f"{run.name} {kind.text(size)}" for run, size in zip(runs, sizes, strict=True))
    return share, kind.said.format(share=share, each=each)
