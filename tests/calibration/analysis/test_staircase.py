"""Scale factor, linearity and threshold of made-up plateaus, by hand."""

import numpy as np
import pytest

from calibration.analysis.staircase import Plateaus, plateaus, staircase
from cosim.scenarios import load_scenario
from gyro_model.errors import InputError

LEVELS = np.array([0.0, 1.0, 2.0, 1.0, 0.0, -1.0, -2.0, -1.0, 0.0])


def of(rate: np.ndarray, measured: np.ndarray, error: float = 1e-6) -> Plateaus:
    rate = np.asarray(rate, dtype=float)
    return Plateaus(np.arange(len(rate)) * 1.0, rate, np.asarray(measured), np.full(len(rate), error))


def test_a_straight_line_by_hand() -> None:
    found = staircase(of(LEVELS, 1e-3 + (1 + 50e-6) * LEVELS))
    assert found.scale_factor_ppm == pytest.approx(50, rel=1e-6)
    assert found.bias == pytest.approx(1e-3)
    assert found.nonlinearity_ppm < 1e-6
    assert found.asymmetry_ppm == pytest.approx(0, abs=1e-6)
    assert found.scale_factor_error_ppm < 1e-6
    assert found.threshold == 1.0
    np.testing.assert_allclose(found.response[LEVELS != 0], 1.0)
    assert np.isnan(found.response[LEVELS == 0]).all()


def test_asymmetry_by_hand() -> None:
    found = staircase(of(LEVELS, np.where(LEVELS > 0, 1 + 30e-6, 1 - 10e-6) * LEVELS))
    assert found.asymmetry_ppm == pytest.approx(40, rel=1e-6)
    # The line through both sides has the mean of the two.
    assert found.scale_factor_ppm == pytest.approx(10, rel=1e-6)


def test_nonlinearity_by_hand() -> None:
    # Rates -1, 0, 1 with a cube: -1, -1, 0 ... the line through r + c r^3 at r = -2 .. 2 has slope 1 + 3.4 c.
    rate = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    found = staircase(of(rate, rate + 1e-4 * rate**3))
    assert found.scale_factor_ppm == pytest.approx(340, rel=1e-6)
    # At 2: 8e-4 - 6.8e-4 = 1.2e-4 of 2; at 1: 1e-4 - 3.4e-4 = -2.4e-4 of 2.
    np.testing.assert_allclose(found.residual_ppm, [-60, 120, 0, -120, 60], atol=1e-6)
    assert found.nonlinearity_ppm == pytest.approx(120)


def test_standard_error_of_the_scale_factor_is_that_of_the_residuals() -> None:
    rng = np.random.default_rng(5)
    pull = []
    for _ in range(200):
        found = staircase(of(LEVELS, LEVELS + 1e-5 * rng.standard_normal(len(LEVELS))))
        pull.append(found.scale_factor_ppm / found.scale_factor_error_ppm)
    # Student's t with 7 degrees of freedom has a variance of 7/5; 200 draws leave 7 % of scatter.
    assert np.std(pull) == pytest.approx((7 / 5) ** 0.5, rel=0.25)


def test_threshold_is_the_smallest_rate_above_all_that_are_not_seen() -> None:
    rate = np.array([0.0, 0.01, 0.1, 1.0, 5.0, -5.0, -1.0, -0.1, -0.01, 0.0])
    measured = rate.copy()
    # A dead band: one of the two plateaus of 0.1 shows nothing, those of 0.01 are whole again by chance.
    measured[7] = -0.01
    assert staircase(of(rate, measured, 1e-4)).threshold == 1.0
    # Whole, but within the noise of the plateau.
    assert staircase(of(rate, rate, 0.006)).threshold == 0.1
    assert staircase(of(rate, rate, 1e-4)).threshold == 0.01


def record(noise: float = 0.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The plateaus of the packaged staircase at 1 kHz: an angle 20 ppm too large that follows within 50 ms."""
    chosen = load_scenario("staircase")
    rate = chosen.omega_z(1000, 37_000, 1e-3)
    t = np.arange(37_000) * 1e-3
    output = np.empty_like(rate)
    state = 0.0
    for i, value in enumerate(rate):
        state += (value - state) * 0.02
        output[i] = state
    walk = noise * np.random.default_rng(1).standard_normal(len(t))
    return t, np.concatenate(([0.0], np.cumsum((1 + 20e-6) * output * 1e-3 + walk)))[:-1], rate


def test_settling_is_left_out() -> None:
    t, angle, rate = record()
    found = plateaus(t, angle, rate, settling=0.7)
    assert len(found.rate) == 37
    np.testing.assert_array_equal(found.begin, np.arange(37.0))
    # exp(-0.7/0.0495) = 7e-7 of a step of 1 rad/s, and less in the mean of the rest.
    assert staircase(found).scale_factor_ppm == pytest.approx(20, abs=0.3)
    early = staircase(plateaus(t, angle, rate, settling=0.0))
    assert early.nonlinearity_ppm > 1e3


def test_standard_error_of_a_plateau_under_a_random_walk() -> None:
    t, angle, rate = record(noise=1e-7)
    found = plateaus(t, angle, rate, settling=0.7)
    # The slope of a random walk over T scatters by N sqrt(6/(5 T)), N = 1e-7/sqrt(1 ms), T = 0.3 s.
    expected = 1e-7 / 1e-3**0.5 * (6 / 5 / 0.3) ** 0.5
    off = found.measured - (1 + 20e-6) * found.rate
    # 37 plateaus: 12 % of scatter each.
    assert off.std() == pytest.approx(expected, rel=0.4)
    assert np.sqrt(np.mean(found.error**2)) == pytest.approx(expected, rel=0.4)


def test_what_can_not_be_known_is_said() -> None:
    t, angle, rate = record()
    with pytest.raises(InputError, match="no plateau of the rate has 24 rows more than 2 s after its begin"):
        plateaus(t, angle, rate, settling=2.0)
    with pytest.raises(InputError, match="5 values do not determine 2 unknowns"):
        staircase(of(np.ones(5), np.ones(5)))
    assert staircase(of(LEVELS[:5], LEVELS[:5])).asymmetry_ppm is None
    gap = np.where(t < 3.8, np.nan, angle)
    assert len(plateaus(t, gap, rate, settling=0.7).rate) == 33


@pytest.mark.filterwarnings("error")
def test_an_output_that_never_moves_has_no_response() -> None:
    rate = np.array([0.0, 1.0, -1.0, 2.0])
    found = staircase(Plateaus(np.arange(4.0), rate, np.zeros(4), np.zeros(4)))
    assert np.isnan(found.response).all()
    assert found.threshold is None
