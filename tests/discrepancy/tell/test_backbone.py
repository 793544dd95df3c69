"""Frequency and damping over amplitude against the hand formula of a cubic spring, on free decays and a slow sweep that
scipy's DOP853 integrates."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discrepancy.data.record import Floats, Record, make_record
from discrepancy.tell.backbone import backbone

M, F0, Q, K3 = 1e-7, 300.0, 200.0, 2e8
K = M * (2 * np.pi * F0) ** 2
D = float(np.sqrt(K * M)) / Q
PARAMETERS = {"m": M, "kxx": K, "dxx": D, "sense_gain_x": 1e6}
RATE = 5e3


def run(force: Callable[[Floats], Floats], start: float, duration: float) -> Record:
    t = np.arange(int(duration * RATE)) / RATE

    def motion(time: float, z: Floats) -> list[float]:
        return [z[1], (float(force(np.array(time))) - K * z[0] - D * z[1] - K3 * z[0] ** 3) / M]

    x = solve_ivp(motion, (0, t[-1]), [start, 0.0], t_eval=t, method="DOP853", rtol=1e-8, atol=1e-14).y[:1].T
    v = 1e6 * x + 1e-3 * np.random.default_rng(1).standard_normal(x.shape)
    return make_record("run", t, force(t)[:, None], v, sample_rate=RATE, hold="band-limited")


def swept(t: Floats) -> Floats:
    """A tenth of a line width in the time that an amplitude takes to settle."""
    return 1e-8 * np.sin(2 * np.pi * (299 * t + t**2 / 2))


@pytest.mark.parametrize(
    ("force", "start", "duration"), [(lambda t: 0.0 * t, 3e-6, 0.6), (swept, 0.0, 3.0)], ids=["free decay", "sweep"]
)
def test_a_cubic_spring_bends_the_frequency_by_hand(
    force: Callable[[Floats], Floats], start: float, duration: float
) -> None:
    record = run(force, start, duration)
    found = backbone(record, record.v, PARAMETERS, 0)
    assert found is not None and len(found.amplitude) > 20
    by_hand = F0 * np.sqrt(1 + 0.75 * K3 * found.amplitude**2 / K)
    loud = found.amplitude > 0.3 * found.amplitude.max()
    # The amplitude falls by a quarter over a window: its mean square is 2 % off that in the middle, of a bend of 2e-3.
    assert np.abs(found.frequency / by_hand - 1)[loud].max() < 5e-5
    # Noise of 1e-3 of the signal over 20 periods: 1 % of the damping.
    assert np.median(np.abs(found.quality / Q - 1)[loud]) < 0.01


def test_two_frequencies_at_a_time_are_no_backbone() -> None:
    record = run(lambda t: 0.0 * t, 3e-6, 0.2)
    other = 0.3 * np.sin(2 * np.pi * 330 * record.t)[:, None]
    assert backbone(record, record.v + other, PARAMETERS, 0) is None


def test_of_one_amplitude_there_is_no_curve() -> None:
    record = run(lambda t: 1e-7 * np.sin(2 * np.pi * F0 * t), 0.0, 0.1)
    steady = np.sin(2 * np.pi * F0 * record.t)[:, None]
    assert backbone(record, steady, PARAMETERS, 0) is None
