"""A cart on rails with a weak dry friction: pushed one way, or moved back and forth; its own simulation, in fine
steps."""

from pathlib import Path

import numpy as np
import pytest
from rails import Rails

from discrepancy.data.dataset import Dataset
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Record, make_record
from discrepancy.data.repeats import repeated_noise
from discrepancy.data.resisted import one_way
from discrepancy.diagnose import diagnose
from discrepancy.tell.answer import Diagnosis
from gyro_model.model import load_model

RATE, SAMPLES, FINE = 1000.0, 4000, 20
MASS, NOISE = 2.0, 3e-4
PUSH = 3.0
"""Peak force [N]; the frictions are a fiftieth to a fifteenth of it."""


def cart(seed: int, friction: float, role: str, *, turns: bool, damping: float = 1.0) -> Record:
    rng, t = np.random.default_rng(seed), np.arange(SAMPLES) / RATE
    swing = np.sin(2 * np.pi * np.clip((t - 0.4) / 3.2, 0, 1))
    one = np.where(t < 2, np.sin(0.5 * np.pi * t) ** 2, 0) + 0.3 * (t > 0.4)
    u = PUSH * (1 - 0.1 * (seed % 3)) * (swing if turns else one)
    x, v, seen = 0.0, 0.0, np.empty(SAMPLES)
    rails = Rails(MASS, damping, friction, 1 / RATE / FINE)
    for k in range(SAMPLES):
        seen[k] = x
        x, v = rails.slide(x, v, u[k], FINE)
    seen += NOISE * rng.standard_normal(SAMPLES)
    return make_record(f"{seed}", t, u[:, None], seen[:, None], sample_rate=RATE, role=role)


def found(seed: int, friction: float, *, turns: bool, damping: float = 1.0) -> Diagnosis:
    runs = tuple(
        cart(seed + i, friction, role, turns=turns, damping=damping)
        for i, role in enumerate(("fit", "fit", "held-out"))
    )
    nominal = linear_start(runs[:2], (1.0,))
    assert nominal is not None
    return diagnose(Dataset(Path(), nominal, runs), load_model(), jobs=1)


@pytest.mark.parametrize("damping", [1.0, 0.0])
def test_a_weak_friction_is_named_where_the_cart_turns_round(damping: float) -> None:
    answer = found(600, 0.06, turns=True, damping=damping)
    [finding] = answer.effects
    assert (answer.verdict, finding.id, finding.either) == ("missing effects", "dry_friction", ())
    assert finding.parameters["friction_x"].value == pytest.approx(0.06, rel=0.02)


@pytest.mark.parametrize("damping", [1.0, 0.0])
def test_one_way_it_may_be_a_constant_force(damping: float) -> None:
    answer = found(610, 0.06, turns=False, damping=damping)
    [finding] = answer.effects
    assert {"dry_friction", "constant_force"} <= {finding.id, *finding.either}


@pytest.mark.parametrize("turns", [True, False])
def test_nothing_is_missing_without_friction(*, turns: bool) -> None:
    assert found(620, 0.0, turns=turns).verdict == "nothing missing"


def test_which_way_it_moves_is_seen() -> None:
    assert one_way([cart(630, 0.06, "fit", turns=False)])
    assert not one_way([cart(630, 0.06, "fit", turns=True)])


def test_a_force_that_never_changes_has_no_periods() -> None:
    # Its mean is off by the last bit.
    v = np.linspace(0, 1, SAMPLES)[:, None]
    run = make_record("", np.arange(SAMPLES) / RATE, np.full((SAMPLES, 1), 0.9), v, sample_rate=RATE)
    assert repeated_noise([run]) is None
