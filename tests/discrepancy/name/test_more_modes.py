"""More resonances than the effect files have: copies of a resonant force, against a linear device of four modes."""

from pathlib import Path

import numpy as np
from scipy.signal import cont2discrete

from discrepancy.data.dataset import Dataset
from discrepancy.data.modes import further_modes
from discrepancy.data.record import make_record
from discrepancy.diagnose import diagnose
from discrepancy.discover.term_search import TermSearch
from discrepancy.name.more_modes import copies
from gyro_model.model import load_model

RATE, SAMPLES, NOISE = 100_000.0, 3000, 2e-5
NOMINAL = {"m": 1.8e-7, "kxx": 64.0, "kyy": 96.0, "kxy": 13.0, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
           "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip
X, Y = (5200.0, 300.0, 10.0), (7100.0, 500.0, 15.0)
"""Frequency alone [Hz], quality factor and coupling [N/m] of the modes beside."""


def _device() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """State space of two main modes and one more on each axis, scaled to the same mass."""
    p, m = NOMINAL, NOMINAL["m"]
    w = 2 * np.pi * np.array([X[0], Y[0]])
    k = np.array([[p["kxx"], p["kxy"], X[2], 0], [p["kxy"], p["kyy"], 0, Y[2]],
                  [X[2], 0, m * w[0] ** 2, 0], [0, Y[2], 0, m * w[1] ** 2]])  # fmt: skip
    d = np.diag([0.0, 0.0, m * w[0] / X[1], m * w[1] / Y[1]])
    d[:2, :2] = [[p["dxx"], p["dxy"]], [p["dxy"], p["dyy"]]]
    a = np.block([[np.zeros((4, 4)), np.eye(4)], [-k / m, -d / m]])
    b = np.zeros((8, 2))
    b[4, 0] = b[5, 1] = 1 / m
    c = np.zeros((2, 8))
    c[0, 0] = c[1, 1] = 1e6
    step, into, *_ = cont2discrete((a, b, c, np.zeros((2, 2))), 1 / RATE)
    return step, into, c


def _dataset() -> Dataset:
    rng = np.random.default_rng(4)
    step, into, seen = _device()
    t = np.arange(SAMPLES) / RATE
    records = []
    for number in range(3):
        f, phase = rng.uniform(1500, 9000, (60, 2)), rng.uniform(0, 6.28, (60, 2))
        u = 4e-6 * np.sin(2 * np.pi * f * t[:, None, None] + phase).sum(axis=1)
        state, v = np.zeros(8), np.empty((SAMPLES, 2))
        for k in range(SAMPLES):
            v[k] = seen @ state
            state = step @ state + into @ u[k]
        v += NOISE * rng.standard_normal(v.shape)
        role = "held-out" if number == 2 else "fit"
        records.append(make_record(f"run-{number}", t, u, v, sample_rate=RATE, role=role))
    return Dataset(Path(), NOMINAL, tuple(records))


def test_a_mode_on_each_axis_is_named_with_its_file(tmp_path: Path) -> None:
    found = diagnose(_dataset(), load_model(), jobs=1, further=TermSearch(tmp_path))
    by_id = {finding.id: finding for finding in found.effects}
    assert set(by_id) == {"parasitic_mode", "parasitic_mode_y"}
    for name, true in (("parasitic_mode", X), ("parasitic_mode_y", Y)):
        suffix = name.removeprefix("parasitic_mode")
        for quantity, value in zip(("frequency", "q"), true, strict=False):
            interval = by_id[name].parameters[f"parasitic_{quantity}{suffix}"]
            # Four deviations, where the interval has two: a true value leaves it once in twenty.
            assert abs(interval.value - value) < interval.high - interval.low
    # Simulated without noise the model leaves what was drawn.
    assert found.misfit["final"] < 1.1 * found.misfit["noise_floor"]
    assert load_model(tmp_path).effect("parasitic_mode_y").terms() == found.model.effect("parasitic_mode_y").terms()
    assert {e.id for e in found.model.effects} == {e.id for e in load_model().effects} | {"parasitic_mode_y"}


def test_a_copy_waits_for_its_turn() -> None:
    assert len(further_modes(_dataset().records[:1])[1]) == 2
    more = copies(load_model(), 2, 2)
    # The response shows the further modes, so that one on y may come first.
    assert {name: copy.after for name, copy in more.items()} == {
        "parasitic_mode_2": "parasitic_mode",
        "parasitic_mode_y": "",
        "parasitic_mode_y_2": "parasitic_mode_y",
    }


def test_a_model_that_has_a_copy_gets_no_other_of_its_name(tmp_path: Path) -> None:
    copies(load_model(), 2, 0)["parasitic_mode_y"].write(tmp_path)
    assert set(copies(load_model(tmp_path), 2, 0)) == {"parasitic_mode_2", "parasitic_mode_y_2"}


def test_a_record_of_one_axis_has_as_many_copies_as_it_shows_modes() -> None:
    assert set(copies(load_model(), 1, 0)) == {"parasitic_mode_2"}
    assert list(copies(load_model(), 1, 4)) == ["parasitic_mode_2", "parasitic_mode_3", "parasitic_mode_4"]
