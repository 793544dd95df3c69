"""Least squares on what the temperature did before: its slope, lags that no sensor sees, and plays.

    bias = s(T) + Σ c_j(T) m_j

s is a penalised cubic spline of the leading temperature T (Eilers and Marx 1996), m_j are slopes, lags, plays and the
distance of the other sensor (``derived.py``), c_j are straight lines in T: the bias of a device is a product of what
the temperature moves. What a turn-on adds and a walk that is read off the record are noise to the fit
(``wander.py``): neither must be booked on a slow lag. Scale factor alike.
"""

from collections.abc import Iterator
from functools import partial
from itertools import product
from typing import Final

import numpy as np
from scipy.interpolate import BSpline, PPoly

from calibration.compensation.derived import derived, lag_name, play_name
from calibration.compensation.methods.method import Asked, Candidate, Method
from calibration.compensation.model import (
    Compensation,
    Constant,
    Function,
    Input,
    Piecewise,
    Varying,
    both_ways,
    fitted_inputs,
    inputs_of,
)
from calibration.compensation.points import Points, bias_points, scale_points
from calibration.compensation.record import CIRCUIT, FREQUENCY, RATE_OF, STRUCTURE, Blocks, Floats
from calibration.compensation.wander import walk_of, whitened
from gyro_model.errors import InputError

LAGS: Final = (100.0, 300.0, 1000.0, 3000.0)
"""Time constants [s], a half decade apart: two neighbours make any between them within 10 %."""
WIDTHS: Final = (0.025, 0.035, 0.05, 0.07, 0.1, 0.14, 0.2, 0.4)
"""Half widths of plays, of the temperature range; a factor of √2 apart where hysteresis usually lies."""
INTERVALS: Final = 24
DEGREE: Final = 3
PENALTIES: Final = (1e-6, 1e-3)
"""Of second differences of the spline, as in ``spline.py``."""
RIDGES: Final = (1e-5, 1e-3)
"""Of the weights of the memory, in units of the mean square of a column."""
SMALLEST: Final = 1e-9


def fit(
    blocks: Blocks, sampling_time: float, names: tuple[str, ...], penalty: float, ridge: float, bends: bool
) -> Compensation:
    """Fits ``names``, the leading temperature first; bends: the c_j are lines in it, else constants.

    Raises InputError for an input that is missing or never changes.
    """
    blocks = blocks.with_inputs(names)
    inputs = tuple(map(both_ways, fitted_inputs(blocks, list(names))))
    for i in inputs:
        if not i.high > i.low:
            raise InputError(f"{blocks.name}: {i.name} never changes from {i.low:g} {i.unit}: nothing to fit")
    found = scale_points(blocks)
    scale: Function = Constant(1.0)
    if len(found.value):
        scale = _fit(found, inputs, penalty, ridge, bends)
    bias = _fit(bias_points(blocks, scale(inputs_of(blocks, list(names)))), inputs, penalty, ridge, bends)
    note = (
        f"{', '.join(names)}; penalty {penalty:g}, ridge {ridge:g}{', weights linear in temperature' if bends else ''}"
    )
    return Compensation("history", inputs, scale, bias, sampling_time, blocks.unit, note)


def _fit(points: Points, inputs: tuple[Input, ...], penalty: float, ridge: float, bends: bool) -> Varying:
    x = inputs_of(points.blocks, [i.name for i in inputs])
    lead = inputs[0]
    step = (lead.high - lead.low) / INTERVALS
    knots = lead.low + step * np.arange(-DEGREE, INTERVALS + DEGREE + 1, dtype=np.float64)
    inside = np.clip(x[:, 0], lead.low, np.nextafter(lead.high, lead.low))
    spline = BSpline.design_matrix(inside, knots, DEGREE).toarray()
    bend = (2 * (inside - lead.low) / (lead.high - lead.low) - 1)[:, None] if bends else np.zeros((len(x), 0))
    lines = np.concatenate([np.ones((len(x), 1)), bend], axis=1)
    centres = np.array([0.5 * (i.low + i.high) for i in inputs])
    spans = np.array([0.5 * (i.high - i.low) for i in inputs])
    memory = ((x - centres) / spans)[:, 1:]
    parts = (memory[:, :, None] * lines[:, None, :]).reshape(len(x), -1)
    width, design = spline.shape[1], np.concatenate([spline, parts], axis=1)
    weights = _weights(points, design, width, penalty, ridge)
    poly = PPoly.from_spline(BSpline(knots, weights[:width], DEGREE))
    base = poly.c[::-1, DEGREE : DEGREE + INTERVALS].T.copy()
    base[:, 0] += float(np.mean(points.value - design @ weights))
    terms = [Piecewise(poly.x[DEGREE : DEGREE + INTERVALS + 1], base)]
    edges = np.array([lead.low, lead.high])
    for weight_of, span in zip(weights[width:].reshape(len(inputs) - 1, -1), spans[1:], strict=True):
        slope = weight_of[1] if bends else 0.0
        line = np.array([[weight_of[0] - slope, 2 * slope / (lead.high - lead.low)]]) / span
        terms.append(Piecewise(edges, line))
    return Varying(tuple(terms), centres)


def _weights(points: Points, design: Floats, width: int, penalty: float, ridge: float) -> Floats:
    """Weights of the columns of ``design``, shape (n, k), of which the first ``width`` are the spline's, up to a
    constant."""
    walk = walk_of(points, design)
    white = whitened(points, walk, np.concatenate([design, points.value[:, None]], axis=1))
    columns, values = white[:, :-1], white[:, -1]
    gram = columns.T @ columns
    size = np.diag(gram).copy()
    spline = float(np.mean(size[:width]))
    row = np.diff(np.eye(width), 2, axis=0)
    gram[:width, :width] += penalty * spline * row.T @ row
    # What hardly moves is not to be divided by.
    own = ridge * np.maximum(size[width:], SMALLEST * spline)
    gram += np.diag(np.concatenate([np.full(width, SMALLEST * spline), own]))
    return np.asarray(np.linalg.solve(gram, columns.T @ values), dtype=np.float64)


def _shape(names: tuple[str, ...], penalty: float, ridge: float, bends: bool) -> str:
    return f"{', '.join(names)}; penalty {penalty:g}, ridge {ridge:g}, weights {'linear' if bends else 'constant'}"


def sets(blocks: Blocks) -> Iterator[tuple[str, ...]]:
    """Sets of inputs, the leading temperature first: with its slope and the other sensor; and lags; and plays; and
    both."""
    leads = [name for name in (STRUCTURE, FREQUENCY, CIRCUIT) if name in blocks.inputs]
    for lead in leads[:2]:
        other = (CIRCUIT, CIRCUIT + RATE_OF) if lead != CIRCUIT and CIRCUIT in blocks.inputs else ()
        span = float(np.ptp(blocks.inputs[lead]))
        lags = tuple(lag_name(lead, time) for time in LAGS)
        plays = tuple(play_name(lead, share * span) for share in WIDTHS) if span > 0 else ()
        slow = lags[-2:]
        yield (lead, lead + RATE_OF)
        for more in ((), slow, lags, plays, (*plays, *slow), (*plays, *lags)):
            if more or other:
                yield (lead, lead + RATE_OF, *other, *more)


def _candidates(blocks: Blocks, asked: Asked) -> Iterator[Candidate]:
    for names, penalty, ridge, bends in product(sets(blocks), PENALTIES, RIDGES, (False, True)):
        line = partial(fit, sampling_time=asked.sampling_time, names=names, penalty=penalty, ridge=ridge, bends=bends)
        memory = tuple(name for name in names if derived(name).remembers)
        yield Candidate("history", _shape(names, penalty, ridge, bends), line, memory)


SOURCE: Final = "M. A. Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis, 1989"
METHOD: Final = Method("history", SOURCE, _candidates)
