"""Cubic splines of the temperatures and slopes of their derivatives, with a penalty: in neither document.

S(X) and B(X) are each a sum of a penalised cubic spline of every signal (Eilers and Marx 1996: uniform B-splines, the
squared second differences of their weights times λ) and a straight line in every derivative, which stands for a
sensor's lag to first order: T(t - τ) = T - τ T'.
"""

from collections.abc import Iterator
from functools import partial
from itertools import product
from typing import Final

import numpy as np
from scipy.interpolate import BSpline, PPoly

from calibration.compensation.methods.method import Asked, Candidate, Method, holds
from calibration.compensation.model import (
    Additive,
    Compensation,
    Constant,
    Function,
    Input,
    Piecewise,
    both_ways,
    fitted_inputs,
    inputs_of,
)
from calibration.compensation.points import Points, bias_points, scale_points
from calibration.compensation.record import CIRCUIT, FREQUENCY, RATE_OF, STRUCTURE, Blocks, Floats
from gyro_model.errors import InputError

INTERVALS: Final = 24
"""Of each spline: 3 °C over -20 .. 60 °C; the penalty decides how much of that is used."""
DEGREE: Final = 3
SETS: Final[tuple[tuple[str, ...], ...]] = (
    (STRUCTURE,),
    (FREQUENCY,),
    (CIRCUIT,),
    (STRUCTURE, CIRCUIT),
    (FREQUENCY, CIRCUIT),
    (STRUCTURE, STRUCTURE + RATE_OF),
    (CIRCUIT, CIRCUIT + RATE_OF),
    (STRUCTURE, STRUCTURE + RATE_OF, CIRCUIT, CIRCUIT + RATE_OF),
    (FREQUENCY, FREQUENCY + RATE_OF, CIRCUIT, CIRCUIT + RATE_OF),
)
"""Sets of inputs that the choice by held-out error looks at."""
PENALTIES: Final = (1e-6, 1e-4, 1e-2)
"""λ that the choice looks at, a point: in units of the mean square of a column of the design."""
RIDGE: Final = 1e-9
"""Of every weight: a sum of splines holds the same constant in each, which is made unique so."""


def fit(blocks: Blocks, sampling_time: float, names: tuple[str, ...], penalty: float) -> Compensation:
    """Fits splines of ``names``, of SIGNALS and their derivatives, scale factor first.

    Raises InputError for an input that is missing or never changes.
    """
    inputs = tuple(map(both_ways, fitted_inputs(blocks, list(names))))
    for i in inputs:
        if not i.high > i.low:
            raise InputError(f"{blocks.name}: {i.name} never changes from {i.low:g} {i.unit}: nothing to fit")
    found = scale_points(blocks)
    scale: Function = Constant(1.0)
    at = inputs_of(blocks, list(names))
    if len(found.value):
        scale = _fit(found, inputs, penalty)
    bias = _fit(bias_points(blocks, scale(at)), inputs, penalty)
    return Compensation(
        "spline", inputs, scale, bias, sampling_time, blocks.unit, f"{', '.join(names)}; penalty {penalty:g}"
    )


def _knots(i: Input) -> Floats:
    """Uniform knots over the range of an input, DEGREE of them beyond either end."""
    step = (i.high - i.low) / INTERVALS
    return i.low + step * np.arange(-DEGREE, INTERVALS + DEGREE + 1, dtype=np.float64)


def _fit(points: Points, inputs: tuple[Input, ...], penalty: float) -> Additive:
    x = inputs_of(points.blocks, [i.name for i in inputs])
    middle = float(points.value.mean())
    parts, rows = [], []
    for column, i in zip(x.T, inputs, strict=True):
        if i.name.endswith(RATE_OF):
            parts.append((column / i.high)[:, None])
            rows.append(np.zeros((0, 1)))
        else:
            # A reading at the very end belongs to the last interval.
            inside = np.clip(column, i.low, np.nextafter(i.high, i.low))
            parts.append(BSpline.design_matrix(inside, _knots(i), DEGREE).toarray())
            rows.append(np.diff(np.eye(INTERVALS + DEGREE), 2, axis=0))
    design = np.concatenate(parts, axis=1)
    # Of a typical point; bases overlap so that each point meets four.
    weight = len(x) * float(np.mean(design**2))
    smooth = np.zeros((design.shape[1],) * 2)
    ends = np.cumsum([0] + [part.shape[1] for part in parts])
    for first, last, row in zip(ends, ends[1:], rows, strict=False):
        smooth[first:last, first:last] = row.T @ row
    gram = design.T @ design + weight * (penalty * smooth + RIDGE * np.eye(len(smooth)))
    weights = np.linalg.solve(gram, design.T @ (points.value - middle))
    terms = [_term(i, weights[first:last]) for i, first, last in zip(inputs, ends, ends[1:], strict=False)]
    first_term = terms[0]
    coefficients = first_term.coefficients.copy()
    coefficients[:, 0] += middle
    return Additive((first_term._replace(coefficients=coefficients), *terms[1:]))


def _term(i: Input, weights: Floats) -> Piecewise:
    if i.name.endswith(RATE_OF):
        slope = float(weights[0]) / i.high
        return Piecewise(np.array([i.low, i.high]), np.array([[slope * i.low, slope]]))
    poly = PPoly.from_spline(BSpline(_knots(i), weights, DEGREE))
    # Columns beyond the range belong to the knots outside.
    inside = slice(DEGREE, DEGREE + INTERVALS)
    return Piecewise(poly.x[DEGREE : DEGREE + INTERVALS + 1], poly.c[::-1, inside].T.copy())


def _candidates(blocks: Blocks, asked: Asked) -> Iterator[Candidate]:
    for names, penalty in product(SETS, PENALTIES):
        if holds(blocks, names):
            curve = partial(fit, sampling_time=asked.sampling_time, names=names, penalty=penalty)
            yield Candidate("spline", f"{', '.join(names)}; penalty {penalty:g}", curve)


METHOD: Final = Method("spline", "P. H. C. Eilers and B. D. Marx, Statistical Science 11, 1996", _candidates)
