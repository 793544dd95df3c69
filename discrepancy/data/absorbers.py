"""A structure of several modes as a mass that carries resonators, from how it answers to forces at the sensors' places.

    X = Σ φ_i φ_iᵀ / (s² + 2 ζ_i w_i s + w_i²) F,  Σ φ_i φ_iᵀ = 1/m

One force and one sensor at two places have residues φ_i χ_i of either sign. Nothing that they show tells what either
is alone: φ_i = √|φ_i χ_i| is taken, and one of OPPOSED times as much where it is negative.

Turned by an orthogonal matrix whose first rows are √m φ, the modes are the mass and what it carries: the frequencies of
the rest are those of the structure while the mass is held, its antiresonances (J. P. Den Hartog, Mechanical Vibrations,
1956, section 3.2). A fit of one mode an axis ends at the mass of that mode, of which the structure is only a part, so
that no further resonance fits beside it.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from discrepancy.data.modes import Mode
from discrepancy.data.record import Course, Floats, Record
from discrepancy.data.residues import Answer, answered

OF_ONE: Final = 0.3
"""Of what a mode answers with, that the product of one shape with itself may leave: no mode answers otherwise where
sensors are at the places of the forces."""
OPPOSED: Final = (0.25, 0.5, 2.0, 4.0)
"""Of the shape of a mode that answers against the force, one of which is taken: that with which the response tells most
of mass and resonators. Each leads to a direction that hardly shows in a structure or another; 1 in all of two masses,
whose modes answer alike but for the sign, so that mass and resonator would have one frequency, and only the sum of
their damping shows."""
NEAR: Final = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)
"""Half widths of a mode's peak from it, where the response is looked at."""
STEP: Final = 1e-5
"""Relative changes for difference quotients: of the third order and of roundings each makes 1e-10."""


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
    """m [kg], stiffness [N/m] and damping [N.s/m] (axes, axes) of the mass without joints; its resonators, that which
    is coupled most first; friction [N] and cubic [N/m³], by which the spring bends, at each sensor, 0 where records
    have no such course; near_rest: by how much the friction is higher there, relative, and the speed [m/s] at which
    that has faded."""

    m: float
    k: Floats
    d: Floats
    absorbers: tuple[Absorber, ...]
    friction: Floats
    cubic: Floats
    near_rest: tuple[float, float] | None = None


def carried(records: Sequence[Record], modes: Sequence[Mode], gains: Sequence[float]) -> Carried | None:
    """The structure of ``modes`` that driven records show, for sensors of so many ``gains`` [V/m], one an axis; None
    where the modes are no more than the axes, those of several forces do not answer as at the places of the forces, or
    the mass would not be positive, as where a sensor is connected the other way round.
    """
    axes = len(gains)
    answer = answered(records, modes) if len(modes) > axes else None
    residues = answer.residues / np.asarray(gains) if answer else None
    shapes = None if residues is None else _shapes(residues)
    if answer is None or residues is None or shapes is None:
        return None
    cubic = _pushing(answer, "cube") * np.asarray(gains) ** 3
    made = {"friction": np.maximum(_pushing(answer, "friction"), 0.0), "cubic": cubic}
    if axes > 1 or (residues > 0).all():
        found = _turned(modes, residues, shapes, apart=False)
        return found and found._replace(**made)
    against = residues[:, :, 0] < 0
    tried = (_turned(modes, residues, np.where(against, own, 1.0) * shapes, apart=True) for own in OPPOSED)
    found = max((own for own in tried if own is not None), key=lambda own: _told(modes, own), default=None)
    return found and found._replace(**made)


def _turned(modes: Sequence[Mode], residues: Floats, shapes: Floats, *, apart: bool) -> Carried | None:
    """Modes of these ``residues`` (modes, axes, axes) and ``shapes`` (modes, axes) as mass and resonators; ``apart``:
    of a force and a sensor at two places. None where the mass would not be positive."""
    axes = shapes.shape[1]
    # Columns: the mass along each axis, then the rest, in any order.
    turn = np.linalg.qr(shapes, mode="complete")[0]
    turn[:, :axes] *= np.sign((turn[:, :axes] * shapes).sum(axis=0))
    w = 2 * np.pi * np.array([mode.frequency for mode in modes])
    stiffness = turn.T @ np.diag(w**2) @ turn
    damping = turn.T @ np.diag(w / [mode.quality for mode in modes]) @ turn
    squares, own = eigh(stiffness[axes:, axes:])
    pushed = (residues[:, 0, 0] / turn[:, 0]) @ turn if apart else np.zeros(len(modes))
    facing = pushed[axes:] @ own if apart else (stiffness[:axes, axes:] @ own).sum(axis=0)
    own *= np.where(facing < 0, -1.0, 1.0)
    m = 1 / float(pushed[0] + np.abs(facing).sum()) if apart else axes / float((shapes**2).sum())
    # A mode that does not answer at all leaves no number.
    if not m > 0:
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
    return Carried(m, m * stiffness[:axes, :axes], m * own_damping, tuple(absorbers), np.zeros(axes), np.zeros(axes))


def _pushing(answer: Answer, kind: Course) -> Floats:
    """Of each axis that force [N] which makes all modes answer as they do to the course of a ``kind``."""
    axes = answer.residues.shape[1]
    if kind not in answer.to:
        return np.zeros(axes)
    pairs = [(answer.to[kind][:, i].ravel(), answer.residues[:, i].ravel()) for i in range(axes)]
    return np.array([course @ force / np.sum(force**2) for course, force in pairs])


def _told(modes: Sequence[Mode], found: Carried) -> float:
    """How much of mass and resonators on one axis the response tells: the smallest singular value of its slopes by
    their constants, each scaled to 1."""
    w = 2 * np.pi * np.array([mode.frequency for mode in modes])
    half = 0.5 * w / [mode.quality for mode in modes]
    s = 1j * (w + np.outer(NEAR, half)).ravel()
    own = found.absorbers
    speeds = 2 * np.pi * np.array([a.frequency for a in own])
    couplings = np.array([a.coupling[0] for a in own])
    held = np.array([a.drive for a in own]) * found.m * speeds**2 / couplings
    losses = speeds / [a.quality for a in own]
    # Without joints the mass may seem to be driven by its own damping; as it is damped as the modes are, it is not.
    damping = found.m * float(half.mean()) * 2
    values = np.concatenate(([found.m, found.k[0, 0], damping], couplings, speeds, losses))
    columns = []
    for i, value in enumerate(values):
        up, down = values.copy(), values.copy()
        up[i], down[i] = value * (1 + STEP), value * (1 - STEP)
        change = _response(up, held, s) - _response(down, held, s)
        columns.append(np.concatenate((change.real, change.imag)))
    changes = np.column_stack(columns)
    return float(np.linalg.svd(changes / np.linalg.norm(changes, axis=0), compute_uv=False)[-1])


def _response(values: Floats, held: Floats, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """What a force moves the mass by at ``s`` [1/s]; values: m, k, d, then couplings, frequencies [rad/s] and losses
    [1/s] of the resonators; held: their share of the force over how far they follow."""
    (m, k, d), (couplings, speeds, losses) = values[:3], np.split(values[3:], 3)
    own = s[:, None] ** 2 + losses * s[:, None] + speeds**2
    driven = held * couplings / (m * speeds**2)
    follows = couplings / (m * own)
    of = m * s**2 + d * s + k - (couplings * follows).sum(axis=1)
    return np.asarray((1 - driven.sum() - (follows * driven).sum(axis=1)) / of)


def _shapes(residues: Floats) -> Floats | None:
    """The modes' shapes (modes, axes) [1/kg½] whose products with themselves are the ``residues`` (modes, axes, axes),
    of one axis but for the sign; None where one's are not such."""
    if residues.shape[1:] == (1, 1):
        return np.asarray(np.sqrt(np.abs(residues[:, :, 0])))
    shapes = []
    for own in residues:
        values, vectors = eigh((own + own.T) / 2)
        shape = vectors[:, -1] * np.sqrt(max(values[-1], 0.0))
        if np.linalg.norm(own - np.outer(shape, shape)) > OF_ONE * np.linalg.norm(own):
            return None
        shapes.append(shape)
    return np.array(shapes)
