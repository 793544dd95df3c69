"""What is no name is not in the improved device: a mass that carries another, both let go, by a simulation of its own.
The held-out part of the decay begins while the other moves, which no state of the model's own tells."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discrepancy.data.dataset import Dataset
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Record, make_record
from discrepancy.diagnose import diagnose
from gyro_model.model import load_model

RATE, SAMPLES = 1000.0, 3000
FREQUENCY, OTHER = 20.0, 47.0
MASS, CARRIED = 1.0, 0.05


@pytest.fixture(scope="module")
def runs() -> tuple[Record, Record]:
    rng, t = np.random.default_rng(5), np.arange(SAMPLES) / RATE
    k, other = MASS * (2 * np.pi * FREQUENCY) ** 2, CARRIED * (2 * np.pi * OTHER) ** 2
    d, loss = np.sqrt(k * MASS) / 150, np.sqrt(other * CARRIED) / 200

    def slope(_: float, s: np.ndarray) -> np.ndarray:
        pull = other * (s[0] - s[1]) + loss * (s[2] - s[3])
        return np.array([s[2], s[3], (-k * s[0] - d * s[2] - pull) / MASS, pull / CARRIED])

    begin = [0.1, 0.02 * rng.standard_normal(), 0.0, 0.0]
    x = solve_ivp(slope, (0, t[-1]), begin, t_eval=t, method="DOP853", rtol=1e-9, atol=1e-12).y[0]
    v = x + 1e-5 * rng.standard_normal(SAMPLES)
    cut = SAMPLES * 4 // 5
    parts = (("fit", slice(0, cut)), ("held-out", slice(cut, None)))
    return tuple(
        make_record(role, t[own] - t[own][0], np.zeros((len(t[own]), 1)), v[own, None], sample_rate=RATE, role=role)
        for role, own in parts
    )  # type: ignore[return-value]


def test_the_improved_device_holds_no_effect_that_is_no_name(runs: tuple[Record, Record]) -> None:
    nominal = linear_start(runs[:1], (1.0,))
    assert nominal is not None
    found = diagnose(Dataset(Path(), nominal, runs), load_model(), jobs=1)
    assert "parasitic_mode" in {finding.id for finding in found.immaterial}
    assert not found.effects
    assert not [name for name in (*found.parameters, *found.device) if name.startswith("parasitic")]
    # What the mass itself does was refitted; of both masses the lower mode is slower than that of one.
    alone = np.sqrt(found.parameters["kxx"] / found.parameters["m"]) / (2 * np.pi)
    assert alone == pytest.approx(19.42, rel=1e-2)
    assert any("48.4 Hz" in doubt for doubt in found.doubts)
