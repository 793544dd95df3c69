"""An offset far beyond the motion is taken off and said; a deflection that may be an answer stays."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.data.offset import levelled
from discrepancy.data.record import Record, Senses, make_record
from gyro_model.model import load_model

MODEL = load_model()


def run(offset: float, force: float = 0.0, seed: int = 1, strength: float = 1.0) -> Record:
    rng = np.random.default_rng(seed)
    t = np.arange(2000) * 1e-4
    v = strength * np.sin(2 * np.pi * 100 * t)[:, None] + 1e-3 * rng.normal(size=(2000, 1)) + offset
    u = np.cos(2 * np.pi * 100 * t)[:, None] + force
    return make_record(f"run-{seed}", t, u, v, sample_rate=1e4, role="fit", conditions={})


def test_an_offset_beyond_the_motion_is_taken_off_and_said() -> None:
    runs, left, said = levelled([run(17.0), run(17.2, seed=2)], {}, MODEL)
    # The mean of both; a record of 2000 samples in 20 whole periods has its own mean to 1e-4.
    assert np.allclose([r.v.mean() for r in runs], [-0.1, 0.1], atol=1e-3)
    assert len(said) == 1
    assert "v_x stands at 17.1 V" in said[0]
    # A held-out run has no say, and is levelled by the others.
    seen, _, _ = levelled([run(17.0), replace(run(27.0, seed=2), role="held-out")], {}, MODEL)
    assert np.allclose([r.v.mean() for r in seen], [0.0, 10.0], atol=1e-3)
    # What the mean leaves is fitted, and not named.
    assert left.keys() == {"offset_x"}


@pytest.mark.parametrize(("offset", "strength", "taken"), [(1.5, 0.25, True), (1.5, 1.0, False), (0.5, 0.25, False)])
def test_runs_of_unlike_strength_that_stand_at_one_place_have_an_offset(
    offset: float, strength: float, taken: bool
) -> None:
    runs, _, said = levelled([run(offset), run(offset, seed=2, strength=strength)], {}, MODEL)
    assert bool(said) == taken
    assert runs[0].v.mean() == pytest.approx(0.0 if taken else offset, abs=1e-3)


def test_what_bends_with_the_motion_stays() -> None:
    # A mean that goes with the square of the motion, 2.1 times the strongest.
    runs = [run(1.5), run(1.5 / 16, seed=2, strength=0.25)]
    assert levelled(runs, {}, MODEL).said == ()


def test_what_may_be_the_device_s_own_stays() -> None:
    for runs in (
        [run(1.0)],
        [run(17.0, force=0.5)],
        [run(17.0), run(27.0, seed=2)],
    ):
        assert levelled(runs, {}, MODEL) == (tuple(runs), {}, ())
    own = next(q for e in MODEL.effects if e.id == "amplifier_offset" for q in e.sizes)
    assert levelled([run(17.0)], {own.name: 17.0}, MODEL).said == ()


@pytest.mark.parametrize("senses", ["velocity", "acceleration"])
def test_the_mean_of_a_velocity_or_an_acceleration_is_the_sensor_s(senses: Senses) -> None:
    # As an accelerometer under gravity or without its zero; a free decay is no different.
    for force in (1.0, 0.0):
        own = replace(run(0.3), senses=senses, u=force * run(0.3).u)
        [levelled_run], left, said = levelled([own], {}, MODEL)
        assert abs(levelled_run.v.mean()) < 1e-12
        assert not left
        assert "v_x stands at 0.299987 V" in said[0]
    # A force with a mean may turn or push a mass on and on; and a motion that ends elsewhere has a small mean.
    for stays in (run(0.3, force=0.5), run(0.02)):
        own = replace(stays, senses=senses)
        assert levelled([own], {}, MODEL) == ((own,), {}, ())
