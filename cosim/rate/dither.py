"""A small tone on the sense axis: force at a fixed distance above and below the drive, as a virtual rate would make it.

    U_d = -2i F cos θ,  θ' = ν,    z_y,k -> z_y,k - a_k e^{iθ_k} - b_k e^{-iθ_k}
    a_{k+1} = a_k + μ z e^{-iθ_k},  b_{k+1} = b_k + μ z e^{iθ_k},  z what is left

U_d lies in the phase of the Coriolis force (sense_loop). The answers a and b at both distances are taken off z_y before
the loops and the output see it: to them the dither is not there, but for a notch of the half-width μ/T about ν
(B. Widrow et al., Adaptive noise cancelling, Proc. IEEE 63, 1692, 1975, section VIII).
"""

from cmath import exp
from math import expm1, pi
from typing import NamedTuple, Self

from numba import njit


class Dither(NamedTuple):
    """The tone. step: ν T, its phase a sample [rad]; force F of each side [N]; share μ of what is left [1]. By default
    there is none."""

    step: float = 0.0
    force: float = 0.0
    share: float = 0.0

    @classmethod
    def design(cls, frequency: float, force: float, notch: float, period: float) -> Self:
        """A tone at ``frequency`` [Hz] either side, ``force`` [N] each; notch: its half-width [Hz]; period T [s]."""
        return cls(2 * pi * frequency * period, force, -expm1(-2 * pi * notch * period))


@njit(cache=True)
def without_tones(block, state, z_y):  # type: ignore[no-untyped-def]
    """``z_y`` [V] without the answers to the dither, which are learnt from it."""
    turn = exp(1j * state.dither_phase)
    left = z_y - state.tone_above * turn - state.tone_below * turn.conjugate()
    state.tone_above += block.share * left * turn.conjugate()
    state.tone_below += block.share * left * turn
    return left


@njit(cache=True)
def dither(block, state):  # type: ignore[no-untyped-def]
    """The envelope of the dither's force [N], and its phase one sample on."""
    turn = exp(1j * state.dither_phase)
    state.dither_phase = (state.dither_phase + block.step) % (2 * pi)
    return -2j * block.force * turn.real
