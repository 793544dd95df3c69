"""What a shaft carries, by the force that its motion asks for, against shafts that no line of the FMU moved."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from benchmarks.drives import band, drawn
from benchmarks.rubbing import Rubbing, fading, motion
from benchmarks.structures import Structure, runs_of
from discrepancy.data.inverse import structures
from discrepancy.data.record import Record, Senses

NOISE = 1e-3


def shaft(friction: float, excess: float = 0.0, senses: Senses = "position") -> tuple[Structure, float, list[Record]]:
    """A motor that carries a load and rubs, by how much more near rest, and the speed at which that has faded; its two
    runs to fit."""
    own = drawn(np.random.default_rng(8101))._replace(sensed=0)
    faded = 3 * fading(own)
    rubbing = Rubbing(own, friction, excess, faded)
    rng = np.random.default_rng(1)
    runs = runs_of(band(own), rng, senses, "zero", NOISE, lambda u, step: motion(rubbing, u, step, "zero"))
    return own, faded, [run for run in runs if run.role == "fit"]


def gain(records: list[Record]) -> float:
    """With which the values are those of the shaft."""
    return float(records[0].reference ** records[0].order)


def held(own: Structure) -> np.ndarray:
    """Frequencies [Hz] of the loads while the motor is held."""
    return np.sqrt(eigh(own.stiffness[1:, 1:], own.mass[1:, 1:], eigvals_only=True)) / (2 * np.pi)


# Of the force, 1 N rms: the motor stands for a tenth and for half of the time.
@pytest.mark.parametrize(("friction", "senses"), [(0.1, "position"), (0.1, "velocity"), (0.5, "velocity")])
def test_mass_friction_and_loads_come_out(friction: float, senses: Senses) -> None:
    own, _, records = shaft(friction, senses=senses)
    [*_, told] = [found for found in structures(records, gain(records)) if len(found.absorbers) == len(own.mass) - 1]
    assert told.m == pytest.approx(own.mass[0, 0], rel=0.05)
    assert told.friction[0] == pytest.approx(friction, rel=0.05)
    np.testing.assert_allclose(sorted(one.frequency for one in told.absorbers), held(own), rtol=5e-3)
    assert told.near_rest is None


def test_a_friction_that_is_higher_near_rest_is_told_as_such() -> None:
    _own, faded, records = shaft(0.3, 0.6, "velocity")
    told = structures(records, gain(records))[-1]
    assert told.near_rest is not None
    excess, speed = told.near_rest
    # Both lean on each other: what is slower than a tenth of the speed's rms is left out.
    assert excess == pytest.approx(0.6, rel=0.3)
    assert speed == pytest.approx(faded, rel=0.3)
    assert told.friction[0] == pytest.approx(0.3, rel=0.1)


def test_an_accelerometer_shows_the_load_too() -> None:
    own, _, records = shaft(0.5, senses="acceleration")
    told = structures(records, gain(records))[-1]
    # Its speed is an integral, which wanders: where the motor stands it seems to move.
    assert min(abs(one.frequency / held(own)[0] - 1) for one in told.absorbers) < 0.03


def test_a_mass_that_carries_nothing_has_no_structure() -> None:
    own, _, records = shaft(0.3)
    alone = own._replace(mass=own.mass[:1, :1], damping=own.damping[:1, :1], stiffness=np.zeros((1, 1)))
    u = records[0].u[:, 0]
    rubbing, step = Rubbing(alone, 0.3, 0.0, 1.0), 1 / records[0].sample_rate
    x = motion(rubbing, u, step, "zero")[:, :1]
    x = x + NOISE * x.std() * np.random.default_rng(3).standard_normal(x.shape)
    assert structures([replace(records[0], v=x)], 1.0) == []


def test_what_no_friction_holds_back_is_left_to_the_response() -> None:
    _, _, smooth = shaft(0.0, senses="velocity")
    assert structures(smooth, gain(smooth)) == []
    _, _, records = shaft(0.3)
    free = [replace(record, u=np.zeros_like(record.u)) for record in records]
    two = [replace(r, u=np.hstack((r.u, r.u)), v=np.hstack((r.v, r.v))) for r in records]
    assert structures(free, 1.0) == structures(two, 1.0) == []
