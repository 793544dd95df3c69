"""Where a hump stands out of the floor, and whether chance would have made it.

A bank of matched filters runs over the spectrum divided by its floor: shapes 1/(1 + z²) of all widths that the record
resolves, or of the one that Q gives. It only proposes where fits begin; the likelihood ratio of the best fit decides.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.signal import oaconvolve

from calibration.mode_split.model import SplitModel, response
from calibration.mode_split.record import Floats
from calibration.mode_split.spectrum import Groups, Spectrum, grouped
from calibration.mode_split.whittle import Fit, Likelihood, free_parameters, maximise

NARROWEST: Final = 4.0
"""Half-width of the narrowest hump that can be told from a line, in bins: see spectrum.NEIGHBOURS."""
WIDEST: Final = 0.125
"""Half-width of the widest hump that can be told from the floor, as a share of the band searched."""
PER_HALF_WIDTH: Final = 8
"""Groups in a half-width: a mean over an eighth of it keeps 99.9 % of the information on f_y."""
REACH: Final = 300.0
"""Half-widths either side of the hump that a fit looks at: for a hump 40 dB over the floor all but 0.5 %."""
CANDIDATES: Final = 4
WITHOUT_SKIRT: Final = 0.01
"""Share of the skirt with which the fit of a hump under the line begins."""
FALSE_ALARM: Final = 1e-3
"""Probability that a record of floor alone gives a number."""
POWER: Final = 1.64
"""Deviations by which the mean of a statistic must exceed its threshold for 95 % power."""


@dataclass(frozen=True)
class Found:
    """The best fit and what chance says of it.

    fit, likelihood: with hump; gain: log-likelihood over that of the floor alone; trials: independent places looked
    at; chance: upper bound of the probability of that gain without a hump.
    """

    fit: Fit
    likelihood: Likelihood
    groups: Groups
    gain: float
    trials: float
    chance: float

    @property
    def is_hump(self) -> bool:
        """Whether chance would give it less often than FALSE_ALARM."""
        return self.chance < FALSE_ALARM


def find_hump(
    spectrum: Spectrum, q: float | None, clean_line: bool = False, near: tuple[float, float] | None = None
) -> Found:
    """The hump of greatest likelihood. clean_line: the line has no skirt of phase noise; near: (f_y, reach) [Hz] where
    f_y is looked for, default the whole band."""
    floor = _floor(spectrum, clean_line)
    low, high = (spectrum.f[0], spectrum.f[-1]) if near is None else (near[0] - near[1], near[0] + near[1])
    widths = _widths(spectrum, q)
    excess = np.where(spectrum.valid, spectrum.power / floor.floor(spectrum.f) - 1, 0.0)
    proposals = [_proposal(spectrum, excess, width, low, high) for width in widths]
    best = sorted(proposals, reverse=True)[:CANDIDATES]
    found = [_fitted(spectrum, floor, place, width, q) for _, place, width in best]
    found += _under_line(spectrum, floor, widths, low, high, q)
    fit, likelihood, groups, gain = max(found, key=lambda item: item[3])
    # Two places a half-width apart are about independent; widths a factor 2 apart too.
    trials = sum(float(high - low) / width for width in widths) * (0.5 if q is None else 1.0)
    return Found(fit, likelihood, groups, gain, trials, min(1.0, float(trials * np.exp(-max(gain, 0.0)))))


def detectable(spectrum: Spectrum, found: Found, q: float) -> float:
    """Height of a hump over the floor [1] that a search like ``found`` would have found with 95 % power at this Q.

    The gain of a bin, P R s/(1 + R s) - ln(1 + R s), has the mean R s - ln(1 + R s) and the deviation R s; s = |G|².
    """
    f = spectrum.f[spectrum.valid]
    shape = response(f, 0.5 * (f[0] + f[-1]), q)
    threshold = np.log(max(found.trials, 1.0) / FALSE_ALARM) * spectrum.spread

    def surplus(log_height: float) -> float:
        size = np.exp(log_height) * shape
        scatter = np.sqrt(spectrum.spread * np.sum(size**2))
        return float(np.sum(size - np.log1p(size)) - POWER * scatter - threshold)

    return float(np.exp(brentq(surplus, np.log(1e-3), np.log(1e9))))


def _widths(spectrum: Spectrum, q: float | None) -> list[float]:
    """Half-widths [Hz] of the shapes."""
    if q is not None:
        return [0.5 * spectrum.drive_line / q]
    narrow, wide = NARROWEST * spectrum.bin, WIDEST * (spectrum.f[-1] - spectrum.f[0])
    count = max(int(np.ceil(2 * np.log2(max(wide / narrow, 1.0)))), 1)
    return [float(width) for width in np.geomspace(narrow, max(wide, narrow), count + 1)]


def _floor(spectrum: Spectrum, clean_line: bool) -> SplitModel:
    """The floor alone, fitted to the spectrum with what stands out of it clipped."""
    groups = grouped(spectrum, max(len(spectrum.f) // 4000, 1))
    level = float(np.median(groups.power))
    beside = float(np.median(groups.power[np.argsort(np.abs(groups.f - spectrum.drive_line))[:5]]))
    skirt = 0.0 if clean_line else beside
    model = SplitModel(
        spectrum.drive_line, 1.0, 0.0, 0.7 * level, 0.3 * level, skirt, spectrum.drive_line, spectrum.guard
    )
    free = free_parameters(hump=False, q_known=True, clean_line=clean_line)
    for _ in range(4):
        clipped = Groups(groups.f, np.minimum(groups.power, 3 * model.floor(groups.f)), groups.count)
        model = maximise(Likelihood(clipped, model.vector, spectrum.spread), model, free).model
    return model


def _proposal(spectrum: Spectrum, excess: Floats, width: float, low: float, high: float) -> tuple[float, float, float]:
    """The best matched filter of one width: its output in deviations, its place [Hz], the width [Hz].

    excess (n,): spectrum over floor, less one, zero where not valid.
    """
    size = max(int(width / spectrum.bin / PER_HALF_WIDTH), 1)
    starts = np.arange(0, len(spectrum.f), size)
    count = np.add.reduceat(spectrum.valid.astype(float), starts)
    total = np.add.reduceat(excess, starts)
    place = spectrum.f[starts] + 0.5 * (size - 1) * spectrum.bin
    reach = min(int(12 * width / (size * spectrum.bin)) + 1, len(starts))
    shape = 1 / (1 + (np.arange(-reach, reach + 1) * size * spectrum.bin / width) ** 2)
    kept = slice(reach, reach + len(starts))
    output = oaconvolve(total, shape)[kept] / np.sqrt(np.maximum(oaconvolve(count, shape**2)[kept], 1.0))
    output = np.where((place >= low) & (place <= high), output, -np.inf)
    best = int(np.argmax(output))
    return float(output[best]), float(place[best]), width


def _under_line(
    spectrum: Spectrum, floor: SplitModel, widths: list[float], low: float, high: float, q: float | None
) -> list[tuple[Fit, Likelihood, Groups, float]]:
    """The fit of what lies beside the line as a hump under it, where it has a skirt that may have taken that up.

    No matched filter shows such a hump over the floor, so another place came out: 5 to 16 half-widths off, Q known.
    """
    line = spectrum.drive_line
    wide = [width for width in widths if width >= spectrum.guard]
    if floor.skirt == 0 or not wide or not low <= line <= high:
        return []
    level = replace(floor, skirt=0.0).floor(spectrum.f)
    excess = np.where(spectrum.valid, spectrum.power / level - 1, 0.0)
    _, _, width = max(_proposal(spectrum, excess, width, line - width, line + width) for width in wide)
    fitted = _fitted(spectrum, floor, line, width, q, WITHOUT_SKIRT)
    model = fitted[0].model
    own, f_y = model.half_width, float(model.f_y)
    if q is not None or 0.5 * width < own < 2 * width:
        return [fitted]
    # Its gain counts beside the others in groups of its own width only.
    if not max(spectrum.guard, widths[0]) <= own <= widths[-1] or not low <= f_y <= high:
        return []
    return [_fitted(spectrum, floor, f_y, own, q, WITHOUT_SKIRT)]


def _fitted(
    spectrum: Spectrum, floor: SplitModel, place: float, width: float, q: float | None, skirt: float = 1.0
) -> tuple[Fit, Likelihood, Groups, float]:
    """Fit from one proposal, with this share of the skirt, and its gain over the floor alone on the same bins."""
    start_q = 0.5 * place / width if q is None else q
    part = spectrum.band(place - REACH * width, place + REACH * width)
    groups = grouped(part, int(width / spectrum.bin / PER_HALF_WIDTH))
    near = np.abs(groups.f - place) < width
    level = float(groups.power[near].mean()) if near.any() else float(groups.power.mean())
    local = float(floor.floor(np.array([place]))[0])
    hump = max(level - local, 0.1 * local)
    start = SplitModel(place, start_q, hump, floor.white, floor.flicker, floor.skirt, floor.drive_line, floor.guard)
    likelihood = Likelihood(groups, start.vector, spectrum.spread)
    clean_line = floor.skirt == 0
    begin = replace(start, skirt=skirt * start.skirt)
    fit = maximise(likelihood, begin, free_parameters(True, q is not None, clean_line))
    alone = SplitModel(place, start_q, 0.0, floor.white, floor.flicker, floor.skirt, floor.drive_line, floor.guard)
    without = maximise(likelihood, alone, free_parameters(False, True, clean_line))
    return fit, likelihood, groups, fit.value - without.value
