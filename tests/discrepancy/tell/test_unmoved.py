"""Places of a shape that no fit has moved."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from discrepancy.fit.fitted import Fitted, Free
from discrepancy.name.search import Search
from discrepancy.tell.unmoved import _fits


class Bounded:
    """A fitter of a parabola around 1, beyond which no motion stays within bounds from ``top`` on."""

    def __init__(self, top: float) -> None:
        self.top = top

    def evaluated(self, at: Fitted) -> Fitted:
        place = at.parameters["shape"]
        return replace(at, cost=np.inf if place > self.top else 100.0 + np.log(place) ** 2)

    def fit(self, at: Fitted, *_: Any) -> Fitted:
        return self.evaluated(at)


def test_where_the_motion_leaves_all_bounds_is_no_place() -> None:
    free = (Free("size", 1.0), Free("shape", 1.0, 1e-6, 1e6))
    at = Fitted({"size": 1.0, "shape": 1.0}, (), free, cast(Any, None), (), cost=100.0, count=100)
    for top in (2.0, np.inf):
        search = SimpleNamespace(fitter=Bounded(top))
        found = _fits(cast(Search, search), at)
        assert np.isfinite([fit.cost for fit in found.values()]).all()
        assert min(found) < 0.3
        assert (max(found) > 3) == (top > 10)
