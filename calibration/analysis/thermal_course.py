"""How a bias follows the ambient temperature: its curve, how late it is, and its hysteresis, from a record of a cycle.

    b = c(T) + h s + b_0,   T' = (T_ambient - T)/τ
    s = mean of (T - p_i)/w_i,   p_i = max(T - w_i, min(T + w_i, p_i before)),  p_i = T at the start

c is a curve through evenly spaced knots (E. Catmull, R. Rom, A class of local interpolating splines, 1974). c, h and
the offset b_0 of the record's own turn-on by least squares at each τ; τ where the residual is least. The play operators
and their widths are those of thermal hysteresis in docs/theory/effects.md.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

Floats = NDArray[np.float64]

SHORTEST: Final = 1.0
LONGEST: Final = 5000.0
"""Time constants tried [s]."""


SMOOTH: Final = 1e-3
"""Weight of the second differences of the knots, which holds those between which nothing was measured."""


class ThermalCourse(NamedTuple):
    """lag τ [s]; hysteresis h and the curve at the knots, in the unit of the bias. No errors: what is left is the
    model's, and not white; ``returns.side`` measures hysteresis with its error."""

    lag: float
    hysteresis: float
    curve: Floats


def basis(temperature: Floats, knots: Floats) -> Floats:
    """Weights of the values at ``knots``, evenly spaced, for the curve at ``temperature``, shape (n, knots); beyond the
    ends it stays."""
    count = len(knots)
    x = np.clip((temperature - knots[0]) / (knots[-1] - knots[0]), 0.0, 1.0) * (count - 1)
    first = np.minimum(x.astype(int), count - 2)
    f = x - first
    g = 1 - f
    weights = (-0.5 * f * g**2, g * (1 + f - 1.5 * f**2), f * (1 + g - 1.5 * g**2), -0.5 * g * f**2)
    # A knot beyond each end, in line with the last two.
    wide = np.zeros((len(x), count + 2))
    for k, weight in enumerate(weights):
        wide[np.arange(len(x)), first + k] = weight
    found = wide[:, 1:-1].copy()
    for beyond, near, next_to in ((0, 0, 1), (-1, -1, -2)):
        found[:, near] += 2 * wide[:, beyond]
        found[:, next_to] -= wide[:, beyond]
    return found


def curve_through(knots: Floats, temperature: Floats, values: Floats) -> Floats:
    """The smoothest curve through ``values`` at ``temperature``, shapes (m,), at the knots."""
    return _solved(basis(temperature, knots), values, 0)[0]


def followed(ambient: Floats, interval: float, lag: float) -> Floats:
    """The temperature behind a lag [s], at rest at the first ambient one, which moves in straight lines between the
    rows, ``interval`` [s] apart; shape (n,)."""
    if lag <= 0:
        return ambient.copy()
    x = interval / lag
    decay = np.exp(-x)
    late = (1 - decay) / x
    moved = (late - decay) * ambient[:-1] + (1 - late) * ambient[1:]
    rest, _ = lfilter([1.0], [1.0, -decay], moved, zi=[decay * ambient[0]])
    return np.concatenate([ambient[:1], rest])


def pushed(temperature: Floats, widths: Sequence[float]) -> Floats:
    """S of play operators of half ``widths`` [K], between -1 and 1; shape (n,)."""
    total = np.zeros(len(temperature))
    for width in widths:
        behind = temperature[0]
        for k, value in enumerate(temperature.tolist()):
            behind = max(value - width, min(value + width, behind))
            total[k] += (value - behind) / width
    return total / len(widths)


def thermal_course(
    ambient: Floats,
    bias: Floats,
    interval: float,
    settled: tuple[Floats, Floats],
    knots: Floats,
    widths: Sequence[float],
) -> ThermalCourse:
    """Of a record of ``ambient`` [K] and ``bias``, shapes (n,), and of ``settled`` temperatures [K] and biases, shapes
    (m,), m = 0 where there are none, which weigh together as much as the record."""
    weight = np.sqrt(len(bias) / max(len(settled[0]), 1))
    still = weight * np.column_stack([basis(settled[0], knots), np.zeros((len(settled[0]), 2))])
    data = np.concatenate([bias, weight * settled[1]])

    def solved(lag: float) -> tuple[Floats, float]:
        temperature = followed(ambient, interval, lag)
        record = np.column_stack([basis(temperature, knots), pushed(temperature, widths), np.ones(len(temperature))])
        return _solved(np.vstack([record, still]), data, 2)

    tried = np.geomspace(SHORTEST, LONGEST, 30)
    best = int(np.argmin([solved(lag)[1] for lag in tried]))
    edges = np.log([tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]])
    found = minimize_scalar(lambda e: solved(float(np.exp(e)))[1], bounds=edges, method="bounded")
    lag = float(np.exp(found.x))
    values, _ = solved(lag)
    n = len(knots)
    return ThermalCourse(lag, float(values[n]), values[:n])


def _solved(design: Floats, data: Floats, others: int) -> tuple[Floats, float]:
    """Values and the residual's rms; of the unknowns all but the last ``others`` are knots."""
    unknowns = design.shape[1]
    bend = np.diff(np.eye(unknowns - others), n=2, axis=0)
    smooth = SMOOTH * np.column_stack([bend, np.zeros((len(bend), others))])
    every = np.vstack([design, smooth])
    values = np.linalg.lstsq(every, np.concatenate([data, np.zeros(len(smooth))]), rcond=None)[0]
    return values, float(np.sqrt(np.mean((data - design @ values) ** 2)))
