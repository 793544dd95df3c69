"""Whether data that a fit did not see improve with an effect: cross-validation over runs, or pieces of one.

At the final fit the model is linear in what a part of the data can move. So the parameters are solved for from the
blocks of all other runs, with the effect and without it, and the blocks left out are predicted with both (M. Stone,
J. Royal Statistical Society B 36, 1974). The gain of each block has a mean and a scatter, and their ratio counts. So
it is with the logarithm by which a block's square falls: where a few blocks hold most of the motion, their gains alone
would scatter too much to say that every block is better. The clearer of the two decides.
"""

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from discrepancy.algebra import inverse_scaled
from discrepancy.fitted import Fitted
from discrepancy.record import Floats
from discrepancy.refit import Fitter
from discrepancy.score import without

PIECES: Final = 4
"""Of the only run, each left out in turn."""


def unseen_gains(
    fitter: Fitter, at: Fitted, effects: Sequence[tuple[Collection[str], Mapping[str, float]]]
) -> list[float]:
    """By effect (its parameters' names, and the values that switch it off), the mean gain on blocks left out over the
    standard deviation of that mean; of the square or of its logarithm, whichever is more."""
    linear = fitter.with_grams(at, [off for _, off in effects])
    assert linear.grams is not None
    folds = _folds(linear.grams, len(fitter.records))
    gains = []
    for number, (names, _) in enumerate(effects):
        rest = [i for i, free in enumerate(linear.free) if free.name not in names]
        less = without(linear.grams, linear.known + number)
        worse = np.concatenate([_loss(less, rest, fold) for fold in folds])
        better = np.concatenate([_loss(linear.grams, range(linear.known), fold) for fold in folds])
        with np.errstate(divide="ignore", invalid="ignore"):
            gains.append(max(_deviations(worse - better), _deviations(np.log(worse / better))))
    return gains


def _deviations(gain: Floats) -> float:
    """The mean over its standard deviation; 0 where there is none."""
    if len(gain) < 2 or not np.isfinite(gain).all():
        return 0.0
    return float(gain.mean()) / max(float(np.std(gain, ddof=1)) / len(gain) ** 0.5, 1e-300)


def _folds(grams: Floats, runs: int) -> list[slice]:
    parts = runs if runs > 1 else PIECES
    edges = np.linspace(0, len(grams), parts + 1).astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]


def _loss(grams: Floats, columns: Sequence[int], fold: slice) -> Floats:
    """Of each block in ``fold``, the square that parameters from the others leave [V²]."""
    own = [*columns, grams.shape[1] - 1]
    chosen = grams[:, own][:, :, own]
    kept = chosen.sum(axis=0) - chosen[fold].sum(axis=0)
    step = np.append(-inverse_scaled(kept[:-1, :-1]) @ kept[:-1, -1], 1.0)
    return np.asarray(np.einsum("i,bij,j->b", step, chosen[fold], step))
