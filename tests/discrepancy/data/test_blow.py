"""Blows of a hammer, and the noise of its channel between them."""

import numpy as np
import pytest

from discrepancy.data.blow import windowed
from discrepancy.data.record import Floats, Record, make_record

RATE, COUNT = 2000.0, 4000


def blow(*begins: int, length: int = 10, size: float = 150.0) -> Floats:
    u = np.zeros(COUNT)
    for begin in begins:
        u[begin : begin + length] = size * np.sin(np.pi * (np.arange(length) + 0.5) / length)
    return u


def run(u: Floats) -> Record:
    t = np.arange(COUNT) / RATE
    return make_record("run", t, u[:, None], np.cos(300 * t)[:, None], sample_rate=RATE)


@pytest.mark.parametrize("begins", [(200,), (200, 1500)])
def test_the_noise_between_blows_is_taken_out(begins: tuple[int, ...]) -> None:
    rng, true = np.random.default_rng(3), blow(*begins)
    noisy = true + 0.4 + 0.05 * rng.standard_normal(COUNT)
    [found], said = windowed([run(noisy)])
    # Within a blow it stays, and so does the level of the channel, as its median of 4000 samples is known.
    assert np.abs(found.u[:, 0] - true - 0.4).max() < 5 * 0.05
    quiet = np.abs(found.u[:, 0] - found.u[0, 0]) == 0
    assert quiet.sum() > 0.98 * COUNT
    assert "0.05" in said[0]


@pytest.mark.parametrize("kind", ["noise", "tone", "clean", "small drive"])
def test_what_is_no_blow_stays(kind: str) -> None:
    rng, t = np.random.default_rng(3), np.arange(COUNT) / RATE
    u = {
        "noise": rng.standard_normal(COUNT),
        "tone": np.sin(40 * t) + 1e-3 * rng.standard_normal(COUNT),
        "clean": blow(200),
        "small drive": blow(200) + 0.05 * np.sin(200 * t),
    }[kind]
    [found], said = windowed([run(u)])
    assert found.u is run(u).u or np.array_equal(found.u[:, 0], u)
    assert not said
