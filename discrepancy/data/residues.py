"""How much each of some modes answers to each force, and what of the voltage that leaves."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import cont2discrete, lfilter

from discrepancy.data.modal import TINY
from discrepancy.data.modes import Mode
from discrepancy.data.record import Floats, Record


class Answer(NamedTuple):
    """residues: by how much each mode answers with each voltage to each force, (modes, forces, voltages) [V/(N.s²)];
    residuals: what is left of the voltage of each run (n, voltages) [V], beside how it begins and a mean; left: rms of
    that over the voltage."""

    residues: Floats
    residuals: tuple[Floats, ...]
    left: float


def answered(records: Sequence[Record], modes: Sequence[Mode]) -> Answer:
    """What driven records show of ``modes``, by least squares."""
    axes, made, told = records[0].axes, [], []
    for record in records:
        answers = np.hstack([_answers(record, mode) for mode in modes])
        starts = np.linalg.qr(_starts(record, modes))[0]
        columns = np.hstack((answers, record.v))
        columns -= starts @ (starts.T @ columns)
        made.append(columns[:, :-axes])
        told.append(columns[:, -axes:])
    columns, shown = np.vstack(made), np.vstack(told)
    found = np.linalg.lstsq(columns, shown, rcond=None)[0]
    residuals = tuple(v - of @ found for v, of in zip(told, made, strict=True))
    left = float(np.linalg.norm(np.vstack(residuals)) / (np.linalg.norm(shown) + TINY))
    return Answer(np.asarray(found.reshape(len(modes), axes, axes)), residuals, left)


def _starts(record: Record, modes: Sequence[Mode]) -> Floats:
    """What modes do by themselves, and a mean, (n, 2 * modes + 1)."""
    t = np.arange(len(record.t)) / record.sample_rate
    columns = [np.ones_like(t)]
    for mode in modes:
        w = 2 * np.pi * mode.frequency
        one, other = np.exp(np.outer(np.roots([1.0, w / mode.quality, w**2]), t))
        columns += [one.real, one.imag] if np.iscomplexobj(one) else [one, other]
    return np.column_stack(columns)


def _answers(record: Record, mode: Mode) -> Floats:
    """The motion (n, forces) of a mode of 1 kg under each force, as the sensors take it: its displacement, speed or
    acceleration."""
    w = 2 * np.pi * mode.frequency
    pulled = [-(w**2), -w / mode.quality]
    seen, through = [([1.0, 0.0], 0.0), ([0.0, 1.0], 0.0), (pulled, 1.0)][record.order]
    system = np.array([[0.0, 1.0], pulled]), np.array([[0.0], [1.0]]), np.array([seen]), np.array([[through]])
    held = record.hold == "zero"
    a, b, c, d, _ = cont2discrete(system, 1 / record.sample_rate, "zoh" if held else "foh")
    # What a held force makes at once is seen before it changes, a sample late; else it is no more than a share.
    at_once = through * record.u
    at_once = np.vstack((at_once[:1], at_once[:-1])) if held else at_once
    numerator = np.poly(a - b @ c) + (d[0, 0] - through - 1) * np.poly(a)
    return np.asarray(lfilter(numerator, np.poly(a), record.u, axis=0) + at_once) / record.reference**record.order
