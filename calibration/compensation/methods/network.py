"""CN 105222765: Y = purelin(a2 · tansig(a1 · X + b1) + b2), Y = [bias, scale factor].

X = [drive frequency, its derivative, temperature of the circuit, its derivative]: the frequency tells the structure's
temperature, the sensor the circuit's. Trained by Levenberg and Marquardt's method with the analytic Jacobian; inputs
and outputs are mapped to -1 .. 1. Training stops once (Y - T)ᵀ(Y - T)/2 is below a threshold (claim 5), here what the
noise of the blocks would leave of it.

The inputs move together, and a network may follow any mixture of them until a faster ramp parts them. So each is
trained on less what the inputs before it tell (regression), which is folded into a1 and b1 afterwards: with weights
decaying, the circuit and the derivatives then act only where they add something.
"""

from collections.abc import Iterator
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares

from calibration.compensation.methods.method import Asked, Candidate, Method, holds
from calibration.compensation.model import Compensation, Constant, Function, Network, fitted_inputs, inputs_of
from calibration.compensation.points import Points, bias_points, scale_points
from calibration.compensation.record import CIRCUIT, FREQUENCY, RATE_OF, Blocks, Floats
from gyro_model.errors import InputError

INPUTS: Final = (FREQUENCY, FREQUENCY + RATE_OF, CIRCUIT, CIRCUIT + RATE_OF)
PARTED: Final = (0, 2, 1, 3)
"""Order in which the inputs are told apart: both temperatures, then their derivatives."""
HIDDEN: Final = (2, 4, 8)
"""Numbers of neurons that the inner validation looks at: 21, 41 and 81 weights of what a few hundred blocks tell."""
STARTS: Final = 3
"""Random starts; the best training error is kept."""
DECAY: Final = 1e-5
"""Weight of |weights|²/2 beside the sum of squares, in units of the mapped outputs: keeps the weights of inputs that
carry nothing near zero, so that a ramp faster than any trained on does no harm."""
EVALUATIONS: Final = 400
"""At most, of the residual, a start."""


class _ReachedError(Exception):
    """Training error below the threshold, at these weights."""

    def __init__(self, weights: Floats) -> None:
        self.weights = weights


class _Training(NamedTuple):
    """Mapped inputs (n, inputs) and targets (n,) of each output, and which output row i belongs to (n,)."""

    u: Floats
    target: Floats
    output: np.ndarray
    hidden: int
    outputs: int
    threshold: float

    def split(self, w: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """a1 (hidden, inputs), b1 (hidden,), a2 (outputs, hidden), b2 (outputs,)."""
        h, i, o = self.hidden, self.u.shape[1], self.outputs
        a1, b1, a2, b2 = np.split(w, np.cumsum([h * i, h, o * h]))
        return a1.reshape(h, i), b1, a2.reshape(o, h), b2

    def residual(self, w: Floats) -> Floats:
        """Errors, then the weights times √DECAY. Raises _ReachedError at the threshold."""
        a1, b1, a2, b2 = self.split(w)
        z = np.tanh(self.u @ a1.T + b1)
        error = (z * a2[self.output]).sum(axis=1) + b2[self.output] - self.target
        if 0.5 * float(error @ error) < self.threshold:
            raise _ReachedError(w.copy())
        return np.concatenate([error, np.sqrt(DECAY) * w])

    def jacobian(self, w: Floats) -> Floats:
        """Of the residual by the weights, shape (n + weights, weights)."""
        a1, b1, a2, _ = self.split(w)
        z = np.tanh(self.u @ a1.T + b1)
        inner = a2[self.output] * (1 - z * z)
        n = len(self.u)
        of_output = np.eye(self.outputs)[self.output]
        errors = np.concatenate(
            [
                (inner[:, :, None] * self.u[:, None, :]).reshape(n, -1),
                inner,
                (of_output[:, :, None] * z[:, None, :]).reshape(n, -1),
                of_output,
            ],
            axis=1,
        )
        return np.concatenate([errors, np.sqrt(DECAY) * np.eye(len(w))])


def fit(blocks: Blocks, sampling_time: float, seed: int, hidden: int) -> Compensation:
    """Trains the network on the blocks; the same seed gives the same network.

    Raises InputError where an input is missing, or fewer points than weights are given.
    """
    if hidden < 1:
        raise InputError(f"hidden = {hidden}: give 1 or more neurons")
    inputs = fitted_inputs(blocks, list(INPUTS))
    scale = scale_points(blocks)
    # Bias after the division, as the compensation subtracts it: by the scale factors measured around each block.
    measured = np.interp(blocks.t, scale.blocks.t, scale.value) if len(scale.value) else None
    targets = [bias_points(blocks, measured)] + ([scale] if len(scale.value) else [])
    low, high = (np.array([getattr(i, end) for i in inputs]) for end in ("low", "high"))
    if not (high > low).all():
        stuck = inputs[int(np.argmin(high > low))]
        raise InputError(f"{blocks.name}: {stuck.name} never changes: the network can't be trained on it")
    shifts, gains = zip(*(_mapping(points) for points in targets), strict=True)
    training = _training(targets, low, high, shifts, gains, hidden)
    parted, offset, mixing = _parted(training.u)
    training = training._replace(u=parted)
    weights, note = _train(training, blocks.name, np.random.default_rng(seed))
    a1, b1, a2, b2 = training.split(weights)
    a1, b1 = a1 @ mixing.T, b1 + a1 @ offset
    functions: list[Function] = [
        Network(a1, b1, a2[k], float(b2[k]), low, high, float(shifts[k]), float(gains[k])) for k in range(len(targets))
    ]
    scale_of = functions[1] if len(functions) > 1 else Constant(1.0)
    return Compensation("network", inputs, scale_of, functions[0], sampling_time, blocks.unit, note)


def _parted(u: Floats) -> tuple[Floats, Floats, Floats]:
    """Inputs less their regression on those before them, in the order of INPUTS' signals: u mixing + offset."""
    count = u.shape[1]
    mixing, offset = np.eye(count), np.zeros(count)
    for step, column in enumerate(PARTED):
        before = list(PARTED[:step])
        design = np.concatenate([np.ones((len(u), 1)), u[:, before]], axis=1)
        solution, *_ = np.linalg.lstsq(design, u[:, column], rcond=None)
        offset[column], mixing[before, column] = -solution[0], -solution[1:]
    return u @ mixing + offset, offset, mixing


def _mapping(points: Points) -> tuple[float, float]:
    """Middle and half range of the values."""
    low, high = float(points.value.min()), float(points.value.max())
    return 0.5 * (low + high), 0.5 * (high - low) or 1.0


def _training(
    targets: list[Points],
    low: Floats,
    high: Floats,
    shifts: tuple[float, ...],
    gains: tuple[float, ...],
    hidden: int,
) -> _Training:
    x = np.concatenate([inputs_of(points.blocks, list(INPUTS)) for points in targets])
    value = [(p.value - shift) / gain for p, shift, gain in zip(targets, shifts, gains, strict=True)]
    noise = [np.sum((p.noise / gain) ** 2) for p, gain in zip(targets, gains, strict=True)]
    output = np.repeat(np.arange(len(targets)), [len(v) for v in value])
    u = 2 * (x - low) / (high - low) - 1
    return _Training(u, np.concatenate(value), output, hidden, len(targets), 0.5 * float(sum(noise)))


def _train(training: _Training, name: str, rng: np.random.Generator) -> tuple[Floats, str]:
    """The best of STARTS trainings and a sentence on it."""
    h, i, o = training.hidden, training.u.shape[1], training.outputs
    size = h * i + h + o * h + o
    if len(training.target) < size:
        raise InputError(
            f"{name}: {len(training.target)} points for the {size} weights of {h} neurons: give a longer record, a "
            "shorter --sampling-time, or --hidden with fewer neurons"
        )
    best, lowest = np.zeros(size), np.inf
    for _ in range(STARTS):
        # Nguyen and Widrow: the neurons' slopes share the range of the inputs.
        a1 = rng.standard_normal((h, i))
        a1 *= 0.7 * h ** (1 / i) / np.linalg.norm(a1, axis=1, keepdims=True)
        start = np.concatenate([a1.ravel(), rng.uniform(-1, 1, h), 0.1 * rng.standard_normal(o * h), np.zeros(o)])
        try:
            weights = least_squares(
                training.residual, start, training.jacobian, method="lm", max_nfev=EVALUATIONS, xtol=1e-10, ftol=1e-10
            ).x
        except _ReachedError as end:
            return end.weights, f"{h} neurons, training error reached its threshold, {training.threshold:.3g}"
        error = training._replace(threshold=-1.0).residual(weights)[: len(training.target)]
        if float(error @ error) / 2 < lowest:
            best, lowest = weights, float(error @ error) / 2
    return best, f"{h} neurons, training error {lowest:.3g} (threshold {training.threshold:.3g})"


def _candidates(blocks: Blocks, asked: Asked) -> Iterator[Candidate]:
    if asked.hidden is not None and asked.hidden < 1:
        raise InputError(f"--hidden {asked.hidden}: give 1 or more neurons")
    if not holds(blocks, INPUTS) and asked.method != "network":
        return
    for hidden in HIDDEN if asked.hidden is None else (asked.hidden,):
        train = partial(fit, sampling_time=asked.sampling_time, seed=asked.seed, hidden=hidden)
        yield Candidate("network", f"{hidden} neurons", train)


METHOD: Final = Method("network", "patent CN 105222765", _candidates)
