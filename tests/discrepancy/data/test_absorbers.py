"""A structure as a mass with resonators, held against the eigenvalues of its matrices."""

import numpy as np
import pytest
from structures import DAMPING, Structure, chain, plane

from discrepancy.data.absorbers import Carried, carried
from discrepancy.data.modes import further_modes


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


def test_a_sensor_at_another_place_than_the_force_sees_no_mass_that_carries_the_rest() -> None:
    assert told(chain(driven=0, sensed=2)) is None
