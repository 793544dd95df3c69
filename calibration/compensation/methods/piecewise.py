"""Liu et al. 2014: scale factor aT + b and bias cT + d in segments of the temperature, by least squares.

The lines of neighbouring segments meet: the paper prints a table of coefficients a segment and no condition, and a
jump of the output at an edge would be a fault of its own.
"""

from collections.abc import Iterator
from functools import partial
from typing import Final

import numpy as np

from calibration.compensation.methods.method import Asked, Candidate, Method
from calibration.compensation.model import Additive, Compensation, Constant, Function, Piecewise, fitted_inputs, unit_of
from calibration.compensation.points import Points, bias_points, scale_points
from calibration.compensation.record import CIRCUIT, STRUCTURE, Blocks, Floats
from gyro_model.errors import InputError

SEGMENTS: Final = (1, 2, 3, 4, 6, 8, 10, 12, 16, 20, 24)
"""Numbers of segments that the choice by held-out error looks at."""


def fit(blocks: Blocks, sampling_time: float, sensor: str, segments: int) -> Compensation:
    """Fits ``segments`` lines of equal width over the temperature of ``sensor``, scale factor first.

    Raises InputError for fewer points than the segments need, and for a segment without data.
    """
    if segments < 1:
        raise InputError(f"segments = {segments}: give 1 or more")
    inputs = fitted_inputs(blocks, [sensor])
    temperature = blocks.inputs[sensor]
    if segments >= len(temperature):
        raise InputError(f"--segments {segments}: {blocks.name} has {len(temperature)} blocks: give fewer --segments")
    edges = np.linspace(temperature.min(), temperature.max(), segments + 1)
    if edges[0] == edges[-1]:
        raise InputError(f"{blocks.name}: {sensor} never changes from {edges[0]:g} {unit_of(sensor)}: nothing to fit")
    found = scale_points(blocks)
    scale: Function = Constant(1.0)
    if len(found.value):
        scale = _lines(found, sensor, edges, "scale factor")
    divided = bias_points(blocks, scale(temperature[:, None]))
    note = f"{segments} segment{'' if segments == 1 else 's'} of {edges[1] - edges[0]:.3g} {unit_of(sensor)}"
    bias = _lines(divided, sensor, edges, "bias")
    return Compensation(f"piecewise, {sensor}", inputs, scale, bias, sampling_time, blocks.unit, note)


def _lines(points: Points, sensor: str, edges: Floats, what: str) -> Additive:
    """The continuous polygon of least squares over ``edges``."""
    x = points.blocks.inputs[sensor]
    segments = len(edges) - 1
    if len(x) < len(edges):
        raise InputError(
            f"{points.blocks.name}: {len(x)} points of the {what} for {segments} segments, which need {len(edges)}: "
            f"give fewer --segments or more temperatures"
        )
    k = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, segments - 1)
    counts = np.bincount(k, minlength=segments)
    if not counts.all():
        empty = int(np.argmin(counts > 0))
        raise InputError(
            f"{points.blocks.name}: no point of the {what} in segment {empty + 1} of {segments}, {edges[empty]:.4g} to "
            f"{edges[empty + 1]:.4g} {unit_of(sensor)}: give fewer --segments or a test with that temperature"
        )
    width = np.diff(edges)
    share = (x - edges[k]) / width[k]
    hats = np.zeros((len(x), len(edges)))
    rows = np.arange(len(x))
    hats[rows, k], hats[rows, k + 1] = 1 - share, share
    values, _, rank, _ = np.linalg.lstsq(hats, points.value, rcond=1e-6)
    if rank < len(edges):
        raise InputError(
            f"{points.blocks.name}: the temperatures of the {what} determine {rank} of the {len(edges)} corners of "
            f"{segments} segments: give fewer --segments or more temperatures"
        )
    return Additive((Piecewise(edges, np.stack([values[:-1], np.diff(values) / width], axis=1)),))


def _candidates(blocks: Blocks, asked: Asked) -> Iterator[Candidate]:
    sensors = [name for name in (STRUCTURE, CIRCUIT) if name in blocks.inputs and asked.sensor in (None, name)]
    if not sensors and (asked.sensor or asked.method == "piecewise"):
        raise InputError(
            f"{blocks.name}: holds no temperature of the {asked.sensor or STRUCTURE}: map one with --map, or take the "
            "other --sensor"
        )
    if asked.segments is not None and asked.segments < 1:
        raise InputError(f"--segments {asked.segments}: give 1 or more")
    if asked.segments is not None and sensors:
        # Said at once: beside other methods, one that can't be fitted is passed over without a word.
        fit(blocks, asked.sampling_time, sensors[0], asked.segments)
    for segments in SEGMENTS if asked.segments is None else (asked.segments,):
        for sensor in sensors[:1]:
            line = partial(fit, sampling_time=asked.sampling_time, sensor=sensor, segments=segments)
            yield Candidate("piecewise", f"{sensor}, {segments} segments", line)


METHOD: Final = Method("piecewise", "Liu et al. 2014", _candidates)
