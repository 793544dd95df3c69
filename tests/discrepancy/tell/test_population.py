"""The hierarchical estimate: coverage, individuals that do not belong, limits."""

import numpy as np
import pytest

from discrepancy.tell.population import Population, independent, population

CHANCE = 0.05 / 60
BAD = {3: 12.0, 17: -10.0, 44: 15.0}


def drawn(seed: int, n: int = 60) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """True values of spread 1 about 5 and a slope of 0.3, estimates, their deviations, columns."""
    rng = np.random.default_rng(seed)
    columns = np.array([(i % 8, i // 8) for i in range(n)], dtype=float)
    deviations = rng.uniform(0.2, 2.0, n)
    true = 5 + 0.3 * (columns[:, 0] - columns[:, 0].mean()) + rng.standard_normal(n)
    return true, true + deviations * rng.standard_normal(n), deviations, columns


def found_in(values: np.ndarray, deviations: np.ndarray, columns: np.ndarray) -> Population:
    result = population(values, deviations, columns, CHANCE)
    assert result is not None
    return result


def test_intervals_hold_the_truth_beside_outliers() -> None:
    held = {"mean": 0, "spread": 0, "slope": 0, "none": 0, "individuals": 0, "chance": 0}
    trials = 100
    for seed in range(trials):
        true, values, deviations, columns = drawn(seed)
        for i, off in BAD.items():
            values[i] += off
        found = found_in(values, deviations, columns)
        held["mean"] += found.mean.low < 5 < found.mean.high
        held["spread"] += found.spread.low < 1 < found.spread.high
        held["slope"] += found.slopes[0].low < 0.3 < found.slopes[0].high
        held["none"] += found.slopes[1].low < 0 < found.slopes[1].high
        inside = [own.low < t < own.high for i, (own, t) in enumerate(zip(found.individuals, true, strict=True))
                  if i not in BAD]  # fmt: skip
        held["individuals"] += sum(inside)
        held["chance"] += len(set(found.outliers) - set(BAD))
    # 95 of 100 are meant; 88 and fewer come once in 400 trials of a right interval.
    assert min(held[name] for name in ("mean", "spread", "slope", "none")) > 88
    # 5,700 individuals, in trials that share a mean: 0.95 to a standard error of about 0.005.
    assert 0.925 < held["individuals"] / (trials * 57) < 0.975
    # A trial has a chance of 0.05 to call any of its 60 one: 5 are meant, 12 come once in 1,000.
    assert held["chance"] <= 12


def test_those_that_do_not_belong_are_found_however_far() -> None:
    for far in (1e2, 1e6):
        _, values, deviations, columns = drawn(1)
        values[[3, 17, 44]] += far
        found = found_in(values, deviations, columns)
        assert found.outliers == (3, 17, 44)
        assert found.individuals[3].value == pytest.approx(values[3])


def test_a_scale_and_an_offset_change_nothing_else() -> None:
    _, values, deviations, columns = drawn(2)
    plain, scaled = found_in(values, deviations, columns), found_in(1e-9 * values + 1, 1e-9 * deviations, columns)
    # Values of 1 + 1e-9 hold 1e-9 of themselves to 1e-7.
    assert scaled.spread.value == pytest.approx(1e-9 * plain.spread.value, rel=1e-4)
    assert scaled.outliers == plain.outliers


def test_without_a_spread_it_is_the_weighted_mean() -> None:
    rng = np.random.default_rng(5)
    deviations = np.geomspace(0.01, 1.0, 20)
    # Less scatter than the deviations say: no spread is left.
    values = 3 + 0.3 * deviations * rng.standard_normal(20)
    found = found_in(values, deviations, np.empty((20, 0)))
    weight = deviations**-2.0
    assert found.spread.value == 0.0
    # In units of the scatter, of which the median is taken out before: rounding alone.
    assert found.mean.value == pytest.approx(float(weight @ values / weight.sum()), rel=1e-12)
    assert found.individuals[-1].value == pytest.approx(found.mean.value, abs=1e-12)


def test_values_known_exactly_keep_their_place() -> None:
    values = np.array([1.0, 2.0, 4.0, 3.0, 2.5, 1.5])
    found = found_in(values, np.zeros(6), np.empty((6, 0)))
    assert [own.value for own in found.individuals] == pytest.approx(values)
    # The restricted likelihood of values alone has its maximum at the sample's standard deviation.
    assert found.spread.value == pytest.approx(float(np.std(values, ddof=1)), rel=1e-4)


def test_nothing_is_said_of_a_few_or_of_equals_that_scatter() -> None:
    assert population(np.ones(4), np.ones(4), np.empty((4, 0)), CHANCE) is None
    equal = found_in(np.full(8, 7.0), np.full(8, 0.5), np.empty((8, 0)))
    assert equal.mean.value == 7.0
    assert equal.spread.value == 0.0
    assert equal.outliers == ()


def test_columns_that_can_not_be_told_apart_say_nothing() -> None:
    _, values, deviations, columns = drawn(3)
    assert independent(columns)
    for second in (np.full(60, 2.0), 3 - 7 * columns[:, 0]):
        columns[:, 1] = second
        assert not independent(columns)
        assert population(values, deviations, columns, CHANCE) is None
