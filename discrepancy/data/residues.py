"""How much each of some modes answers to each force, and what of the voltage that leaves."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.signal import cont2discrete, lfilter

from discrepancy.data.modal import TINY
from discrepancy.data.modes import Mode
from discrepancy.data.record import Course, Floats, Record


class Answer(NamedTuple):
    """residues: by how much each mode answers with each voltage to each force, (modes, forces, voltages) [V/(N.s²)];
    to: the same by kind of course that the records have, to that of each axis; residuals: what is left of the voltage
    of each run (n, voltages) [V], beside how it begins and a mean; left: rms of that over the voltage."""

    residues: Floats
    to: Mapping[Course, Floats]
    residuals: tuple[Floats, ...]
    left: float


class Columns(NamedTuple):
    """What modes may do in a run: their answers (n, ...) to its forces and courses, and what they do by themselves
    (n, ...)."""

    answers: Floats
    starts: Floats


def columns_of(records: Sequence[Record], modes: Sequence[Mode]) -> list[Columns]:
    """What ``modes`` may do in each record."""
    return [
        Columns(
            np.hstack([np.empty((len(record.t), 0)), *(a for mode in modes for a in _answers(record, mode))]),
            np.hstack([np.empty((len(record.t), 0)), *(_starts(record, mode) for mode in modes)]),
        )
        for record in records
    ]


def answered(
    records: Sequence[Record], modes: Sequence[Mode], *, beside: Sequence[Columns] = (), higher: bool = False
) -> Answer:
    """What driven records show of ``modes``, by least squares; beside: of each record, what others may do that it is
    beside; ``higher``: beside such whose frequencies are higher, of which an accelerometer sees the mass that they take
    with them."""
    axes, count, made, told = records[0].axes, 0, [], []
    for record, own, others in zip(records, columns_of(records, modes), beside or columns_of(records, ()), strict=True):
        count, taken = own.answers.shape[1], [record.v]
        if higher and record.order == 2:
            taken.insert(0, _at_once(record.u, held=record.hold == "zero"))
        columns = np.hstack((own.answers, others.answers, *taken))
        starts = np.linalg.qr(np.hstack((np.ones((len(columns), 1)), own.starts, others.starts)))[0]
        columns -= starts @ (starts.T @ columns)
        made.append(columns[:, :-axes])
        told.append(columns[:, -axes:])
    shown = np.vstack(told)
    answers = np.vstack(made)
    # A force in newtons and a cube of volts are of any size.
    size = np.maximum(np.linalg.norm(answers, axis=0), TINY)
    found = np.linalg.lstsq(answers / size, shown, rcond=None)[0] / size[:, None]
    residuals = tuple(v - of @ found for v, of in zip(told, made, strict=True))
    left = float(np.linalg.norm(np.vstack(residuals)) / (np.linalg.norm(shown) + TINY))
    residues, *courses = np.split(found[:count].reshape(len(modes), -1, axes), 1 + len(records[0].courses), axis=1)
    return Answer(residues, dict(zip(records[0].courses, courses, strict=True)), residuals, left)


def _starts(record: Record, mode: Mode) -> Floats:
    """What a mode does by itself, (n, 2)."""
    w = 2 * np.pi * mode.frequency
    rates = np.roots([1.0, w / mode.quality, w**2])
    if np.iscomplexobj(rates):
        # The other one's is its conjugate.
        rates = rates[:1]
    alone = np.exp(np.outer(np.arange(len(record.t)) / record.sample_rate, rates))
    return alone.view(np.float64) if np.iscomplexobj(alone) else alone


def _answers(record: Record, mode: Mode) -> list[Floats]:
    """The motion (n, forces) of a mode of 1 kg under each force, and under each course of those that it makes."""
    forced = _motion(record, mode, record.u, held=record.hold == "zero")
    return [forced, *(_motion(record, mode, course, held=False) for course in record.courses.values())]


def _motion(record: Record, mode: Mode, force: Floats, *, held: bool) -> Floats:
    """The motion of a mode of 1 kg under forces (n, forces), ``held`` or running on between samples, as the sensors
    take it: its displacement, speed or acceleration."""
    w = 2 * np.pi * mode.frequency
    pulled = [-(w**2), -w / mode.quality]
    seen, through = [([1.0, 0.0], 0.0), ([0.0, 1.0], 0.0), (pulled, 1.0)][record.order]
    system = np.array([[0.0, 1.0], pulled]), np.array([[0.0], [1.0]]), np.array([seen]), np.array([[through]])
    a, b, c, d, _ = cont2discrete(system, 1 / record.sample_rate, "zoh" if held else "foh")
    numerator = np.poly(a - b @ c) + (d[0, 0] - through - 1) * np.poly(a)
    at_once = through * _at_once(force, held=held)
    return np.asarray(lfilter(numerator, np.poly(a), force, axis=0) + at_once) / record.reference**record.order


def _at_once(force: Floats, *, held: bool) -> Floats:
    """A force as an accelerometer sees it: what is held is seen before it changes, a sample late."""
    return np.vstack((force[:1], force[:-1])) if held else force
