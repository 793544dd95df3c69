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


def moved(found: Carried, which: int, by: float) -> Carried:
    """With one of m, k and each resonator's coupling and frequency ``by`` times as large, at the same
    ``parasitic_drive``: the share of the force over how far a resonator follows."""
    if which < 2:
        m, k = ((by, 1.0), (1.0, by))[which]
        shared = tuple(own._replace(drive=own.drive / m) for own in found.absorbers)
        return found._replace(m=found.m * m, k=found.k * k, absorbers=shared)
    i, frequency = divmod(which - 2, 2)
    own = found.absorbers[i]
    changed = (own._replace(frequency=own.frequency * by, drive=own.drive / by**2) if frequency
               else own._replace(coupling=own.coupling * by, drive=own.drive * by))  # fmt: skip
    return found._replace(absorbers=(*found.absorbers[:i], changed, *found.absorbers[i + 1 :]))


def test_the_response_tells_mass_and_resonators_apart() -> None:
    masses, k = np.array([0.93, 1.06, 1.01, 1.12]), np.array([49600.0, 55900.0, 47700.0, 45800.0])
    stiffness = np.diag(k + np.append(k[1:], 0.0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    structure = Structure(masses, stiffness, [0], [2])
    found = carried([structure.record("a", "fit", 1, 0.0)], modes(structure), [1.0])
    assert found is not None
    frequencies = np.linspace(4.0, 95.0, 400)
    slopes = [answers(moved(found, i, 1 + 1e-5), frequencies) - answers(moved(found, i, 1 - 1e-5), frequencies)
              for i in range(2 + 2 * len(found.absorbers))]  # fmt: skip
    parts = [np.concatenate((own.real, own.imag)) / np.linalg.norm(own) for own in slopes]
    # 0.011; with half the shape of what answers against the force 0.0012, with which a fit ends nowhere.
    assert np.linalg.svd(np.array(parts), compute_uv=False)[-1] > 3e-3


def test_a_sensor_connected_the_other_way_round_shows_no_mass() -> None:
    structure = chain()
    assert carried([structure.record("a", "fit", 1, 0.0)], modes(structure), [-1.0]) is None
