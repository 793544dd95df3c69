"""How many values of a force a one-step method needs: those that a quadrature of Gauss takes on the true motion.

Whatever such a method does (Runge-Kutta, exponential, collocation), what the forces that bend the motion give in a
part of a step is an integral of which it knows some values, and no formula makes more of so many values than the one
of Gauss, of twice their number as order. So even where the motion is known for nothing, a part takes as many values
as that formula needs. The plant itself says the motion between its cuts: it is asked there and leaves no trace.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BarycentricInterpolator

from cosim.exchange import exchange
from cosim.fmu import open_plant
from gyro_model.anatomy import Force
from gyro_model.effect_points import MODEL
from gyro_model.evaluate import evaluate
from gyro_model.linear_forces import is_linear

Floats = NDArray[np.float64]

STATES: Final = tuple(symbol.name for symbol in MODEL.state_symbols)
STEPS: Final = 400
"""2 ms, six periods of 3 kHz."""
DENSE: Final = 24
"""Values that the integral is taken by which others are held against, and from which the motion is interpolated."""
MOST: Final = 11
LIMIT: Final = 1e-6
"""Phase error that all forces together may leave [rad/s]."""


class Parts(NamedTuple):
    """Parts of steps: lengths [s], shape (parts,), and states [SI] at the points, shape (parts, DENSE, states)."""

    lengths: Floats
    states: Floats


def gauss(n: int) -> tuple[Floats, Floats]:
    """Points on [0, 1] and weights."""
    point, weight = np.polynomial.legendre.leggauss(n)
    return (point + 1.0) / 2.0, weight / 2.0


def move(parameters: Mapping[str, float], inputs: Mapping[str, Floats], step: float, cut: float) -> Parts:
    """The motion of the plant in steps [s] that are cut at ``cut`` [s], 0: nowhere, a row of ``inputs`` a step."""
    points, _ = gauss(DENSE)
    bounds = [0.0, cut, step] if cut else [0.0, step]
    times = np.concatenate([a + points * (b - a) for a, b in pairwise(bounds)] + [[step]])
    states, got, flags = [], np.zeros(len(STATES)), np.zeros(4)
    now = 0.0
    with open_plant(parameters) as plant:
        entering, leaving = (plant.value_references(names) for names in (list(inputs), STATES))
        for k in range(STEPS):
            row = np.array([column[k % len(column)] for column in inputs.values()])
            for to in k * step + times:
                if exchange(plant.handle, entering, row, leaving, got, flags, now, to - now) > 1:
                    raise RuntimeError(plant.complaint())
                now = to
                states.append(got.copy())
    shaped = np.reshape(states, (STEPS, len(times), len(STATES)))[:, :-1]
    return Parts(np.tile(np.diff(bounds), STEPS), shaped.reshape(-1, DENSE, len(STATES)))


def bending(parameters: Mapping[str, float]) -> list[Force]:
    """The forces that act and bend the motion."""
    set_here = [e for e in MODEL.forces if any(parameters.get(q.name, q.start) != q.start for q in e.sizes)]
    return [e for e in set_here if not is_linear(e, MODEL)]


def force_of(effects: Sequence[Force], parameters: Mapping[str, float], states: Floats) -> Floats:
    """Their sum [N] at ``states``, shape (..., states), for both axes, shape (..., 2); no law acts."""
    values = {q.name: parameters.get(q.name, q.start) for q in MODEL.quantities}
    values |= {name: states[..., i] for i, name in enumerate(STATES)}
    total = np.zeros((*states.shape[:-1], 2))
    for effect in effects:
        terms = evaluate(effect, values)
        total[..., 0] += terms["force_x"]
        total[..., 1] += terms["force_y"]
    return total


def phase_error(parts: Parts, effects: Sequence[Force], parameters: Mapping[str, float], n: int) -> float:
    """What n values a part leave of the phase [rad/s], of the worse axis."""
    points, weights = gauss(DENSE)
    few, few_weights = gauss(n)
    between = BarycentricInterpolator(points, parts.states.swapaxes(0, 1))(few).swapaxes(0, 1)
    true = np.einsum("j,pja->pa", weights, force_of(effects, parameters, parts.states))
    left = np.einsum("j,pja->pa", few_weights, force_of(effects, parameters, between)) - true
    place, speed = (parts.states[:, DENSE // 2, i::2][:, :2] for i in (0, 1))
    frequency = np.sqrt(np.array([parameters["kxx"], parameters["kyy"]]) / parameters["m"])
    size = np.mean(speed**2 + (frequency * place) ** 2, axis=0)
    turned = left * parts.lengths[:, None] / parameters["m"] * place * frequency / size
    duration = parts.lengths.sum()
    return float(np.max(np.abs(turned.sum(axis=0))) / duration)


def values_needed(parameters: Mapping[str, float], inputs: Mapping[str, Floats], step: float) -> tuple[int, int]:
    """Parts of a step, and the fewest values of the forces in each from which on the phase is right to ``LIMIT``;
    more than ``MOST`` where so many don't do."""
    cut = parameters.get("actuator_delay", 0.0) % step
    parts, effects = move(parameters, inputs, step, cut), bending(parameters)
    wrong = [n for n in range(1, MOST + 1) if phase_error(parts, effects, parameters, n) > LIMIT]
    return (2 if cut else 1), max(wrong, default=0) + 1
