"""A step of a fit that meets bounds goes along them, and what is linear falls all the way."""

from typing import Any

import numpy as np
import pytest

from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter


def step(columns: np.ndarray, residual: np.ndarray, bounds: list[tuple[float, float]]) -> np.ndarray:
    """Of parameters that stand at 0 and change the voltage by ``columns`` (p, n)."""
    own: Any = np.vstack((columns, residual))
    free = tuple(Free(f"p{i}", 1.0, *b) for i, b in enumerate(bounds))
    at = Fitted({f.name: 0.0 for f in free}, (), free, Any, (), grams=np.array([own @ own.T]))  # type: ignore[arg-type]
    return Fitter.__new__(Fitter)._step(at, 0.0)


def left(columns: np.ndarray, residual: np.ndarray, taken: np.ndarray) -> float:
    return float(np.sum((residual - taken @ columns) ** 2))


def test_what_is_linear_falls_however_many_bounds_are_met() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        # Six parameters that nearly make up for one another.
        columns = rng.normal(size=(1, 40)) + 0.05 * rng.normal(size=(6, 40))
        residual = columns[0] + 0.3 * rng.normal(size=40)
        bounds = [(-b, b) for b in 10.0 ** rng.uniform(-1, 1, 6)]
        taken = step(columns, residual, bounds)
        assert all(low <= t <= high for t, (low, high) in zip(taken, bounds, strict=True))
        assert left(columns, residual, taken) < left(columns, residual, np.zeros(6))


def test_beside_one_bound_the_others_are_solved_for() -> None:
    rng = np.random.default_rng(1)
    columns, residual = rng.normal(size=(3, 40)), rng.normal(size=40)
    residual += columns[0]
    taken = step(columns, residual, [(-1.0, 0.25), (-np.inf, np.inf), (-np.inf, np.inf)])
    assert taken[0] == 0.25
    beside = np.linalg.lstsq(columns[1:].T, residual - 0.25 * columns[0], rcond=None)[0]
    # Normal equations of 40 samples lose some digits.
    assert taken[1:] == pytest.approx(beside, rel=1e-9)


def test_a_shape_at_its_bound_stays_and_does_not_hold_the_rest() -> None:
    columns, residual = np.eye(2, 40), np.zeros(40)
    residual[:2] = -1.0, 2.0
    assert step(columns, residual, [(0.0, 5.0), (-5.0, 5.0)]).tolist() == [0.0, 2.0]


@pytest.mark.parametrize("scale", [np.nan, np.inf])
def test_columns_beyond_all_numbers_move_nothing(scale: float) -> None:
    rng = np.random.default_rng(2)
    columns, residual = rng.normal(size=(2, 40)), rng.normal(size=40)
    with np.errstate(all="ignore"):
        taken = step(np.vstack((columns[0] * scale, columns[1])), residual, [(-1.0, 1.0), (-1.0, 1.0)])
    assert taken.tolist() == [0.0, 0.0]
