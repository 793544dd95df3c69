"""A response that is bent far from a linear one: what bends it is in the model before a linear fit goes astray."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.bent import Bent, runs
from benchmarks.structures import diagnosed
from benchmarks.sweeps import Swept, sweep
from discrepancy.data.dataset import Dataset
from discrepancy.data.hold import better_hold
from discrepancy.data.linear_start import bent_response, linear_start
from discrepancy.data.record import Floats, Record, make_record
from discrepancy.diagnose import diagnose
from gyro_model.model import load_model

M, K, D, K3 = 5e-3, 16.9e3, 0.131, 8.4e10
"""292 Hz, Q = 70; at the motion below K3 makes 3 % of the spring's force in the mean, and its stiffness 9 % more."""
RATE, SAMPLES = 8000.0, 9000


def moved(u: Floats, d2: float = 0.0) -> Floats:
    """The mass from rest under a held force, by 16 steps of RK4 a sample: no line of it is the FMU's."""
    h, state, found = 1 / (16 * RATE), np.zeros(2), np.empty(len(u))

    def rate(s: Floats, force: float) -> Floats:
        return np.array([s[1], (force - D * s[1] - K * s[0] - K3 * s[0] ** 3 - d2 * s[0] ** 2 * s[1]) / M])

    for i, force in enumerate(u):
        found[i] = state[0]
        for _ in range(16):
            a = rate(state, force)
            b = rate(state + h / 2 * a, force)
            c = rate(state + h / 2 * b, force)
            state = state + h / 6 * (a + 2 * b + 2 * c + rate(state + h * c, force))
    return found


def run(name: str, role: str, seed: int, d2: float = 0.0) -> Record:
    rng, t = np.random.default_rng(seed), np.arange(SAMPLES) / RATE
    frequency = rng.uniform(100, 500, 40)
    u = 0.03 * np.sin(2 * np.pi * frequency * t[:, None] + rng.uniform(0, 2 * np.pi, 40)).sum(axis=1)
    x = moved(u, d2)
    v = x + 5e-3 * x.std() * rng.standard_normal(SAMPLES)
    return make_record(name, t, u, v, role=role, sample_rate=RATE)


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    runs = (run("a", "fit", 1), run("b", "held-out", 2))
    return Dataset(Path("here"), {"m": M / 3, "kxx": K / 3, "dxx": D, "sense_gain_x": 1.0}, runs)


def test_the_weak_form_finds_mass_and_spring_beside_a_cube(dataset: Dataset) -> None:
    told = bent_response(dataset.fit, dataset.nominal)
    assert told is not None
    # A hold of a force over a sample, 27 a period, and noise of 5e-3: some 1e-3 each.
    assert told.linear["m"] == pytest.approx(M, rel=5e-3)
    assert told.linear["kxx"] == pytest.approx(K, rel=5e-3)
    [(k3, d2)] = told.cubic
    assert k3 == pytest.approx(K3, rel=2e-2)
    assert abs(d2) * 1e-12 < 0.1 * D
    assert told.left < 1e-2


def test_a_cubic_spring_far_from_linear_is_named(dataset: Dataset) -> None:
    found = diagnose(dataset, load_model(), jobs=1).report()
    assert [e["id"] for e in found["effects"]] == ["cubic_stiffness"]
    value = found["effects"][0]["parameters"]["k3_x"]
    # 1.96 deviations, and what RK4 of 16 steps a sample is off by.
    assert value["low"] * 0.999 <= K3 <= value["high"] * 1.001
    assert value["value"] == pytest.approx(K3, rel=5e-3)
    assert found["verdict"] == "missing effects"


def test_a_cubic_spring_is_named_where_the_motion_is_chaotic() -> None:
    rng, own = np.random.default_rng(5), Bent(1.0, 0.628, 158.0, 7.2e6, 0.0)
    records, grown = runs(own, 2.0, rng, "velocity", "zero", 2e-3)
    assert grown > 1e4
    answer = diagnosed(records, 2e-3)
    assert answer is not None
    found = answer[0].report()
    assert found["verdict"] == "missing effects"
    assert any("go their own way" in doubt for doubt in found["doubts"])
    assert [e["id"] for e in found["effects"]] == ["cubic_stiffness"]
    assert found["effects"][0]["parameters"]["k3_x"]["value"] == pytest.approx(own.k3, rel=1e-2)


RUBBING = Swept(m=0.4, d=1.26, k=6317.0, k3=5e7, friction=0.3, speed=1e-4)
"""20 Hz, Q 40; at the largest motion the cube is 1.4 times the spring; friction is a tenth of the force."""


def swept(name: str, amplitude: float, role: str = "fit", own: Swept = RUBBING) -> Record:
    """A sweep under a force of that amplitude [N], in micrometres, which runs on though the record does not say so."""
    rate, count = 1600.0, 9600
    u, moved = sweep(own, rate, amplitude, count, "first")
    x = moved[:, 0] + 1e-3 * moved[:, 0].std() * np.random.default_rng(len(name)).standard_normal(count)
    return make_record(name, np.arange(count) / rate, u, 1e6 * x, role=role, sample_rate=rate)


@pytest.fixture(scope="module")
def rubbing() -> Dataset:
    runs = (swept("a", 2.0), swept("bb", 4.0), swept("ccc", 3.0, "held-out"))
    nominal = linear_start(runs[:2], [1.0])
    assert nominal is not None
    # A line through a spring that bends as far would be the spring of another device, a quarter as heavy.
    assert nominal["m"] == pytest.approx(RUBBING.m * 1e-6, rel=0.02)
    return Dataset(Path("here"), nominal, runs)


def test_a_friction_beside_a_bent_spring_hides_no_hold(rubbing: Dataset) -> None:
    found = better_hold(rubbing.fit, rubbing.nominal)
    assert found is not None
    assert found.hold == "band-limited"


def test_the_weak_form_finds_friction_beside_a_cube(rubbing: Dataset) -> None:
    told = bent_response(rubbing.held("band-limited").fit, rubbing.nominal)
    assert told is not None
    # Volts are micrometres. The sign of a measured speed is that of the true one but for where it turns round.
    assert told.linear["m"] == pytest.approx(RUBBING.m * 1e-6, rel=1e-2)
    assert told.cubic[0][0] == pytest.approx(RUBBING.k3 * 1e-18, rel=1e-2)
    assert told.friction[0] == pytest.approx(RUBBING.friction, rel=0.1)
    smooth = RUBBING._replace(friction=0.0)
    told = bent_response([swept("a", 2.0, own=smooth), swept("bb", 4.0, own=smooth)], rubbing.nominal)
    assert told is not None
    assert told.friction == (0.0,)


def test_a_bent_spring_that_rubs_is_named_under_sweeps(rubbing: Dataset) -> None:
    found = diagnose(rubbing, load_model(), jobs=1).report()
    assert found["verdict"] == "missing effects"
    values = {n: p["value"] for e in found["effects"] for n, p in e["parameters"].items()}
    assert {e["id"] for e in found["effects"]} == {"cubic_stiffness", "dry_friction"}
    # The midpoint rule of 24 steps a sample, 1,900 a period of the resonance, shifts it by 1e-6.
    assert values["k3_x"] == pytest.approx(RUBBING.k3 * 1e-18, rel=1e-3)
    assert values["friction_x"] == pytest.approx(RUBBING.friction, rel=1e-3)
    assert values["friction_speed"] == pytest.approx(RUBBING.speed * 1e6, rel=0.1)


def test_a_spring_and_a_damping_that_bend_by_no_more_than_a_resonance_are_found_together() -> None:
    # A resonator as small as they are made, let go three times, whose speed is seen in noise: no score sees either of
    # the two without the other.
    w, far, rate = 2 * np.pi * 12e3, 4e-6, 1e5
    k3, d2 = 2e-3 * w**2 / far**2, 1.2 * (w / 900) / far**2

    def swung(state: Floats) -> Floats:
        return np.array([state[1], -(w / 900 + d2 * state[0] ** 2) * state[1] - (w**2 + k3 * state[0] ** 2) * state[0]])

    def decay(name: str, role: str, begin: float) -> Record:
        rng, h, state, v = (
            np.random.default_rng(int(1e7 * begin)),
            1 / (12 * rate),
            np.array([begin, 0.0]),
            np.zeros(8000),
        )
        for i in range(len(v)):
            v[i] = state[1]
            for _ in range(12):
                a = swung(state)
                b = swung(state + h / 2 * a)
                c = swung(state + h / 2 * b)
                state = state + h / 6 * (a + 2 * b + 2 * c + swung(state + h * c))
        noisy = v + 1e-3 * np.abs(v).max() * rng.standard_normal(len(v))
        return make_record(name, np.arange(len(v)) / rate, np.zeros(len(v)), noisy, role=role, senses="velocity")

    records = (decay("a", "fit", 4e-6), decay("b", "fit", 3e-6), decay("c", "held-out", 2e-6))
    gain = records[0].reference
    nominal = linear_start(records[:2], (gain,))
    assert nominal is not None
    data, lines = Dataset(Path("here"), nominal, records, estimated=("kxx", "dxx")), list[str]()
    found = diagnose(data, load_model(), jobs=1, progress=lines.append)
    assert {e.id for e in found.effects} == {"cubic_stiffness", "nonlinear_damping"}
    # Else a hysteresis is taken for them, and its rivals take the time.
    assert not any("hysteresis" in line for line in lines)
    assert found.verdict == "missing effects"
    for effect, name, true in zip(found.effects, ("k3_x", "d2_x"), (k3, d2), strict=True):
        value = effect.parameters[name]
        # Twice the 95 % interval: one of 16,000 leaves it by chance.
        assert abs(value.value - true) < value.high - value.low, name
