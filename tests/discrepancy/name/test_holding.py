"""How the force ran between samples, where the device bends the response so that it hides half a sample."""

from pathlib import Path

import numpy as np
import pytest

from discrepancy.criteria import Criteria
from discrepancy.data.dataset import Dataset, load_dataset
from discrepancy.data.hold import better_hold
from discrepancy.data.record import Record, make_record
from discrepancy.diagnose import diagnose
from discrepancy.tell.answer import Diagnosis
from discrepancy.trial_runs import write_trial
from gyro_model.device import load_device
from gyro_model.model import load_model

M, K, D = 2.0, 5e4, 10.0
H, LENGTH, BETA, GAMMA = 31.25, 6.25e-4, 0.5, -0.6875
"""That of the Bouc-Wen benchmark (J. P. Noel, M. Schoukens, 2016), whose linear mode is at 35.6 Hz."""
RATE, SAMPLES, FINE, NOISE = 750.0, 4000, 20, 0.01
NOMINAL = {"m": 1.8, "kxx": 1.1e5, "dxx": 80.0, "sense_gain_x": 1.0}


def run(name: str, role: str, seed: int) -> Record:
    """From rest under a smooth force, by RK4 in steps of a twentieth of a sample: no line of it is the FMU's."""
    rng, h = np.random.default_rng(seed), 1 / (FINE * RATE)
    lines, phase = 2 * np.pi * np.arange(5.0, 150.0, 0.4), rng.uniform(0, 2 * np.pi, 363)
    instants = np.arange(2 * FINE * SAMPLES + 1) * h / 2
    u = np.concatenate([3.7 * np.sin(lines * t[:, None] + phase).sum(axis=1) for t in np.array_split(instants, 40)])
    state, x = np.zeros(3), np.empty(SAMPLES)

    def rate(s: np.ndarray, force: float) -> np.ndarray:
        bent = BETA * abs(s[1]) * s[2] + GAMMA * s[1] * abs(s[2])
        return np.array((s[1], (force - D * s[1] - K * s[0] - H * s[2]) / M, (s[1] - bent) / LENGTH))

    for i in range(SAMPLES):
        x[i] = state[0]
        for k in range(2 * FINE * i, 2 * FINE * (i + 1), 2):
            a = rate(state, u[k])
            b = rate(state + h / 2 * a, u[k + 1])
            c = rate(state + h / 2 * b, u[k + 1])
            state = state + h / 6 * (a + 2 * b + 2 * c + rate(state + h * c, u[k + 2]))
    v = x + NOISE * x.std() * rng.standard_normal(SAMPLES)
    return make_record(name, np.arange(SAMPLES) / RATE, u[: -1 : 2 * FINE], v, role=role, sample_rate=RATE)


@pytest.fixture(scope="module")
def records() -> tuple[Record, ...]:
    return run("a", "fit", 1), run("b", "held-out", 2)


def answer(records: tuple[Record, ...], time_limit: float = 110.0, *, stated: bool = False) -> Diagnosis:
    dataset = Dataset(Path("here"), NOMINAL, records, hold_stated=stated)
    return diagnose(dataset, load_model(), criteria=Criteria(time_limit=time_limit))


def test_it_shows_once_the_model_has_what_bends_the_response(records: tuple[Record, ...]) -> None:
    assert better_hold(records, NOMINAL) is None
    found = answer(records)
    [effect] = found.effects
    assert effect.id == "hysteresis" and found.verdict == "missing effects"
    assert any("ran on between samples" in doubt for doubt in found.doubts)
    for name, true in (("hysteresis_x", H), ("hysteresis_length", LENGTH), ("hysteresis_gamma", GAMMA)):
        own = effect.parameters[name]
        assert abs(own.value - true) < own.high - own.low, name


def test_what_the_lab_states_stays(records: tuple[Record, ...]) -> None:
    # Long enough to be found where it is not stated.
    for stated in (False, True):
        found = answer(records, 20.0, stated=stated)
        assert any("ran on" in doubt for doubt in found.doubts) != stated


def test_a_data_set_says_whether_it_states_it(tmp_path: Path) -> None:
    file = write_trial(load_device("reference"), {"k3_x": 1e8}, tmp_path / "trial", runs=2, samples=2000)
    assert not load_dataset(file).hold_stated
    file.write_text(file.read_text().replace("[[run]]", '[[run]]\nhold = "zero"'))
    assert load_dataset(file).hold_stated
