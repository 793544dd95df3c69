"""Which blocks make a cycle, and what is held out of one."""

import numpy as np
import pytest

from benchmarks.cycle_records import blocks, course
from calibration.compensation.cycles import count, cycle_numbers, hold_outs, last_cycle, memory_of
from calibration.compensation.record import joined

ONE = course(((55.0, 2.0), (-15.0, 2.0)))
MIDDLE_UP, UP_TO_MIDDLE = np.linspace(25, 60, 35), np.concatenate([np.linspace(-20, 25, 45), np.full(20, 25.0)])
UP, DOWN = np.linspace(-20, 60, 80), np.linspace(60, -20, 80)


@pytest.mark.parametrize(
    ("legs", "cycles"),
    [
        ([UP], 1),
        ([UP, DOWN], 1),
        ([UP, DOWN, UP], 1),
        ([UP, DOWN, UP, DOWN], 2),
        ([UP, DOWN] * 5, 5),
        ([DOWN, UP, DOWN, UP], 2),
        ([np.linspace(20, 60, 40), DOWN, UP, np.linspace(60, 20, 40)], 1),
        ([UP, DOWN[:20], UP[-20:], DOWN], 1),
        ([MIDDLE_UP, DOWN, UP_TO_MIDDLE] * 4, 4),
        ([MIDDLE_UP, DOWN, UP, DOWN, UP_TO_MIDDLE], 2),
    ],
)
def test_a_cycle_goes_through_the_range_and_back(legs: list[np.ndarray], cycles: int) -> None:
    numbers = cycle_numbers(np.concatenate(legs))
    assert numbers.max() + 1 == cycles
    assert (np.diff(numbers) >= 0).all()


def test_cycles_that_begin_between_the_ends_have_one_course() -> None:
    # A sensor that lags by 15 blocks never quite arrives in a rest of 20.
    ambient = np.concatenate([np.full(20, 25.0), *[MIDDLE_UP, DOWN, UP_TO_MIDDLE] * 4])
    lagged = ambient.copy()
    for k in range(1, len(ambient)):
        lagged[k] = lagged[k - 1] + (ambient[k] - lagged[k - 1]) / 15
    lengths = np.bincount(cycle_numbers(lagged))
    assert len(lengths) == 4
    assert lengths[1] == pytest.approx(180, abs=1) and lengths[2] == pytest.approx(180, abs=1)


def test_cycles_are_left_out_whole() -> None:
    both = joined([blocks(ONE, 1), blocks(ONE, 2)])
    assert count(both) == 2
    for fold in hold_outs(both, 100.0):
        assert fold.whole
        assert len(np.unique(both.cycle[fold.left_out])) == 1
        assert (fold.fitted == ~fold.left_out).all()
    assert (both.cycle[last_cycle(both, 100.0).left_out] == 1).all()


def test_of_one_cycle_parts_are_left_out_with_gaps() -> None:
    one = blocks(ONE, 1)
    for fold in hold_outs(one, 100.0):
        assert not fold.whole
        assert not (fold.fitted & fold.left_out).any()
        gap = np.abs(one.t[fold.fitted][:, None] - one.t[fold.left_out]).min()
        # A gap ends half a block of 10 s before the block beside it.
        assert 100.0 <= gap <= 120.0


def test_memory_is_that_of_what_a_curve_leaves() -> None:
    white, walking = (memory_of(blocks(course(), 1, walk=walk)) for walk in (0.0, 3e-6))
    # A curve of degree five leaves some of the curve even without a walk.
    assert walking > 1.5 * white
