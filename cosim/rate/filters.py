"""Synchronous demodulator and output filter: two equal first-order sections each."""

from math import exp, pi, sqrt
from typing import Final, NamedTuple, Self

from numba import njit

SECTION: Final = 1 / sqrt(sqrt(2) - 1)
"""Each of two equal sections has this much of the bandwidth of both: |1/(1 + if/f_1)|² = 1/√2 at f = f_1/SECTION."""


class LowPass(NamedTuple):
    """Two first-order sections in a row, each exact for an input held over the period T:

        a_{k+1} = a_k + g (s_k - a_k),  b_{k+1} = b_k + g (a_{k+1} - b_k),  g = 1 - exp(-2π f_1 T)

    No overshoot, gain 1 at zero frequency; ``bandwidth`` [Hz] is where the power has halved.
    """

    gain: float

    @classmethod
    def design(cls, bandwidth: float, period: float) -> Self:
        """The filter of ``bandwidth`` [Hz] at the sample period ``period`` [s]."""
        return cls(1 - exp(-2 * pi * SECTION * bandwidth * period))


def delay(bandwidth: float) -> float:
    """How much the filter delays slow signals [s]: twice the time constant of a section."""
    return 2 / (2 * pi * SECTION * bandwidth)


@njit(cache=True)
def low_pass(block, first, second, sample):  # type: ignore[no-untyped-def]
    """The two sections after ``sample``; the second one is the output."""
    first = first + block.gain * (sample - first)
    return first, second + block.gain * (first - second)


@njit(cache=True)
def demodulate(block, first, second, voltage, reference):  # type: ignore[no-untyped-def]
    """The two sections after a sample ``voltage`` [V] with ``reference`` = e^{iφ}; the second is the envelope z of
    v = Re(z e^{iφ}), z = v_i + i v_q = LP[2 v e^{-iφ}] less its ripple:

        a_{k+1} = a_k + g · 2 (v_k - Re(a_k e^{iφ_k})) e^{-iφ_k},  b_{k+1} = b_k + g (a_{k+1} - b_k)

    2 v e^{-iφ} = z + z* e^{-2iφ}; the part that turns at twice the frequency is taken off with the envelope already
    known. Left in, the amplitude loop would modulate the drive force with it, 10 % at a bandwidth of f/12, and half of
    that falls back on the drive frequency.
    """
    missing = voltage - (first * reference).real
    first = first + block.gain * 2 * missing * reference.conjugate()
    return first, second + block.gain * (first - second)
