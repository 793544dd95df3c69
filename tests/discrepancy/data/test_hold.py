"""How the force ran between samples, by the response of a mode under many tones in closed form."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete, lfilter

from discrepancy.data.checks import hold as said
from discrepancy.data.dataset import Dataset
from discrepancy.data.hold import better_hold
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Floats, Record, make_record

RATE, N, M, F, Q = 8e3, 12_000, 2e-3, 900.0, 60.0
NOMINAL = {"m": M, "kxx": M * (2 * np.pi * F) ** 2, "dxx": M * 2 * np.pi * F / Q, "sense_gain_x": 1.0}


def run(true: str, stated: str, noise: float = 1e-3, role: str = "fit") -> Record:
    """The mode under 40 tones that run on, or are held, from sample to sample."""
    rng = np.random.default_rng(1)
    t, w, phase = np.arange(N) / RATE, 2 * np.pi * rng.uniform(500, 1400, 40), rng.uniform(0, 2 * np.pi, 40)
    m, k, d = (NOMINAL[name] for name in ("m", "kxx", "dxx"))
    u = np.cos(w * t[:, None] + phase).sum(axis=1)
    if true == "zero":
        b, a, _ = cont2discrete(([1.0], [m, d, k]), 1 / RATE, "zoh")
        v = lfilter(np.ravel(b), a, u)
    else:
        v = np.real(np.exp(1j * (w * t[:, None] + phase)) / (k - m * w**2 + 1j * d * w)).sum(axis=1)
    v += noise * v.std() * rng.standard_normal(N)
    return make_record("run", t, u[:, None], v[:, None], sample_rate=RATE, role=role, hold=stated)


@pytest.mark.parametrize("true", ["zero", "band-limited"])
@pytest.mark.parametrize("stated", ["zero", "band-limited"])
def test_the_response_tells_a_hold_that_is_stated_wrong(true: str, stated: str) -> None:
    found = better_hold([run(true, stated)], NOMINAL)
    if true == stated:
        assert found is None
    else:
        assert found is not None
        assert found.hold == true
        # Half a sample at nine samples a period is a third of a radian: 0.1 of the force's power.
        assert found.given > 0.03
        assert found.left < 1e-3


def accelerations(true: str, above: float = 0.0) -> tuple[Floats, Floats, Floats, float]:
    """Time [s], force [N], voltage [V] and sample rate [Hz] of a mass with two others: no single mode explains them.
    ``above``: modes beyond the band, of which an accelerometer sees 1/kg at once."""
    rng, rate = np.random.default_rng(1), 400.0
    t, w, phase = np.arange(N) / rate, 2 * np.pi * rng.uniform(3, 16, 60), rng.uniform(0, 2 * np.pi, 60)
    tones, s = np.exp(1j * (w * t[:, None] + phase)), 1j * w
    u, modes = tones.real.sum(axis=1), [(4.0, 40.0, 0.3), (7.3, 25.0, 0.5), (12.0, 50.0, 0.4)]
    # Just before the force changes: what it makes at once comes a sample late.
    late = np.concatenate(([0.0], u[:-1]))
    parts = [above * (late if true == "zero" else u)]
    for f, q, share in modes:
        own = [1.0, 2 * np.pi * f / q, (2 * np.pi * f) ** 2]
        if true == "zero":
            b, a, _ = cont2discrete(([share, 0.0, 0.0], own), 1 / rate, "zoh")
            parts.append(lfilter(np.ravel(b) - share * np.asarray(a), a, u) + share * late)
        else:
            parts.append(np.real(tones * share * s**2 / np.polyval(own, s)).sum(axis=1))
    v = sum(parts)
    return t, u, v + 1e-3 * v.std() * rng.standard_normal(N), rate


@pytest.mark.parametrize("true", ["zero", "band-limited"])
@pytest.mark.parametrize("above", [0.0, -0.5])
def test_so_does_that_of_several_modes(true: str, above: float) -> None:
    t, u, v, rate = accelerations(true, above)
    nominal = {"m": 1.0, "kxx": 1.2e3, "dxx": 1.0, "sense_gain_x": 1.0}
    for stated in ("zero", "band-limited"):
        record = make_record("run", t, u[:, None], v[:, None], sample_rate=rate, hold=stated, senses="acceleration")
        found = better_hold([record], nominal)
        assert (found.hold if found else stated) == true
        assert found is None or found.left < 2e-3


@pytest.mark.parametrize("true", ["zero", "band-limited"])
def test_a_diagnosis_begins_with_what_nobody_has_stated(true: str) -> None:
    data = Dataset(Path(), NOMINAL, (run(true, "zero"), run(true, "zero", role="held-out")))
    assert {record.hold for record in data.shown.records} == {true}
    stated = replace(data, hold_stated=True)
    assert stated.shown is stated


def test_noise_that_hides_it_says_nothing() -> None:
    assert better_hold([run("band-limited", "zero", noise=1.0)], NOMINAL) is None


def test_a_diagnosis_says_what_to_write() -> None:
    data = Dataset(Path(), NOMINAL, (run("band-limited", "zero"), run("band-limited", "zero", role="held-out")))
    [finding] = said(data)
    assert 'write hold = "band-limited"' in finding.message


def test_a_force_that_ran_on_is_seen_though_the_spring_hardens() -> None:
    # Without unit: a spring that is 1.3 times as hard at 1, Q 50, swept over its resonance, twelve samples a period.
    t, h = np.arange(6000) * np.pi / 6, np.pi / 6

    def force(at: Floats) -> Floats:
        return np.asarray(0.05 * np.sin(0.85 * at + 0.6 * at**2 / t[-1] / 2))

    def rate(at: float, s: Floats) -> tuple[float, float]:
        return s[1], float(force(np.array(at))) - 0.02 * s[1] - s[0] - 0.3 * s[0] ** 3

    x = solve_ivp(rate, (0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-8, atol=1e-10, max_step=0.5).y[0]
    runs = [make_record("run", t, force(t), x, sample_rate=1 / h)]
    values = linear_start(runs, (1.0,))
    assert values is not None
    found = better_hold(runs, values)
    assert found is not None
    assert found.hold == "band-limited"


def pushed(name: str, rng: np.random.Generator, noise: float) -> Record:
    """A mass of 4.7 kg on air from rest, pushed by a smooth force in steps of a twentieth of a sample."""
    rate, m, d, fine, count = 2000.0, 4.7, 0.9, 20, 12000
    t, step = np.arange(fine * count) / (fine * rate), 1 / (fine * rate)
    u = sum(np.sin(w * t + rng.uniform(0, 2 * np.pi)) for w in 2 * np.pi * np.arange(2.0, 80.0, 1.5))
    kept = np.exp(-d / m * step)
    speed = np.concatenate(([0.0], lfilter([(1 - kept) / d], [1.0, -kept], 0.5 * (u[1:] + u[:-1]))))
    x = np.concatenate(([0.0], np.cumsum(0.5 * step * (speed[1:] + speed[:-1]))))[::fine]
    # Of what it swings by beside where it goes.
    swings = x - np.polynomial.Polynomial.fit(t[::fine], x, 3)(t[::fine])
    v = x + noise * swings.std() * rng.standard_normal(count)
    return make_record(name, np.arange(count) / rate, u[::fine], v, sample_rate=rate)


def test_of_a_mass_that_nothing_holds_half_a_sample_shows_beside_noise() -> None:
    rng = np.random.default_rng(4)
    records = [pushed(name, rng, 0.01) for name in "ab"]
    nominal = linear_start(records, (1.0,))
    assert nominal is not None
    better = better_hold(records, nominal)
    # Noise hides by how much: the hold that is given leaves no three times as much.
    assert better is not None and better.hold == "band-limited" and better.given < 3 * better.left
    # Of a force that is said to run on nothing else is better.
    assert better_hold([replace(record, hold=better.hold) for record in records], nominal) is None
