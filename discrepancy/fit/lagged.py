"""What the amplifier's lag leaves of a voltage that is known at samples, without the plant: columns of a run beside a
lag are those of the run without it, behind it. It begins where the voltage does, as the plant's; the filters of
``low_pass.py`` have seen the voltage before."""

from typing import Final

import numpy as np
from scipy.signal import lfilter
from scipy.special import hyp1f1

from discrepancy.data.record import Floats

STENCIL: Final = 6
"""Samples through which the voltage between two of them goes as a polynomial. Of a tone, by any time constant, that
leaves 4e-9 at 60 samples a period, 6e-5 at 12 and 6e-4 at 8; four times that at the ends."""
BEFORE: Final = 2
"""Of these, how many lie before the two."""


def lagged(v: Floats, period: float, time_constant: float) -> Floats:
    """The voltage v (n, axes) [V], a sample each ``period`` [s], smooth between them, behind a lag of ``time_constant``
    [s] that begins where it does:

        tau v_out' + v_out = v
    """
    n = len(v)
    if time_constant == 0 or n < STENCIL:
        return v
    ratio = period / time_constant
    kept = np.exp(-ratio)
    entering = np.empty_like(v)
    entering[0] = v[0]
    inner = _weights(ratio, BEFORE)
    first, last = BEFORE, n - STENCIL + BEFORE
    # What enters from sample k to the next goes to that.
    entering[first + 1 : last + 2] = sum(w * v[i : n - STENCIL + 1 + i] for i, w in enumerate(inner))
    for k in range(first):
        entering[k + 1] = _weights(ratio, k) @ v[:STENCIL]
    for k in range(last + 1, n - 1):
        entering[k + 1] = _weights(ratio, k - (n - STENCIL)) @ v[n - STENCIL :]
    return np.asarray(lfilter([1.0], [1.0, -kept], entering, axis=0))


def _weights(ratio: float, before: int) -> Floats:
    """Of the samples of a stencil, ``before`` of which lie before the two between which the lag goes: what each adds
    in a period of so many time constants."""
    places = np.arange(STENCIL) - before
    # The integral of s^j z exp(-z (1 - s)) from 0 to 1.
    powers = np.arange(STENCIL)
    integrals = ratio / (powers + 1) * hyp1f1(1, powers + 2, -ratio)
    return np.asarray(np.linalg.solve(np.vander(places, increasing=True).T.astype(float), integrals))
