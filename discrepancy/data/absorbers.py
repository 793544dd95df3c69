"""A structure of several modes as a mass that carries resonators, from how it answers to forces at the sensors' places.

    X = Σ φ_i φ_iᵀ / (s² + 2 ζ_i w_i s + w_i²) F,  Σ φ_i φ_iᵀ = 1/m

One force and one sensor at two places have residues φ_i χ_i of either sign. Nothing that they show tells what either
is alone: φ_i = √|φ_i χ_i| is taken, and OPPOSED times as much where it is negative.

Turned by an orthogonal matrix whose first rows are √m φ, the modes are the mass and what it carries: the frequencies of
the rest are those of the structure while the mass is held, its antiresonances (J. P. Den Hartog, Mechanical Vibrations,
1956, section 3.2). A fit of one mode an axis ends at the mass of that mode, of which the structure is only a part, so
that no further resonance fits beside it.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import eigh
from scipy.signal import cont2discrete, lfilter

from discrepancy.data.modes import Mode
from discrepancy.data.record import Floats, Record

OF_ONE: Final = 0.3
"""Of what a mode answers with, that the product of one shape with itself may leave: no mode answers otherwise where
sensors are at the places of the forces."""
OPPOSED: Final = 0.5
"""Of the shape of a mode that answers against the force. Any would do but 1: of two masses with the force on one and
the sensor on the other both modes answer alike but for the sign, so that mass and resonator would have one frequency,
where the response shows only the sum of their damping."""


class Absorber(NamedTuple):
    """frequency [Hz] and quality factor of a resonator alone; the spring [N/m] that couples it to each axis, scaled to
    the mass; joint: how much of its damping lies along the spring to each axis, 0 where its damper is on the ground;
    drive: the share of the force that acts on it."""

    frequency: float
    quality: float
    coupling: Floats
    joint: Floats
    drive: float

    @property
    def axis(self) -> int:
        """The axis to which it is coupled most."""
        return int(np.abs(self.coupling).argmax())


class Carried(NamedTuple):
    """m [kg], stiffness [N/m] and damping [N.s/m] (axes, axes) of the mass without joints, and its resonators, that
    which is coupled most first."""

    m: float
    k: Floats
    d: Floats
    absorbers: tuple[Absorber, ...]


def carried(records: Sequence[Record], modes: Sequence[Mode], gains: Sequence[float]) -> Carried | None:
    """The structure of ``modes`` that driven records show, for sensors of so many ``gains`` [V/m], one an axis; None
    where the modes are no more than the axes, those of several forces do not answer as at the places of the forces, or
    the mass would not be positive, as where a sensor is connected the other way round.
    """
    axes = len(gains)
    residues = _residues(records, modes) / np.asarray(gains) if len(modes) > axes else None
    shapes = None if residues is None else _shapes(residues)
    if residues is None or shapes is None:
        return None
    # Columns: the mass along each axis, then the rest, in any order.
    turn = np.linalg.qr(shapes, mode="complete")[0]
    turn[:, :axes] *= np.sign((turn[:, :axes] * shapes).sum(axis=0))
    w = 2 * np.pi * np.array([mode.frequency for mode in modes])
    stiffness = turn.T @ np.diag(w**2) @ turn
    damping = turn.T @ np.diag(w / [mode.quality for mode in modes]) @ turn
    squares, own = eigh(stiffness[axes:, axes:])
    apart = bool((residues < 0).any()) and axes == 1
    pushed = (residues[:, 0, 0] / turn[:, 0]) @ turn if apart else np.zeros(len(modes))
    facing = pushed[axes:] @ own if apart else (stiffness[:axes, axes:] @ own).sum(axis=0)
    own *= np.where(facing < 0, -1.0, 1.0)
    m = 1 / float(pushed[0] + np.abs(facing).sum()) if apart else axes / float((shapes**2).sum())
    if m <= 0:
        return None
    losses, couplings = np.diag(own.T @ damping[axes:, axes:] @ own), m * stiffness[:axes, axes:] @ own
    dragged, followed = damping[:axes, axes:] @ own / losses, couplings / (m * squares)
    absorbers = [
        Absorber(float(speed / (2 * np.pi)), float(speed / loss), coupling, joint, float(drive))
        for speed, loss, coupling, joint, drive in zip(
            np.sqrt(squares), losses, couplings.T, (dragged / followed).T, m * (pushed[axes:] @ own), strict=True
        )
    ]
    absorbers.sort(key=lambda a: -float(np.abs(a.coupling).max()))
    own_damping = damping[:axes, :axes] - dragged * losses @ dragged.T
    return Carried(m, m * stiffness[:axes, :axes], m * own_damping, tuple(absorbers))


def _shapes(residues: Floats) -> Floats | None:
    """The modes' shapes (modes, axes) [1/kg½] whose products with themselves are the ``residues`` (modes, axes, axes),
    of one axis but for the sign; None where one's are not such."""
    if residues.shape[1:] == (1, 1):
        return np.asarray(np.where(residues < 0, OPPOSED, 1.0) * np.sqrt(np.abs(residues)))[:, :, 0]
    shapes = []
    for own in residues:
        values, vectors = eigh((own + own.T) / 2)
        shape = vectors[:, -1] * np.sqrt(max(values[-1], 0.0))
        if np.linalg.norm(own - np.outer(shape, shape)) > OF_ONE * np.linalg.norm(own):
            return None
        shapes.append(shape)
    return np.array(shapes)


def _residues(records: Sequence[Record], modes: Sequence[Mode]) -> Floats:
    """By how much each mode answers with each voltage to each force, (modes, forces, voltages) [V/(N.s²)], by least
    squares beside how the runs begin and a mean."""
    axes, made, told = records[0].axes, [], []
    for record in records:
        answers = np.hstack([_answers(record, mode) for mode in modes])
        starts = np.linalg.qr(_starts(record, modes))[0]
        columns = np.hstack((answers, record.v))
        columns -= starts @ (starts.T @ columns)
        made.append(columns[:, :-axes])
        told.append(columns[:, -axes:])
    found = np.linalg.lstsq(np.vstack(made), np.vstack(told), rcond=None)[0]
    return np.asarray(found.reshape(len(modes), axes, axes))


def _starts(record: Record, modes: Sequence[Mode]) -> Floats:
    """What modes do by themselves, and a mean, (n, 2 * modes + 1)."""
    t = np.arange(len(record.t)) / record.sample_rate
    columns = [np.ones_like(t)]
    for mode in modes:
        w, loss = 2 * np.pi * mode.frequency, 0.5 / mode.quality
        own = np.exp(w * complex(-loss, (1 - loss**2) ** 0.5) * t)
        columns += [own.real, own.imag]
    return np.column_stack(columns)


def _answers(record: Record, mode: Mode) -> Floats:
    """The motion (n, forces) of a mode of 1 kg under each force, as the sensors take it: its displacement, speed or
    acceleration."""
    w = 2 * np.pi * mode.frequency
    pulled = [-(w**2), -w / mode.quality]
    seen, through = [([1.0, 0.0], 0.0), ([0.0, 1.0], 0.0), (pulled, 1.0)][record.order]
    system = np.array([[0.0, 1.0], pulled]), np.array([[0.0], [1.0]]), np.array([seen]), np.array([[through]])
    method = "zoh" if record.hold == "zero" else "foh"
    a, b, c, d, _ = cont2discrete(system, 1 / record.sample_rate, method)
    numerator = np.poly(a - b @ c) + (d[0, 0] - 1) * np.poly(a)
    return np.asarray(lfilter(numerator, np.poly(a), record.u, axis=0)) / record.reference**record.order
