"""Decimation of samples that come in pieces: linear phase, flat in the band kept, what folds back 120 dB down."""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import kaiserord, upfirdn
from scipy.signal.windows import kaiser

Complexes = NDArray[np.complex128]

FLAT: Final = 0.4
"""Band of a decimated record, of its rate, either way: the filter is flat below it, what folds back lies above it."""
STOP_DB: Final = 120.0
"""Attenuation of what folds back: a line 60 dB above the hump's power lies then 60 dB below that."""


class Decimator:
    """Every ``factor``-th sample of a low-pass (windowed sinc, Kaiser), those that it sees in full.

    ``taps``: length of the filter, odd; output k belongs to input sample (taps - 1)/2 + k factor.
    """

    def __init__(self, factor: int) -> None:
        count, beta = kaiserord(STOP_DB, 2 * (1 - 2 * FLAT) / factor)
        self.factor = factor
        self.taps = count | 1 if factor > 1 else 1
        shape = np.sinc((np.arange(self.taps) - self.taps // 2) / factor) * kaiser(self.taps, beta)
        self._low_pass = shape / shape.sum()
        self.waiting: Complexes = np.zeros(0, complex)
        """Samples that later outputs need, too."""

    def feed(self, samples: Complexes) -> Complexes:
        """The outputs (m,) that ``samples`` (n,), the next ones of the input, complete."""
        block = np.concatenate([self.waiting, samples])
        count = max((len(block) - self.taps) // self.factor + 1, 0)
        self.waiting = block[count * self.factor :]
        if count == 0:
            return np.zeros(0, complex)
        # upfirdn keeps output 0, factor, ...; that of full overlap is output taps - 1.
        lead = (-(self.taps - 1)) % self.factor
        used = block[: (count - 1) * self.factor + self.taps]
        filtered: Complexes = upfirdn(self._low_pass, np.concatenate([np.zeros(lead), used]), 1, self.factor)
        first = (self.taps - 1 + lead) // self.factor
        return filtered[first : first + count]
