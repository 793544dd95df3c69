"""Modes of a structure on a spring that bends and rubs; no line of the motion is the FMU's."""

from typing import get_args

import numpy as np
import pytest

from benchmarks.rubbing import Rubbing, motion
from benchmarks.structures import Structure, runs_of
from discrepancy.data.absorbers import carried
from discrepancy.data.courses import beside, leave_as_little
from discrepancy.data.modes import Mode
from discrepancy.data.record import Floats, Record, Senses
from discrepancy.data.weak_modes import all_modes

MASS, LOAD, JOINT, GROUND = 1.3, 0.35, 3e4, 7e4
DAMPING = np.diag([3.0, 1.0])
STIFFNESS = np.array([[GROUND + JOINT, -JOINT], [-JOINT, JOINT]])
OWN = Structure(np.diag([MASS, LOAD]), DAMPING, STIFFNESS, 0, 0)


def records(senses: Senses, k3: float, friction: float, own: Structure = OWN) -> list[Record]:
    """Two runs of a mass that carries another, 1e-3 of noise."""
    rng, device = np.random.default_rng(11), Rubbing(own, friction, 0.0, 1.0, k3)

    def moved(u: Floats, step: float) -> Floats:
        return motion(device, u, step, "zero")

    return runs_of(own.modes, rng, senses, "zero", 1e-3, moved)[:2]


def bend(share: float) -> float:
    """k3 that makes the spring so much stiffer at the rms of the straight one's motion."""
    straight = records("position", 0.0, 0.0)[0]
    return share * STIFFNESS[0, 0] / (3 * float(np.mean(straight.v**2)))


@pytest.mark.parametrize(("senses", "friction"), [*((s, 0.0) for s in get_args(Senses)), ("velocity", 0.1)])
def test_modes_show_beside_what_the_motion_makes_itself(senses: Senses, friction: float) -> None:
    k3 = bend(0.4)
    runs = records(senses, k3, friction)
    found = sorted(mode for modes in all_modes(runs) for mode in modes)
    assert [mode.frequency for mode in found] == pytest.approx(OWN.modes.tolist(), rel=0.01)
    kinds = ("friction", "cube") if friction else ("cube",)
    told = carried(beside(runs, kinds), found, [runs[0].reference ** runs[0].order])
    assert told is not None
    # What is measured of a place or a speed has noise, and the sign of a friction is a sample off.
    assert told.m == pytest.approx(MASS, rel=0.04)
    assert told.cubic[0] == pytest.approx(k3, rel=0.1)
    assert told.friction[0] == pytest.approx(friction, rel=0.2)
    assert told.absorbers[0].frequency == pytest.approx(np.sqrt(JOINT / LOAD) / (2 * np.pi), rel=0.01)


def test_a_mass_alone_has_one_mode_however_far_its_spring_bends() -> None:
    own = Structure(OWN.mass[:1, :1], DAMPING[:1, :1], STIFFNESS[:1, :1], 0, 0)
    true = Mode(float(own.modes[0]), float(np.sqrt(STIFFNESS[0, 0] * MASS)) / DAMPING[0, 0])
    runs = records("velocity", bend(1.0), 0.1, own)
    assert leave_as_little(runs, [true], [true, Mode(1.15 * true.frequency, 9.0)])
    assert not leave_as_little(records("velocity", bend(0.4), 0.1), [true], all_modes(records("velocity", 0.0, 0.0))[1])
