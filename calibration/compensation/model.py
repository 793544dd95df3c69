"""A fitted compensation as data: two functions of its inputs, each with the range that it was fitted on."""

from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from calibration.compensation.derived import derived
from calibration.compensation.record import SIGNALS, Blocks, Floats
from gyro_model.errors import InputError, nearest

OUTSIDE: Final = ("refuse", "clamp")
"""What happens outside the fitted range."""
MARGIN: Final = 0.01
"""Share of the fitted range that an input may lie beyond it: readings of the same cycle differ by their noise."""
NOISES: Final = 4.0
"""And it may lie beyond by so many standard deviations of its own noise: 1 in 16,000 readings does."""


def unit_of(name: str) -> str:
    """Unit of an input."""
    wanted = derived(name)
    return SIGNALS[wanted.signal] + ("/s" if wanted.kind == "rate" else "")


class Input(NamedTuple):
    """An input: name of a signal or of its derivative, and the range fitted [°C, Hz, or these a second]."""

    name: str
    low: float
    high: float

    @property
    def unit(self) -> str:
        """Unit of the input."""
        return unit_of(self.name)


class Function(Protocol):
    """A function of the inputs."""

    def __call__(self, x: Floats) -> Floats:
        """Values, shape (n,), at ``x``, shape (n, inputs)."""


class Piecewise(NamedTuple):
    """A piecewise polynomial of one input: edges (s + 1,) rising; coefficients (s, d + 1), of (x - edge)^0 .. d from
    each segment's lower edge on. The outermost segments go on beyond their edges."""

    edges: Floats
    coefficients: Floats

    def __call__(self, x: Floats) -> Floats:
        """Values at ``x``, shape (n,)."""
        k = np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, len(self.edges) - 2)
        u, c = x - self.edges[k], self.coefficients[k]
        value = c[:, -1]
        for power in range(c.shape[1] - 2, -1, -1):
            value = value * u + c[:, power]
        return value


class Additive(NamedTuple):
    """A sum of piecewise polynomials, one an input."""

    terms: tuple[Piecewise, ...]

    def __call__(self, x: Floats) -> Floats:
        """Values, shape (n,), at ``x``, shape (n, inputs)."""
        total = np.zeros(len(x))
        for column, term in zip(x.T, self.terms, strict=True):
            total += term(column)
        return total


class Varying(NamedTuple):
    """A piecewise polynomial of the first input, and for each other input one that multiplies it:

        f_0(x_0) + Σ f_j(x_0) (x_j - centre_j)

    terms: f_0, f_1, ..; centres (inputs,), the first unused.
    """

    terms: tuple[Piecewise, ...]
    centres: Floats

    def __call__(self, x: Floats) -> Floats:
        """Values, shape (n,), at ``x``, shape (n, inputs)."""
        total = self.terms[0](x[:, 0])
        for term, column, centre in zip(self.terms[1:], x.T[1:], self.centres[1:], strict=True):
            total = total + term(x[:, 0]) * (column - centre)
        return total


class Constant(NamedTuple):
    """The same value everywhere: the scale factor of a test that never turns."""

    value: float

    def __call__(self, x: Floats) -> Floats:
        """Values, shape (n,), at ``x``, shape (n, inputs)."""
        return np.full(len(x), self.value)


class Network(NamedTuple):
    """One output of the network: y = shift + gain · (a2 · tanh(a1 · u + b1) + b2), u = 2 (x - low)/(high - low) - 1.

    a1 (hidden, inputs), b1 (hidden,), a2 (hidden,); low, high (inputs,): the range that is mapped to -1 .. 1.
    """

    a1: Floats
    b1: Floats
    a2: Floats
    b2: float
    low: Floats
    high: Floats
    shift: float
    gain: float

    def __call__(self, x: Floats) -> Floats:
        """Values, shape (n,), at ``x``, shape (n, inputs)."""
        u = 2 * (x - self.low) / (self.high - self.low) - 1
        return self.shift + self.gain * (np.tanh(u @ self.a1.T + self.b1) @ self.a2 + self.b2)


class Compensation(NamedTuple):
    """What a fit gives: compensated rate = rate/scale(X) - bias(X).

    method; inputs in the order of X; scale [1]; bias [unit]; sampling_time: over which inputs and rate are means [s];
    unit of the rate; note: how the fit went.
    """

    method: str
    inputs: tuple[Input, ...]
    scale: Function
    bias: Function
    sampling_time: float
    unit: str
    note: str = ""

    def at(self, blocks: Blocks, outside: str = "refuse") -> "Applied":
        """Scale factor and bias at the inputs of ``blocks``.

        outside: "refuse" inputs beyond the fitted range, or "clamp" them to it and count them. Raises InputError for an
        input that is missing or, refusing, beyond its range.
        """
        if outside not in OUTSIDE:
            raise InputError(f"outside = {outside!r}: give {' or '.join(OUTSIDE)}{nearest(outside, OUTSIDE)}")
        x = inputs_of(blocks.with_inputs(i.name for i in self.inputs), [i.name for i in self.inputs])
        low, high = (np.array(edge) for edge in zip(*((i.low, i.high) for i in self.inputs), strict=True))
        beyond: NDArray[np.bool_] = (x < low) | (x > high)
        if outside == "refuse" and beyond.any():
            column = int(np.argmax(beyond.sum(axis=0) > 0))
            raise InputError(self._refusal(blocks, self.inputs[column], x[:, column], beyond[:, column]))
        x = np.clip(x, low, high)
        return Applied(self.scale(x), self.bias(x), np.asarray(beyond.any(axis=1)))

    def _refusal(self, blocks: Blocks, fitted: Input, x: Floats, beyond: NDArray[np.bool_]) -> str:
        return (
            f"{blocks.name}: {fitted.name} reaches from {x.min():.5g} to {x.max():.5g} {fitted.unit}, but the "
            f"compensation ({self.method}) is fitted from {fitted.low:.5g} to {fitted.high:.5g} ({int(beyond.sum())} "
            f"of {len(x)} blocks outside): fit on a wider cycle, or clamp with --outside clamp"
        )


class Applied(NamedTuple):
    """Scale factor and bias at blocks, and whether it was clamped there, shape (n,) each."""

    scale: Floats
    bias: Floats
    outside: NDArray[np.bool_]


def inputs_of(blocks: Blocks, names: list[str]) -> Floats:
    """X, shape (n, inputs). Raises InputError for an input that the record does not hold."""
    for name in names:
        if name not in blocks.inputs:
            has = ", ".join(blocks.inputs)
            raise InputError(f"{blocks.name}: holds no {name} (has {has}): map a column to it, or use another method")
    return np.stack([blocks.inputs[name] for name in names], axis=1)


REACH: Final = 3.0
"""A line in a slope, a lag or a play goes on for so many times what was fitted: T(t - τ) = T - τ T' on any ramp."""


def both_ways(i: Input) -> Input:
    """The range of an input on which a compensation depends by a line: as far down as up, and REACH times that."""
    if not derived(i.name).kind:
        return i
    most = REACH * max(-i.low, i.high)
    return i._replace(low=-most, high=most)


def fitted_inputs(blocks: Blocks, names: list[str]) -> tuple[Input, ...]:
    """The inputs with their ranges in the blocks that are fitted, widened by MARGIN or by NOISES of their own noise."""
    x = inputs_of(blocks, names)
    # Second differences of a smooth course are noise times √6.
    noise = np.median(np.abs(np.diff(x, 2, axis=0)), axis=0) / 0.6745 / np.sqrt(6)
    low, high = x.min(axis=0), x.max(axis=0)
    extra = np.maximum(MARGIN * (high - low), NOISES * noise)
    return tuple(Input(n, float(a - e), float(b + e)) for n, a, b, e in zip(names, low, high, extra, strict=True))
