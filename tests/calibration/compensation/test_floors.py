"""What no function can remove is what was put in that no function tells; methods that remember come down to it."""

import numpy as np
import pytest

from benchmarks.cycle_records import NOISE, blocks, course
from calibration.compensation.floors import Floor, floors
from calibration.compensation.methods.method import Asked
from calibration.compensation.record import joined
from calibration.compensation.trial import Trial, trial

pytestmark = pytest.mark.minutes(4)

BLOCK_NOISE = NOISE / np.sqrt(10)


def of(method: str, cycles: int = 4, legs: tuple[tuple[float, float], ...] | None = None, **sizes: float) -> Trial:
    """Fitted on cycles of one course, tested on one of another, or on the last."""
    turn_on = sizes.pop("turn_on", 0.0)
    fitted = [blocks(course(), seed, turn_on=turn_on * seed, **sizes) for seed in range(1, cycles)]
    test = blocks(course() if legs is None else course(legs), 9, turn_on=9 * turn_on, **sizes)
    if legs is None:
        return trial(joined([*fitted, test]), None, Asked(method), "clamp")
    return trial(joined(fitted), test, Asked(method), "clamp")


def test_white_noise_alone_is_the_floor_of_both() -> None:
    found = floors([blocks(course(), seed) for seed in range(1, 5)])
    for floor in found:
        assert isinstance(floor, Floor)
        # The mean of three others adds a third of the variance: 1.15; the local plane a little of the curve.
        assert 0.9 * BLOCK_NOISE < floor.rms < 1.4 * BLOCK_NOISE


def test_a_turn_on_is_the_floor_of_history() -> None:
    offsets = 50 * BLOCK_NOISE * np.array([1.0, -0.5, 0.8, -1.6, 0.3])
    found = floors([blocks(course(), k, turn_on=size) for k, size in enumerate(offsets.tolist())]).history
    assert isinstance(found, Floor)
    left = [size - np.delete(offsets, k).mean() for k, size in enumerate(offsets)]
    # White noise is 2 % of it.
    assert found.rms == pytest.approx(np.sqrt(np.mean(np.square(left))), rel=2e-3)


def test_the_interval_is_that_of_chi_square() -> None:
    found = floors([blocks(course(), seed, turn_on=1e-4 * seed) for seed in range(1, 4)]).history
    assert isinstance(found, Floor)
    # Tables of χ² at two degrees of freedom: 0.0506 and 7.378.
    assert found.low == pytest.approx(np.sqrt(2 / 7.378), rel=1e-3)
    assert found.high == pytest.approx(np.sqrt(2 / 0.0506), rel=1e-3)


def test_other_courses_give_no_floor_of_history() -> None:
    found = floors([blocks(course(), 1), blocks(course(((55.0, 1.0), (-15.0, 3.0))), 2)])
    assert isinstance(found.history, str)
    assert "same course" in found.history
    assert isinstance(floors([blocks(course(), 1)]).present, str)


def test_a_gap_and_courses_that_nearly_repeat_raise_no_floor() -> None:
    first, second = (blocks(course(((top, 2.0), (-15.0, 2.0))), seed) for seed, top in ((1, 55.0), (2, 54.0)))
    second = second.part((second.t < 3000) | (second.t > 3500))
    found = trial(joined([first, second]), None, Asked("spline"), "clamp")
    for floor in found.floors:
        assert isinstance(floor, Floor)
        # Of the raw rates, half a degree apart at 1e-4 rad/s/°C, it would be ten times as much.
        assert floor.rms < 2 * max(BLOCK_NOISE, found.judged[0].held_out.rms)


def test_a_method_that_remembers_meets_hysteresis_on_ramps_it_has_not_seen() -> None:
    sizes = {"play": 4e-5, "slow": 2e-5}
    other = ((55.0, 4.0), (-15.0, 1.0))
    remembers, forgets = (of(method, 4, other, **sizes).judged[0].held_out for method in ("history", "spline"))
    assert remembers.rms < 0.4 * forgets.rms
    # What is left is not only noise: plays and lags are laid on a grid, 0.1 °C of 5.
    assert remembers.rms < 10 * remembers.floor


@pytest.mark.parametrize(
    ("sizes", "method", "named"),
    [
        ({"play": 1e-4}, "piecewise", "hysteresis"),
        ({"slow": 1e-4}, "piecewise", "slow lag"),
        ({"walk": 3e-6}, "history", "walk"),
        ({"turn_on": 1e-4}, "history", "step at turn-on"),
    ],
)
def test_the_residual_is_named(sizes: dict[str, float], method: str, named: str) -> None:
    causes = [cause.name for cause in of(method, 4, **sizes).residual]
    assert any(name.startswith(named) for name in causes)
    # A walk goes on while the device is off: whole cycles then differ, too. Nothing else is named.
    others = ("step at turn-on", "walk", "none of these", "white noise")
    assert all(name.startswith((named, *others)) for name in causes)


def test_a_clean_residual_is_noise() -> None:
    causes = of("history").residual
    assert [cause.name for cause in causes] == ["white noise of the record"]
