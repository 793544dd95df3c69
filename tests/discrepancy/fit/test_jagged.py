"""A fit whose cost is jagged ends, however many rounds it has; one that falls does not."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.patience import JAGGED, STEPS
from discrepancy.fit.refit import Fitter


def costs(share: float, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Costs at which a fit was linearised where only steps that hold the initial states lead down, by this share of
    the cost each, half of what they promise."""
    found: list[float] = []

    def evaluated(self: Fitter, at: Fitted) -> Fitted:
        return at

    def moved(self: Fitter, at: Fitted, damping: float, part: float = 1.0) -> Fitted:
        return replace(at, cost=at.cost * (1 - share if damping and part < 1 else 2.0))

    def linearised(self: Fitter, at: Fitted, *_: Any, **__: Any) -> Fitted:
        found.append(at.cost)
        return replace(at, grams=np.eye(2)[None], left=2 * share * at.cost / at.variance)

    own_methods = {"evaluated": evaluated, "_moved": moved, "with_grams": linearised, "_adrift": lambda *_: ()}
    for name, own in own_methods.items():
        monkeypatch.setattr(Fitter, name, own)
    at = Fitted({"p": 1.0}, (), (Free("p", 1.0),), Any, (), cost=1.0, count=1000)  # type: ignore[arg-type]
    fitter = Fitter.__new__(Fitter)
    fitter.off = lambda at: 0.5  # type: ignore[method-assign]
    fitter.fit(at)
    return found


def test_steps_that_bring_little_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(costs(JAGGED / 2, monkeypatch)) == 1 + STEPS


def test_steps_that_bring_more_are_not(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(costs(2 * JAGGED, monkeypatch)) == 31
