"""The force that drives the steps of a run, against the motion of a free mass by formula."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.data.record import make_record
from discrepancy.fit.forced import steps_a_sample
from discrepancy.fit.simulate import Simulator
from gyro_model.model import load_model

RATE, SAMPLES, LOSS = 2000.0, 4000, 0.4
"""Hz; none; damping over mass [1/s]."""
T = np.arange(SAMPLES) / RATE


def place(w: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Of 1 kg that a damper alone slows down, from rest under forces cos(w t + phase)."""
    z = np.exp(1j * phase) / (1j * w * (1j * w + LOSS))
    swing = (z * np.exp(1j * np.outer(T, w))).sum(axis=1).real
    at, speed = z.sum().real, (1j * w * z).sum().real
    return swing - at - speed * (1 - np.exp(-LOSS * T)) / LOSS


def simulated(u: np.ndarray, hold: str, more: dict[str, float]) -> np.ndarray:
    record = make_record("run", T, u, np.sin(T), sample_rate=RATE, hold=hold)
    parameters = {"m": 1.0, "kxx": 1e-9, "dxx": LOSS, "sense_gain_x": 1.0, **more}
    with Simulator(load_model(), jobs=1) as simulator:
        return simulator.run(record, parameters)[:, 0]


# Behind a delay of next to nothing the force goes in steps a quarter as long.
@pytest.mark.parametrize("more", [{}, {"actuator_delay": 1e-12}], ids=["plain", "late"])
def test_a_free_mass_keeps_the_speed_of_every_push(more: dict[str, float]) -> None:
    # Sines, which go on before the first sample as a record is continued there.
    w, phase = 2 * np.pi * np.array([7.0, 31.0, 300.0]), np.full(3, -np.pi / 2)
    u, true = np.cos(np.outer(T, w) + phase).sum(axis=1), place(w, phase)
    # Steps of 1/6000 s leave 2.4e-6 of a force up to 300 Hz; with a first push that is short they leave 1.3e-5.
    assert np.abs(simulated(u, "band-limited", more) - true).max() < 5e-6 * np.abs(true).max()


def along_lines(u: np.ndarray) -> np.ndarray:
    """Places under a force straight from sample to sample, by the trapezium rule, a hundred steps a sample."""
    fine = 100
    t = np.arange(SAMPLES * fine) / (RATE * fine)
    force = np.interp(t, T, u)
    kept, step = np.exp(-LOSS * t), t[1]
    speed = kept * np.concatenate(([0.0], np.cumsum(0.5 * step * (force[1:] / kept[1:] + force[:-1] / kept[:-1]))))
    return np.concatenate(([0.0], np.cumsum(0.5 * step * (speed[1:] + speed[:-1]))))[::fine]


def test_a_force_on_straight_lines_pushes_as_their_corners_say() -> None:
    u = np.random.default_rng(1).standard_normal(SAMPLES)
    true = along_lines(u)
    # With the error of the rule 1e-7 is left; with a first push that is short 1.6e-4.
    assert np.abs(simulated(u, "first", {}) - true).max() < 1e-6 * np.abs(true).max()


@pytest.mark.parametrize("hold", ["band-limited", "first"])
def test_a_slow_force_goes_in_one_step_a_sample(hold: str) -> None:
    w, phase = 2 * np.pi * np.array([7.0, 31.0]), np.full(2, -np.pi / 2)
    u = np.cos(np.outer(T, w) + phase).sum(axis=1)
    true = place(w, phase) if hold == "band-limited" else along_lines(u)
    record = make_record("run", T, u, np.sin(T), sample_rate=RATE, hold=hold)
    assert steps_a_sample(record) == 1
    for senses in ("velocity", "acceleration"):
        assert steps_a_sample(replace(record, senses=senses)) > 1
    loud = replace(record, u=record.u + 1e-2 * np.random.default_rng(1).standard_normal(record.u.shape))
    assert steps_a_sample(loud) == 1
    # Images at 2 kHz and less are 65 times as fast as what drives.
    assert np.abs(simulated(u, hold, {}) - true).max() < 2e-6 * np.abs(true).max()
