"""Whether data that a fit did not see improve with an effect: cross-validation over runs, or pieces of one.

At the final fit the model is linear in what a part of the data can move. So the parameters are solved for from all
other blocks, with the effect and without it, and the blocks left out are predicted with both (M. Stone, J. Royal
Statistical Society B 36, 1974). The gain of each block has a mean and a scatter, and their ratio counts. So it is with
the logarithm by which a block's square falls: where a few blocks hold most of the motion, their gains alone would
scatter too much to say that every block is better. The clearer of the two decides.

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
from discrepancy.name.score import without

Ints = NDArray[np.intp]

PIECES: Final = 4
"""Of a run, each left out in turn."""
CONTRADICTS: Final = 9.0
"""Times what the deviations of its sizes cost a prediction, by which one that contradicts is worse than none: three
deviations."""


def unseen_gains(
    fitter: Fitter, at: Fitted, effects: Sequence[tuple[Collection[str], Mapping[str, float]]]
) -> list[float]:
    """By effect (its parameters' names, and the values that switch it off), the mean gain on blocks left out over the
    standard deviation of that mean; of the square or of its logarithm, of runs or of their pieces."""
    linear = fitter.with_grams(at, [off for _, off in effects])
    assert linear.grams is not None
    runs, gains = len(fitter.records), []
    for number, (names, _) in enumerate(effects):
        rest = [i for i, free in enumerate(linear.free) if free.name not in names]
        less = Linear(without(linear.grams, linear.known + number), rest)
        gains.append(unseen_gain(less, Linear(linear.grams, range(linear.known)), at.variance, runs))
    return gains


class Linear(NamedTuple):
    """A model near its fit. grams (blocks, p, p): of columns, the residual last, in the order of the runs; columns:
    those of what is free."""

    grams: Floats
    columns: Sequence[int]


def unseen_gain(less: Linear, more: Linear, variance: float, runs: int) -> float:
    """The gain of a model with one effect ``more``, over its deviation; variance: of an innovation [V²]."""
    blocks = len(more.grams)
    each = np.array_split(np.arange(blocks), runs)
    pieces = [np.concatenate([np.array_split(run, PIECES)[i] for run in each]) for i in range(PIECES)]
    worse, better = _losses(less, pieces), _losses(more, pieces)
    by_pieces = _clearest(worse.square, better.square)
    if runs == 1:
        return by_pieces
    worse, better = _losses(less, each), _losses(more, each)
    by_runs = _clearest(worse.square, better.square)
    unsure = variance * (better.spread - worse.spread)
    contradicted = float(np.sum(worse.square - better.square)) < -CONTRADICTS * unsure
    return by_runs if contradicted else max(by_runs, by_pieces)


def _clearest(worse: Floats, better: Floats) -> float:
    with np.errstate(divide="ignore", invalid="ignore"):
        return max(_deviations(worse - better), _deviations(np.log(worse / better)))


def _deviations(gain: Floats) -> float:
    """The mean over its standard deviation; 0 where there is none."""
    if len(gain) < 2 or not np.isfinite(gain).all():
        return 0.0
    return float(gain.mean()) / max(float(np.std(gain, ddof=1)) / len(gain) ** 0.5, 1e-300)


class _Losses(NamedTuple):
    """square: of each block, what parameters from others leave [V²]; spread: what their deviations add to all squares,
    in variances of an innovation."""

    square: Floats
    spread: float


def _losses(model: Linear, folds: Sequence[Ints]) -> _Losses:
    """Every block predicted from those that are not in its fold."""
    own = [*model.columns, model.grams.shape[1] - 1]
    chosen = model.grams[:, own][:, :, own]
    total, square, spread = chosen.sum(axis=0), np.empty(len(chosen)), 0.0
    for fold in folds:
        out = chosen[fold].sum(axis=0)
        inverse = inverse_scaled((total - out)[:-1, :-1])
        step = np.append(-inverse @ (total - out)[:-1, -1], 1.0)
        square[fold] = np.einsum("i,bij,j->b", step, chosen[fold], step)
        spread += float(np.sum(inverse * out[:-1, :-1]))
    return _Losses(square, spread)
