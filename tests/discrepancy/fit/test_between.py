"""Tests of the voltage between its samples."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from discrepancy.fit.between import DEGREE, between


@pytest.mark.parametrize("n", [DEGREE + 1, DEGREE + 2, 31, 64, 3001])
@pytest.mark.parametrize("axes", [(), (1,), (2,)])
def test_it_is_the_spline_through_the_samples(n: int, axes: tuple[int, ...]) -> None:
    v = np.random.default_rng(n).normal(size=(n, *axes))
    k = np.arange(n)
    spline = make_interp_spline(k, v, k=DEGREE)
    for places in (k, k * (1 + 1e-4), k - 0.3, np.linspace(-0.5, n - 0.5, 17)):
        # Both solve the same equations: a hundred roundings of the largest value.
        assert np.abs(between(v, places) - spline(places)).max() <= 100 * np.spacing(np.abs(spline(places)).max())


def test_a_sine_of_eight_samples_a_period_is_met() -> None:
    k = np.arange(2000.0)
    places = k[100:-100] + 0.5
    assert np.abs(between(np.sin(np.pi / 4 * k), places) - np.sin(np.pi / 4 * places)).max() <= 4e-7
