"""Chooses a method and its shape by held-out error: parts of the record are left out in turn, fitted without, and
predicted.

The score is the rms of what remains of rate and scale factor at the blocks left out, each over its noise, so that both
count in what can be known of them.
"""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.compensation import network, piecewise, spline
from calibration.compensation.model import Applied, Compensation
from calibration.compensation.points import bias_points, scale_points
from calibration.compensation.record import CIRCUIT, STRUCTURE, Blocks, Floats
from gyro_model.errors import InputError, nearest

METHODS: Final = ("piecewise", "network", "spline", "best")
FOLDS: Final = 4
STRETCHES: Final = 20
"""The record is cut in so many stretches, dealt out to the folds: each fold then holds parts of every temperature."""
SHORTEST: Final = 8
"""Blocks of a stretch at least: two rounds of rest, +R, rest, -R at the usual sampling time, so that each stretch tells
a scale factor."""

Fit = Callable[[Blocks], Compensation]


class Asked(NamedTuple):
    """What is asked for: method of METHODS; sensor of the piecewise one, structure or circuit; segments, None: chosen;
    seed and hidden neurons of the network; sampling_time [s]."""

    method: str = "best"
    sensor: str | None = None
    segments: int | None = None
    hidden: int = network.HIDDEN
    seed: int = 1
    sampling_time: float = 10.0


class Candidate(NamedTuple):
    """A method with its shape, as a function of the blocks that are fitted; held_out: its score."""

    family: str
    fit: Fit
    held_out: float = np.inf


def held_out_stretches(count: int, fold: int, stretches: int = STRETCHES) -> NDArray[np.bool_]:
    """Which of ``count`` blocks belong to a fold, shape (count,): of so many ``stretches``, or as many as hold SHORTEST
    blocks each."""
    stretches = min(stretches, max(count // SHORTEST, FOLDS))
    return np.arange(count) * stretches // count % FOLDS == fold


def choose(blocks: Blocks, asked: Asked) -> list[Candidate]:
    """The best candidate of each family asked for, best first. Raises InputError where none can be fitted."""
    if asked.method not in METHODS:
        raise InputError(f"method {asked.method!r}: give one of {', '.join(METHODS)}{nearest(asked.method, METHODS)}")
    best: dict[str, Candidate] = {}
    refusal: InputError | None = None
    folds = folds_of(blocks)
    for candidate in _candidates(blocks, asked):
        try:
            candidate.fit(blocks)
            scored = candidate._replace(held_out=score(blocks, folds, candidate.fit))
        except InputError as error:
            refusal = refusal or error
            continue
        if candidate.family not in best or scored.held_out < best[candidate.family].held_out:
            best[candidate.family] = scored
    if not best:
        raise refusal or InputError(f"{blocks.name}: no method fits what the record holds")
    return sorted(best.values(), key=lambda candidate: candidate.held_out)


def _candidates(blocks: Blocks, asked: Asked) -> Iterator[Candidate]:
    """Those of the method asked for; of "best", those whose inputs the record holds."""
    asks = {method: asked.method in (method, "best") for method in METHODS}
    if asks["piecewise"]:
        yield from _piecewise(blocks, asked)
    if asked.method == "network" or (asks["network"] and _holds(blocks, network.INPUTS)):
        train = partial(network.fit, sampling_time=asked.sampling_time, seed=asked.seed, hidden=asked.hidden)
        yield Candidate("network", train)
    if asks["spline"]:
        for names, penalty in product(spline.SETS, spline.PENALTIES):
            if _holds(blocks, names):
                draw = partial(spline.fit, sampling_time=asked.sampling_time, names=names, penalty=penalty)
                yield Candidate("spline", draw)


def _piecewise(blocks: Blocks, asked: Asked) -> Iterator[Candidate]:
    sensors = [name for name in (STRUCTURE, CIRCUIT) if name in blocks.inputs and asked.sensor in (None, name)]
    if not sensors and (asked.sensor or asked.method == "piecewise"):
        raise InputError(
            f"{blocks.name}: holds no temperature of the {asked.sensor or STRUCTURE}: map one with --map, or take the "
            "other --sensor"
        )
    counts = piecewise.SEGMENTS if asked.segments is None else (asked.segments,)
    for sensor, segments in product(sensors[:1], counts):
        fit = partial(piecewise.fit, sampling_time=asked.sampling_time, sensor=sensor, segments=segments)
        yield Candidate("piecewise", fit)


def _holds(blocks: Blocks, names: tuple[str, ...]) -> bool:
    return all(name in blocks.inputs for name in names)


class Fold(NamedTuple):
    """Blocks that are fitted; left_out: the others, shape (n,) of all."""

    fitted: Blocks
    left_out: NDArray[np.bool_]


def folds_of(blocks: Blocks) -> list[Fold]:
    """FOLDS parts of the record, each left out in turn."""
    left_out = [held_out_stretches(len(blocks), fold) for fold in range(FOLDS)]
    return [Fold(blocks.part(~chosen), chosen) for chosen in left_out]


def score(blocks: Blocks, folds: list[Fold], fit: Fit) -> float:
    """The rms of residual over noise at blocks left out in turn, those apart that lie beyond what the others cover;
    infinite where a fold can't be fitted."""
    total, count = 0.0, 0
    for fold in folds:
        try:
            compensation = fit(fold.fitted)
        except InputError:
            return np.inf
        applied = compensation.at(blocks, "clamp")
        for residual in _residuals(blocks, applied):
            chosen = residual[fold.left_out & ~applied.outside & np.isfinite(residual)]
            total, count = total + float(chosen @ chosen), count + len(chosen)
    return float(np.sqrt(total / count)) if count else np.inf


def _residuals(blocks: Blocks, applied: Applied) -> tuple[Floats, Floats]:
    """What remains of bias and of scale factor over their noise, shape (n,) each; NaN where a block shows none."""
    rest = bias_points(blocks, applied.scale)
    bias, scale = np.full((2, len(blocks)), np.nan)
    bias[blocks.at_rest] = (rest.value - applied.bias[blocks.at_rest]) / rest.noise
    found = scale_points(blocks)
    if len(found.value):
        where = np.searchsorted(blocks.t, found.blocks.t)
        scale[where] = (found.value / applied.scale[where] - 1) / found.noise
    return bias, scale
