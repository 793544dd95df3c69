"""Records that are sampled far more often than anything moves: what is left says the same."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import cont2discrete

from discrepancy.data import thinning
from discrepancy.data.dataset import load_dataset
from discrepancy.data.record import Floats, Record, make_record
from discrepancy.data.thinning import MANY, spare, thinned

RATE, FREQUENCY, Q, M = 20_000.0, 5.0, 30.0, 2.0
W = 2 * np.pi * FREQUENCY


def matrices() -> tuple[Floats, Floats]:
    return np.array([[0.0, 1.0], [-(W**2), -W / Q]]), np.array([[0.0], [1 / M]])


def answer(u: Floats, rate: float, method: str) -> Floats:
    """Places of a resonator at samples of a force that is held ("zoh") or runs straight ("foh"), by its exponential."""
    a, b, c, d, _ = cont2discrete((*matrices(), np.eye(2), np.zeros((2, 1))), 1 / rate, method)
    state, found = np.zeros(2), np.empty(len(u))
    if method == "foh":
        # The state of that form is the motion less a part of the present force.
        state = -(d[:, 0] * u[0])
    for k, force in enumerate(u):
        found[k] = (c @ state + d[:, 0] * force)[0]
        state = a @ state + b[:, 0] * force
    return found


def tones(t: Floats) -> Floats:
    rng = np.random.default_rng(5)
    starts = rng.uniform(0, 2 * np.pi, 11)
    return np.sum([np.sin(2 * np.pi * f * t + start) for f, start in enumerate(starts, 1)], axis=0)


def squares(t: Floats) -> Floats:
    return np.sign(np.sin(2 * np.pi * (1 + 0.8 * t) * t))


def noise(t: Floats) -> Floats:
    return tones(t) + np.random.default_rng(6).normal(size=len(t))


def record(force: Callable[[Floats], Floats], hold: str, n: int = 80_000, senses: str = "position") -> Record:
    t = np.arange(n) / RATE
    u = force(t)
    v = answer(u, RATE, "zoh" if hold == "zero" else "foh")
    return make_record("one", t, u, v, sample_rate=RATE, hold=hold, senses=senses)


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize(("force", "most"), [(tones, 1e-6), (squares, 1e-5), (noise, 1e-5)])
def test_a_force_that_is_its_mean_drives_as_it_did(
    force: Callable[[Floats], Floats], most: float, hold: str, residual: Callable[[str, float, float], None]
) -> None:
    whole = record(force, hold)
    few = thinned(whole, 25)
    left = answer(few.u[:, 0], few.sample_rate, "zoh") - few.v[:, 0]
    # What a step does beside pushing as much and when it does: (w h)^3 of it, 5e-4, here and there in an edge or noise.
    residual("motion", float(np.sqrt(np.mean(left**2)) / np.std(few.v)), most)
    assert few.hold == "zero"


def test_what_is_left_is_as_it_was_measured() -> None:
    whole = record(tones, "zero")
    valid = whole.valid.copy()
    valid[50] = False
    warm = np.linspace(20.0, 21.0, len(whole.t))
    few = thinned(replace(whole, valid=valid, conditions={"temperature": warm}), 25)
    assert np.array_equal(few.v, whole.v[::25])
    assert np.array_equal(few.t, whole.t[::25])
    assert not few.valid[2] and few.valid.sum() == len(few.t) - 1
    assert few.conditions["temperature"] == pytest.approx(warm[::25] + 12 * (warm[1] - warm[0]), abs=1e-12)


def test_as_many_are_left_as_a_diagnosis_takes_and_what_moves_asks_for() -> None:
    one = record(tones, "zero")
    assert spare([one]) == 1
    # 11 Hz are 1,818 samples a period.
    assert spare([one] * 5) == 5 * len(one.t) // MANY
    fast = replace(one, u=np.sin(2 * np.pi * 300.0 * one.t)[:, None])
    assert spare([fast] * 5) == 1


@pytest.mark.parametrize("noise", [1e-3, 0.1, 0.3])
def test_noise_is_not_what_moves(noise: float) -> None:
    one = record(tones, "zero")
    rng = np.random.default_rng(3)
    loud = [replace(one, v=one.v + noise * np.std(one.v) * rng.normal(size=one.v.shape),
                    u=one.u + noise * np.std(one.u) * rng.normal(size=one.u.shape)) for _ in range(5)]  # fmt: skip
    assert spare(loud) == spare([one] * 5)


def test_of_a_force_that_is_noise_what_moves_decides() -> None:
    one = record(noise, "zero")
    assert spare([replace(one, u=np.random.default_rng(2).normal(size=one.u.shape))] * 5) > 1


def test_accelerations_show_the_force_of_each_instant() -> None:
    pushed = replace(record(tones, "zero"), senses="acceleration")
    assert spare([pushed] * 5) == 1
    assert spare([replace(pushed, u=0 * pushed.u)] * 5) > 1


@pytest.mark.parametrize("stated", ["", 'hold = "first"\n'])
def test_a_data_set_is_thinned_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stated: str) -> None:
    monkeypatch.setattr(thinning, "MANY", 20_000)
    text = "format = 1\n"
    for name in ("a", "b"):
        run = record(tones, "first", 240_000)
        np.savetxt(tmp_path / f"{name}.csv", np.column_stack((run.t, run.u, run.v)), delimiter=",",
                   header="t,u_x,v_x", comments="")  # fmt: skip
        text += f'[[run]]\nfile = "{name}.csv"\nsample_rate = {RATE}\n{stated}'
    (tmp_path / "dataset.toml").write_text(text)
    data = load_dataset(tmp_path)
    assert any("one of 24 samples" in note for note in data.notes)
    assert [len(run.t) for run in data.records] == [10_000, 10_000]
    assert data.nominal["m"] == pytest.approx(M, rel=1e-3)
    # Half a step of the record, which a hold would take the force back by, is seen before any sample goes.
    left = answer(data.records[0].u[:, 0], RATE / 24, "zoh") - data.records[0].v[:, 0]
    assert np.std(left) < 1e-5 * np.std(data.records[0].v)
