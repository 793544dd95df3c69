"""A structure as a mass with resonators, held against the eigenvalues of its matrices."""

from dataclasses import replace

import numpy as np
import pytest
from structures import DAMPING, Structure, chain, plane

from discrepancy.data.absorbers import Carried, carried
from discrepancy.data.modes import Mode, further_modes
from discrepancy.data.record import Floats


def told(structure: Structure, noise: float = 1e-3) -> Carried | None:
    records = (structure.record("a", "fit", 1, noise),)
    first, further = further_modes(records)
    return carried(records, sorted([*first, *further]), [1.0] * len(structure.driven))


@pytest.mark.parametrize("structure", [chain(), plane()])
def test_antiresonances_are_what_the_rest_does_while_the_mass_is_held(structure: Structure) -> None:
    found = told(structure)
    assert found is not None
    own = sorted(absorber.frequency for absorber in found.absorbers)
    # A start for a fit: poles of a record of 12 s are known to 1e-4, what they answer with to 1e-2.
    np.testing.assert_allclose(own, structure.frequencies(held=structure.driven), rtol=3e-3)
    assert found.m == pytest.approx(1.0, rel=0.02)
    axes = len(structure.driven)
    np.testing.assert_allclose(found.k, structure.stiffness[:axes, :axes], rtol=0.02, atol=300.0)
    np.testing.assert_allclose(np.diag(found.d), DAMPING, rtol=0.1)


def test_a_resonator_is_coupled_to_its_own_axis() -> None:
    structure = plane()
    found = told(structure)
    assert found is not None
    for absorber in found.absorbers:
        # Springs of 4.5e4 and 8.3e4 N/m to half the mass, whose motion is scaled to the mass.
        spring = (4.5e4, 8.3e4)[absorber.axis] * 2**0.5
        assert abs(absorber.coupling[absorber.axis]) == pytest.approx(spring, rel=0.02)
        assert abs(absorber.coupling[1 - absorber.axis]) < 0.03 * spring


def modes(structure: Structure) -> list[Mode]:
    """Those of the matrices: every mass is damped alike, so that no mode's shape is complex."""
    frequencies = structure.frequencies(held=[])
    return [Mode(float(f), float(2 * np.pi * f / DAMPING)) for f in frequencies]


def answers(found: Carried, frequencies: Floats) -> Floats:
    """What the sensor of x shows of a force of 1 N on the mass and what it carries, as equations of motion have it."""
    laplace, count = 2j * np.pi * frequencies, len(found.absorbers)
    shown = []
    for s in laplace:
        of, pushed = np.zeros((count + 1, count + 1), complex), np.zeros(count + 1)
        of[0, 0] = found.m * s**2 + found.d[0, 0] * s + found.k[0, 0]
        pushed[0] = 1 - sum(own.drive for own in found.absorbers)
        for i, own in enumerate(found.absorbers, 1):
            w = 2 * np.pi * own.frequency
            along = own.joint[0] * own.coupling[0] / (found.m * w**2)
            damper = found.m * w / own.quality
            of[0, 0] += damper * along**2 * s
            of[0, i] = of[i, 0] = own.coupling[0] + damper * along * s
            of[i, i] = found.m * (s**2 + w**2) + damper * s
            pushed[i] = own.drive
        shown.append(np.linalg.solve(of, pushed)[0])
    return np.array(shown)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("driven", "sensed"), [(0, 0), (0, 1), (1, 0), (0, 2), (1, 2)])
def test_mass_and_resonators_answer_as_the_structure_wherever_force_and_sensor_are(
    driven: int, sensed: int, sign: float
) -> None:
    structure = chain(driven, sensed)
    records = [structure.record("a", "fit", 1, 0.0)]
    records = [replace(r, v=sign * r.v) for r in records]
    found = carried(records, modes(structure), [sign])
    assert found is not None
    s = 2j * np.pi * (frequencies := np.linspace(3.0, 90.0, 200))
    matrices = [np.diag(structure.masses) * (w**2 + DAMPING * w) + structure.stiffness for w in s]
    true = np.linalg.inv(matrices)[:, sensed, driven]
    # Residues by least squares from 6000 samples, exact to rounding times the condition of the columns.
    np.testing.assert_allclose(answers(found, frequencies), true, atol=1e-9 * np.abs(true).max())


def test_of_two_masses_with_a_force_on_one_and_a_sensor_on_the_other_the_damping_of_each_shows() -> None:
    stiffness = np.array([[7e4, -3e4], [-3e4, 6e4]])
    structure = Structure(np.array([1.0, 0.8]), stiffness, [0], [1])
    found = carried([structure.record("a", "fit", 1, 0.0)], modes(structure), [1.0])
    assert found is not None
    (own,) = found.absorbers
    # Residues of r and -r: their sum is no mass, whatever this one and its resonator share the force by.
    assert found.m > 0
    # Alike, only the sum of their damping would show, and the fit would end nowhere.
    alone = np.sqrt(found.k[0, 0] / found.m) / (2 * np.pi)
    assert abs(alone / own.frequency - 1) > 0.1


def test_a_sensor_connected_the_other_way_round_shows_no_mass() -> None:
    structure = chain()
    assert carried([structure.record("a", "fit", 1, 0.0)], modes(structure), [-1.0]) is None
