"""The simulation of records: how the force runs between samples, against exact responses of the linear oscillator."""

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.signal import lsim

from discrepancy.record import Record, make_record
from discrepancy.simulate import Simulator
from gyro_model.model import load_model

OSCILLATOR = {"m": 5e-6, "kxx": 1.0, "dxx": 2.5e-4, "sense_gain_x": 1.0}
"""71 Hz, Q = 9."""
PERIOD = 1 / 610.35
"""Longer than the longest step of the FMU: nine samples in a period of the mode."""
SETTLED = 400
"""Samples after which the start has decayed to exp(-25 x 0.66) = 1e-7."""


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(load_model(), jobs=1) as made:
        yield made


def record(hold: str, frequency: float) -> Record:
    t = np.arange(2000) * PERIOD
    u = 0.02 * np.sin(2 * np.pi * frequency * t)
    return make_record("run", t, u, u, sample_rate=1 / PERIOD, hold=hold)


def exact(run: Record, interp: bool) -> np.ndarray:
    """The oscillator from rest under a force that is held (or linear) between samples, by matrix exponentials."""
    p = OSCILLATOR
    return np.asarray(lsim(([1], [p["m"], p["dxx"], p["kxx"]]), run.u[:, 0], run.t, interp=interp)[1])


@pytest.mark.parametrize("frequency", [40.0, 70.0, 200.0])
def test_force_held_over_a_long_period(simulator: Simulator, frequency: float) -> None:
    run = record("zero", frequency)
    v = simulator.run(run, OSCILLATOR)[:, 0]
    # Order 8 at steps of half a period, w h = 0.36: (w h)^9/9! = 3e-10 a step, over the 26 steps of a decay.
    assert np.abs(v - exact(run, False)).max() < 1e-8 * np.abs(v).max()


@pytest.mark.parametrize(("frequency", "relative"), [(40.0, 1e-4), (70.0, 1e-4), (200.0, 2e-2)])
def test_force_linear_between_samples(simulator: Simulator, frequency: float, relative: float) -> None:
    run = record("first", frequency)
    v = simulator.run(run, OSCILLATOR)[SETTLED:, 0]
    # What is left is of fourth order: (pi f h)^4 = 3e-5 at the mode, 1e-2 at 200 Hz, for steps h of a third; a plain
    # hold of the middle would be off by (pi f h)^2/3 = 5e-3 at the mode.
    assert np.abs(v - exact(run, True)[SETTLED:]).max() < relative * np.abs(v).max()


@pytest.mark.parametrize(("frequency", "relative"), [(40.0, 2e-5), (70.0, 1e-5), (200.0, 2e-3)])
def test_force_band_limited(simulator: Simulator, frequency: float, relative: float) -> None:
    run, w = record("band-limited", frequency), 2 * np.pi * frequency
    # The ends of a record do not say how the force ran beyond them.
    inside = slice(SETTLED, -SETTLED)
    v = simulator.run(run, OSCILLATOR)[inside, 0]
    p = OSCILLATOR
    response = 1 / (p["kxx"] - p["m"] * w**2 + 1j * w * p["dxx"])
    true = 0.02 * np.imag(response * np.exp(1j * w * run.t[inside]))
    # Only images at 3/T - f are left, f/(3/T - f) as strong, and weaker in the motion by (f0/(3/T - f))^2 over the
    # response at f: 2e-5 at 40 Hz, 6e-5/Q at the mode, 2e-3 at 200 Hz.
    assert np.abs(v - true).max() < relative * np.abs(true).max()
