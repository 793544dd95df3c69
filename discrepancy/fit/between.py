"""The voltage between its samples."""

from functools import lru_cache
from typing import Any, Final

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg.lapack import dgbtrf, dgbtrs

from discrepancy.data.record import Floats

DEGREE: Final = 7
"""Of the spline through the samples: a sine of eight samples a period is right to 4e-7, one of sixteen to 1e-9. A cubic
is off by 1e-3 and 6e-5 there, which is as much as a quiet sensor's noise."""
BAND: Final = DEGREE - 1
"""Diagonals on either side of the middle one in the equations of the coefficients, at the ends; inside there are three.
"""
FEW: Final = 32
"""Samples up to which an end reaches everywhere in those equations."""


def between(v: Floats, places: Floats) -> Floats:
    """The voltage (n, axes) or (n,) at ``places``, counted in samples; beyond the ends the last curve goes on."""
    if len(v) <= FEW:
        return np.asarray(make_interp_spline(np.arange(len(v)), v, k=DEGREE)(places))
    factors, pivots = _factored(len(v))
    coefficients, _ = dgbtrs(factors, BAND, BAND, v.reshape(len(v), -1), pivots)
    return np.asarray(BSpline(_knots(len(v)), coefficients.reshape(v.shape), DEGREE)(places))


def _knots(n: int) -> Floats:
    """The samples but for three beside each end (C. de Boor, A Practical Guide to Splines, 2001, chapter XIII)."""
    inside = (DEGREE + 1) // 2
    return np.concatenate((np.zeros(DEGREE + 1), np.arange(inside, n - inside), np.full(DEGREE + 1, n - 1.0)))


@lru_cache(maxsize=8)
def _factored(n: int) -> tuple[Any, Any]:
    """The equations of the coefficients of ``n`` samples, as LAPACK's band factors them. They depend on nothing else,
    and take longer than to solve them."""
    rows = BSpline.design_matrix(np.arange(FEW, dtype=np.float64), _knots(FEW), DEGREE).toarray()
    band = np.zeros((3 * BAND + 1, FEW))
    for offset in range(-BAND, BAND + 1):
        own = np.diagonal(rows, offset)
        band[2 * BAND - offset, max(offset, 0) : max(offset, 0) + len(own)] = own
    # Far from the ends every column is the same.
    middle = np.repeat(band[:, FEW // 2 : FEW // 2 + 1], n - FEW, axis=1)
    whole = np.asfortranarray(np.concatenate((band[:, : FEW // 2], middle, band[:, FEW // 2 :]), axis=1))
    factors, pivots, _ = dgbtrf(whole, BAND, BAND, overwrite_ab=True)
    return factors, pivots
