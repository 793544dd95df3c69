"""Gains on data that a fit did not see, on columns that are noise: every prediction is linear in them."""

from collections.abc import Collection, Sequence

import numpy as np
import pytest

from discrepancy.data.record import Floats
from discrepancy.name.unseen import Linear, unseen_gain

BLOCKS, SAMPLES, KNOWN = 16, 200, 4
"""Of a run, of a block, and how many columns a model has without the effect."""
RUNS = 3
ALL, HARDLY = range(RUNS * BLOCKS), 1e-4
"""All blocks, and of a column in others than those that show it."""


def gain(
    loudness: Sequence[float], sizes: Sequence[float], seed: int, noise: float = 1.0, shown: Collection[int] = ALL
) -> float:
    """What ``unseen_gain`` says of a column of unit power times ``loudness`` of each run, in the blocks where it is
    ``shown``, where the data hold it with the ``sizes``."""
    rng = np.random.default_rng(seed)
    grams = []
    for run, (loud, size) in enumerate(zip(loudness, sizes, strict=True)):
        for block in range(BLOCKS):
            own = rng.standard_normal((KNOWN, SAMPLES))
            column = loud * (1.0 if run * BLOCKS + block in shown else HARDLY) * rng.standard_normal(SAMPLES)
            grams.append(gram([*own, -column, size * column + noise * rng.standard_normal(SAMPLES)]))
    # The model is the fit without the effect: taking it out changes nothing.
    found = np.array(grams)
    return unseen_gain(found, Linear(range(KNOWN)), Linear(range(KNOWN + 1)), noise**2, RUNS)


def gram(columns: Sequence[Floats]) -> Floats:
    """The products of all with all."""
    stacked = np.array(columns)
    return np.asarray(stacked @ stacked.T)


@pytest.mark.parametrize("loudness", [(1.0, 1.0, 1.0), (1.0, 0.3, 0.3), (1.0, 0.2, 0.05), (1.0, 0.01, 0.01)])
def test_an_effect_of_30_deviations_stays_however_loud_the_runs_are(loudness: Sequence[float]) -> None:
    size = 30 / np.sqrt(BLOCKS * SAMPLES * float(np.sum(np.square(loudness))))
    gains = [gain(loudness, [size] * RUNS, seed) for seed in range(40)]
    assert np.quantile(gains, 0.05) > 3.0


def test_what_is_right_in_one_run_only_goes() -> None:
    # A size of another sign in each run, as of an effect that imitates another.
    gains = [gain((1.0, 1.0, 1.0), (0.4, -0.3, 0.2), seed) for seed in range(40)]
    assert max(gains) < 3.0


def test_an_imitation_that_fits_one_run_half_as_well_as_the_others_does_not_count_as_right() -> None:
    gains = [gain((1.0, 0.3, 0.3), (0.1, 1.0, 1.0), seed) for seed in range(40)]
    assert max(gains) < 3.0


def test_needless_effects_rarely_get_as_far() -> None:
    gains = [gain((1.0, 1.0, 1.0), (0.0, 0.0, 0.0), seed) for seed in range(2000)]
    # 1 in 740 of a normal distribution beyond three deviations; the mean of a needless gain is below zero.
    assert sum(g > 3.0 for g in gains) <= 3
    assert np.mean(gains) < 0


@pytest.mark.parametrize("shown", [(1, 11, 36), (17, 22, 27, 30)])
def test_an_effect_that_few_blocks_show_stays(shown: Collection[int]) -> None:
    size = 30 / np.sqrt(len(shown) * SAMPLES)
    gains = [gain((1.0, 1.0, 1.0), [size] * RUNS, seed, shown=shown) for seed in range(40)]
    assert np.quantile(gains, 0.05) > 3.0


def test_what_a_single_block_shows_nothing_confirms() -> None:
    gains = [gain((1.0, 1.0, 1.0), (3.0, 0.0, 0.0), seed, shown=(5,)) for seed in range(40)]
    assert max(gains) < 3.0
