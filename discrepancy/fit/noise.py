"""Noises of a measured device, each by what sets it apart, with 95 % intervals.

White noise shows between the modes and half the sample rate, flicker below the modes, a jittering clock where the
voltage changes fast, thermal force as a motion that nothing drives, the converter's step in the values themselves.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize, minimize_scalar
from scipy.stats import chi2

from discrepancy.criteria import Criteria
from discrepancy.data.linear_fit import mode_frequencies
from discrepancy.data.modes import band_of
from discrepancy.data.record import Bools, Floats, Record
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.whitening import Setting, lifted, misfit_under, top_rate, whitener

SURE: Final = 30.0
"""Chi-square by which a noise beside the white one has to show: one in 2e7 by chance."""
WITHIN: Final = float(chi2.ppf(0.95, 1))
"""Rise of twice the negative log likelihood at the ends of a 95 % interval."""
NEIGHBOUR: Final = float(np.log(4.0))
"""The filter's settings are tried a factor of 3 or 4 apart."""
ASIDE: Final = 0.15
"""Step of a logarithm from which the curvature of the likelihood is taken."""
FEW: Final = 10.0
"""Periods of a run below which a mode does not say where the motion is."""
BOLTZMANN: Final = 1.380649e-23
HANN: Final = 35 / 18
"""Bins of a Hann window are correlated: the mean over B of them scatters as that over B/HANN independent ones."""
PIECES, SHORTEST = 15, 512
"""Pieces of a run, each half in the next, so that all of a run counts alike but a sixteenth at both ends: one window
over a run whose motion grew saw 4/5 of the noise of a jittering clock. No piece is of fewer samples."""
GROUPS: Final = 1000
"""Of samples that move about as fast, each taken as one: the size of a jitter changed by less than 1e-4 of it in a
sine, a beat and a motion that grew."""
FEWEST: Final = 50
"""Such groups of a channel, however many there are."""
NO_MEMORY: Final = Setting()


@dataclass(frozen=True)
class Level:
    """Size of a noise with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Noise:
    """All that is white, rounding included, rms a sample [V], with its 95 % interval; lsb: step of the converter [V]
    or 0."""

    rms: float
    low: float
    high: float
    lsb: float


def noise_of(
    residuals: Sequence[Floats],
    records: Sequence[Record],
    parameters: Mapping[str, float],
    memory: Setting = NO_MEMORY,
) -> Noise | None:
    """From the residual's density above five times the highest mode, or, where hardly a spring makes one, the top of
    the motion, and below 0.45 of the rate; None without such a band. memory: flicker and colour that are no part of
    it."""
    rate = records[0].sample_rate
    highest = float(mode_frequencies(parameters, records[0].axes)[-1])
    if highest * max(len(r.t) for r in records) < FEW * rate:
        highest = max(band_of(record) for record in records)
    low, high = 5 * highest, 0.45 * rate
    square, seen, count = 0.0, 0.0, 0
    for given, record in zip(residuals, records, strict=True):
        residual = without_memory(given, record, parameters, memory)
        for part in _pieces(len(residual)):
            window = (np.hanning(part.stop - part.start) * record.valid[part])[:, None]
            f = np.fft.rfftfreq(len(window), 1 / rate)
            inside = np.abs(np.fft.rfft(residual[part] * window, axis=0)[(f > low) & (f < high)]) ** 2
            square, seen = square + float(inside.sum()), seen + float(np.sum(window**2)) * inside.size
            count += inside.size
    if count < 20 or seen == 0:
        return None
    # Two degrees a bin; under a Hann window neighbours share half of what they hold, or, of many pieces, those that
    # overlap do.
    bounds = chi2.ppf([0.975, 0.025], count) / count
    mean = square / seen
    ends = float(np.sqrt(mean / bounds[0])), float(np.sqrt(mean / bounds[1]))
    return Noise(float(np.sqrt(mean)), *ends, lsb=converter_step(records))


def without_memory(residual: Floats, record: Record, parameters: Mapping[str, float], memory: Setting) -> Floats:
    """What flicker and colour do not tell of a residual (n, axes) [V], with the level of the white noise beside them;
    zero where a sample is not valid, if there are such."""
    still = replace(memory, bandwidth=0.0)
    if still == NO_MEMORY:
        return residual
    filtered = whitener(parameters, record.axes, 1 / record.sample_rate, still, len(residual))
    return filtered(residual[None], record.valid)[0]


def _pieces(n: int) -> Iterator[slice]:
    """Parts of n samples, each half in the next."""
    number = max(min(PIECES, 2 * n // SHORTEST - 1), 1)
    length = 2 * n // (number + 1)
    return (slice(k * length // 2, k * length // 2 + length) for k in range(number))


def converter_step(records: Sequence[Record]) -> float:
    """The step [V] of which every sample is a whole multiple, 0 where there is none."""
    v = np.concatenate([r.v.ravel() for r in records])
    gaps = np.diff(np.unique(v))
    gaps = gaps[gaps > 1e-9 * np.abs(v).max()]
    if len(gaps) < 10:
        return 0.0
    step = float(gaps.min())
    whole = v / step
    # Printed digits leave gaps of one unit too; they count as the converter's where no finer one is seen.
    return step if np.abs(whole - np.rint(whole)).max() < 0.01 else 0.0


def noises(at: Fitted, records: Sequence[Record], white: Noise | None) -> dict[str, Level]:
    """Every noise that shows beside the final model, by its parameter's name."""
    found: dict[str, Level | None] = {
        "thermal_force": thermal(at, records),
        "sampling_jitter": jitter(at, records),
        "flicker_noise": flicker(at, records),
    }
    if white is not None:
        found["sense_noise"] = _white(at, records, white, found["sampling_jitter"])
        found["adc_lsb"] = Level(white.lsb, white.lsb, white.lsb) if white.lsb else None
    return {name: level for name, level in found.items() if level is not None}


def _white(at: Fitted, records: Sequence[Record], white: Noise, clock: Level | None) -> Level:
    """The white noise of the sensor: what rounding, a jittering clock and flicker leave of all that is white."""
    setting, valid = at.whiten.setting, [r.valid for r in records]
    rms = white.rms
    if setting.corner or setting.colour:
        rms = float(np.sqrt(misfit_under(at.parameters, 1 / records[0].sample_rate, setting, at.residuals, valid)[1]))
    slope = float(np.mean([np.mean(np.gradient(r.v, 1 / r.sample_rate, axis=0) ** 2) for r in records]))
    taken = white.lsb**2 / 12 + (clock.value**2 * slope if clock else 0.0)
    unsure = clock.value * (clock.high - clock.low) * slope if clock else 0.0
    spread = [(white.low / white.rms) ** 2, 1.0, (white.high / white.rms) ** 2]
    low, value, high = (
        np.sqrt(max(rms**2 * s - taken + d, 0.0)) for s, d in zip(spread, (-unsure, 0, unsure), strict=True)
    )
    return Level(float(value), float(low), float(high))


def flicker(at: Fitted, records: Sequence[Record]) -> Level | None:
    """Size a [V/√Hz at 1 Hz] of a one-sided density a²/f, by the filter that whitens the residual."""
    setting, period = at.whiten.setting, 1 / records[0].sample_rate
    lift = lifted(setting, 0.0)
    return _tuned(at, records, setting.corner, lambda corner: replace(setting, corner=corner),
                  lambda corner, variance: float(np.sqrt(lift * 2 * variance * period * corner)))  # fmt: skip


def unlike_flicker(at: Fitted, records: Sequence[Record], chance: float, times: float) -> tuple[float, float] | None:
    """Frequency [Hz] about which the residual is furthest from the flicker of the filter that whitens it, and how many
    times its density it has there; None where none is ``times`` below it, nor, where flicker is above the white noise,
    over it, or ``chance`` would make it so. What a model lacks adds elsewhere, and takes nothing away."""
    found = _octaves(at, records)
    slow = found.begin < at.whiten.setting.corner
    return _furthest(found.only(slow | (found.ratio < 1)), chance, times)


def is_white(at: Fitted, records: Sequence[Record], criteria: Criteria) -> bool:
    """Whether no octave of what the filter leaves of the residual has so much more than the mean density, but where
    chance would make it so. What a model lacks adds to some; parameters that are fitted take away of others."""
    found = _octaves(at, records)
    return _furthest(found.only(found.ratio > 1), criteria.noise_chance, criteria.white) is None


class _Octaves(NamedTuple):
    """Of a whitened residual, (n,): where octaves begin [Hz], their density over the mean, and its degrees of
    freedom."""

    begin: Floats
    ratio: Floats
    freedom: Floats

    def only(self, which: Bools) -> "_Octaves":
        """Those of ``which``."""
        return _Octaves(*(values[which] for values in self))


def _octaves(at: Fitted, records: Sequence[Record]) -> _Octaves:
    lowest = min(r.sample_rate / len(residual) for r, residual in zip(records, at.residuals, strict=True))
    power, count, square, samples = np.zeros(64), np.zeros(64), 0.0, 0
    for residual, record in zip(at.residuals, records, strict=True):
        own = at.whiten(residual[None], record.valid)[0]
        square, samples = square + float(np.sum(own**2)), samples + int(record.valid.sum()) * record.axes
        window = (np.hanning(len(own)) * record.valid)[:, None]
        density = np.abs(np.fft.rfft(own * window, axis=0))[1:] ** 2 / np.sum(window**2)
        octave = np.log2(np.fft.rfftfreq(len(own), 1 / record.sample_rate)[1:] / lowest * (1 + 1e-9)).astype(int)
        power += np.bincount(octave, density.sum(axis=1), len(power))
        count += np.bincount(octave, minlength=len(power)) * record.axes
    ratio = power / np.maximum(count, 1) / (square / samples)
    begin = np.asarray(lowest * 2.0 ** np.arange(64), np.float64)
    return _Octaves(begin, ratio, 2 * count / HANN).only(count > 0)


def _furthest(found: _Octaves, chance: float, times: float) -> tuple[float, float] | None:
    """Middle of the octave whose density is furthest from the mean, and that; None where it is less than ``times`` away
    or by ``chance``."""
    told = np.minimum(
        chi2.sf(found.ratio * found.freedom, found.freedom), chi2.cdf(found.ratio * found.freedom, found.freedom)
    )
    off = np.where(told < chance, np.abs(np.log(np.maximum(found.ratio, 1e-300))), 0.0)
    worst = int(np.argmax(off)) if len(off) else 0
    if not len(off) or off[worst] < np.log(times):
        return None
    return float(found.begin[worst] * 2.0**0.5), float(found.ratio[worst])


def jitter(at: Fitted, records: Sequence[Record]) -> Level | None:
    """Deviation [s] of the sampling instants: innovations whose variance grows with the square of v'. The white noise
    beside it is another one in each channel of each run: a range may have been switched between them."""
    each = GROUPS // sum(record.axes for record in records)
    channels = []
    for residual, record in zip(at.residuals, records, strict=True):
        slope = np.gradient(record.v, 1 / record.sample_rate, axis=0)[record.valid]
        error = at.whiten(residual[None], record.valid)[0][record.valid]
        # White noise of v makes a slope of its own; two of four neighbours' mean is far below that of the motion.
        moving = [(s, e) for s, e in zip(slope.T, error.T, strict=True) if s.any() and e.any()]
        channels += [_alike(s**2, e**2, max(each, FEWEST)) for s, e in moving]
    if not channels:
        return None
    squares = [float(np.average(error, weights=count)) for _, error, count in channels]
    slopes = [float(np.average(slope, weights=count)) for slope, _, count in channels]

    def cost(a: float) -> float:
        return sum(
            _beside(a**2 * slope, error, count, square)
            for (slope, error, count), square in zip(channels, squares, strict=True)
        )

    return _likeliest(cost, float(np.sqrt(np.mean(squares) / np.mean(slopes))))


def _beside(told: Floats, error: Floats, count: Floats, square: float) -> float:
    """Twice the negative log likelihood of squared innovations whose variance is ``told`` and a white part, that which
    fits best; ``square`` is their mean."""
    top = float(np.log(square))

    def under(log_white: float) -> float:
        variance = np.exp(log_white) + told
        return float(count @ (np.log(variance) + error / variance))

    return float(minimize_scalar(under, bounds=(top - 8, top + 1), method="bounded", options={"xatol": 1e-4}).fun)


def _alike(slope: Floats, error: Floats, groups: int) -> tuple[Floats, Floats, Floats]:
    """Means over groups of nearly equal ``slope``, and how many each has: all that the likelihood asks for."""
    order = np.argsort(slope)
    begins = np.unique(np.linspace(0, len(slope), groups, endpoint=False).astype(int))
    count = np.diff(begins, append=len(slope)).astype(float)
    return np.add.reduceat(slope[order], begins) / count, np.add.reduceat(error[order], begins) / count, count


def thermal(at: Fitted, records: Sequence[Record]) -> Level | None:
    """Size of the thermal force (1: physical), by the filter that whitens the residual."""
    setting, period, p = at.whiten.setting, 1 / records[0].sample_rate, at.parameters
    axes = records[0].axes
    seen = [p[f"sense_gain_{axis}"] ** 2 * p[f"d{axis}{axis}"] for axis in "xy"[:axes]]
    kelvin = float(np.mean([np.mean(r.conditions.get("temperature", p.get("t_ref", 298.15))) for r in records]))
    # The filter's drift of the velocity, 4 b² T² r w² d/mean(d G²), is 2 kB T_K d T/m² times the square of the size.
    unit = np.sqrt(2 * period * top_rate(p, axes) / (BOLTZMANN * kelvin * np.mean(seen))) * p["m"]
    unit *= lifted(setting, float(np.sqrt(top_rate(p, axes))) * period) ** 0.5
    return _tuned(at, records, setting.bandwidth, lambda bandwidth: replace(setting, bandwidth=bandwidth),
                  lambda bandwidth, variance: float(unit * np.sqrt(variance) * bandwidth))  # fmt: skip


def _tuned(
    at: Fitted,
    records: Sequence[Record],
    guess: float,
    setting: Callable[[float], Setting],
    size: Callable[[float, float], float],
) -> Level | None:
    """The likeliest size of a noise that the filter takes out. guess: the part of the filter that makes it, None where
    that is off; setting: the filter with another such part; size: from the part and the variance of the white noise."""
    if guess == 0:
        return None
    valid, period = [r.valid for r in records], 1 / records[0].sample_rate

    @cache
    def under(log: float) -> tuple[float, float]:
        return misfit_under(at.parameters, period, setting(float(np.exp(log))), at.residuals, valid)

    middle = float(np.log(guess))
    room = (middle - NEIGHBOUR, middle + NEIGHBOUR)
    best = float(minimize_scalar(lambda x: under(float(x))[0], bounds=room, method="bounded",
                                 options={"xatol": 0.02}).x)  # fmt: skip
    sides = (best - ASIDE, best + ASIDE)
    curvature = max(sum(under(x)[0] - under(best)[0] for x in sides), 1e-3) / ASIDE**2
    low, value, high = (size(float(np.exp(x)), under(x)[1]) for x in (sides[0], best, sides[1]))
    # Part and level are not known apart: along the likeliest level of each part the size may hardly change, while for a
    # given part count samples leave it sure to one over the root of twice their number.
    slope, count = float(np.log(high / low)) / (2 * ASIDE), sum(int(u.sum()) for u in valid) * records[0].axes
    width = float(np.sqrt(2 * WITHIN * (slope**2 / curvature + 0.25 / count)))
    return Level(value, value * float(np.exp(-width)), value * float(np.exp(width)))


def _likeliest(cost: Callable[[float], float], guess: float) -> Level | None:
    """The size at the minimum of ``cost`` (twice the negative log likelihood) over decades about ``guess``; None where
    it is not SURE against none."""
    grid = guess * np.geomspace(1e-3, 1e3, 25)
    values = [cost(float(a)) for a in grid]
    best = int(np.argmin(values))
    if cost(0.0) - values[best] < SURE or best in (0, len(grid) - 1):
        return None
    found = minimize(lambda x: cost(float(np.exp(x[0]))), [np.log(grid[best])], method="Nelder-Mead",
                     options={"xatol": 1e-4, "fatol": 1e-3})  # fmt: skip
    size, least = float(np.exp(found.x[0])), float(found.fun)

    def rise(a: float) -> float:
        return cost(a) - least - WITHIN

    low = float(brentq(rise, size / 100, size, rtol=1e-4)) if rise(size / 100) > 0 else 0.0
    high = float(brentq(rise, size, size * 100, rtol=1e-4)) if rise(size * 100) > 0 else np.inf
    return Level(size, low, high)
