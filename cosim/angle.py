"""Angle units: the angle of the vibration pattern, no rate integrated (TW 201137310, eqs. 8-11).

    phi = atan2(2 (w^2 x y + x' y'), w^2 (x^2 - y^2) + x'^2 - y'^2) / 2,   w^2 = k / m

(the patent prints k for w^2 and a plain arctan). The pattern turns by -lambda int(Omega dt) in the
body, so the reported angle is theta = -(phi - phi at convergence) / lambda.

A: band-pass the four states, then phi. B: phi, then low-pass. C: subtract the observer's response
to the two tones, then phi, no filter.

x' of a pattern that turns against the package also holds that turn times y, which would ripple phi by
turn/(2 w) at twice the oscillation frequency, 0.008 deg at 5 rad/s and 0.15 deg at 100 rad/s. The mean
would be zero, but not what a single sample finds, and one sets the angle's zero. A and C take it out by
the estimated rate, B by its low-pass.

Why B works although the tones bend phi by tens of degrees: with z = x + j x'/w and likewise y, phi
is half the argument of (z_x + j z_y)(z_x* + j z_y*). The factors are the pattern, a + b and a - b
in size for semi-axes a, b and turning at the oscillation frequency, plus the tones; as long as
a - b is the larger, the argument of 1 + tone/pattern has zero mean over its turns, and what the
tones add lies near the difference of the frequencies (2.5 kHz), far above the low-pass. Two tones
of 32 uN on the reference device reach 0.73 um. Below that B errs, by up to 0.5 deg where a - b is
0.7 um and 6 deg at 0.5 um.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from math import atan2, nan, sqrt
from typing import Final, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from cosim.angle_filters import Filter, Floats, Shape, band_pass, low_pass

Number = TypeVar("Number", float, Floats)


@dataclass(frozen=True)
class Block:
    """What the loop records over n consecutive samples; the arrays are not changed.

    t [s]; states: estimates of x, x_dot, y, y_dot at t [m, m/s], shape (4, n); forced: the response to the tones and
    what held forces bend of the pattern there, likewise; near: the part of it at tones near the oscillation;
    omega_squared = k/m [1/s^2]; converged: bool; lambda_: the angular gain [1]; turned: angle by which the controller
    has turned the pattern [rad]; turn: rate at which the pattern turns against the package, by the estimated
    rate and by the controller, backwards [rad/s]."""

    t: Floats
    states: Floats
    forced: Floats
    near: Floats
    omega_squared: Floats
    converged: NDArray[np.bool_]
    lambda_: float
    turned: Floats
    turn: Floats

    @cached_property
    def filterable(self) -> Floats:
        """The states without the response to tones near the oscillation, which no filter could tell from it."""
        return self.states - self.near

    @cached_property
    def free(self) -> tuple[Floats, Floats]:
        """Phi within +-pi/2 [rad] and quality, shape (n,), of the pattern without its response to the tones."""
        return orientation(at_rest(self.states - self.forced, self.turn), self.omega_squared)

    @cached_property
    def frequency_hz(self) -> Floats:
        """Of the oscillation that the observer has found, shape (n,)."""
        return np.sqrt(self.omega_squared) / (2 * np.pi)


class AngleUnit(Protocol):
    """An angle unit remembers what it needs, so that the division into blocks changes nothing."""

    name: str

    @property
    def filter(self) -> Filter | None:
        """The filter that the angle passes, if any."""
        ...

    @property
    def zero(self) -> float:
        """Where the pattern stood when the angle was valid first, less what it had been turned by [rad]; NaN
        before."""
        ...

    def process(self, block: Block) -> tuple[Floats, Floats]:
        """Return angle [rad], unwrapped, NaN before convergence, and quality, each shape (n,).

        Quality is (a^2 - b^2)/(a^2 + b^2) of the orbit with semi-axes a, b: 1 is a straight line,
        0 a circle, which has no angle.
        """
        ...


class _PatternUnit:
    """What units that follow a pattern have in common."""

    _pattern: "Pattern"

    @property
    def zero(self) -> float:
        """See AngleUnit."""
        return self._pattern.zero

    def _follows(self, block: Block) -> NDArray[np.bool_]:
        """Whether a filter follows the oscillation, shape (n,): until the angle is valid first, so that what a change
        stirs up is over by then, and while it is."""
        return block.converged | np.isnan(self.zero)


RETUNE: Final = 1e-3
"""A unit designs its filter anew when the oscillation is this far from what it was designed for, relative: unit A reads
edges of the rate 0.01 deg wrong for each 0.1 % off (measured: 0.24 deg at 2.5 %)."""


HIGHEST: Final = 0.4
"""Share of the sample rate up to which a filter follows: the upper edge of unit A is at 1.18 times the oscillation.
What is found above comes of an observer that has lost the device."""


def _away(frequency_hz: Floats, designed_hz: float, sample_rate: float) -> NDArray[np.bool_]:
    """Whether a filter is far from the oscillation, shape (n,)."""
    away: NDArray[np.bool_] = np.abs(frequency_hz / designed_hz - 1) > RETUNE
    return away & (frequency_hz > 0) & (frequency_hz < HIGHEST * sample_rate)


class UnitA(_PatternUnit):
    """Band-pass on the four states, then phi (TW 201137310, eqs. 8-9).

    The filter is designed for the nominal device and follows the oscillation that the observer found, sqrt(k/m)/2pi,
    which sensors of unknown gain move by as much as they move m.
    """

    name = "A"

    def __init__(self, design: Filter) -> None:
        self.filter = design
        self._memory = np.zeros((len(design.sos), 4, 2))
        self._pattern = Pattern()

    def process(self, block: Block) -> tuple[Floats, Floats]:
        """Angle [rad] and quality, see AngleUnit."""
        raw, quality = orientation(at_rest(self._filtered(block), block.turn), block.omega_squared)
        return self._pattern.angle(self._pattern.unwrapped(raw), block), quality

    def _filtered(self, block: Block) -> Floats:
        states, follows, frequency_hz = block.filterable.copy(), self._follows(block), block.frequency_hz
        begin = 0
        while begin < len(frequency_hz):
            away = _away(frequency_hz[begin:], self.filter.centre_hz, self.filter.sample_rate) & follows[begin:]
            if away[0]:
                self.filter = band_pass(self.filter.sample_rate, float(frequency_hz[begin]), self.filter.shape)
                continue
            end = begin + int(away.argmax()) if away.any() else len(frequency_hz)
            states[:, begin:end], self._memory = signal.sosfilt(self.filter.sos, states[:, begin:end], zi=self._memory)
            begin = end
        return states


class UnitB(_PatternUnit):
    """Phi of the unfiltered states, then low-pass on angle and quality (TW 201137310, eqs. 10-11).

    The filter is designed for the nominal device, `frequency_hz`, and follows the oscillation that the observer found:
    one that is a third too slow reads edges of the rate 1.8 times as wrong.
    """

    name = "B"

    def __init__(self, design: Filter, frequency_hz: float) -> None:
        self.filter = design
        self._designed_hz = frequency_hz
        self._memory: Floats | None = None
        self._last = np.zeros(2)
        self._pattern = Pattern()
        self._near = Pattern()

    def process(self, block: Block) -> tuple[Floats, Floats]:
        """Angle [rad] and quality, see AngleUnit."""
        # Of the values phi + n pi the one nearest the pattern without the tones is taken. From sample to sample a half
        # turn would be counted whenever the tones outgrow the pattern for a moment, and never taken back.
        near = self._near.unwrapped(block.free[0])
        raw, quality = orientation(block.filterable, block.omega_squared)
        signals = np.stack((raw + np.pi * np.rint((near - raw) / np.pi), quality))
        phi, quality = self._filtered(signals, block.frequency_hz, self._follows(block))
        # The lag-free low-pass overshoots; quality is a ratio.
        return self._pattern.angle(phi, block), np.clip(quality, 0.0, 1.0)

    def _filtered(self, signals: Floats, frequency_hz: Floats, follows: NDArray[np.bool_]) -> Floats:
        """Angle and quality, shape (2, n), passed by the filter, which goes on from where it is when it changes."""
        begin, count = 0, len(frequency_hz)
        if self._memory is None and count:
            # As if the first sample had been there for ever: no step from zero.
            self._last = signals[:, 0]
            self._memory = self._rest()
        while begin < count:
            away = _away(frequency_hz[begin:], self._designed_hz, self.filter.sample_rate) & follows[begin:]
            if away[0]:
                self._designed_hz = float(frequency_hz[begin])
                self.filter = low_pass(self.filter.sample_rate, self._designed_hz, self.filter.shape)
                self._memory = self._rest()
                continue
            end = begin + int(away.argmax()) if away.any() else count
            signals[:, begin:end], self._memory = signal.sosfilt(
                self.filter.sos, signals[:, begin:end], zi=self._memory
            )
            self._last = signals[:, end - 1].copy()
            begin = end
        return signals

    def _rest(self) -> Floats:
        """The filter's memory where both have long been as they are, shape (sections, 2, 2)."""
        rest: Floats = signal.sosfilt_zi(self.filter.sos)[:, None, :] * self._last[None, :, None]
        return rest


class UnitC(_PatternUnit):
    """Subtract the forced response to the two tones, then phi; no filter."""

    name = "C"
    filter = None

    def __init__(self) -> None:
        self._pattern = Pattern()

    def process(self, block: Block) -> tuple[Floats, Floats]:
        """Angle [rad] and quality, see AngleUnit."""
        raw, quality = block.free
        return self._pattern.angle(self._pattern.unwrapped(raw), block), quality


UNIT_NAMES: Final = ("A", "B", "C")


def make_units(sample_rate: float, frequency_hz: float, shape: Shape = "lag_free") -> dict[str, AngleUnit]:
    """Return fresh units A, B and C for an oscillation at `frequency_hz` = sqrt(k/m)/2pi.

    Raises InputError where a filter does not fit below half of `sample_rate` [Hz].
    """
    return {
        "A": UnitA(band_pass(sample_rate, frequency_hz, shape)),
        "B": UnitB(low_pass(sample_rate, frequency_hz, shape), frequency_hz),
        "C": UnitC(),
    }


class Pattern:
    """Follows the orientation phi of an orbit over blocks, and sets the angle's zero.

    zero: phi less what was turned, where the angle was valid first [rad].
    """

    def __init__(self) -> None:
        self._last = np.nan
        self.zero = np.nan

    def unwrapped(self, raw: Floats) -> Floats:
        """Return phi [rad], shape (n,), which goes on from the last one, of its values ``raw`` within +-pi/2."""
        if not len(raw):
            return raw
        phi = unwrapped(raw) if np.isnan(self._last) else unwrapped(np.concatenate(([self._last], raw)))[1:]
        self._last = float(phi[-1])
        return phi

    def angle(self, phi: Floats, block: Block) -> Floats:
        """Return theta [rad] of `phi`: zero at the first converged sample, NaN before."""
        first = 0
        if np.isnan(self.zero):
            if not block.converged.any():
                return np.full_like(phi, np.nan)
            first = int(block.converged.argmax())
            self.zero = float(phi[first] - block.turned[first])
        # This order of the difference makes the first converged angle +0.0.
        angle = (self.zero - (phi - block.turned)) / block.lambda_
        angle[:first] = np.nan
        return angle


def unwrapped(raw: Floats) -> Floats:
    """Phi without jumps of half turns [rad], shape (n,), of its values ``raw`` within +-pi/2; what is no number stays
    so, and changes no other."""
    jumps = np.rint((raw[1:] - raw[:-1]) / np.pi)
    if not jumps.any():
        return raw
    return raw - np.pi * np.concatenate(([0.0], np.cumsum(np.nan_to_num(jumps))))


def ripple(phi: Floats, cycle: int) -> float:
    """Root mean square [rad] of what ``phi``, shape (n,), has beside its mean over ``cycle`` samples; NaN of fewer.

    What goes with twice the oscillation a device does not turn by, but a single sample finds it.
    """
    # An odd number lies around its middle.
    width = max(cycle, 2) // 2 * 2 + 1
    if len(phi) < width:
        return nan
    since = phi - phi[0]
    sums = np.concatenate(([0.0], np.cumsum(since)))
    beside = since[width // 2 : len(phi) - width // 2] - (sums[width:] - sums[:-width]) / width
    return sqrt(np.dot(beside, beside) / len(beside))


def sine_lag(t: Floats, angle: Floats, angle_true: Floats, frequency_hz: float = 20.0) -> float:
    """Lag [s] of `angle` behind `angle_true` for a rate that is a sine of `frequency_hz`.

    Offset and drift are fitted with the sine and so removed; samples without an angle (NaN) are
    left out. Shapes (n,). The lag is unambiguous within half a period.
    """
    valid = np.isfinite(angle) & np.isfinite(angle_true)
    since = t[valid] - t[valid].mean()
    phase = 2 * np.pi * frequency_hz * since
    basis = np.stack((np.ones_like(since), since, np.cos(phase), np.sin(phase)), axis=1)
    fitted, *_ = np.linalg.lstsq(basis, np.stack((angle[valid], angle_true[valid]), axis=1))
    measured, true = fitted[2] - 1j * fitted[3]
    return float(-np.angle(measured / true) / (2 * np.pi * frequency_hz))


def at_rest(states: Floats, turn: Floats) -> Floats:
    """x, x', y, y', shape (4, n), with the velocities as one sees them who turns with the pattern: z' + i turn z,
    z = x + i y; ``turn`` against the package [rad/s], shape (n,)."""
    x, x_dot, y, y_dot = states
    return np.stack((x, x_dot - turn * y, y, y_dot + turn * x))


def orientation_at(state: Iterable[float], omega_squared: float) -> float:
    """Phi of ``orientation`` at one sample, of x, x', y, y'."""
    cross, difference, _ = _of_orbit(state, omega_squared)
    return 0.5 * atan2(cross, difference)


def _of_orbit(state: Iterable[Number], omega_squared: Number) -> tuple[Number, Number, Number]:
    """Of x, x', y, y': twice the product of both motions, the difference of their energies, and the sum."""
    x, x_dot, y, y_dot = state
    pull = omega_squared * x
    energy_x = pull * x + x_dot * x_dot
    energy_y = omega_squared * y * y + y_dot * y_dot
    return 2 * (pull * y + x_dot * y_dot), energy_x - energy_y, energy_x + energy_y


def orientation(states: Floats, omega_squared: Floats) -> tuple[Floats, Floats]:
    """Phi within +-pi/2 [rad] and quality, shape (n,), of x, x', y, y', shape (4, n)."""
    # Estimates of an observer that has lost the device may be of any size; what comes of them is no number, and no
    # news.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        cross, difference, total = _of_orbit(states, omega_squared)
        # A root of squares takes a third of the time of hypot, and no energy is near the ends of the numbers.
        straight = np.sqrt(difference * difference + cross * cross)
        # Rounding may take the ratio of a straight line past 1 by an ulp.
        quality = np.where(total > 0, np.minimum(straight / total, 1.0), 0.0)
        return 0.5 * np.arctan2(cross, difference), quality
