"""What a name is worth: its probability by rivals, by what is left and by what it brought."""

from types import SimpleNamespace
from typing import Any

import pytest

from discrepancy.criteria import Criteria
from discrepancy.tell.answer import Finding, Stage
from discrepancy.tell.assemble import _scaled
from discrepancy.tell.verdict import Remainder, probability

CLEAN = Remainder(share=0.0, ratio=1.0, above=False, significant=False)


def search(asked: bool = True, **behind: float) -> Any:
    """Two effects in a model, the rivals of each so far ``behind``."""
    names = [SimpleNamespace(id=name, behind=behind, asked=asked) for name in ("large", "small")]
    return SimpleNamespace(accepted=names, partners=set(), criteria=Criteria())


def stages(*misfits: float) -> tuple[Stage, ...]:
    return tuple(Stage(n, {}, {"": m}, {}) for n, m in zip(("refit", "large", "small"), misfits, strict=True))


def of(name: str, found: Any, rest: Remainder, *misfits: float) -> float:
    return probability(found, Finding(name, (), {}), rest, stages(*misfits))


def test_rivals_take_by_their_likelihood() -> None:
    sure = 1 - Criteria().prior_none
    assert of("large", search(), CLEAN, 1.0, 0.1, 0.01) == pytest.approx(sure)
    # A rival that fits as well has half; one that was not tried may.
    assert of("large", search(rival=0.0), CLEAN, 1.0, 0.1, 0.01) == pytest.approx(sure / 2)
    assert of("large", search(asked=False), CLEAN, 1.0, 0.1, 0.01) == pytest.approx(sure / 2)


def test_of_what_stays_above_noise_the_one_that_brought_little_is_in_doubt() -> None:
    rest = Remainder(share=0.0001, ratio=4.0, above=True, significant=False)
    sure = 1 - Criteria().prior_none
    # Noise 0.003: 0.012² - 0.003² of 0.02² - 0.003² are left of what "small" found, next to nothing of 1.
    assert of("small", search(), rest, 1.0, 0.02, 0.012) == pytest.approx(sure * (1 - 1.35e-4 / 3.91e-4))
    assert of("large", search(), rest, 1.0, 0.02, 0.012) == pytest.approx(sure, abs=1e-3)
    assert of("small", search(), CLEAN, 1.0, 0.02, 0.012) == pytest.approx(sure)


def test_only_values_that_a_laboratory_states_say_that_the_force_is_off() -> None:
    nominal = {"m": 1.0, "kxx": 2.0}
    for estimated, said in (((), True), (("m", "kxx"), False)):
        dataset = SimpleNamespace(nominal=nominal, estimated=estimated)
        at = SimpleNamespace(parameters={"m": 1.1, "kxx": 2.2})
        found: Any = SimpleNamespace(dataset=dataset, at=at)
        assert any("force_scale were -9.09%" in doubt for doubt in _scaled(found)) == said
