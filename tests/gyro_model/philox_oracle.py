"""The noise of the FMU by another road: Philox 4x32-10 in numpy, and scipy's inverse of the normal distribution.

J. K. Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC'11. Counter = (sample, 0), key = (seed, stream),
stream = CRC-32 of the effect's id. Pink noise is made of normal numbers of lanes 0, 1, ... (fmu_src/pink.c).
"""

import zlib
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.special import ndtri

_MASK = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)


def philox(counter: NDArray[np.uint64], key: tuple[int, int]) -> NDArray[np.uint64]:
    """Ten rounds on 32-bit words, shape (n, 4)."""
    words = [counter[:, i].astype(np.uint64) for i in range(4)]
    k0, k1 = key
    for _ in range(10):
        high0, low0 = np.divmod(words[0] * np.uint64(0xD2511F53), np.uint64(1) << _32)
        high1, low1 = np.divmod(words[2] * np.uint64(0xCD9E8D57), np.uint64(1) << _32)
        words = [high1 ^ words[1] ^ np.uint64(k0), low1, high0 ^ words[3] ^ np.uint64(k1), low0]
        k0, k1 = (k0 + 0x9E3779B9) & 0xFFFFFFFF, (k1 + 0xBB67AE85) & 0xFFFFFFFF
    return np.stack(words, axis=1)


def normals(seed: int, effect_id: str, samples: NDArray[np.int64], lane: int = 0) -> NDArray[np.float64]:
    """Standard normal numbers of an effect for the x and y axis, shape (n, 2)."""
    index = np.asarray(samples, dtype=np.uint64)
    zero = np.zeros_like(index)
    counter = np.stack([index & _MASK, index >> _32, zero + np.uint64(lane), zero], axis=1)
    words = philox(counter, (seed, zlib.crc32(effect_id.encode())))
    bits = (words[:, 0::2] << np.uint64(21)) ^ (words[:, 1::2] >> np.uint64(11))
    return np.asarray(ndtri((bits.astype(np.float64) + 0.5) * 2.0**-53))


def pink_sections(period: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Corners [Hz] and variances [Hz] of the processes whose sum is pink noise of density 1 Hz/f."""
    ratio = 10 ** (1 / 1.5)
    corners = [0.692 * 0.5 / period]
    while corners[-1] > 0.3:
        corners.append(corners[-1] / ratio)
    variances = np.full(len(corners), np.log(ratio))
    variances[0] *= 0.582
    variances[-1] *= ratio / (ratio - 1)
    return np.array(corners), variances


PINK_TAPS = np.array([1.03077199, 0.02840696, -0.05917895])


def pink(seed: int, effect_id: str, count: int, period: float) -> NDArray[np.float64]:
    """Pink noise of an effect for the x and y axis, samples 0 .. count - 1, shape (count, 2)."""
    total = np.zeros((count + 3, 2))
    for lane, (corner, variance) in enumerate(zip(*pink_sections(period), strict=True)):
        pole = np.exp(-2 * np.pi * corner * period)
        driven = np.sqrt(variance) * normals(seed, effect_id, np.arange(count + 3), lane)
        driven[1:] *= np.sqrt(1 - pole**2)
        total += lfilter([1.0], [1.0, -pole], driven, axis=0)
    return np.asarray(lfilter(PINK_TAPS, [1.0], total, axis=0)[3:])


def drawn(seed: int, count: int) -> Callable[[str, int], tuple[float, float]]:
    """The random numbers as the reference simulation asks for them, for samples below ``count`` of 5 µs."""
    table: dict[str, NDArray[np.float64]] = {}

    def pair(effect_id: str, sample: int) -> tuple[float, float]:
        if effect_id == "flicker_noise" and effect_id not in table:
            table[effect_id] = pink(seed, effect_id, count, 5e-6)
        if effect_id not in table:
            table[effect_id] = normals(seed, effect_id, np.arange(count))
        x, y = table[effect_id][sample]
        return float(x), float(y)

    return pair
