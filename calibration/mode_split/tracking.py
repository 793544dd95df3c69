"""The split followed through time, and the bias that tunes it away.

Blocks of a record each give a split with its variance; a Kalman filter with the state [Δf, dΔf/dt] joins them, dΔf/dt
being a random walk. On blocks that reach the Cramér–Rao bound its variance is the posterior bound of the track.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from calibration.mode_split.estimate import NothingFoundError, Question, Split, estimate
from calibration.mode_split.record import Envelope, Floats
from calibration.mode_split.spectrum import line_spectrum
from gyro_model.errors import InputError

GATE: Final = 5.0
"""Deviations about the prediction within which the next hump is looked for."""
SLOWEST_RATE: Final = 1.0
"""Prior deviation of dΔf/dt, half-widths a second: wider than any drift that a block could resolve."""


PACKAGE_SPLIT: Final = 2e-5
"""Of the stiffness of one axis against the other by stress of the package [1/K]; silicon's own -60e-6 is common to
both."""
FASTEST_RAMP: Final = 1 / 60
"""Of the ambient temperature that a tracker is made for [K/s]: 1 °C/min, as chambers run."""
TAKES_UP: Final = 240.0
"""Within which the structure takes up a ramp [s]: package in still air."""


def expected_drift(frequency: float) -> float:
    """Of the split of modes at ``frequency`` [Hz] under the fastest ramp [Hz/s]."""
    return 0.5 * frequency * PACKAGE_SPLIT * FASTEST_RAMP


def expected_wander(frequency: float) -> float:
    """Strength of the random walk of such a drift [Hz/s per √s]: it may come or go within the lag of a package."""
    return expected_drift(frequency) / TAKES_UP**0.5


@dataclass
class SplitTracker:
    """Recursive estimate of the split.

    wander: strength of the random walk of dΔf/dt [Hz/s per √s]; mean (2,) [Hz, Hz/s] and covariance (2, 2) after the
    last block. ``update`` gives what is known at the middle of a block.
    """

    wander: float
    mean: Floats = field(default_factory=lambda: np.zeros(2))
    covariance: Floats | None = None

    def predict(self, step: float) -> None:
        """Moves on by ``step`` [s]: F = [[1, h], [0, 1]], Q = wander² [[h³/3, h²/2], [h²/2, h]]."""
        if self.covariance is None:
            return
        move = np.array([[1.0, step], [0.0, 1.0]])
        noise = np.array([[step**3 / 3, step**2 / 2], [step**2 / 2, step]])
        self.mean = move @ self.mean
        self.covariance = move @ self.covariance @ move.T + self.wander**2 * noise

    def update(self, split: float, deviation: float, half_width: float) -> None:
        """Takes in the split of a block [Hz] with its deviation [Hz]."""
        if self.covariance is None:
            self.mean = np.array([split, 0.0])
            self.covariance = np.diag([deviation**2, (SLOWEST_RATE * half_width) ** 2])
            return
        gain = self.covariance[:, 0] / (self.covariance[0, 0] + deviation**2)
        self.mean = self.mean + gain * (split - self.mean[0])
        self.covariance = self.covariance - np.outer(gain, self.covariance[0])

    @property
    def deviation(self) -> float:
        """Of the split [Hz]; infinite before the first block."""
        return np.inf if self.covariance is None else float(np.sqrt(self.covariance[0, 0]))


@dataclass(frozen=True)
class Tracked:
    """One block: t at its middle [s]; split and deviation [Hz] of the track; block: its own answer, None where nothing
    was found."""

    t: float
    split: float
    deviation: float
    block: Split | None


def track(part: Envelope, question: Question, block: float, wander: float) -> Iterator[Tracked]:
    """The split of every ``block`` [s] of an envelope around the drive line. ``question`` must give Q.

    Raises InputError where it doesn't. Before the first hump is found nothing is given.
    """
    if question.q is None:
        raise InputError("a track needs Q: give it, or find it first in a long record")
    tracker = SplitTracker(wander)
    for index in range(int(part.duration / block)):
        tracker.predict(block)
        piece = part.part(index * block, (index + 1) * block)
        found = block_split(piece, question, tracker)
        if found is not None:
            tracker.update(found.split, found.deviation, found.model.half_width)
        if tracker.covariance is not None:
            yield Tracked((index + 0.5) * block, float(tracker.mean[0]), tracker.deviation, found)


def block_split(piece: Envelope, question: Question, tracker: SplitTracker) -> Split | None:
    """The split in one block, looked for where the track predicts it; None where nothing is found or the line moves."""
    try:
        spectrum = line_spectrum(piece, question.drive_frequency or piece.centre, question.guard)
    except InputError:
        # A line that moves too far within the block: the next may be quieter.
        return None
    near = None
    if tracker.covariance is not None and question.q:
        half_width = 0.5 * piece.centre / question.q
        near = (spectrum.drive_line + float(tracker.mean[0]), GATE * tracker.deviation + 2 * half_width)
    try:
        return estimate(spectrum, question, near)
    except NothingFoundError:
        return None


@dataclass(frozen=True)
class BiasTuner:
    """Integral control of the bias that holds the split at zero.

        V²[k+1] = V²[k] - gain Δf[k] / (dΔf/dV²)

    slope: dΔf/dV² [Hz/V²] by ``split_slope``; gain [1]: share of the split taken away a block, 0 < gain < 1; highest:
    largest bias [V]. Where no split was found the bias stays.
    """

    slope: float
    gain: float
    highest: float

    def next_bias(self, v_bias: float, split: float | None) -> float:
        """The bias of the next block [V]."""
        if split is None:
            return v_bias
        square = v_bias**2 - self.gain * split / self.slope
        return float(np.sqrt(np.clip(square, 0.0, self.highest**2)))


def split_slope(softening: float, gap: float, amplitude: float, m: float, f_y: float) -> float:
    """dΔf/dV² [Hz/V²] of equal electrodes on both axes, x swinging by ``amplitude`` [m], y small.

    F_q = a V² q/(1 - (q/g)²)². The part of it in phase with x = A cos φ is a V² x (1 - r²)^(-3/2), r = A/g, since
    <2 cos²φ/(1 - r² cos²φ)²> = (1 - r²)^(-3/2); that on a small y is a V² y. So

        (ω_y² - ω_x²) m = kyy - kxx + a V² ((1 - r²)^(-3/2) - 1),  dΔf/dV² = a ((1 - r²)^(-3/2) - 1)/(8 π² m f_y)

    Bias on equal electrodes moves both axes, and only the swing of x tells them apart: without it (r → 0) nothing tunes
    the split. The device is made with kyy < kxx, so that bias, which softens x more, brings f_x down to f_y.
    """
    r = amplitude / gap
    return float(softening * ((1 - r**2) ** -1.5 - 1) / (8 * np.pi**2 * m * f_y))
