"""Blocks, points and measures of a temperature test, by hand."""

import numpy as np
import pytest

from calibration.compensation.measures import Curve, change, expected_range, passes
from calibration.compensation.points import bias_points, scale_points
from calibration.compensation.record import Blocks, TemperatureTest, make_blocks
from gyro_model.errors import InputError

STEP = 0.1
T = STEP * np.arange(1, 4001)
TRUE = 0.5 * np.array([0, 1, 0, -1])[((T - STEP / 2) // 10).astype(int) % 4]
WARM = 20 + 0.01 * T


def a_test(rate: np.ndarray = TRUE, true: np.ndarray = TRUE, **signals: np.ndarray) -> TemperatureTest:
    return TemperatureTest(T, rate, true, signals or {"structure": WARM}, name="a test")


def test_blocks_are_means_less_the_settling_after_a_step() -> None:
    transient = TRUE + np.where((T - STEP / 2) % 10 < 0.9, 0.3, 0.0)
    blocks = make_blocks(a_test(transient), 10.0, 1.0)
    # 40 blocks of 10 s; the first gives only a start to the first derivative.
    assert len(blocks) == 39
    # Means of 90 equal numbers: rounding.
    assert blocks.rate == pytest.approx(blocks.rate_true, abs=1e-13)
    assert blocks.inputs["structure_rate"] == pytest.approx(0.01, rel=1e-9)
    assert blocks.inputs["structure"] == pytest.approx(20 + 0.01 * blocks.t, rel=1e-12)


def test_noise_of_a_block_is_its_standard_error_about_a_line() -> None:
    rng = np.random.default_rng(1)
    blocks = make_blocks(a_test(TRUE + 1e-3 * T + 0.02 * rng.standard_normal(len(T))), 10.0, 0.0)
    # 40 variances of 98 degrees of freedom: their median is good to 3 %.
    assert np.median(blocks.noise) == pytest.approx(0.02 / np.sqrt(100), rel=0.05)


def test_scale_factor_and_bias_come_apart_while_the_bias_drifts() -> None:
    blocks = make_blocks(a_test(1.01 * TRUE + 1e-3 + 1e-6 * T**2 - 1e-9 * T**3), 10.0, 1.0)
    found = scale_points(blocks)
    # A cubic in time is followed exactly but for the means over 10 s of it: T² step²/12 stays a constant offset.
    assert found.value == pytest.approx(1.01, abs=1e-6)
    rest = bias_points(blocks, np.full(len(blocks), 2.0))
    assert rest.value == pytest.approx(0.5 * blocks.rate[blocks.at_rest], rel=1e-12)


def test_a_test_at_rest_has_no_scale_factor() -> None:
    assert len(scale_points(make_blocks(a_test(WARM, 0 * T), 10.0, 1.0)).value) == 0


def test_a_test_that_never_rests_is_refused() -> None:
    blocks = make_blocks(a_test(true=TRUE + 2), 10.0, 1.0)
    with pytest.raises(InputError, match="0 stretches at rest"):
        scale_points(blocks)
    with pytest.raises(InputError, match="no block at rest"):
        bias_points(blocks)


@pytest.mark.parametrize(
    ("change_of", "text"),
    [
        ({"structure": np.where(T > 300, np.nan, WARM)}, "structure is no finite number in data row 3001"),
        ({}, "neither a temperature nor"),
    ],
)
def test_wrong_rows_are_refused(change_of: dict[str, np.ndarray], text: str) -> None:
    with pytest.raises(InputError, match=text):
        TemperatureTest(T, TRUE, TRUE, change_of, name="a test")


def test_time_that_goes_back_is_refused() -> None:
    back = T.copy()
    back[100] = back[99]
    with pytest.raises(InputError, match="t does not increase at data row 101"):
        TemperatureTest(back, TRUE, TRUE, {"structure": WARM})


def test_too_few_blocks_are_refused() -> None:
    with pytest.raises(InputError, match=r"blocks of 100 s .* shorter --sampling-time"):
        make_blocks(a_test(0 * T, 0 * T), 100.0, 1.0)


def blocks_at(temperature: np.ndarray) -> Blocks:
    n = len(temperature)
    return Blocks(10.0 * np.arange(n), *np.zeros((3, n)), {"structure": temperature})


def test_up_and_down_are_passes_of_their_own() -> None:
    up = np.linspace(-20, 60, 161)
    group = passes(blocks_at(np.concatenate([up, up[::-1]])))
    low, high = group[:161], group[161:]
    # Only the pass at the turning point holds both.
    assert len(set(low) & set(high)) == 1
    # 161 blocks half a degree apart, five to a pass of 2 °C, twice.
    assert 64 <= group[-1] + 1 <= 66


def test_settled_blocks_are_those_at_rest() -> None:
    temperature = np.concatenate([np.full(60, 20.0), 20 + 0.2 * np.arange(60), np.full(60, 31.8)])
    settled = blocks_at(temperature).settled
    # The slope is taken over 120 s, 12 blocks, either side.
    assert settled[:48].all() and settled[132:].all()
    assert not settled[60:120].any()


def test_coefficient_is_the_range_over_the_temperatures() -> None:
    curve = Curve(np.arange(3.0), np.array([0.0, 10.0, 40.0]), np.array([1.0, 9.0, 5.0]), np.array([0.0, -0.1, 0.1]),
                  np.full(3, 0.01))  # fmt: skip
    found = change(curve)
    assert (found.before, found.after, found.factor) == pytest.approx((0.2, 0.005, 40.0))


def test_expected_range_of_noise() -> None:
    # Two normals: 2/√π; ten: 3.0775 (Tippett 1925). The grid of 2001 points is good to 1e-4.
    assert expected_range(np.ones(2)) == pytest.approx(2 / np.sqrt(np.pi), rel=1e-4)
    assert expected_range(np.full(10, 2.0)) == pytest.approx(2 * 3.07751, rel=1e-4)
    # One wide and many that are almost exact: the range is |wide| on average, √(2/π).
    assert expected_range(np.array([1.0, *np.full(5, 1e-9)])) == pytest.approx(np.sqrt(2 / np.pi), rel=1e-2)
