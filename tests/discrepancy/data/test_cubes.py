"""Forces of third order by the weak form, whatever sees the motion."""

from typing import get_args

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discrepancy.data.cubes import places
from discrepancy.data.linear_start import bent_response, linear_start
from discrepancy.data.record import Floats, Record, Senses, make_record

M, D, K, K3, D2 = 0.8, 1.6, 3.2e3, 4e7, 2e4
RATE = 800.0


@pytest.fixture(scope="module")
def motion() -> tuple[Floats, Floats, Floats]:
    """Times, a force that runs on, and place, speed and acceleration (3, n), by DOP853: the spring is stiffer by half
    at the amplitude."""
    t = np.arange(12_000) / RATE
    tones = 2 * np.pi * np.array([2.7, 6.1, 9.3, 11.8, 14.2, 17.9])
    phases = np.array([0.4, 2.2, 5.1, 3.3, 1.0, 4.4])

    def force(at: Floats) -> Floats:
        return np.asarray(4.0 * np.cos(np.multiply.outer(at, tones) + phases).sum(axis=-1))

    def rate(at: float, state: Floats) -> list[float]:
        x, v = state
        return [v, (float(force(np.array(at))) - D * v - K * x - K3 * x**3 - D2 * x**2 * v) / M]

    x, v = solve_ivp(rate, (0.0, t[-1]), [0.0, 0.0], "DOP853", t, rtol=1e-10, atol=1e-14).y
    u = force(t)
    return t, u, np.array([x, v, (u - D * v - K * x - K3 * x**3 - D2 * x**2 * v) / M])


def record(motion: tuple[Floats, Floats, Floats], senses: Senses) -> Record:
    """What a sensor shows, with noise of 1e-3."""
    t, u, moved = motion
    v = moved[get_args(Senses).index(senses)]
    noisy = v + 1e-3 * v.std() * np.random.default_rng(7).standard_normal(len(v))
    return make_record("run", t, u, noisy, sample_rate=RATE, hold="band-limited", senses=senses)


@pytest.mark.parametrize("senses", get_args(Senses))
def test_a_spring_that_bends_is_known_by_any_sensor(motion: tuple[Floats, Floats, Floats], senses: Senses) -> None:
    own = record(motion, senses)
    nominal = linear_start([own], [own.reference**own.order])
    assert nominal is not None
    # A line through the motion would be another mass: that of the start is right, by the forces beside it.
    assert nominal["m"] == pytest.approx(M, rel=0.03)
    found = bent_response([own], nominal)
    assert found is not None
    # What is lost of the place by its slow part is a percent or two of its cube.
    assert found.cubic[0][0] == pytest.approx(K3, rel=0.03)
    assert found.left < 2e-3
    assert not any(found.friction)


@pytest.mark.parametrize("senses", get_args(Senses))
def test_a_place_is_that_of_the_motion(motion: tuple[Floats, Floats, Floats], senses: Senses) -> None:
    own = record(motion, senses)
    shown = places(own, [own.reference**own.order], 1.0)[:, 0]
    x = motion[2][0]
    # An acceleration has the noise of its slow part; at its ends a filter that runs both ways has not settled.
    assert np.std(shown[1_000:-1_000] - x[1_000:-1_000]) < 0.04 * np.std(x)
    assert np.abs(shown - x).max() < 0.5 * np.std(x)
