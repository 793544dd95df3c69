"""The colour of a noise, from the frequencies at which a record holds nothing else: an autoregression.

Where what is simulated is hardly more than the residual nothing but noise was recorded, whatever the model lacks
elsewhere.
An autoregression is fitted to the density there (G. U. Yule, Phil. Trans. Royal Society A 226, 1927; likelihood: P.
Whittle, Arkiv för Matematik 2, 1953), the bands of the motion being filled by its own prediction, again and again, as
an expectation-maximisation does (A. P. Dempster, N. M. Laird, D. B. Rubin, J. Royal Statistical Society B 39, 1977).
Where the residual is stronger while the device moves more it is no noise: a model that lacks something leaves that.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numba import njit
from scipy.linalg import solve_toeplitz
from scipy.ndimage import median_filter
from scipy.stats import spearmanr

from discrepancy.data.record import Bools, Floats

CELLS: Final = 256
"""Bands of equal width from 0 to half the sample rate; fewer where a run is short, so that each has 8 bins."""
NOISE_ALONE: Final = 2.0
"""Power of the simulated voltage over that of the residual up to which a band is nothing but noise: a model that is
wrong by 5 % leaves 1/400 of what moves."""
ORDERS: Final = (1, 2, 4, 8)
FEWEST: Final = 4 * max(ORDERS)
"""Bands from which an autoregression is told from chance; pieces of runs that are shorter have none."""
AROUND: Final = 9
"""Bands over whose median the residual's power is taken for that."""
ENOUGH: Final = 0.5
"""Share of the bands that must be noise alone: of fewer an autoregression would be extrapolated into the motion, where
it took an oscillator's nonlinear damping for noise."""
ROUNDS: Final = 12
"""Of filling: each halves at least what the bands of the motion, at most half of all, are wrong by."""
EARNED: Final = 60.0
"""Twice the log likelihood that an autoregression must earn, and 12 for each number of it: far beyond chance."""
PRICE: Final = 12.0
PARTS: Final = 24
"""Of a run, in which its residual may follow its motion."""
FOLLOWS: Final = 1e-3
"""Probability by chance of a rank correlation from which it does: a noise that is taken for a misfit once in a thousand
records stays white until more is named."""
MATERIAL: Final = 0.05
"""Share of the noise's power that it must predict."""
SCATTER: Final = 35 / 18 * 2.08
"""Bins of a Hann window are correlated, 35/18 count as one; a median scatters as the mean of 2.08 times fewer."""


def autoregression(
    voltages: Sequence[Floats], residuals: Sequence[Floats], valid: Sequence[Bools]
) -> tuple[float, ...]:
    """Numbers a of e_k = Σ a_i e_k-i + white that predict the noise in ``residuals`` (one (n, axes) a run) [V] of
    ``voltages``, the same for all channels; empty where the noise is white or is nowhere seen alone."""
    cells = min(CELLS, min(len(r) for r in residuals) // 16)
    if cells < FEWEST or _follows(voltages, residuals, valid):
        return ()
    axes = residuals[0].shape[1]
    power, count = np.zeros((cells, axes)), np.zeros((cells, axes))
    for v, residual, usable in zip(voltages, residuals, valid, strict=True):
        own, number = _densities(np.where(usable[:, None], residual - residual[usable].mean(axis=0), 0.0), cells)
        moved = v - residual
        # Of bands about it too, so that none is chosen for its own chance.
        around = median_filter(own, (AROUND, 1), mode="nearest")
        alone = _densities(moved - moved.mean(axis=0), cells)[0] < NOISE_ALONE * around
        power += np.where(alone, own * number[:, None], 0.0)
        count += alone * number[:, None]
    shared = (count > 0).all(axis=1)
    if shared.mean() < ENOUGH:
        return ()
    # Of each channel the shape: its level is divided out, where all are seen.
    level = power[shared].sum(axis=0) / count[shared].sum(axis=0)
    if not (level > 0).all():
        return ()
    power, count = (power / level).sum(axis=1), count.sum(axis=1)
    seen = count > 0
    density, weight = np.where(seen, power / np.maximum(count, 1), 0.0), np.where(seen, count, 0.0) * 2 / SCATTER
    if not (density[seen] > 0).all():
        return ()
    flat = float(np.average(density[seen], weights=weight[seen]))
    begin = best = _unlikely(density, weight, np.full(cells, flat))
    chosen: tuple[float, ...] = ()
    for order in ORDERS:
        fitted = _fitted(density, seen, order)
        if fitted is None:
            break
        numbers, modelled = fitted
        cost = _unlikely(density, weight, modelled) + PRICE * order
        if cost < min(best, begin - EARNED):
            best, chosen = cost, numbers
    return chosen if chosen and 1 - 1 / gain(chosen) > MATERIAL else ()


def gain(numbers: Sequence[float]) -> float:
    """Power of the noise over that of what is white in it."""
    turns = np.linspace(0, np.pi, 4097)
    density = 1 / np.abs(response(numbers, turns)) ** 2
    return float(np.mean(0.5 * (density[1:] + density[:-1])))


def response(numbers: Sequence[float], turns: Floats) -> Floats:
    """1 - Σ a_i z^-i at angles ``turns`` [rad a sample], complex."""
    powers = np.exp(-1j * np.outer(turns, np.arange(1, len(numbers) + 1)))
    return np.asarray(1 - powers @ np.asarray(numbers, np.float64))


def predicted_out(v: Floats, valid: Bools, numbers: Sequence[float], out: Floats | None = None) -> Floats:
    """What the numbers do not predict of v (columns, n, axes) [V], zero where a sample is not valid (n,), whose
    prediction stands for it later; into ``out``, which may be ``v``, where it is given."""
    out = np.empty_like(v) if out is None else out
    _predicted_out(np.ascontiguousarray(v), valid, np.asarray(numbers, np.float64), out)
    return out


def _follows(voltages: Sequence[Floats], residuals: Sequence[Floats], valid: Sequence[Bools]) -> bool:
    """Whether the residual is stronger where the motion is."""
    moved, left = [], []
    for v, residual, usable in zip(voltages, residuals, valid, strict=True):
        for part in np.array_split(np.flatnonzero(usable), PARTS):
            moved.append(float(np.mean(np.var((v - residual)[part], axis=0))))
            left.append(float(np.mean(np.var(residual[part], axis=0))))
    return bool(spearmanr(moved, left, alternative="greater").pvalue < FOLLOWS)


def _densities(v: Floats, cells: int) -> tuple[Floats, Floats]:
    """Power of each band (cells, axes), and how many bins it has (cells,); by the median, ln 2 of an exponential
    distribution's mean, of bins and of three bands, which a line of a motion that the model lacks does not move."""
    window = np.hanning(len(v))[:, None]
    power = np.abs(np.fft.rfft(v * window, axis=0))[1:] ** 2 / np.sum(window**2)
    parts = np.array_split(power, cells)
    middle = np.array([np.median(part, axis=0) for part in parts]) / np.log(2)
    return median_filter(middle, (3, 1), mode="nearest"), np.array([float(len(part)) for part in parts])


def _fitted(density: Floats, seen: Bools, order: int) -> tuple[tuple[float, ...], Floats] | None:
    """The autoregression of a density of which ``seen`` is known, and its own density; None where that is so sharp that
    fewer numbers leave nothing white."""
    cells = len(density)
    turns = np.pi * (np.arange(cells) + 0.5) / cells
    places = np.arange(cells)
    filled = np.exp(np.interp(places, places[seen], np.log(density[seen])))
    waves = np.cos(np.outer(np.arange(order + 1), turns)) / cells
    numbers, modelled = np.zeros(order), filled
    for _ in range(ROUNDS):
        correlation = waves @ filled
        try:
            numbers = solve_toeplitz(correlation[:-1], correlation[1:])
        except np.linalg.LinAlgError:
            return None
        variance = float(correlation[0] - numbers @ correlation[1:])
        if not variance > 0:
            return None
        # What nobody sees has no end where what is seen falls away from it as from a line.
        with np.errstate(divide="ignore", over="ignore"):
            modelled = variance / np.abs(response(numbers, turns)) ** 2
        filled = np.where(seen, density, modelled)
        if not np.isfinite(filled).all():
            return None
    return tuple(numbers.tolist()), modelled


def _unlikely(density: Floats, weight: Floats, modelled: Floats) -> float:
    """Twice Whittle's negative log likelihood."""
    return float(np.sum(weight * (np.log(modelled) + density / modelled)))


@njit(cache=True, nogil=True)
def _predicted_out(v, valid, numbers, out):  # type: ignore[no-untyped-def]
    columns, n, axes = v.shape
    order = len(numbers)
    for c in range(columns):
        for axis in range(axes):
            before = np.zeros(order)
            for k in range(n):
                told = 0.0
                for i in range(order):
                    told += numbers[i] * before[(k - 1 - i) % order]
                now = v[c, k, axis] if valid[k] else told
                out[c, k, axis] = now - told
                before[k % order] = now
