"""Least squares from gram matrices whose columns have any size, and a deviation that few far values do not move."""

import numpy as np

from discrepancy.data.record import Floats

DEAD = 1e-13
"""Of the largest eigenvalue of a gram with unit diagonal: below lies what rounding leaves of a direction."""


def inverse_scaled(matrix: Floats, damping: float = 0.0) -> Floats:
    """The inverse of a gram matrix; dead columns and directions get zero, and so does what is beyond all numbers.
    damping: added to the unit diagonal."""
    # Rounding may leave less than nothing of a dead column.
    size = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    size = np.where((size > 0) & np.isfinite(size), size, 1.0)
    # One size after the other: their product may be beyond all numbers where they are not.
    scaled = matrix / size[:, None] / size
    values, vectors = np.linalg.eigh(np.where(np.isfinite(scaled), scaled, 0.0))
    kept = values > DEAD * values[-1] if len(values) else np.zeros(0, np.bool_)
    inverse = (vectors[:, kept] / (values[kept] + damping)) @ vectors[:, kept].T
    return np.asarray(inverse / size[:, None] / size)


def median_deviation(values: Floats) -> Floats:
    """The standard deviation (channels,) of values (n, channels) or (n,) about zero, by the median of their size, which
    is 0.6745 of it for a normal distribution: few that are far off don't count."""
    return np.asarray(np.median(np.abs(values), axis=0) / 0.6745)
