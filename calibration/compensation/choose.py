"""Chooses a method and its shape by inner validation: parts of the fitting cycles are left out in turn, fitted without,
and predicted. Nothing else is looked at.

The score is the rms of what remains of rate and scale factor at the blocks left out, each over its noise, so that both
count in what can be known of them. Of a whole cycle neither the mean nor a walk counts (``wander.py``): no method tells
the turn-on or the walk of the next, and one that is luckier with them is no better.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray

from calibration.compensation.cycles import INNER_PARTS, MEMORY, HoldOut, hold_outs, memory_of
from calibration.compensation.methods import methods
from calibration.compensation.methods.method import Asked, Candidate, Fit
from calibration.compensation.model import Applied
from calibration.compensation.points import Points, bias_points, scale_points
from calibration.compensation.record import Blocks, Floats
from calibration.compensation.wander import walk_of, whitened
from gyro_model.errors import InputError, nearest
from gyro_model.progress import Progress

BEST: Final = "best"
CURVE: Final = 12
"""Degree of the curve over temperature beside which a walk is seen: a bend each 7 °C of -20 .. 60."""


class Choice(NamedTuple):
    """best: the best candidate of each family asked for, best first; tried: all, with their scores."""

    best: list[Candidate]
    tried: list[Candidate]


def candidates(blocks: Blocks, asked: Asked) -> list[Candidate]:
    """Those of the method asked for; of "best", those whose inputs the record holds. Raises InputError for a method
    that is none, and as the methods do."""
    known = methods()
    if asked.method != BEST and asked.method not in known:
        names = (*known, BEST)
        raise InputError(f"method {asked.method!r}: give one of {', '.join(names)}{nearest(asked.method, names)}")
    wanted = [method for name, method in known.items() if asked.method in (name, BEST)]
    return [candidate for method in wanted for candidate in method.candidates(blocks, asked)]


def inputs_of_all(found: list[Candidate]) -> tuple[str, ...]:
    """Inputs that remember, of all candidates: to be made before a record is parted."""
    return tuple(dict.fromkeys(name for candidate in found for name in candidate.inputs))


def choose(
    blocks: Blocks, asked: Asked, among: list[Candidate] | None = None, progress: Progress | None = None
) -> Choice:
    """The best candidate of each family, by cycles left out in turn, of a single cycle by contiguous parts.

    progress: is called with the candidates done and all of them. Raises InputError where none can be fitted.
    """
    among = candidates(blocks, asked) if among is None else among
    blocks = blocks.with_inputs(inputs_of_all(among))
    folds = hold_outs(blocks, MEMORY * memory_of(blocks), INNER_PARTS)
    walk = _walk(blocks)
    best: dict[str, Candidate] = {}
    tried = []
    refusal: InputError | None = None
    for number, candidate in enumerate(among):
        if progress is not None:
            progress(number, len(among))
        try:
            candidate.fit(blocks)
            held_out, bias_error = score(blocks, folds, candidate.fit, walk)
        except InputError as error:
            refusal = refusal or error
            continue
        scored = candidate._replace(held_out=held_out, bias_error=bias_error)
        tried.append(scored)
        if candidate.family not in best or scored.held_out < best[candidate.family].held_out:
            best[candidate.family] = scored
    if not best:
        raise refusal or InputError(f"{blocks.name}: no method fits what the record holds")
    return Choice(sorted(best.values(), key=lambda candidate: candidate.held_out), tried)


def score(blocks: Blocks, folds: list[HoldOut], fit: Fit, walk: float) -> tuple[float, float]:
    """The rms of residual over noise at blocks left out in turn, those apart that lie beyond what the others cover, and
    the rms of what remains of the bias [unit]; infinite where no fold can be fitted. walk: of the bias [unit²/s]."""
    total, count = 0.0, 0
    left: list[Floats] = []
    for fold in folds:
        part = blocks.part(fold.fitted)
        try:
            compensation = fit(part)
            applied = compensation.at(blocks, "clamp")
        except InputError:
            return np.inf, np.inf
        inside: NDArray[np.bool_] = fold.left_out & ~applied.outside
        bias, scale = _residuals(blocks, applied, inside)
        for remains, wander in ((bias, walk), (scale, 0.0)):
            values = remains.value[:, None]
            white = whitened(remains, wander, values)[:, 0] if fold.whole else remains.value / remains.noise
            total, count = total + float(white @ white), count + len(white)
        left.append(bias.value)
    found = np.concatenate(left)
    if not count:
        return np.inf, np.inf
    return float(np.sqrt(total / count)), float(np.sqrt(np.mean(found**2))) if len(found) else np.inf


def _residuals(blocks: Blocks, applied: Applied, inside: NDArray[np.bool_]) -> tuple[Points, Points]:
    """What remains of bias and of scale factor at the blocks ``inside``, shape (n,)."""
    rest, found = bias_points(blocks, applied.scale), scale_points(blocks)
    bias = rest._replace(value=rest.value - applied.bias[blocks.at_rest])
    where = np.searchsorted(blocks.t, found.blocks.t)
    scale = found._replace(value=found.value / applied.scale[where] - 1)
    return bias.part(inside[blocks.at_rest]), scale.part(inside[where])


def _walk(blocks: Blocks) -> float:
    """Walk of the bias [unit²/s], beside a curve over temperature and all inputs."""
    points = bias_points(blocks)
    lead = points.blocks.temperature
    curve = chebvander(2 * (lead - lead.min()) / max(float(np.ptp(lead)), 1e-12) - 1, CURVE)[:, 1:]
    return walk_of(points, np.concatenate([curve, np.stack(list(points.blocks.inputs.values()), axis=1)], axis=1))
