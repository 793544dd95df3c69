"""Modes counted from records of a linear system whose modes are known: states under a held force are exact."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from numba import njit
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from structures import Structure

from discrepancy.data.checks import modes
from discrepancy.data.modal import Modal, refined
from discrepancy.data.modes import _in_band, further_modes
from discrepancy.data.record import Floats, Record, make_record

RATE, SAMPLES, GAIN, MASS = 200_000.0, 12_000, 1e6, 1e-7
NOISE = 2e-5
"""V rms a sample: 20 pm."""


def records(
    frequencies: Sequence[float], qualities: Sequence[float], coupling: float, seed: int, kind: str, bend: float = 0.0
) -> tuple[list[Record], Floats]:
    """Runs of a chain of masses, the first two driven and sensed, and its modes [Hz]. coupling: of each further one to
    one of these, over its stiffness; bend: what a cubic spring adds to the first, at a micrometre."""
    rng, n = np.random.default_rng(seed), len(frequencies)
    own = (2 * np.pi * np.array(frequencies)) ** 2
    stiffness = np.diag(own)
    stiffness[0, 1] = stiffness[1, 0] = 0.1 * own[0]
    for j in range(2, n):
        stiffness[j % 2, j] = stiffness[j, j % 2] = -coupling * own[0]
    damping = np.diag(np.sqrt(own) / qualities)
    rates = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]])
    moved = expm(np.block([[rates, np.eye(2 * n)], [np.zeros((2 * n, 4 * n))]]) / RATE)
    step, into = moved[: 2 * n, : 2 * n], moved[: 2 * n, 2 * n + n : 2 * n + n + 2] / MASS
    found = []
    for number in range(3):
        t = np.arange(SAMPLES) / RATE
        u = driven(rng, kind, t, 0.4 * min(frequencies), 1.3 * max(frequencies))
        u *= 1e-6 * own[0] * MASS / 40
        v = GAIN * moved_by(u, step, np.ascontiguousarray(into), bend * own[0] * MASS / 1e-12)
        v += NOISE * rng.standard_normal(v.shape)
        found.append(make_record(f"run-{number}", t, u, v, sample_rate=RATE))
    return found, np.sort(np.sqrt(np.linalg.eigvalsh(stiffness))) / (2 * np.pi)


@njit(cache=True)
def moved_by(u, step, into, cubic):  # type: ignore[no-untyped-def]
    """Displacements (n, 2) [m] under held forces, and a cubic spring [N/m³] on the first mass."""
    x, found = np.zeros(len(step)), np.empty_like(u)
    for k in range(len(u)):
        found[k] = x[:2]
        # Held over the step as it is in its middle, so that no energy comes with it.
        middle = x[0] + 0.5 / RATE * x[len(step) // 2]
        force = u[k].copy()
        force[0] -= cubic * middle**3
        x = step @ x + into @ force
    return found


def driven(rng: np.random.Generator, kind: str, t: Floats, low: float, high: float) -> Floats:
    """Forces (n, 2) of rms 1 between two frequencies [Hz]."""
    if kind == "sweep":
        phase = np.cumsum(low + (high - low) * t / t[-1]) * 2 * np.pi / RATE
        return np.sqrt(2) * np.column_stack([np.sin(phase + rng.uniform(0, 6)), np.sin(phase + rng.uniform(0, 6))])
    f = np.fft.rfftfreq(len(t), 1 / RATE)
    band = ((f > low) & (f < high))[:, None] * np.exp(2j * np.pi * rng.uniform(size=(len(f), 2)))
    u = np.fft.irfft(band, len(t), axis=0)
    return np.asarray(u / u.std(axis=0))


@pytest.mark.parametrize("kind", ["noise", "sweep"])
@pytest.mark.parametrize("seed", range(3))
def test_further_modes_are_found_at_their_frequencies(kind: str, seed: int) -> None:
    drawn = np.random.default_rng([seed, 1])
    base = drawn.uniform(2000, 6000)
    runs, true = records(base * np.array([1, 1.25, 0.6, 1.7]), [1500, 1500, 150, 300], 0.15, seed, kind)
    own, more = further_modes(runs)
    said = sorted(mode.frequency for mode in (*own, *more))
    # Of a run of 60 ms a peak of Q 150 is as broad as 1/150; its middle is known a hundred times better.
    assert said == pytest.approx(true.tolist(), rel=2e-3)
    assert len(own) == 2
    assert [finding.check for finding in modes(own, more)] == ["modes"]


@pytest.mark.parametrize("kind", ["noise", "sweep"])
@pytest.mark.parametrize("bend", [0.0, 0.02, 0.2])
def test_two_modes_are_two_however_the_first_bends(kind: str, bend: float) -> None:
    for seed in range(3):
        runs, _ = records([3000, 3800], [2000, 2000], 0.0, seed, kind, bend)
        own, more = further_modes(runs)
        assert more == []
        assert not list(modes(own, more))


def decay(seed: int, *parts: tuple[float, float, float], noise: float = 1e-3) -> Record:
    """A free decay of modes, each with its frequency [Hz], quality factor and first amplitude [V]."""
    rng, t = np.random.default_rng(seed), np.arange(8000) / RATE
    v = noise * rng.standard_normal(len(t))
    for frequency, quality, amplitude in parts:
        rate = np.pi * frequency / quality
        v += amplitude * np.exp(-rate * t) * np.cos(2 * np.pi * frequency * t + rng.uniform(0, 6))
    return make_record("ring", t, np.zeros((len(t), 1)), v[:, None], sample_rate=RATE)


def bent_decay(seed: int, cubic: float, square: float, friction: float) -> Record:
    """A free decay of one mode of 2 kHz and Q 150 with springs x³ and x², in shares of the linear one at first, and a
    dry friction."""
    w, t = 2 * np.pi * 2000.0, np.arange(8000) / RATE

    def slope(_: float, s: Floats) -> Floats:
        force = s[0] + cubic * s[0] ** 3 + square * s[0] ** 2 + friction * np.tanh(1e3 * s[1] / w)
        return np.array([s[1], -w / 150 * s[1] - w**2 * force])

    v = solve_ivp(slope, (0, t[-1]), [1.0, 0.0], t_eval=t, method="LSODA", rtol=1e-8, atol=1e-10).y[0]
    v += 1e-4 * np.random.default_rng(seed).standard_normal(len(t))
    return make_record("ring", t, np.zeros((len(t), 1)), v[:, None], sample_rate=RATE)


@pytest.mark.parametrize("seed", range(3))
def test_modes_of_a_free_decay_are_told_with_frequency_and_quality(seed: int) -> None:
    own, more = further_modes([decay(seed, (2000, 150, 1.0), (4700, 200, 0.1))])
    assert [mode.frequency for mode in own] == pytest.approx([2000], rel=1e-2)
    [mode] = more
    assert mode.frequency == pytest.approx(4700, rel=1e-3)
    assert mode.quality == pytest.approx(200, rel=0.05)
    own, more = further_modes([decay(seed, (2000, 150, 1.0), (3320, 120, 0.2), (5600, 200, 0.1))])
    assert [mode.frequency for mode in more] == pytest.approx([3320, 5600], rel=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_a_mode_far_below_the_others_keeps_its_quality(seed: int) -> None:
    # 40 samples, as many as a subspace sees ahead, are less than a period of the lowest.
    own, more = further_modes([decay(seed, (900, 55, 1.0), (5800, 50, 0.4), (16000, 45, 0.3), noise=1e-4)])
    found = [*own, *more]
    assert [mode.frequency for mode in found] == pytest.approx([900, 5800, 16000], rel=1e-3)
    assert [mode.quality for mode in found] == pytest.approx([55, 50, 45], rel=0.05)


def test_in_a_free_decay_of_two_axes_each_has_a_mode_of_its_own() -> None:
    x, y = (decay(seed, part, noise=1e-4) for seed, part in enumerate([(2000, 150, 1.0), (3320, 120, 0.5)]))
    both = replace(x, u=np.zeros((len(x.t), 2)), v=np.hstack((x.v, y.v)))
    own, more = further_modes([both])
    assert [mode.frequency for mode in own] == pytest.approx([2000, 3320], rel=1e-3)
    assert more == []


def test_poles_end_where_no_move_fits_better() -> None:
    true = np.array([2000.0, 3320.0])
    runs = _in_band([decay(1, (2000, 150, 1.0), (3320, 120, 0.2))])
    model = refined(runs, np.exp(2 * np.pi * runs.step * true * (1.003j - 0.02)))
    assert np.angle(model.poles) / (2 * np.pi * runs.step) == pytest.approx(true, rel=1e-4)
    for i, way in product(range(2), (1.0, -1.0, 1j, -1j)):
        moved = model.poles.copy()
        moved[i] *= np.exp(0.02 * way * np.log(np.abs(moved[i])))
        assert Modal(runs, moved).left > model.left


@pytest.mark.parametrize(
    ("cubic", "square", "friction"),
    [(0, 0, 0), (0.02, 0, 0), (0.1, 0, 0), (0.3, 0, 0), (0.5, 0, 0), (-0.2, 0, 0), (0.05, 0.2, 0), (0, 0, 0.005),
     (0.3, 0, 0.01)],
)  # fmt: skip
def test_one_mode_is_one_however_its_decay_bends(cubic: float, square: float, friction: float) -> None:
    for seed in range(2):
        assert further_modes([bent_decay(seed, cubic, square, friction)])[1] == []


def test_modes_come_in_the_order_of_their_frequencies() -> None:
    runs, _ = records([3000, 3800, 1900, 5200], [2000, 2000, 150, 200], 0.15, 4, "noise")
    for found in further_modes(runs):
        assert all(a.frequency < b.frequency for a, b in pairwise(found))


def test_of_a_model_without_poles_all_is_left() -> None:
    runs = _in_band(records([3000.0, 4000.0], [100.0, 100.0], 0.1, 1, "noise")[0])
    # A force that acts on a resonance is in quadrature with most of its answer.
    assert 0.5 < Modal(runs, np.array([], np.complex128)).left <= 1.0


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_what_an_acceleration_shows_at_once_is_no_mode(hold: str) -> None:
    # The light mass is pushed, so that much of the force is seen before anything moves, and a sample late where it is
    # held: that passed for a mode at 182 Hz.
    two = Structure(np.array([1.0, 0.8]), np.array([[7e4, -3e4], [-3e4, 3e4]]), [1], [1])
    run = two.record("a", "fit", 1, 1e-3, accelerations=True)
    first, further = further_modes([replace(run, hold=hold)])  # type: ignore[arg-type]
    found = sorted(mode.frequency for mode in (*first, *further))
    assert found == pytest.approx(two.frequencies(held=[]), rel=1e-3)
