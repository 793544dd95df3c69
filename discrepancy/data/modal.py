"""A modal model of records: a sum of poles, whose residues and starts follow by least squares, and the poles too.

The residues are eliminated (variable projection: G. Golub and V. Pereyra, SIAM Journal on Numerical Analysis 10, 1973,
with the derivative of L. Kaufman, BIT 15, 1975).
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from discrepancy.data.record import Floats

Complexes = NDArray[np.complex128]

ROUNDS: Final = 8
"""Steps of a fit of poles: three or four are usual."""
SHARES: Final = (1.0, 0.3, 0.1)
"""Of a step that is tried until less is left."""
SETTLED: Final = 1e-3
"""Share of what is left that a step has to take for another to be worth it."""
FURTHEST: Final = 4.0
"""Factor by which a step changes how fast a pole dies away at most."""
TINY: Final = 1e-300
"""Added to poles, which may be none."""
PEAK: Final = 2.0
"""Half widths of a peak to either side of it that are around it."""
BINS: Final = 3
"""Bins of a run's spectrum to either side of a peak that are around it at least."""
SURE: Final = 1e-12
"""Singular value over the largest from which a response is another than the rest."""


class Runs(NamedTuple):
    """forces and voltages: of each run in the band, (n, axes), without unit; at_once: the forces, as often as they are
    seen at other times, as they are seen without a motion; step [s]."""

    pairs: list[tuple[Floats, Floats]]
    at_once: list[Floats]
    step: float


class Modal:
    """A model of the ``poles`` of the upper half plane, of which those ``ringing`` are modes; ``left``: the share of
    the voltage's power that it leaves."""

    def __init__(self, runs: Runs, poles: Complexes) -> None:
        self._runs = runs
        self.poles = poles[poles.imag >= 0]
        self.ringing = self.poles.imag > 0
        self._responses = [_responses(self.poles, u) for u, _ in runs.pairs]
        self._starts = [_starts(self.poles, len(u)) for u, _ in runs.pairs]
        self._without = [np.linalg.qr(start)[0] for start in self._starts]
        made = [np.hstack((r.real, r.imag, u)) for r, u in zip(self._responses, runs.at_once, strict=True)]
        target = self._beside_starts([v for _, v in runs.pairs])
        basis = self._beside_starts(made)
        scale = or_one(np.linalg.norm(basis, axis=0))
        vectors, sizes, shares = np.linalg.svd(basis / scale, full_matrices=False)
        known = sizes > SURE * max(sizes, default=0.0)
        self._span = vectors[:, known]
        self._residues = (shares[known].T @ (self._span.T @ target / sizes[known, None])) / scale[:, None]
        self._error = target - self._span @ (self._span.T @ target)
        self._made = made
        self.left = float(np.mean(self._error**2) / np.mean(np.vstack([v for _, v in runs.pairs]) ** 2))

    def left_around(self, pole: complex) -> float:
        """The power that it leaves around the peak of a ``pole``, to compare with that of another model."""
        rate, begin, found = np.log(pole), 0, 0.0
        for _, v in self._runs.pairs:
            own, begin = self._error[begin : begin + len(v)], begin + len(v)
            w = 2 * np.pi * np.fft.rfftfreq(len(own))
            near = np.abs(w - np.abs(rate)) <= max(-PEAK * rate.real, BINS * w[1])
            found += float(np.sum(np.abs(np.fft.rfft(own * np.hanning(len(own))[:, None], axis=0)[near]) ** 2))
        return found

    def step(self) -> Floats:
        """By how much frequencies and decays [1/sample] of the modes are to change, (2, modes)."""
        changes = []
        axes, count = self._runs.pairs[0][0].shape[1], len(self.poles)
        real, imaginary = (self._residues[i * axes * count : (i + 1) * axes * count] for i in range(2))
        residues = (real - 1j * imaginary).reshape(count, axes, -1)
        for made, start, responses, (_, v) in zip(
            self._made, self._starts, self._responses, self._runs.pairs, strict=True
        ):
            begun = np.linalg.lstsq(start, v - made @ self._residues, rcond=SURE)[0]
            free = begun[:count] - 1j * begun[count : 2 * count]
            alone = _alone(self.poles, len(v)) * np.arange(len(v))[:, None]
            own = []
            for i in np.flatnonzero(self.ringing):
                p = self.poles[i]
                slope = lfilter([0.0, 1.0], [1.0, -p], responses[:, i * axes : (i + 1) * axes], axis=0)
                own.append(p * slope @ residues[i] + alone[:, i, None] * free[i])
            changes.append(np.stack(own, axis=1))
        # A frequency turns the pole, a decay shortens it.
        columns = [self._across([(way * c).real.reshape(len(c), -1) for c in changes])
                   .reshape(len(self._error), -1, self._error.shape[1]) for way in (1j, -1.0)]  # fmt: skip
        slopes = np.concatenate(columns, axis=1).transpose(0, 2, 1).reshape(self._error.size, -1)
        found = np.linalg.lstsq(slopes, self._error.ravel(), rcond=SURE)[0]
        return np.asarray(found.reshape(2, -1))

    def moved(self, step: Floats) -> Complexes:
        """The poles after a step, each within the upper half of the circle."""
        poles = self.poles.copy()
        angle, decay = np.angle(poles[self.ringing]), -np.log(np.abs(poles[self.ringing]))
        decay = np.clip(decay + step[1], decay / FURTHEST, decay * FURTHEST)
        poles[self.ringing] = np.exp(-decay + 1j * np.clip(angle + step[0], angle / FURTHEST, np.pi * (1 - SETTLED)))
        return poles

    @property
    def both(self) -> Complexes:
        """The poles of both half planes."""
        return np.concatenate((self.poles, self.poles[self.ringing].conj()))

    def _beside_starts(self, columns: list[Floats]) -> Floats:
        """Columns of each run, (n, k), all runs below each other, without what starts can make."""
        return np.vstack([c - q @ (q.T @ c) for c, q in zip(columns, self._without, strict=True)])

    def _across(self, columns: list[Floats]) -> Floats:
        """The same without what residues can make."""
        own = self._beside_starts(columns)
        return np.asarray(own - self._span @ (self._span.T @ own))


def refined(runs: Runs, poles: Complexes) -> Modal:
    """The model of ``poles``, these fitted by least squares. A subspace sees no more than its window, and poles that it
    has no states for pull at the others."""
    at = Modal(runs, poles)
    for _ in range(ROUNDS if at.ringing.any() else 0):
        step, before = at.step(), at.left
        tried = (Modal(runs, at.moved(share * step)) for share in SHARES)
        at = next((model for model in tried if model.left < at.left), at)
        if at.left > (1 - SETTLED) * before:
            break
    return at


def or_one(scale: Floats) -> Floats:
    """``scale``, 1 where it is none."""
    return np.where(scale > 0, scale, 1.0)


def _responses(poles: Complexes, u: Floats) -> Complexes:
    """Of each pole to each force, (n, poles * axes)."""
    made = [lfilter([0.0, 1.0], [1.0, -p], a) for p in poles for a in u.T]
    return np.reshape(made, (-1, len(u))).T.astype(np.complex128)


def _starts(poles: Complexes, count: int) -> Floats:
    """What poles do by themselves, and a mean, (n, 2 * poles + 1)."""
    alone = _alone(poles, count)
    return np.hstack((alone.real, alone.imag, np.ones((count, 1))))


def _alone(poles: Complexes, count: int) -> Complexes:
    """Powers of poles, (n, poles)."""
    # Far sooner than by ``**``, which takes the logarithm anew for each.
    return np.asarray(np.exp(np.arange(count)[:, None] * np.log(poles.astype(np.complex128) + TINY)))
