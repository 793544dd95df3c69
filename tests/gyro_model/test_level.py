"""Where forces that bend the motion do not: each stays as it is there, and only those have such places."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from sympy import Expr, Symbol, lambdify, tanh

from gyro_model import symbols
from gyro_model.anatomy import Force
from gyro_model.level import Region, regions
from gyro_model.model import load_model

MODEL = load_model()
LEVEL = [e for e in MODEL.forces if regions(e, MODEL)]
SCALE = {symbols.x: 3e-6, symbols.y: 3e-6, symbols.x_dot: 1.0, symbols.y_dot: 1.0}
"""Of each state, SI: beyond stops and speeds of friction."""


def test_dry_friction_and_stops_have_places() -> None:
    names = {e.id for e in LEVEL}
    assert {"contact_stop", "dry_friction"} <= names
    assert not names & {"cubic_stiffness", "nonlinear_damping", "squeeze_film", "hysteresis", "electrostatic_softening"}
    # What is linear has none either: it bends no motion.
    assert not names & {"suspension", "parasitic_mode"}


def inside(found: tuple[Region, ...], values: Mapping[Symbol, float]) -> bool:
    """Whether states and parameters are within all regions."""
    return all(float(side.distance.subs(values)) > 0 for region in found for side in region.sides)


@pytest.mark.parametrize("effect", LEVEL, ids=lambda e: e.id)
def test_a_force_stays_within_its_regions(effect: Force) -> None:
    rng, found = np.random.default_rng(7), regions(effect, MODEL)
    parameters = {q.symbol: q.nominal or q.start for q in effect.parameters} | {symbols.kxx: 64.0}
    forces = [lambdify(tuple(SCALE), expr.subs(parameters)) for expr in effect.force]
    tried = 0
    while tried < 100:
        here, there = ({s: scale * rng.uniform(-1.0, 1.0) for s, scale in SCALE.items()} for _ in range(2))
        # On one side of what bends it.
        there = {s: float(np.copysign(there[s], here[s])) for s in SCALE}
        if inside(found, parameters | here) and inside(found, parameters | there):
            tried += 1
            for force in forces:
                assert force(*here.values()) == pytest.approx(force(*there.values()), rel=1e-15, abs=0.0)


def test_one_that_goes_with_another_state_has_none() -> None:
    friction = next(e for e in LEVEL if e.id == "dry_friction")
    f, x, x_dot = friction.sizes[0].symbol, symbols.x, symbols.x_dot

    def of(force: Expr) -> tuple[Region, ...]:
        own = replace(friction, force=(force, 0))
        return regions(own, replace(MODEL, effects=tuple(own if e is friction else e for e in MODEL.effects)))

    [region] = of(f * tanh(x_dot))
    assert [side.state for side in region.sides] == [x_dot]
    # Away from rest that is a spring.
    assert of(f * x * tanh(x_dot)) == ()
    assert of(f * tanh(x * x_dot)) == ()
    assert of(f * tanh(x_dot) + f * x**3) == ()
