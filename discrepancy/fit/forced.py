"""What drives each step of a run: the force of a record between its samples, and conditions."""

from collections.abc import Mapping
from math import ceil
from typing import Final

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from discrepancy.data.record import CONDITIONS, Floats, Record
from discrepancy.data.top import top_of_force
from discrepancy.fit.defect import distortions
from gyro_model.quantities import PARAMETERS

OVERSAMPLING: Final = 3
"""Steps a sample where u runs between samples. What their hold shrinks is made up for (``between``); images of a force
at f come back at f from about 3/T, f/(3/T - f) as strong and weaker by the square of that ratio in the motion: 1e-3 of
what a force at a third of the rate does, 2e-5 of the Silverbox' output."""
DENSE: Final = (50.0, 350.0)
"""Samples a period of the fastest that drives from which one step a sample does, of places and of speeds:
images of a force at f are 1/T - f fast, and f T as strong; in a place that is less by the square of f T, 8e-6 of what
the force does at rest, in a speed by f T itself, and in an acceleration by nothing."""
LONGEST: Final = next(q.high for q in PARAMETERS if q.name == "internal_step")
"""Longest step [s] that the FMU takes."""
MARGIN: Final = 256
"""Samples by which a record is continued at both ends before it is interpolated band-limited."""
AT_SAMPLE: Final = 1e-6
"""Of a period, up to which a late force comes at a sample: the plant's clock has it a picosecond earlier or later."""
INPUTS: Final = ("u_x", "u_y", *CONDITIONS)

Forced = tuple[Floats, tuple[str, ...], float]
"""Inputs of each step (steps, inputs), their names, and the step [s]."""


def distorted(driven: Forced, axes: int, sizes: Mapping[str, float]) -> Forced:
    """``driven`` with the force as distortions of these ``sizes`` leave it on its way."""
    values, names, step = driven
    u = values[:, :axes]
    for distortion in distortions():
        if distortion.force and distortion.acts(sizes):
            u = distortion.force(u, step, sizes)
    return np.ascontiguousarray(np.column_stack((u, values[:, axes:]))), names, step


def commands(record: Record, late: float = 0.0) -> Floats | None:
    """The force of both axes that acts at samples (n, 2) [N], ``late`` [s] after it was sent, that before where it
    changes at one; None where that is the force of the last step."""
    if record.hold == "zero" and not late:
        return None
    found = np.zeros((len(record.t), 2))
    found[:, : record.axes] = _delayed(record.u, record.hold, late * record.sample_rate) if late else record.u
    return found


def _delayed(u: Floats, hold: str, samples: float) -> Floats:
    """What runs through u (n, axes), so many samples later, its first value before."""
    n = len(u)
    if hold == "zero":
        return u[np.maximum(np.ceil(np.arange(n) - samples - AT_SAMPLE).astype(int) - 1, 0)]
    if hold == "first":
        return np.column_stack([np.interp(np.arange(n) - samples, np.arange(n), column) for column in u.T])
    longer, margin = _continued(u)
    spectrum = rfft(longer, axis=0)
    turns = np.arange(len(spectrum)) / len(longer)
    found = irfft(spectrum * np.exp(-2j * np.pi * samples * turns)[:, None], len(longer), axis=0)
    found[margin : margin + ceil(samples)] = u[0]
    return np.asarray(found[margin : margin + n])


def steps_a_sample(record: Record) -> int:
    """Internal steps of the FMU in a sample period of ``record``."""
    least = 1 if record.hold == "zero" or _dense(record) else OVERSAMPLING
    return max(least, ceil(1 / (record.sample_rate * LONGEST)))


def _dense(record: Record) -> bool:
    """Whether the force changes little from sample to sample."""
    top = top_of_force(record)
    return top is not None and record.order < 2 and record.sample_rate >= DENSE[record.order] * top


def forced(record: Record, split: int) -> Forced:
    """What drives a record, in ``split`` times as many steps as it takes."""
    stride = split * steps_a_sample(record)
    u = between(record.u, record.hold, stride)
    columns = [u[:, i] for i in range(record.axes)]
    columns += [np.repeat(values, stride) for values in record.conditions.values()]
    names = (*INPUTS[: record.axes], *record.conditions)
    return np.ascontiguousarray(np.column_stack(columns)), names, 1 / (record.sample_rate * stride)


def between(u: Floats, hold: str, stride: int) -> Floats:
    """Steps (n*stride, axes) that stand for u (n, axes) with so many a sample period: held over each, they drive what
    is slow against a step as u does, whose frequencies a hold would shrink by sinc. What that takes from a step its
    neighbours have, so that all together push as u does: a mass that nothing holds keeps the speed of every push."""
    n = len(u)
    if hold == "zero":
        return np.repeat(u, stride, axis=0)
    if hold == "first":
        at, longer = (np.arange(n * stride) + 0.5) / stride, np.concatenate((u, 2 * u[-1:] - u[-2:-1]))
        middle = np.column_stack([np.interp(at, np.arange(n + 1), column) for column in longer.T])
        # Between two knots the middle is the mean as well; mean and hold shrink by sinc(f h)^2 = 1 - (pi f h)^2/3, by
        # h^2/12 times the second derivative.
        middle -= np.diff(np.pad(middle, ((1, 1), (0, 0)), "edge"), 2, axis=0) / 12
        return middle
    longer, margin = _continued(u)
    size = len(longer)
    spectrum = rfft(longer, axis=0)
    turns = np.arange(len(spectrum)) / (size * stride)
    held = spectrum * (np.exp(1j * np.pi * turns) / np.sinc(turns))[:, None]
    fine = irfft(np.concatenate((held, np.zeros((size * stride // 2 + 1 - len(held), u.shape[1])))),
                 size * stride, axis=0) * stride  # fmt: skip
    found = np.ascontiguousarray(fine[margin * stride : (margin + n) * stride])
    found[0] -= (fine[margin * stride] - fine[margin * stride - 1]) / 12
    found[-1] += (fine[(margin + n) * stride] - fine[(margin + n) * stride - 1]) / 12
    return found


def _continued(u: Floats) -> tuple[Floats, int]:
    """A force u (n, axes) continued at both ends to a ring, and by how many samples before the first: by its point
    reflection, which keeps value and slope, so that the ends do not ring."""
    margin = min(MARGIN, len(u) - 1)
    longer = np.concatenate((2 * u[0] - u[margin:0:-1], u, 2 * u[-1] - u[-2 : -margin - 2 : -1]))
    size = next_fast_len(len(longer), real=True)
    return np.concatenate((longer, np.linspace(longer[-1], longer[0], size - len(longer) + 2)[1:-1])), margin
