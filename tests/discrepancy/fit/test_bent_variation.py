"""Columns by the variation of a motion that dry friction or stops bend in places, against quotients of simulations."""

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
import pytest

from discrepancy.data.record import Record, make_record
from discrepancy.fit.simulate import Simulator
from gyro_model.device import load_device
from gyro_model.model import load_model

DEVICE: Final = load_device("reference").all_parameters | {"sense_noise": 0.0, "x_start": 2e-7, "kxy": 0.0, "dxy": 0.0}
PERIOD: Final = 5e-6
SAMPLES: Final = 4000
STEEP: Final = {"friction_x": 2e-6, "friction_speed": 1e-6}
MODE: Final = {
    "parasitic_coupling": 5.0, "parasitic_frequency": 4100.0, "parasitic_q": 300.0, "parasitic_joint": 1.0,
}  # fmt: skip
BASES: Final = {
    "steep": STEEP,
    "soft": {"friction_x": 2e-6, "friction_speed": 1e-3},
    "excess at rest": {**STEEP, "stribeck": 0.4, "stribeck_speed": 1e-5},
    "beside a mode": {**STEEP, **MODE},
    "beside a cubic stiffness": {**STEEP, "k3_x": 2e9},
    "beside a step of the damping": {**STEEP, "damping_step_factor": 0.5, "damping_step_time": 0.0071223},
    "beside a law": {**STEEP, "ageing": 0.05},
    "stops": {"stop_stiffness": 300.0, "stop_gap": 4e-8, "stop_damping": 1e-3},
}
STEP: Final = {"x_start": 2e-14, "k3_x": 1e5, "force_x": 1e-13}
"""Of parameters that are neutral in some base [SI]; others are moved by 1e-8 of themselves."""
SENSORS: Final = [("position", "zero"), ("velocity", "zero"), ("acceleration", "first")]


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(load_model(), jobs=1) as made:
        yield made


def record(senses: str = "velocity", hold: str = "zero") -> Record:
    """Two tones about the resonance on one axis, sampled 60 times a period."""
    t = np.arange(SAMPLES) * PERIOD
    u = (2e-5 * np.sin(2 * np.pi * np.outer(t, [3100.0, 3350.0]) + [0.0, 1.0])).sum(axis=1)[:, None]
    return make_record("run", t, u, u, conditions={}, sample_rate=1 / PERIOD, hold=hold, senses=senses)


def moved(base: Mapping[str, float], name: str) -> dict[str, float]:
    here = base.get(name, 0.0)
    return {**base, name: here + STEP.get(name, 1e-8 * here)}


@pytest.mark.parametrize(("senses", "hold"), SENSORS)
@pytest.mark.parametrize("own", BASES.values(), ids=BASES)
def test_columns_are_as_by_simulation(simulator: Simulator, own: Mapping[str, float], senses: str, hold: str) -> None:
    run, base = record(senses, hold), {**DEVICE, **own}
    motion = simulator.follow(run, base)
    assert motion is not None
    v, names = simulator.run(run, base), ["m", "kxx", "dxx", "x_start", "k3_x", "force_x"]
    names += [name for name in ("friction_x", "parasitic_q", "stop_stiffness") if name in own]
    for name in names:
        job = run, moved(base, name)
        quotient = simulator.run(*job) - v
        [varied] = simulator.vary(motion, [job])
        assert varied is not None
        error = (varied - quotient).ravel()
        # What is sampled while friction turns round has a slope of its own, which a quotient is not short enough for.
        kept = np.argsort(np.abs(error))[: -SAMPLES // 200]
        # Two nodes in a part of a series of tanh, a third of its argument's unit to one, leave 3e-4.
        assert np.linalg.norm(error[kept]) < 1e-3 * np.linalg.norm(quotient.ravel()[kept]), name


OTHERS: Final = {
    "a mode": {"parasitic_coupling": 1e-3, "parasitic_frequency": 4100.0, "parasitic_q": 30.0},
    "a curved damping": {"d2_x": 1e3},
    "a constant force": {"force_x": 1e-13},
}


@pytest.mark.parametrize("own", OTHERS.values(), ids=OTHERS)
def test_other_effects_beside_friction_too(simulator: Simulator, own: Mapping[str, float]) -> None:
    run, base = record(), {**DEVICE, **STEEP}
    motion = simulator.follow(run, base)
    assert motion is not None
    quotient = simulator.run(run, {**base, **own}) - simulator.run(run, base)
    [varied] = simulator.vary(motion, [(run, {**base, **own})])
    assert varied is not None
    assert np.linalg.norm(varied - quotient) < 1e-3 * np.linalg.norm(quotient)


def test_a_motion_in_more_parts_than_there_is_room_for_at_first(simulator: Simulator) -> None:
    """Held by a friction that gives way at each turn, which takes some twenty parts a step."""
    t = np.arange(400) * PERIOD
    u = 2e-5 * np.sin(2 * np.pi * 3100.0 * t)[:, None]
    run = make_record("held", t, u, u, conditions={}, sample_rate=1 / PERIOD, hold="zero", senses="velocity")
    base = {**DEVICE, "x_start": 0.0, "friction_x": 1.9e-5, "friction_speed": 1e-4}
    motion = simulator.follow(run, base)
    assert motion is not None
    assert motion.motion._run.parts > 2 * motion.motion._run.steps
    job = run, moved(base, "friction_x")
    quotient = simulator.run(*job) - simulator.run(run, base)
    [varied] = simulator.vary(motion, [job])
    assert varied is not None
    assert np.linalg.norm(varied - quotient) < 1e-3 * np.linalg.norm(quotient)
