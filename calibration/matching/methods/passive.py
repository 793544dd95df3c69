"""Passive: from the thermal hump in the sense voltage, after CN 111272193; nothing is added to the device's work."""

from math import pi
from typing import Final

import numpy as np

from calibration.matching.known import Known, Sensed
from calibration.matching.methods.method import Answer, Asked, Estimator, Method, Plan
from calibration.mode_split import Envelope, NothingFoundError, Question, Spectrum, Split, estimate, line_spectrum
from cosim.decimation import FLAT, Decimator
from gyro_model.errors import InputError

RINGING: Final = 12.0
"""Decay times in which the bias goes to its new value: so slowly, it leaves little that rings. The drive loop is left
behind by up to 0.1 Hz even so, and until it has caught up the drive line is as wide as a hump at the match: at Q 521
and a step of 7 Hz that moved a split of -2.1 Hz by 1.9 Hz, six deviations."""
DECAYS: Final = 60.0
"""Decay times of a measurement: the bound is an eighth of the half-width then."""
SHORTEST: Final = 10.0
"""Measurement at least [s]."""
RATE: Final = 1000.0
"""Samples of the envelope a second at most [Hz]."""
SPAN: Final = 100.0
"""Searched either side of the drive [Hz]: the trim of the bias reaches no farther."""
GATE: Final = 5.0
"""Deviations about what is expected in which the hump is looked for."""
SURE: Final = 20.0
"""Where what is expected is less sure than this [Hz], the whole span is searched."""


class Hump:
    """The estimator. Q is found in the blocks; the design's is used where one can't tell it."""

    def __init__(self, known: Known, asked: Asked) -> None:
        least = DECAYS / known.decay
        measure = max(SHORTEST, least) if asked.block is None else asked.block
        if measure < 0.25 * least:
            raise InputError(
                f"--block {measure:g} s: the line width of the sense mode needs {0.25 * least:.3g} s or more"
            )
        self._plan = Plan(RINGING / known.decay, measure, closed=False, rest=known.settling)
        self._designed = pi * known.frequency / known.decay
        self._found: list[float] = []

    def plan(self) -> Plan:
        """All blocks are alike."""
        return self._plan

    def measure(self, sensed: Sensed, expected: tuple[float, float]) -> Answer | None:
        """The split by the likelihood of the spectrum; the drive line has no phase noise in its own frame."""
        centre = float(sensed.frequency.mean())
        factor = max(round(1 / (sensed.period * RATE)), 1)
        rate = 1 / (sensed.period * factor)
        values = Decimator(factor).feed(sensed.voltage) if factor > 1 else sensed.voltage
        part = Envelope(values, rate, centre, min(SPAN, FLAT * rate))
        near = (centre + expected[0], GATE * expected[1] + 2 * centre / self._designed) if expected[1] < SURE else None
        try:
            spectrum = line_spectrum(part, centre)
        except InputError:
            return None
        free = _split(spectrum, None, near)
        if free is not None:
            self._found.append(free.q)
        # A hump under the line shows its Q badly, and its place well once Q is known.
        split = _split(spectrum, float(np.median(self._found or [self._designed])), near) or free
        return None if split is None else Answer(split.split, split.deviation, split.bound)


def _split(spectrum: Spectrum, q: float | None, near: tuple[float, float] | None) -> Split | None:
    try:
        return estimate(spectrum, Question(q=q, clean_line=True), near)
    except NothingFoundError:
        return None


def _start(known: Known, asked: Asked) -> Estimator:
    return Hump(known, asked)


METHOD: Final = Method("passive", "frequency split from the spectrum of thermal noise, CN 111272193", False, _start)
