"""Whether data that a fit did not see improve with an effect: cross-validation over runs, or pieces of one.

At the final fit the model is linear in what a part of the data can move. So the parameters are solved for from all
other blocks, with the effect and without it, and the blocks left out are predicted with both (M. Stone, J. Royal
Statistical Society B 36, 1974). The gain of each block has a mean and a scatter, and their ratio counts. So it is with
the logarithm by which a block's square falls: where a few blocks hold most of the motion, their gains alone would
scatter too much to say that every block is better. And it is set against what noise alone makes of the same two
predictions: an effect that few blocks show, a stop that is met now and then, is as sure as its size there, though most
blocks gain nothing. The clearest of the three decides.

Whole runs are left out, and pieces of all runs. Where one run alone is loud, the others know too little of a nonlinear
effect to predict it, while its own pieces do. So pieces count as well, unless runs contradict: what only imitates
another effect is of another size in each run, and predicts the next one worse than its own uncertainty explains.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from discrepancy.data.algebra import inverse_scaled
from discrepancy.data.record import Floats
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter

Ints = NDArray[np.intp]

PIECES: Final = 4
"""Of a run, each left out in turn."""
CONTRADICTS: Final = 9.0
"""Times what the deviations of its sizes cost a prediction, by which one that contradicts is worse than none: three
deviations."""


class Told(NamedTuple):
    """Of an effect: the gain on blocks left out over its standard deviation, of runs or of their pieces; seen: what its
    fit gains by it, in variances of an innovation, as far as the model is linear."""

    unseen: float
    seen: float


def told(fitter: Fitter, at: Fitted, effects: Sequence[tuple[Collection[str], Mapping[str, float]]]) -> list[Told]:
    """That of each effect: its parameters' names, and the values that switch it off."""
    linear = fitter.with_grams(at, [off for _, off in effects])
    assert linear.grams is not None
    runs, found = len(fitter.records), []
    for number, (names, _) in enumerate(effects):
        rest = [i for i, free in enumerate(linear.free) if free.name not in names]
        less, more = Linear(rest, linear.known + number), Linear(range(linear.known))
        seen = _left(linear.grams, less) - _left(linear.grams, more)
        found.append(Told(unseen_gain(linear.grams, less, more, at.variance, runs), seen / at.variance))
    return found


def steady_gain(fitter: Fitter, without: Fitted, at: Fitted) -> float:
    """By how much the squares of blocks fall from a fit to another, the mean over its deviation; of the run that is
    clear about it least."""
    before, after = (fitter.with_grams(own, []).grams for own in (without, at))
    assert before is not None and after is not None
    gains = before[:, -1, -1] - after[:, -1, -1]
    return min(_deviations(own) for own in np.array_split(gains, len(fitter.records)))


class Linear(NamedTuple):
    """A model near a fit, of columns whose products are known, the residual last. columns: those of what is free; out:
    the one that takes an effect out, None where all are in."""

    columns: Sequence[int]
    out: int | None = None


def unseen_gain(grams: Floats, less: Linear, more: Linear, variance: float, runs: int) -> float:
    """The gain of a model with one effect ``more``, over its deviation. grams (blocks, p, p), in the order of the runs;
    variance: of an innovation [V²]."""
    each = np.array_split(np.arange(len(grams)), runs)
    pieces = [np.concatenate([np.array_split(run, PIECES)[i] for run in each]) for i in range(PIECES)]
    by_pieces = _gain(grams, less, more, variance, pieces)
    if runs == 1:
        return by_pieces.clearest
    by_runs = _gain(grams, less, more, variance, each)
    contradicted = by_runs.total < -CONTRADICTS * by_runs.unsure
    return by_runs.steady if contradicted else max(by_runs.clearest, by_pieces.clearest)


class _Gain(NamedTuple):
    """total: by how much the squares fall [V²]; unsure: what the deviations of the effect's parameters add to them;
    steady: the mean fall over its deviation from block to block; above_noise: over what noise alone makes of the same
    predictions."""

    total: float
    unsure: float
    steady: float
    above_noise: float

    @property
    def clearest(self) -> float:
        return max(self.steady, self.above_noise)


def _gain(grams: Floats, less: Linear, more: Linear, variance: float, folds: Sequence[Ints]) -> _Gain:
    """Of blocks that are predicted from those that are not in their fold."""
    without, within = _predicted(grams, less, folds), _predicted(grams, more, folds)
    worse, better = (np.einsum("bi,bij,bj->b", p.steps, grams, p.steps) for p in (without, within))
    change = within.steps - without.steps
    size = np.einsum("bi,bij,bj->b", change, grams, change)
    cross = np.einsum("bi,bij,bj->b", change, grams, within.steps)
    # The cross products are what noise scatters; where they scatter more from block to block, it is no white noise.
    scatter = max(float(np.sum(cross**2)), variance * float(np.sum(size)), 1e-300)
    with np.errstate(divide="ignore", invalid="ignore"):
        steady = max(_deviations(worse - better), _deviations(np.log(worse / better)))
    total = float(np.sum(worse - better))
    return _Gain(total, variance * (within.spread - without.spread), steady, total / (2 * scatter**0.5))


def _left(grams: Floats, model: Linear) -> float:
    """The squares that a fit to all blocks leaves [V²]."""
    total, own, residual = grams.sum(axis=0), list(model.columns), _residual(model, grams.shape[1])
    right = total[own] @ residual
    return float(residual @ total @ residual - right @ inverse_scaled(total[np.ix_(own, own)]) @ right)


def _residual(model: Linear, columns: int) -> Floats:
    """What of each column makes the residual before anything is fitted."""
    residual = np.zeros(columns)
    residual[-1] = 1.0
    if model.out is not None:
        residual[model.out] = -1.0
    return residual


def _deviations(gain: Floats) -> float:
    """The mean over its standard deviation; 0 where there is none."""
    if len(gain) < 2 or not np.isfinite(gain).all():
        return 0.0
    return float(gain.mean()) / max(float(np.std(gain, ddof=1)) / len(gain) ** 0.5, 1e-300)


class _Predicted(NamedTuple):
    """steps (blocks, p): what of each column makes the residual of a block; spread: what the deviations of parameters
    add to all squares, in variances of an innovation."""

    steps: Floats
    spread: float


def _predicted(grams: Floats, model: Linear, folds: Sequence[Ints]) -> _Predicted:
    """Every block from those that are not in its fold."""
    own, residual = list(model.columns), _residual(model, grams.shape[1])
    total, steps, spread = grams.sum(axis=0), np.empty(grams.shape[:2]), 0.0
    for fold in folds:
        out = grams[fold].sum(axis=0)
        known = total - out
        inverse = inverse_scaled(known[np.ix_(own, own)])
        steps[fold] = residual
        steps[fold[:, None], own] -= inverse @ (known[own] @ residual)
        spread += float(np.sum(inverse * out[np.ix_(own, own)]))
    return _Predicted(steps, spread)
