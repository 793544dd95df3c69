"""A mass that friction holds for most of the time, simulated with friction as a set-valued force."""

from collections.abc import Callable

import numpy as np
import pytest

from discrepancy.data import linear_start
from discrepancy.data.record import Floats, Record, make_record
from discrepancy.data.sticking import sticking

Residual = Callable[[str, float, float], None]

RATE, SAMPLES, PARTS, GAIN = 500.0, 8000, 40, 50.0
MASS, DAMPING, STIFFNESS = 0.4, 2.0, 300.0
"""4.4 Hz, Q 5.5."""


def motion(u: Floats, friction: float, constant: float) -> Floats:
    """The place at samples under a held force: implicit steps, by which a friction stops the mass where it can (J. J.
    Moreau, Unilateral contact and dry friction in finite freedom dynamics, 1988)."""
    h, x, v, found = 1 / (RATE * PARTS), 0.0, 0.0, np.zeros(len(u))
    weight = MASS + h * DAMPING + h * h * STIFFNESS
    for k, force in enumerate(u):
        found[k] = x
        for _ in range(PARTS):
            free = MASS * v + h * (force + constant - STIFFNESS * x)
            v = np.sign(free) * max(abs(free) - h * friction, 0.0) / weight
            x += h * v
    return found


def record(friction: float, noise: float, constant: float = 0.0, seed: int = 1) -> Record:
    rng, t = np.random.default_rng(seed), np.arange(SAMPLES) / RATE
    f = np.arange(2, 160) / 16
    u = np.cos(2 * np.pi * np.outer(t, f) + rng.uniform(0, 2 * np.pi, len(f))).sum(axis=1)
    u /= u.std()
    x = motion(u, friction, constant)
    x = x + noise * x.std() * rng.standard_normal(SAMPLES)
    return make_record("run", t, u[:, None], GAIN * x[:, None], sample_rate=RATE)


@pytest.mark.parametrize(("noise", "off"), [(0.0, 0.03), (1e-3, 0.06), (1e-2, 0.2)])
@pytest.mark.parametrize("friction", [0.7, 1.0, 1.4])
def test_what_moves_it_is_found_while_it_moves(friction: float, noise: float, off: float, residual: Residual) -> None:
    """Of a mass that rests for 0.2 to 0.7 of the time; a linear response says a mass up to 1.6 times as large, and up
    to 14 times the damping."""
    found = sticking([record(friction, noise), record(friction, noise, seed=2)], GAIN)
    assert found is not None
    residual("mass", abs(found.m / MASS - 1), off)
    residual("stiffness", abs(found.k / STIFFNESS - 1), 0.5 * off)
    residual("friction", abs(found.friction / friction - 1), off)
    # By its share of the force, of which it is a tenth.
    residual("damping", abs(found.d / DAMPING - 1), 8 * off)


def test_a_constant_force_is_told_apart(residual: Residual) -> None:
    found = sticking([record(1.0, 1e-3, constant=0.3)], GAIN)
    assert found is not None
    residual("constant", abs(found.constant - 0.3), 0.01)
    residual("friction", abs(found.friction - 1.0), 0.05)


def test_it_is_a_start_where_no_response_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a mass that moves for a thirtieth of the time."""
    runs = [record(2.2, 1e-3), record(2.2, 1e-3, seed=2)]
    start = linear_start.linear_start(runs, [GAIN])
    assert start is not None
    # 0.062 off.
    assert start["kxx"] == pytest.approx(STIFFNESS, rel=0.1)
    monkeypatch.setattr(linear_start, "sticking", lambda *_: None)
    assert linear_start.linear_start(runs, [GAIN]) is None


def test_none_comes_out_of_noise_two_axes_or_another_sensor() -> None:
    t, rng = np.arange(2000) / RATE, np.random.default_rng(3)
    u, v = rng.standard_normal((2, 2000, 1))
    noise = sticking([make_record("run", t, u, v, sample_rate=RATE)], 1.0)
    assert noise is None or noise.left > 0.3
    both = make_record("run", t, np.hstack((u, u)), np.hstack((v, v)), sample_rate=RATE)
    assert sticking([both], 1.0) is None
    assert sticking([make_record("run", t, u, v, sample_rate=RATE, senses="velocity")], 1.0) is None
