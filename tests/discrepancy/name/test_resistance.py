"""Which effects are friction or a constant force, by their formula."""

from hidden_sets import MODEL

from discrepancy.name.resistance import Resistance, resistance


def test_friction_and_a_constant_force_are_told_by_their_formula() -> None:
    found = {effect.id: resistance(effect) for effect in MODEL.effects}
    assert {name for name, kind in found.items() if kind is Resistance.FRICTION} == {"dry_friction"}
    assert {name for name, kind in found.items() if kind is Resistance.CONSTANT} == {"constant_force"}
