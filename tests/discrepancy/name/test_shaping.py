"""Shapes that a search does not try: they move once their effect is in the model and the data ask for others."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from discrepancy.data.dataset import Dataset
from discrepancy.data.record import Floats, Record, make_record
from discrepancy.diagnose import diagnose
from discrepancy.fit.fitted import Free
from discrepancy.name.columns import Candidate
from discrepancy.name.shaping import unmoved
from discrepancy.tell.answer import Diagnosis
from gyro_model.errors import InputError
from gyro_model.grid import Grid
from gyro_model.model import load_model

M, K, D = 2.0, 5e4, 10.0
"""25 Hz, Q = 32."""
H, LENGTH = 6.0, 1e-4
"""Of a hysteresis whose shares do not sum to one."""
RATE, SAMPLES, NOISE = 750.0, 4000, 2e-3
"""Noise over the motion, rms."""


def moved(u: Floats, beta: float, gamma: float, n: float) -> Floats:
    """The mass from rest under a held force, by 8 steps of RK4 a sample: no line of it is the FMU's."""
    h, found = 1 / (8 * RATE), np.empty(len(u))
    x = v = z = 0.0

    def rate(v: float, x: float, z: float, force: float) -> tuple[float, float, float]:
        bent = abs(z) ** (n - 1) * (beta * abs(v) * z + gamma * v * abs(z))
        return v, (force - D * v - K * x - H * z) / M, (v - bent) / LENGTH

    for i, force in enumerate(u):
        found[i] = x
        for _ in range(8):
            a = rate(v, x, z, force)
            b = rate(v + h / 2 * a[1], x + h / 2 * a[0], z + h / 2 * a[2], force)
            c = rate(v + h / 2 * b[1], x + h / 2 * b[0], z + h / 2 * b[2], force)
            d = rate(v + h * c[1], x + h * c[0], z + h * c[2], force)
            x, v, z = (s + h / 6 * (p + 2 * q + 2 * r + e) for s, p, q, r, e in zip((x, v, z), a, b, c, d, strict=True))
    return found


def run(name: str, role: str, seed: int, beta: float, gamma: float, n: float, noise: float) -> Record:
    rng, t = np.random.default_rng(seed), np.arange(SAMPLES) / RATE
    frequency = rng.uniform(5, 60, 40)
    u = 2.0 * np.sin(2 * np.pi * frequency * t[:, None] + rng.uniform(0, 2 * np.pi, 40)).sum(axis=1)
    x = moved(u, beta, gamma, n)
    v = x + noise * x.std() * rng.standard_normal(SAMPLES)
    return make_record(name, t, u, v, role=role, sample_rate=RATE)


def answer(beta: float, gamma: float, n: float, noise: float = NOISE) -> Diagnosis:
    runs = (run("a", "fit", 1, beta, gamma, n, noise), run("b", "held-out", 2, beta, gamma, n, noise))
    nominal = {"m": 1.02 * M, "kxx": 0.98 * K, "dxx": D, "sense_gain_x": 1.0}
    return diagnose(Dataset(Path("here"), nominal, runs), load_model())


@pytest.mark.parametrize(("beta", "gamma", "n"), [(1.2, 0.4, 2.0), (0.15, 0.75, 1.0)])
def test_a_hysteresis_is_found_whatever_its_shares_and_its_sharpness(beta: float, gamma: float, n: float) -> None:
    found = answer(beta, gamma, n)
    [effect] = found.effects
    assert effect.id == "hysteresis" and found.verdict == "missing effects"
    # The scale of its state that makes the shares sum to one.
    scale = (beta + gamma) ** (-1 / n)
    true = {"hysteresis_x": H * scale, "hysteresis_length": LENGTH * scale, "hysteresis_beta": beta / (beta + gamma)}
    true |= {"hysteresis_gamma": gamma / (beta + gamma)} | ({"hysteresis_n": n} if n > 1 else {})
    assert set(effect.parameters) == set(true)
    for name, value in true.items():
        own = effect.parameters[name]
        # 95 % intervals of four parameters each: one in ten would miss by chance, none by as much again.
        assert abs(own.value - value) < own.high - own.low, name


@pytest.mark.parametrize(("beta", "gamma"), [(0.8, -1.1), (0.3, -0.5)])
def test_a_hysteresis_without_a_limit_is_named_alone(beta: float, gamma: float) -> None:
    # No scale of its state makes the shares sum to one; with beta as usual, by half over beta, it is this.
    found = answer(beta, gamma, 1.0)
    [effect] = found.effects
    assert effect.id == "hysteresis" and found.verdict == "missing effects"
    scale = 0.5 / beta
    true = {"hysteresis_x": H * scale, "hysteresis_length": LENGTH * scale, "hysteresis_gamma": gamma * scale}
    assert set(effect.parameters) == set(true)
    for name, value in true.items():
        own = effect.parameters[name]
        assert abs(own.value - value) < own.high - own.low, name


def test_a_shape_to_which_another_is_the_rest_does_not_move_a_scale() -> None:
    effect = load_model().effect("hysteresis")
    own = {q.name: q for q in effect.parameters}
    usual = Candidate(effect, (), {}, (own["hysteresis_length"],))
    alone = replace(usual, searched=(own["hysteresis_length"], own["hysteresis_gamma"]))
    assert [q.name for q in unmoved(usual)] == ["hysteresis_beta", "hysteresis_n"]
    assert [q.name for q in unmoved(alone)] == ["hysteresis_n"]


def test_shapes_stay_where_the_data_ask_for_no_others() -> None:
    [effect] = answer(0.5, 0.5, 1.0).effects
    assert set(effect.parameters) == {"hysteresis_x", "hysteresis_length"}


def test_intervals_hold_the_truth_beside_shapes_that_the_data_do_not_ask_for() -> None:
    # Under so much noise a sharpness of 2.6 is no reason to leave 1, at which force and way differ from the truth by
    # four deviations and more.
    [effect] = answer(0.5, 0.5, 2.6, noise=0.4).effects
    assert set(effect.parameters) == {"hysteresis_x", "hysteresis_length"}
    for name, value in (("hysteresis_x", H), ("hysteresis_length", LENGTH)):
        own = effect.parameters[name]
        assert own.low < value < own.high, name
        # Beside the sharpness they are known to a third still.
        assert own.high - own.low < 0.7 * value, name


def test_a_parameter_moves_against_another() -> None:
    free = Free("a", 1.0, against="b")
    assert free.at(0.7, {"a": 0.5, "b": 0.5, "c": 1.0}) == pytest.approx({"a": 0.7, "b": 0.3})
    assert Free("a", 1.0).at(0.7, {"a": 0.5}) == {"a": 0.7}


def test_a_rest_is_one_to_a_shape_of_its_effect() -> None:
    effect = load_model().effect("hysteresis")
    beta, gamma = (next(q for q in effect.parameters if q.name == f"hysteresis_{own}") for own in ("beta", "gamma"))
    others = tuple(q for q in effect.parameters if q is not gamma)
    assert beta.search == Grid.usual
    lost = replace(gamma, search=Grid.rest("hysteresis_bta"))
    with pytest.raises(InputError, match=r"hysteresis_gamma is the rest to 'hysteresis_bta'.*hysteresis_beta"):
        replace(effect, parameters=(*others, lost))
