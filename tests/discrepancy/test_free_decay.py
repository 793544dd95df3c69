"""A strongly nonlinear resonator that rings freely, by a simulation of its own: over its first record a linear model
is out of step by half a hundred turns."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discrepancy.data.dataset import Dataset
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Record, make_record
from discrepancy.diagnose import diagnose
from discrepancy.fit.measures import start_fitted
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name.bending import bending
from discrepancy.name.search import Given, Search
from gyro_model.model import load_model

RATE, SAMPLES, FREQUENCY, Q = 100e3, 24_000, 5000.0, 1000.0
STIFFENING, AMPLITUDE, NOISE = 0.05, 0.4, 1e-4
"""k3 A²/k of the first turn; its voltage [V], and noise over it."""


@pytest.fixture(scope="module")
def runs() -> tuple[Record, ...]:
    rng, w = np.random.default_rng(2), 2 * np.pi * FREQUENCY
    t = np.arange(SAMPLES) / RATE

    def slope(_: float, s: np.ndarray) -> np.ndarray:
        return np.array([s[1], -w / Q * s[1] - w**2 * (s[0] + STIFFENING * s[0] ** 3)])

    # The phase, some 7,500 rad, to 1e-5.
    x = solve_ivp(slope, (0, t[-1]), [1.0, 0.0], t_eval=t, method="DOP853", rtol=1e-10, atol=1e-13).y[0]
    v = AMPLITUDE * (x + NOISE * rng.standard_normal(SAMPLES))
    parts = (("ring", "fit", slice(0, 16_000)), ("tail", "held-out", slice(16_000, None)))
    return tuple(
        make_record(
            name, t[own] - t[own][0], np.zeros((len(t[own]), 1)), v[own, None], sample_rate=RATE, role=role, hold="zero"
        )
        for name, role, own in parts
    )


def test_a_cubic_stiffness_is_found_and_stays_in_step(runs: tuple[Record, ...]) -> None:
    nominal = linear_start(runs[:1], (1.0,))
    assert nominal is not None
    found = diagnose(Dataset(Path(), nominal, runs), load_model(), jobs=1)
    [finding] = found.effects
    assert (found.verdict, finding.id) == ("missing effects", "cubic_stiffness")
    assert not any("in step" in doubt for doubt in found.doubts)
    # The mass is 1 kg, which no sample knows, and the sensor has 1 V/m.
    true = nominal["m"] * STIFFENING * (2 * np.pi * FREQUENCY / AMPLITUDE) ** 2
    value = finding.parameters["k3_x"]
    # Four deviations instead of the two of the interval; its width is 1e-5 of the value.
    assert abs(value.value - true) < value.high - value.low < 1e-4 * true


def test_a_decay_by_friction_alone_sets_out_from_where_it_was_let_go() -> None:
    """From rest the friction lets no force of the spring go: no fit of initial states that begins there ends elsewhere.
    The motion is that of C. A. Coulomb: half turns about where the spring holds the friction, one way and the other."""
    stiffness, held, amplitude, turn = 400.0, 0.02, 1.0, 20.0
    t = np.arange(4000) / 1000.0
    half = np.floor(turn * t / np.pi)
    amplitudes = np.maximum(amplitude - (2 * half + 1) * held, 0.0)
    v = amplitudes * np.cos(turn * t) + held * (-1) ** half
    record = make_record("a", t, np.zeros((len(t), 1)), v[:, None], sample_rate=1000.0, hold="zero")
    own = {"m": stiffness / turn**2, "kxx": stiffness, "dxx": 1e-6, "sense_gain_x": 1.0,
           "friction_x": held * stiffness, "friction_speed": 1e-3}  # fmt: skip
    with Simulator(load_model(), jobs=1) as simulator:
        residual, unscored = start_fitted(simulator, record, own)
    # The model's friction turns over within 1e-3 m/s of 20 m/s, twice a turn.
    assert np.sqrt(np.mean(residual[unscored:] ** 2)) < 1e-2 * np.sqrt(np.mean(v**2))


def test_a_linear_decay_is_fitted_to_its_minimum() -> None:
    """At rest a decay shows neither stiffness nor damping, and a fit of the initial states alone keeps its promise."""
    rng, w, s = np.random.default_rng(1), 2 * np.pi * 120.0, 2.5
    t = np.arange(9000) / 8000.0
    v = np.exp(-s * t) * np.cos(w * t) + 1e-3 * rng.standard_normal(len(t))
    record = make_record("a", t, np.zeros((len(t), 1)), v[:, None], sample_rate=8000.0, hold="zero")
    nominal = {"m": 1.0, "kxx": w**2 * (1 + 1e-5), "dxx": 2 * s * 1.002, "sense_gain_x": 1.0}
    with Simulator(load_model(), jobs=1) as simulator:
        fitter = Fitter(simulator, [record])
        found = fitter.fit(replace(fitter.begin(nominal), whiten=fitter.plain(nominal)))
        deviation = fitter.deviations(found)
    # Four deviations: one in 8,000 draws is farther off, and the nominal damping is 11 of them off.
    assert abs(found.parameters["dxx"] - 2 * s) < 4 * deviation["dxx"] < 0.4 * 2 * s * 0.002


def test_a_pendulum_let_go_near_a_right_angle_softens() -> None:
    """No linear model stays in step with a dozen of its periods: sin x is x - x³/6 and little more."""
    rng, rate = np.random.default_rng(4), 50.0
    t = np.arange(2500) / rate
    w = 2 * np.pi

    def slope(_: float, s: np.ndarray) -> np.ndarray:
        return np.array([s[1], -0.1 * s[1] - w**2 * np.sin(s[0])])

    x = solve_ivp(slope, (0, t[-1]), [1.5, 0.0], t_eval=t, method="DOP853", rtol=1e-10, atol=1e-12).y[0]
    v = x + 2e-3 * rng.standard_normal(len(t))
    record = make_record("a", t, np.zeros((len(t), 1)), v[:, None], sample_rate=rate, hold="zero")
    nominal = linear_start([record], (1.0,))
    assert nominal is not None
    with Simulator(load_model(), jobs=1) as simulator:
        data, whole = Dataset(Path(), nominal, (record,)), Fitter(simulator, (record,))
        found = bending(Search.of(Given(data), data, whole, whole.begin(nominal)))
    assert found is not None
    assert "cubic_stiffness" in [own.effect.id for own in found.taken]
    # Between the slope at rest, 1/6, and that of the best cubic up to 1.5, 0.145.
    assert 0.14 < -found.at.parameters["k3_x"] / found.at.parameters["kxx"] < 0.167
