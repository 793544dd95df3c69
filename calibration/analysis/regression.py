"""Least squares with standard errors that hold for correlated residuals too."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gyro_model.errors import InputError

Floats = NDArray[np.float64]


class Fit(NamedTuple):
    """values and their standard errors, shapes (p,); residual, shape (n,)."""

    values: Floats
    errors: Floats
    residual: Floats


def least_squares(design: Floats, observed: Floats) -> Fit:
    """``observed``, shape (n,), on the columns of ``design``, shape (n, p); residuals are independent and alike.

    Raises InputError where the columns can't be told apart.
    """
    values, residual, inverse = _solve(design, observed)
    variance = float(residual @ residual) / max(len(observed) - design.shape[1], 1)
    return Fit(values, np.sqrt(variance * np.diag(inverse)), residual)


def least_squares_correlated(design: Floats, observed: Floats) -> Fit:
    """As ``least_squares``, for residuals in order of time that may be correlated: standard errors by Newey and West
    (Econometrica 55, 1987), with lags up to 4 (n/100)^(2/9)."""
    values, residual, inverse = _solve(design, observed)
    rows = len(observed)
    lags = int(4 * (rows / 100) ** (2 / 9))
    moments = design * residual[:, None]
    middle = moments.T @ moments
    for lag in range(1, min(lags, rows - 1) + 1):
        product = moments[lag:].T @ moments[:-lag]
        middle += (1 - lag / (lags + 1)) * (product + product.T)
    # Residuals are smaller than the errors by what the fit has taken.
    covariance = inverse @ middle @ inverse * rows / max(rows - design.shape[1], 1)
    return Fit(values, np.sqrt(np.maximum(np.diag(covariance), 0.0)), residual)


def _solve(design: Floats, observed: Floats) -> tuple[Floats, Floats, Floats]:
    rows, columns = design.shape
    # Columns of one size: the rank must not depend on units.
    size = np.sqrt(np.mean(design**2, axis=0))
    if rows <= columns or not (size > 0).all() or np.linalg.matrix_rank(design / size) < columns:
        raise InputError(f"{rows} values do not determine {columns} unknowns: give a longer or more varied run")
    scaled = design / size
    inverse = np.linalg.inv(scaled.T @ scaled) / np.outer(size, size)
    values: Floats = np.linalg.lstsq(scaled, observed, rcond=None)[0] / size
    return values, observed - design @ values, inverse
