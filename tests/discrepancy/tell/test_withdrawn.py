"""What is no name is not in the improved device: a mass that carries another, both let go, by a simulation of its own,
which has lost the other where it is held out."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discrepancy.data.dataset import Dataset
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Record, make_record
from discrepancy.diagnose import diagnose
from discrepancy.tell.answer import Diagnosis
from gyro_model.model import load_model

RATE, SAMPLES = 1000.0, 3000
FREQUENCY, OTHER = 20.0, 47.0
MASS, CARRIED = 1.0, 0.05


def decay(carried: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Time and voltage of a mass that carries another."""
    rng, t = np.random.default_rng(seed), np.arange(SAMPLES) / RATE
    k, other = MASS * (2 * np.pi * FREQUENCY) ** 2, CARRIED * (2 * np.pi * OTHER) ** 2
    d, loss = np.sqrt(k * MASS) / 150, np.sqrt(other * CARRIED) / 200

    def slope(_: float, s: np.ndarray) -> np.ndarray:
        pull = other * (s[0] - s[1]) + loss * (s[2] - s[3])
        held = pull * carried / CARRIED
        return np.array([s[2], s[3], (-k * s[0] - d * s[2] - held) / MASS, pull / CARRIED])

    begin = [0.1, 0.02 * rng.standard_normal(), 0.0, 0.0]
    x = solve_ivp(slope, (0, t[-1]), begin, t_eval=t, method="DOP853", rtol=1e-9, atol=1e-12).y[0]
    return t, x + 1e-5 * rng.standard_normal(SAMPLES)


def record(role: str, t: np.ndarray, v: np.ndarray) -> Record:
    return make_record(role, t - t[0], np.zeros((len(t), 1)), v[:, None], sample_rate=RATE, role=role)


def answer(fit: Record, held_out: Record) -> Diagnosis:
    nominal = linear_start((fit,), (1.0,))
    assert nominal is not None
    return diagnose(Dataset(Path(), nominal, (fit, held_out)), load_model(), jobs=1)


def test_a_mass_that_is_carried_is_named_by_a_decay_and_what_follows() -> None:
    # The held-out part begins while the other moves.
    (t, v), cut = decay(CARRIED, 5), SAMPLES * 4 // 5
    found = answer(record("fit", t[:cut], v[:cut]), record("held-out", t[cut:], v[cut:]))
    assert found.verdict == "missing effects"
    assert [effect.id for effect in found.effects] == ["parasitic_mode"]
    assert found.misfit["final"] < 1.2 * found.misfit["noise_floor"]
    # 47 Hz, had the other begun at rest.
    assert any("parasitic_mode: its values are those of states at rest" in doubt for doubt in found.doubts)


def test_the_improved_device_holds_no_effect_that_is_no_name() -> None:
    found = answer(record("fit", *decay(CARRIED, 5)), record("held-out", *decay(0.0, 6)))
    assert "parasitic_mode" in {finding.id for finding in found.immaterial}
    assert not found.effects
    assert not [name for name in (*found.parameters, *found.device) if name.startswith("parasitic")]
    # What the mass itself does was refitted; of both masses the lower mode is slower than that of one.
    alone = np.sqrt(found.parameters["kxx"] / found.parameters["m"]) / (2 * np.pi)
    assert alone == pytest.approx(19.42, rel=1e-2)
    assert any("48.4 Hz" in doubt for doubt in found.doubts)
