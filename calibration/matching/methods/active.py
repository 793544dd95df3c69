"""Active: the balance of the answers to a force above and below the drive frequency.

The force is a virtual Coriolis force, which a real rate of turn disturbs in phase with it: that moves the damping found
and not the split (docs/theory/matching.md, eq. 8).
"""

from math import degrees, pi
from typing import Final

from calibration.matching.known import Known, Sensed, virtual_rate_force
from calibration.matching.methods.method import Answer, Asked, Estimator, Method, Plan
from calibration.matching.sidebands import FARTHEST, find_pole
from gyro_model.errors import InputError

SETTLE: Final = 0.2
"""Seconds in which the bias moves: 16 times the time constant of a phase loop of 20 Hz."""
MEASURE: Final = 0.8
"""Seconds of a measurement."""
SHARE: Final = 0.1
"""Of full scale that the virtual rate has."""
BEYOND: Final = (1.5, 2.0)
"""Distance of the tone, over the bandwidths of output and sense loop: beyond what a user asks the output for."""


class Sidebands:
    """The estimator."""

    def __init__(self, known: Known, asked: Asked) -> None:
        rate = SHARE * known.full_scale if asked.dither is None else asked.dither
        if not 0 < rate <= known.full_scale:
            most = degrees(known.full_scale)
            raise InputError(f"--dither {degrees(rate):g}: give more than 0 and at most full scale, {most:g} deg/s")
        block = MEASURE if asked.block is None else asked.block
        measure = max(round(block / known.interval), 1) * known.interval
        tone = max(BEYOND[0] * known.output_bandwidth, BEYOND[1] * known.sense_bandwidth)
        if measure * tone < 2 * FARTHEST:
            raise InputError(
                f"--block {block:g} s: the dither of {tone:g} Hz needs {2 * FARTHEST / tone:.2g} s or more"
            )
        # Whole periods in a measurement: what stays, and it is the rate and the quadrature, drops out.
        self._plan = Plan(SETTLE, measure, round(tone * measure) / measure, virtual_rate_force(known, rate))

    def plan(self) -> Plan:
        """All blocks are alike."""
        return self._plan

    def measure(self, sensed: Sensed, expected: tuple[float, float]) -> Answer | None:
        """The pole of the sense mode by the balance of both sides."""
        pole = find_pole(sensed, self._plan.tone)
        return Answer(pole.split(float(sensed.frequency.mean())), pole.deviation / (2 * pi))


def _start(known: Known, asked: Asked) -> Estimator:
    return Sidebands(known, asked)


METHOD: Final = Method(
    "active",
    "a force either side of the drive frequency; compare two pilot tones, Journal of Sensors 2019, 9894367",
    True,
    _start,
)
