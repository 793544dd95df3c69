"""Samples beside jumps of an acceleration, against a motion by no line of the FMU."""

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from benchmarks import rubbing
from benchmarks.rubbing import Rubbing, motion
from benchmarks.structures import Structure
from discrepancy.criteria import Criteria
from discrepancy.data.record import Hold, Record, Senses, make_record
from discrepancy.fit.defect import Blemish, Left, blemishes
from discrepancy.fit.simulate import Simulator
from gyro_model.model import load_model

RATE, SAMPLES, NOISE = 600.0, 2000, 3e-3
SPRING, DAMPER, FRICTION = (2 * np.pi * 30) ** 2, 10.0, 0.2
FINER, STEPS = 24, 40
"""Parts of a sample in which the true motion is known, and steps of each."""
[JUMPS] = [b for b in blemishes() if b.id == "jumps"]


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(load_model(), jobs=1) as made:
        yield made


@cache
def made(hold: Hold, senses: Senses) -> tuple[Record, np.ndarray]:
    """A run of a mass that rubs, and the way it goes in parts of samples, -1, 0 or 1."""
    own = Rubbing(Structure(np.eye(1), DAMPER * np.eye(1), SPRING * np.eye(1), 0, 0), FRICTION, 0.0, 1.0)
    t, rng, f = np.arange(SAMPLES) / RATE, np.random.default_rng(1), np.arange(10, 80) * 0.5
    u = np.cos(2 * np.pi * np.outer(t, f) + rng.uniform(0, 2 * np.pi, len(f))).sum(axis=1)
    u /= u.std()
    at = np.arange(SAMPLES * FINER) / FINER
    finer = u[at.astype(int)] if hold == "zero" else np.interp(at, np.arange(SAMPLES), u)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rubbing, "STEPS", STEPS)
        whole = motion(own, finer, 1 / (RATE * FINER), hold)
    sensed = whole[::FINER, ("position", "velocity", "acceleration").index(senses)]
    v = sensed + NOISE * sensed.std() * rng.standard_normal(SAMPLES)
    run = make_record("run", t, u[:, None], v[:, None], sample_rate=RATE, hold=hold, senses=senses)
    speed = whole[:, 1]
    return run, np.where(np.abs(speed) < 1e-12, 0.0, np.sign(speed))


def device(run: Record, friction: float = FRICTION) -> dict[str, float]:
    return {"m": 1.0, "kxx": SPRING, "dxx": DAMPER, "sense_gain_x": run.reference**run.order, "friction_x": friction,
            "friction_speed": 1e-7}  # fmt: skip


def within(way: np.ndarray, reach: float) -> np.ndarray:
    """Samples that have within so much of a period a place where the mass turns round or stops."""
    at = np.flatnonzero(np.diff(way)) + 0.5
    beside = np.abs(np.round(at / FINER) * FINER - at) <= reach * FINER
    found = np.zeros(SAMPLES, bool)
    found[np.round(at[beside] / FINER).astype(int).clip(0, SAMPLES - 1)] = True
    return found


def residual(simulator: Simulator, run: Record) -> np.ndarray:
    return np.asarray(run.v - simulator.run(run, device(run)))


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_samples_beside_a_jump_are_found(simulator: Simulator, hold: Hold) -> None:
    run, way = made(hold, "acceleration")
    found = JUMPS.find(
        Left([run], [residual(simulator, run)], lambda _: simulator.between_samples(run, device(run))), Criteria()
    )
    assert found is not None
    masked = np.zeros(SAMPLES, bool)
    masked[[int(k) for k in found.data[0]]] = True
    near, not_far = within(way, 0.07), within(way, 0.2)
    assert near.sum() > 20
    # Within a twelfth of a period, and none beyond two; but for a tenth, as where the jump is a part of the noise.
    assert masked[near].mean() > 0.9
    assert not_far[masked].mean() > 0.9
    clean = JUMPS.without(run, found.data[0])
    assert np.array_equal(clean.valid, ~masked)


@pytest.mark.parametrize("senses", ["position", "velocity"])
def test_other_sensors_see_no_jump(simulator: Simulator, senses: Senses) -> None:
    run, _ = made("first", senses)
    assert simulator.between_samples(run, device(run)) is None


def test_without_friction_nothing_jumps(simulator: Simulator) -> None:
    run, _ = made("first", "acceleration")
    assert simulator.between_samples(run, device(run, friction=0.0)) is None


def test_what_jumps_everywhere_is_no_blemish(simulator: Simulator) -> None:
    run, _ = made("first", "acceleration")
    rng = np.random.default_rng(2)
    wild = rng.standard_normal((SAMPLES, 12, 1)) * (rng.random((SAMPLES, 12, 1)) < 0.1)
    assert JUMPS.find(Left([run], [NOISE * rng.standard_normal((SAMPLES, 1))], lambda _: wild), Criteria()) is None


def test_it_is_taken_out_by_what_the_motion_says() -> None:
    assert isinstance(JUMPS, Blemish) and JUMPS.by_motion
