"""Records that would mislead a compensation: what is told of them, and units that can't be."""

import numpy as np
import pytest

from calibration.analysis.clipping import is_clipped
from calibration.compensation.checks import rounding_step
from calibration.compensation.record import TemperatureTest, make_blocks
from gyro_model.errors import InputError

T = np.arange(0.0, 4000.0)
TEMPERATURE = 25 + 20 * np.sin(2 * np.pi * T / 4000)
TRUE = np.array([0.0, 1.0, 0.0, -1.0])[(T // 60).astype(int) % 4]
NOISE = 1e-3


def blocks_of(rate, true=TRUE, **signals):
    return make_blocks(TemperatureTest(T, rate, true, {"structure": TEMPERATURE, **signals}), 10.0, 1.0)


def measured(seed: int = 1):
    return TRUE + 0.01 + 1e-4 * TEMPERATURE + NOISE * np.random.default_rng(seed).standard_normal(len(T))


@pytest.mark.parametrize("seed", range(5))
def test_of_a_clean_record_nothing_is_told(seed: int) -> None:
    blocks = blocks_of(measured(seed))
    assert blocks.doubts == ()
    # One noise for all blocks, of 10 rows mostly: the median variance of 8 degrees of freedom is 0.92.
    assert blocks.noise[1] == pytest.approx(NOISE * np.sqrt(0.92 / 10), rel=0.1)


def test_a_rate_in_steps_wider_than_its_noise_has_the_noise_of_the_steps() -> None:
    step = 0.01
    rounded = step * np.round(measured() / step)
    blocks = blocks_of(rounded)
    [told] = blocks.doubts
    assert "rounded in steps of 0.01 rad/s, wider than its noise" in told
    # Rounded alike, rows of a block do not average: without the step its noise was 0.
    assert blocks.noise.min() >= step / np.sqrt(12)


@pytest.mark.parametrize("steps", [0.5, 1.0])
def test_noise_that_blurs_the_steps_averages(steps: float) -> None:
    step = steps * NOISE
    rounded = step * np.round(measured() / step)
    assert rounding_step(rounded, NOISE**2) == 0.0
    blocks = blocks_of(rounded)
    assert blocks.doubts == ()
    assert blocks.noise[1] < 1.2 * np.sqrt((NOISE**2 + step**2 / 12) / 10)


def test_rows_written_more_often_than_measured_are_told() -> None:
    held = np.repeat(measured()[::5], 5)
    assert any("written more often than the rate is measured" in told for told in blocks_of(held).doubts)


def test_a_clipped_rate_is_told() -> None:
    clipped = measured().clip(-1.0, 1.0)
    assert is_clipped(clipped) and not is_clipped(measured())
    [told] = blocks_of(clipped).doubts
    assert "clipped" in told
    # A temperature that rests at its end leaves a coarse rate there for long.
    assert not is_clipped(np.round(100 * np.sin(2 * np.pi * T / 4000)))


def test_spikes_and_steps_at_another_time_are_told() -> None:
    spiky = measured()
    spiky[37::300] += 1.0
    late = np.roll(measured(), 3)
    for rate in (spiky, late):
        [told] = blocks_of(rate).doubts
        assert "scatters more than 5 times" in told


def test_a_sensor_that_never_moves_is_left_out() -> None:
    blocks = blocks_of(measured(), circuit=np.full(len(T), 25.0))
    assert set(blocks.inputs) == {"structure", "structure_rate"}
    assert blocks.doubts == ("record: circuit stays at 25 °C and is left out",)


@pytest.mark.parametrize(("factor", "guess"), [(np.degrees(1.0), True), (np.radians(1.0), True), (3667.0, False)])
def test_units_that_differ_are_asked_about(factor: float, guess: bool) -> None:
    with pytest.raises(InputError, match="times rate_true: ") as caught:
        blocks_of(factor * measured())
    assert ("one in deg/s and the other in rad/s" in str(caught.value)) == guess


def test_a_rate_that_runs_backwards_is_told() -> None:
    [told] = blocks_of(-measured()).doubts
    assert "runs against rate_true" in told
