"""Modes from a free decay: complex exponentials by the matrix pencil.

Y. Hua and T. K. Sarkar, Matrix pencil method for estimating parameters of exponentially damped/undamped sinusoids in
noise, IEEE Trans. Acoust., Speech, Signal Process. 38, 1990.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

WINDOW: Final = 60
"""Samples in a column of the pencil: a third of a period of the split at eight samples a period, seven times over."""


class Mode(NamedTuple):
    """frequency [Hz] around the carrier, decay ω/2Q [1/s], energy: of it in the record, over all."""

    frequency: float
    decay: float
    energy: float


def modes(records: Complexes, interval: float, order: int) -> list[Mode]:
    """The ``order`` modes of envelopes ``records``, shape (channels, n), one each ``interval`` [s], that decay freely;
    the strongest first."""
    rows = records.shape[1]
    window = min(WINDOW, rows // 3)
    stacked = np.concatenate([np.lib.stride_tricks.sliding_window_view(one, window) for one in records], axis=0)
    # Rows are pieces of the signal, so that the right subspace is spanned by powers of the poles.
    _, _, right = np.linalg.svd(stacked, full_matrices=False)
    basis = right[:order].T
    poles = np.linalg.eigvals(np.linalg.lstsq(basis[:-1], basis[1:], rcond=None)[0])
    powers = poles[None, :] ** np.arange(rows)[:, None]
    amplitudes = np.linalg.lstsq(powers, records.T, rcond=None)[0]
    energy = (np.abs(amplitudes) ** 2).sum(axis=1) * (np.abs(powers) ** 2).sum(axis=0)
    logs = np.log(poles) / interval
    found = [
        Mode(float(s.imag / (2 * np.pi)), float(-s.real), float(e / energy.sum()))
        for s, e in zip(logs, energy, strict=True)
    ]
    return sorted(found, key=lambda mode: -mode.energy)
