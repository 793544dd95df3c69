"""Turns residuals into innovations: what noises with a memory leave unpredicted.

Thermal force, and any force that a model lacks, shake the modes, so a residual of the output is correlated over the
decay of a mode (longer than many records); flicker noise is correlated over any time. A test for white residuals finds
effects in both that are not there. A Kalman filter takes the correlation out: the linear model with a white force of
unknown strength, and flicker as a sum of first-order lags; before it an autoregression takes out the colour of what is
not white without them (``colour.py``). Columns go through the same filter, so the fit that follows
is generalised least squares (T. Kailath, IEEE Trans. Automatic Control 13, 1968).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Final

import numpy as np
from numba import njit
from scipy.linalg import block_diag, expm

from discrepancy.data.linear_fit import mode_frequencies
from discrepancy.data.record import Bools, Floats
from discrepancy.fit.colour import gain, predicted_out, response

MEMORIES: Final = (0.0, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0)
"""Tracking bandwidths tried, in units of one over the length of a run; 0: no disturbance."""
UNHELD: Final = (4096.0, 16384.0, 65536.0)
"""The same of a mass that no spring holds, whose way adds up what shakes it: far above the white noise of its sensor it
is no slower to be followed."""
LOWEST_CORNER, CORNER_RATIO = 0.3, 4.0
"""Frequencies tried at which flicker equals the white noise: the lowest over one over the length of a run, and the
ratio of neighbours, up to four times the sample rate."""
BETWEEN: Final = (0.5, 0.7, 1.4, 2.0)
"""Times the best of either, tried then."""
EARNED: Final = 30.0
"""Twice the log likelihood that each of the two has to earn to be beyond doubt."""
RATIO: Final = 5.0
"""Of neighbouring corner frequencies of the lags that make flicker; their sum is within 4 % of a²/f between."""
SLOWEST, FASTEST = 0.1, 10.0
"""Corner frequencies of the lags reach from below this, over one over the length of a run, to above this, over the
corner of the flicker."""
TOP, TOP_PART = 0.169, 1.19
"""The highest corner frequency over the sample rate, and the variance of its lag over that of the others: by least
squares of the sampled density, a²/f up to half the rate within 4 % rms and 0.2 % in the mean. Without them its upper
octaves count as white, and a comes out some 7 % too large."""
LEARNT: Final = 16_000
"""Samples from which a gain stays at the latest: that of the slowest lag falls as one over their number."""
CHOSEN: Final = 16_000
"""Samples of each run by which a setting is chosen."""
ALIKE: Final = 0.03
"""By which numbers of two autoregressions may differ and filter alike: three deviations of one from 10,000 samples."""
STEADY: Final = 1e-10
"""Relative change of a gain from which it stays."""
SIDE_BY_SIDE: Final = 8
"""Columns that are filtered at once where there are as many: each alone would wait for what comes out of it."""


Each = Callable[[Callable[["Setting"], float], Sequence["Setting"]], Iterable[float]]


@dataclass(frozen=True)
class Setting:
    """bandwidth [1/s] with which a motion is tracked; corner [Hz] where flicker equals the white noise; 0: none.
    colour: numbers of an autoregression that makes the rest white; bandwidth and corner are those beside what it
    leaves."""

    bandwidth: float = 0.0
    corner: float = 0.0
    colour: tuple[float, ...] = ()

    def like(self, other: "Setting") -> bool:
        """Whether ``other`` is the same, but for what its colour scatters by."""
        same = (self.bandwidth, self.corner, len(self.colour)) == (other.bandwidth, other.corner, len(other.colour))
        return same and np.allclose(self.colour, other.colour, rtol=0.0, atol=ALIKE)

    @property
    def parts(self) -> int:
        """How many noises with a memory the Kalman filter takes out."""
        return (self.bandwidth > 0) + (self.corner > 0)


@dataclass(frozen=True)
class Whitener:
    """The filter of a setting: with error = w - seen s, the innovation of sample k is roots[k] error, and s goes to
    transition (s + gains[k] error); w is what the autoregression does not predict of v.

    transition (s, s), seen (axes, s), gains (k, s, axes), roots (k, axes, axes), the last of them from there on.
    """

    setting: Setting
    transition: Floats = field(repr=False)
    seen: Floats = field(repr=False)
    gains: Floats = field(repr=False)
    roots: Floats = field(repr=False)

    def __call__(self, v: Floats, valid: Bools, out: Floats | None = None) -> Floats:
        """Innovations of v (columns, n, axes) [V], zero where a sample is not valid (n,); same shape and unit, ``v``
        itself where they are the same. They may be put into ``out``, which may be ``v``."""
        if self.setting.colour:
            v = out = predicted_out(v, valid, self.setting.colour, out)
        elif self.setting.parts == 0:
            return v if valid.all() else np.asarray(v * valid[:, None])
        if self.setting.parts == 0:
            return v
        out = np.empty_like(v) if out is None else out
        run = _filter if len(v) < SIDE_BY_SIDE else _filter_many
        run(self.transition, self.seen, self.gains, self.roots, np.ascontiguousarray(v), valid, out)
        return out

    def log_determinants(self, n: int) -> float:
        """Sum of log det roots over the first n samples."""
        logs = np.log(np.linalg.det(self.roots[:n]))
        return float(logs.sum() + (n - len(logs)) * logs[-1])


def whitener(p: Mapping[str, float], axes: int, period: float, setting: Setting, length: int = 1) -> Whitener:
    """The filter of a device with parameters ``p`` (FMU names, SI) for runs of up to ``length`` samples. The motion is
    known at the start, where every fit has it free."""
    if not setting.bandwidth and setting.corner:
        return _of_flicker(axes, period, setting, length)
    if setting.parts == 0:
        return Whitener(setting, np.zeros((0, 0)), np.zeros((axes, 0)), np.zeros((1, 0, axes)), np.eye(axes)[None])
    parts = [_motion(p, axes, period, setting.bandwidth)]
    parts += [_flicker(axes, period, setting.corner, length)] if setting.corner else []
    return _steady(setting, parts, length)


@lru_cache(maxsize=64)
def _of_flicker(axes: int, period: float, setting: Setting, length: int) -> Whitener:
    """The filter of a flicker alone. Kept: no device is in it, and each fit tries the same ones."""
    if axes == 2:
        # Each channel has a flicker of its own.
        one = _of_flicker(1, period, setting, length)
        return Whitener(setting, _twice(one.transition), _twice(one.seen), _twice(one.gains), _twice(one.roots))
    return _steady(setting, [_flicker(axes, period, setting.corner, length)], length)


def _steady(setting: Setting, parts: Sequence["_Part"], length: int) -> Whitener:
    """The filter of ``parts`` side by side."""
    transition = block_diag(*(part[0] for part in parts))
    drift, start = block_diag(*(part[1] for part in parts)), block_diag(*(part[2] for part in parts))
    seen = np.hstack([part[3] for part in parts])
    kept = min(length, LEARNT)
    axes = len(seen)
    gains, roots = np.zeros((kept, len(transition), axes)), np.zeros((kept, axes, axes))
    used = _gains(transition, drift, start, seen, gains, roots)
    return Whitener(setting, transition, seen, gains[:used].copy(), roots[:used].copy())


def _twice(part: Floats) -> Floats:
    return np.asarray(np.kron(np.eye(2), part), np.float64)


_Part = tuple[Floats, Floats, Floats, Floats]
"""Transition, drift and start covariance (s, s), in units of the white noise's variance, and seen (axes, s)."""


def _motion(p: Mapping[str, float], axes: int, period: float, bandwidth: float) -> _Part:
    n = 2 * axes
    k = np.array([[p["kxx"], p.get("kxy", 0.0)], [p.get("kxy", 0.0), p.get("kyy", 1.0)]])[:axes, :axes] / p["m"]
    d = np.array([[p["dxx"], p.get("dxy", 0.0)], [p.get("dxy", 0.0), p.get("dyy", 0.0)]])[:axes, :axes] / p["m"]
    gains = np.array([p["sense_gain_x"], p.get("sense_gain_y", 1.0)][:axes])
    rate = np.zeros((n, n))
    rate[::2, 1::2], rate[1::2, ::2], rate[1::2, 1::2] = np.eye(axes), -k, -d
    # In volt and time of 1/w, where all entries are of order 1.
    scale = np.repeat(1 / gains, 2) * np.tile([1.0, np.sqrt(top_rate(p, axes))], axes)
    transition = expm(rate * period) * scale / scale[:, None]
    # A slowly turning amplitude with drift variance s a second in white noise of density r T is tracked with s = b²
    # r T; it comes to each axis as a thermal force would, in proportion to the damping.
    drift = np.zeros((n, n))
    shaken = d * np.outer(gains, gains)
    drift[1::2, 1::2] = 4 * bandwidth**2 * period**2 * shaken / np.mean(np.diag(shaken))
    seen = np.zeros((axes, n))
    seen[range(axes), range(0, n, 2)] = 1.0
    return transition, drift, np.zeros((n, n)), seen


def coloured_power(p: Mapping[str, float], axes: int, period: float, setting: Setting, length: int) -> float:
    """Mean square over ``length`` samples of what flicker and motion add to the voltage, over that of the white or
    coloured noise beside."""
    total = 0.0
    if setting.corner:
        _, _, start, seen = _flicker(1, period, setting.corner, length)
        total += float((seen @ start @ seen.T)[0, 0]) * lifted(setting, 0.0)
    if setting.bandwidth:
        # In so many steps the growth of the motion's variance is followed well enough for its mean.
        stride = max(length // 500, 1)
        _, drift, covariance, seen = _motion(p, axes, period, setting.bandwidth)
        transition, squares = _motion(p, axes, period * stride, setting.bandwidth)[0], []
        for _ in range(length // stride):
            covariance = transition @ (covariance + stride * drift) @ transition.T
            squares.append(float(np.mean(np.diag(seen @ covariance @ seen.T))))
        total += float(np.mean(squares)) * lifted(setting, float(np.sqrt(top_rate(p, axes))) * period)
    return total / (gain(setting.colour) if setting.colour else 1.0)


def lifted(setting: Setting, turn: float) -> float:
    """Power of a slow noise at ``turn`` [rad a sample] in the voltage, over that behind the autoregression."""
    return float(1 / np.abs(response(setting.colour, np.array([turn]))[0]) ** 2) if setting.colour else 1.0


def top_rate(p: Mapping[str, float], axes: int) -> float:
    """Square of the highest mode's angular frequency [1/s²]; of the rate at which damping takes the speed away, where
    that is higher, as of a mass that no spring holds."""
    k = np.array([[p["kxx"], p.get("kxy", 0.0)], [p.get("kxy", 0.0), p.get("kyy", 0.0)]])[:axes, :axes]
    damping = max(p[f"d{axis}{axis}"] for axis in "xy"[:axes]) / p["m"]
    return float(max(np.linalg.eigvalsh(k).max() / p["m"], damping**2))


def _flicker(axes: int, period: float, corner: float, length: int) -> _Part:
    """Lags of equal variance with corner frequencies in geometric progression: Σ 4 σ²τ/(1 + (2πfτ)²) = σ²/(f ln r)."""
    slowest, fastest = SLOWEST / (length * period), max(FASTEST * corner, 1 / (length * period))
    numbers = np.arange(np.ceil(np.log(TOP / (period * slowest)) / np.log(RATIO)) + 1)
    rates = TOP / period / RATIO ** numbers[::-1]
    # Of those above the flicker's corner where it drowns in white noise, one is enough.
    rates = rates[: int(np.searchsorted(rates, fastest)) + 1]
    poles = np.exp(-2 * np.pi * rates * period)
    # a²/f equals 2 σ_white² T at the corner.
    variance = np.full(len(poles), np.log(RATIO) * 2 * period * corner)
    variance[rates == TOP / period] *= TOP_PART
    transition = np.kron(np.eye(axes), np.diag(poles))
    start = np.kron(np.eye(axes), np.diag(variance))
    drift = np.kron(np.eye(axes), np.diag(variance * (1 - poles**2)))
    seen = np.kron(np.eye(axes), np.ones((1, len(poles))))
    return tuple(np.asarray(part, np.float64) for part in (transition, drift, start, seen))  # type: ignore[return-value]


def misfit_under(
    p: Mapping[str, float], period: float, setting: Setting, residuals: Sequence[Floats], valid: Sequence[Bools]
) -> tuple[float, float]:
    """How unlikely ``residuals`` are under a setting (twice the negative log likelihood with the white noise's level
    free), and that level's variance [V²]."""
    axes = residuals[0].shape[1]
    try:
        filtered = whitener(p, axes, period, setting, max(len(r) for r in residuals))
    except np.linalg.LinAlgError:
        # A model whose motion grows has no such filter.
        return np.inf, np.inf
    square, count, logs = 0.0, 0, 0.0
    for residual, usable in zip(residuals, valid, strict=True):
        # A motion that leaves all bounds is as unlikely as any.
        with np.errstate(over="ignore"):
            square += float(np.sum(filtered(residual[None], usable) ** 2))
        count += int(usable.sum()) * axes
        logs += filtered.log_determinants(len(residual))
    return float(count * np.log(square / count) - 2 * logs), square / count


def likeliest(
    p: Mapping[str, float],
    period: float,
    residuals: Sequence[Floats],
    valid: Sequence[Bools],
    each: Each = map,
    *,
    faint: bool = True,
    colour: tuple[float, ...] = (),
) -> Whitener:
    """The filter under which ``residuals`` (one (n, axes) a run) [V] are likeliest, their noise level free; but of
    ``faint`` ones a motion is taken out only, and that of a mass which a spring holds. each: a ``map``, which may work
    in parallel; colour: an autoregression that is taken where it earns as much as a noise has to."""
    samples = max(len(r) for r in residuals)
    length = samples * period
    residuals, valid = [r[:CHOSEN] for r in residuals], [u[:CHOSEN] for u in valid]

    def best(tried: Sequence[Setting]) -> tuple[float, Setting]:
        costs = each(lambda s: misfit_under(p, period, s, residuals, valid)[0] + s.parts * EARNED, tried)
        return min(zip(costs, tried, strict=True), key=_cost)

    def finer(found: tuple[float, Setting], part: str) -> tuple[float, Setting]:
        value = getattr(found[1], part)
        return (
            min(found, best([replace(found[1], **{part: f * value}) for f in BETWEEN]), key=_cost) if value else found
        )

    def under(colour: tuple[float, ...]) -> tuple[float, Setting]:
        held = mode_frequencies(p, residuals[0].shape[1])[0] * length >= 1
        # What a model lacks of a mass that no spring holds adds up as what shakes it does.
        memories = MEMORIES if held else MEMORIES + UNHELD if faint else MEMORIES[:1]
        bandwidths = [memory / length for memory in memories]
        found = finer(best([Setting(b, 0.0, colour) for b in bandwidths]), "bandwidth")
        if faint and _rises(residuals, valid):
            corners = LOWEST_CORNER / length * CORNER_RATIO ** np.arange(np.log(samples) / np.log(CORNER_RATIO) + 2)
            wandering = finer(best([Setting(0.0, float(corner), colour) for corner in corners]), "corner")
            both = finer(best([replace(wandering[1], bandwidth=b) for b in bandwidths]), "bandwidth")
            found = min(found, wandering, both, key=_cost)
        return found

    found = under(())
    if colour:
        cost, setting = under(colour)
        found = min(found, (cost + EARNED, setting), key=_cost)
    return whitener(p, residuals[0].shape[1], period, found[1], samples)


def _cost(entry: tuple[float, Setting]) -> float:
    return entry[0]


def _rises(residuals: Sequence[Floats], valid: Sequence[Bools]) -> bool:
    """Whether residuals wander: means of eighths about each channel's line vary more than white noise's would, by twice
    their variance. An offset and a drift are no noise."""
    ratios = []
    for residual, usable in zip(residuals, valid, strict=True):
        for channel in residual.T:
            parts = [part for part in np.array_split(channel[usable], 32) if len(part)]
            means = np.array([part.mean() for part in parts])
            steps = np.diff(means, 2)
            # The second difference of white means has six times their variance.
            white = np.median(np.diff(channel[usable], 2) ** 2) / 0.455 / 6
            ratios.append(float(np.mean(steps**2) / 6 / max(white / len(parts[0]), 1e-300)))
    return bool(np.mean(ratios) > 2)


@njit(cache=True, nogil=True)
def _gains(transition, drift, start, seen, gains, roots):  # type: ignore[no-untyped-def]
    """Fills gains and roots until they stay; gives how many samples that took."""
    # Loops, since products of such small matrices are mostly calls; entries that are zero are left out.
    axes, size = seen.shape
    column, count = _places(transition)
    covariance, moved = start.copy(), np.zeros((size, size))
    cross, innovation = np.zeros((size, axes)), np.zeros((axes, axes))
    for k in range(len(gains)):
        for i in range(size):
            for a in range(axes):
                total = 0.0
                for j in range(size):
                    total += covariance[i, j] * seen[a, j]
                cross[i, a] = total
        for a in range(axes):
            for b in range(axes):
                total = 1.0 if a == b else 0.0
                for j in range(size):
                    total += seen[a, j] * cross[j, b]
                innovation[a, b] = total
        root = np.linalg.inv(np.linalg.cholesky(innovation))
        roots[k] = root
        change, largest = 0.0, 0.0
        for i in range(size):
            for a in range(axes):
                total = 0.0
                for b in range(axes):
                    for c in range(axes):
                        total += cross[i, b] * root[c, b] * root[c, a]
                gains[k, i, a] = total
                largest = max(largest, abs(total))
                if k > 0:
                    change = max(change, abs(total - gains[k - 1, i, a]))
        if k > 0 and change < STEADY * largest:
            return k + 1
        for i in range(size):
            for j in range(size):
                for a in range(axes):
                    covariance[i, j] -= gains[k, i, a] * cross[j, a]
        for i in range(size):
            for j in range(size):
                total = 0.0
                for place in range(count[i]):
                    total += transition[i, column[i, place]] * covariance[column[i, place], j]
                moved[i, j] = total
        for i in range(size):
            for j in range(i + 1):
                total = drift[i, j]
                for place in range(count[j]):
                    total += moved[i, column[j, place]] * transition[j, column[j, place]]
                covariance[i, j] = covariance[j, i] = total
    return len(gains)


@njit(cache=True, nogil=True)
def _places(matrix):  # type: ignore[no-untyped-def]
    """Of each row the columns that are not zero, and how many there are."""
    rows, size = matrix.shape
    column, count = np.zeros((rows, size), np.int64), np.zeros(rows, np.int64)
    for i in range(rows):
        for j in range(size):
            if matrix[i, j] != 0:
                column[i, count[i]] = j
                count[i] += 1
    return column, count


@njit(cache=True, nogil=True)
def _filter(transition, seen, gains, roots, v, valid, out):  # type: ignore[no-untyped-def]
    columns, n, axes = v.shape
    size = len(transition)
    # Lags stand alone: a product with zeros would take most of the time.
    used, count = _places(transition)
    for c in range(columns):
        state, moved, error = np.zeros(size), np.zeros(size), np.zeros(axes)
        for k in range(n):
            at = min(k, len(gains) - 1)
            for i in range(axes):
                error[i] = 0.0
                if valid[k]:
                    error[i] = v[c, k, i]
                    for j in range(size):
                        error[i] -= seen[i, j] * state[j]
            for i in range(size):
                for j in range(axes):
                    state[i] += gains[at, i, j] * error[j]
            for i in range(axes):
                total = 0.0
                for j in range(i + 1):
                    total += roots[at, i, j] * error[j]
                out[c, k, i] = total
            for i in range(size):
                total = 0.0
                for place in range(count[i]):
                    total += transition[i, used[i, place]] * state[used[i, place]]
                moved[i] = total
            for i in range(size):
                state[i] = moved[i]


@njit(cache=True, nogil=True)
def _filter_many(transition, seen, gains, roots, v, valid, out):  # type: ignore[no-untyped-def]
    columns, n, axes = v.shape
    size = len(transition)
    used, count = _places(transition)
    shown, shows = _places(seen)
    for begin in range(0, columns, SIDE_BY_SIDE):
        width = min(SIDE_BY_SIDE, columns - begin)
        # All as wide as is known before: the compiler then takes some columns in one operation.
        state, moved = np.zeros((size, SIDE_BY_SIDE)), np.zeros((size, SIDE_BY_SIDE))
        error, total = np.zeros((axes, SIDE_BY_SIDE)), np.zeros(SIDE_BY_SIDE)
        for k in range(n):
            at = min(k, len(gains) - 1)
            for i in range(axes):
                if not valid[k]:
                    error[i] = 0.0
                    continue
                for c in range(width):
                    error[i, c] = v[begin + c, k, i]
                for place in range(shows[i]):
                    _add(error[i], -seen[i, shown[i, place]], state[shown[i, place]])
            for i in range(size):
                for j in range(axes):
                    _add(state[i], gains[at, i, j], error[j])
            for i in range(axes):
                total[:] = 0.0
                for j in range(i + 1):
                    _add(total, roots[at, i, j], error[j])
                for c in range(width):
                    out[begin + c, k, i] = total[c]
            for i in range(size):
                moved[i] = 0.0
                for place in range(count[i]):
                    _add(moved[i], transition[i, used[i, place]], state[used[i, place]])
            state, moved = moved, state


@njit(cache=True, nogil=True, inline="always")
def _add(to, factor, what):  # type: ignore[no-untyped-def]
    for c in range(SIDE_BY_SIDE):
        to[c] += factor * what[c]
