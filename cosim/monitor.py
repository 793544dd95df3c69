"""Whether the angle is valid, judged from what the loop itself knows: no estimate is compared with the truth here.

Valid is the angle while the seven constants are steady and sure, the innovations are as large and as white as the
filter takes them for, and the pattern's turning that the uncertainty of all unknowns allows is within a limit. Where
that stops, the flag is withdrawn and says why."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import degrees, hypot, inf, isfinite, isnan, pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.core.library import Library
from cosim.core.settings import NEAR
from cosim.design import Design
from cosim.layout import KXX, PARAMETER_NAMES, M
from cosim.observers.record import CoreObserver, Observer
from cosim.running import Part, estimate_drift, filter_drift, filter_health, known_values, plain_health
from cosim.setting import Setting, Table

Floats = NDArray[np.float64]

MONITOR: Final[Table] = {
    "agreement": Setting(0.01, 1e-6, 1.0),
    "turn_limit": Setting(5e-3, 0.0, 1.0, "rad/s"),
    "drift_limit": Setting(8.7e-3, 0.0, 100.0, "rad/s"),
    "chi2_low": Setting(0.5, 0.0, 1.0, why="innovations as they should be have 1"),
    "chi2_high": Setting(1.35, 1.0, 1e6, why="innovations as they should be have 1"),
    "start_high": Setting(1.1, 1.0, 1e6, why="innovations as they should be have 1"),
    "whiteness": Setting(0.25, 0.0, 1.0, why="it is a correlation"),
    "lasting_chi2": Setting(1.1, 1.0, 1e6, why="innovations as they should be have 1"),
    "lasting_whiteness": Setting(0.1, 0.0, 1.0, why="it is a correlation"),
    "patience": Setting(0.01, 5e-3, 1e3, "s", why="the flag is judged every 5 ms"),
}
"""agreement: largest relative change of a constant over `patience`, and its largest relative standard deviation, cross
terms relative to their geometric mean; turn_limit: an error of the damping that turns the pattern by no more than this
counts as none [rad/s]; drift_limit: largest standard deviation of the pattern's turning, at its worst angle [rad/s]
(0.5 deg/s); chi2_low, chi2_high: of the squared innovation over its variance, a mean over 5 ms, 2000 numbers at 200
kHz, so that 1.35 is 11 standard deviations off and leaves room for what a sudden change of the rate does; start_high:
of what the last whole start left, 32768 numbers, 13 standard deviations; whiteness:
largest mean product of neighbouring innovations; lasting_chi2, lasting_whiteness: the same over LASTING, in which
jumps of the rate even out: 20,000 numbers and 10,000 an axis, 10 standard deviations each; patience: time over which
all must hold before the flag is set [s]; WINDOW after innovations have withdrawn it."""


INNOVATIONS: Final = "innovations"
DRIFTS: Final = "the angle may drift"
LOST: Final = ("the observer", "an estimate")
LOSSES: Final = (INNOVATIONS, "the start has not found", *LOST)
"""How reasons begin with which the motion itself may be another one than the estimated, and those of no motion at
all."""
DOUBTS: Final = 2
"""Judgements in a row, 5 ms apart, at which innovations that are not as they should be withdraw the flag."""


LASTING: Final = 0.05
"""Over which innovations may not go on beside what they should be [s]: constants that do not fit leave little of that,
and turn the pattern all the same."""
NOTHING: Final = 1e-3
"""Of what innovations should be: a filter for which they are so small takes its own state for unknown."""
WINDOW: Final = 0.1
"""Over which a drift of the angle is meant [s]. All must hold for as long again where innovations have withdrawn the
flag: a fit that is none looks like one for some hundredths of a second."""


def strayed_slope(variance: float, span: float) -> float:
    """Standard deviation of the slope [rad/s] of a straight line of least squares over ``span`` [s] in which an angle
    has strayed by ``variance`` [rad^2]: by steps at any time, of which one of 1 at the share u gives it the slope
    6 u (1 - u)/span, in the mean square 1.2/span^2. Within a cycle of the oscillation the variance may fall: none."""
    return sqrt(1.2 * max(variance, 0.0)) / span


class Orbit(NamedTuple):
    """Where it stands, ``phi`` [rad], k/m of the isotropic oscillator that it is one of [1/s^2], and how fast it may be
    turned by what the force has lacked lately, having met its limit, and by gains older than the constants [rad/s]."""

    phi: float
    omega_squared: float
    pushed: float = 0.0
    behind: float = 0.0


class Verdict(NamedTuple):
    """valid now; reason why not (else empty); predicted standard deviations: of the angle's drift over WINDOW, the
    pattern at its worst angle, with its reading as it is learnt, its random walk and the steps of the rate; of the
    turning where the pattern stands [rad/s]; of the reading, and of what the pattern has strayed by so far, by noise
    that the force feeds back and by steps of the rate [rad]; astray: how far the estimated motion may be beside the
    true one [m], zero while innovations are as they should be."""

    valid: bool
    reason: str
    drift_sigma: float
    drift_sigma_now: float
    bend_sigma: float
    stray_sigma: float
    astray: float = 0.0


@dataclass
class Monitor:
    """Judges a running loop block by block; ``withdrawn`` lists when the flag was taken back, and why. tones: their
    frequencies where the user has told them [Hz]."""

    observer: Observer | CoreObserver
    design: Design
    lib: Library
    part: Part
    period: float
    settings: Mapping[str, float]
    tones: tuple[float, ...] = ()
    withdrawn: list[tuple[float, str]] = field(default_factory=list)
    valid: bool = False
    _good_since: float | None = None
    _doubts: int = 0
    _patience: float = 0.0
    _bent: list[tuple[float, float]] = field(default_factory=list)
    _strayed: list[tuple[float, float]] = field(default_factory=list)
    _behind: list[tuple[float, float]] = field(default_factory=list)
    _lately: list[tuple[float, tuple[float, float, float]]] = field(default_factory=list)
    _previous: list[tuple[float, list[float]]] = field(default_factory=list)

    def judge(self, t: float, estimate: Floats, deviation: Floats, inputs: Floats, orbit: Orbit) -> Verdict:
        """The verdict at ``t`` [s] on the last estimates of a block and their deviations, with the measured inputs and
        the pattern's orbit there."""
        drift = self._drift(estimate, deviation, inputs, orbit)
        largest = hypot(drift["turning"], self._mending(t, drift["bending"]))
        health = self.health()
        strayed = max(health["strayed"], 0.0) / self._gain**2
        reason = self._doubt(t, health, estimate, deviation, largest, drift["unseen"])
        lagging = self._lagging(t, orbit.behind / self._gain, alone=bool(reason))
        sigmas = (
            hypot(largest, self._straying(t, strayed), lagging),
            drift["turning_now"],
            drift["bending"],
            sqrt(strayed),
        )
        reason = reason or self._force_doubt(orbit, lagging)
        astray = self._astray(reason, health, deviation) if reason.startswith(LOSSES) else 0.0
        if reason and not reason.startswith(DRIFTS):
            self._bent.clear()
        if reason and not reason.startswith((DRIFTS, INNOVATIONS)):
            self._lately.clear()
        reason = reason or self._lasting_doubt(t, health)
        self._previous.append((t, estimate[KXX : M + 1].tolist()))
        self._doubts = self._doubts + 1 if reason else 0
        if self.valid and 0 < self._doubts < DOUBTS and reason.startswith(INNOVATIONS):
            # A jump of the rate shows in the innovations for a moment.
            return Verdict(True, "", *sigmas, astray)
        if reason:
            self._good_since = None
            if self.valid:
                self.withdrawn.append((t, reason))
                self._patience = WINDOW if reason.startswith(INNOVATIONS) else self._patience
            self.valid = False
        else:
            self._good_since = t if self._good_since is None else self._good_since
            patience = max(self.settings["patience"], self._patience)
            if not self.valid and t - self._good_since < patience - 0.5 * self.period:
                reason = "not yet: all has been well for too short a time"
            else:
                self.valid = True
        return Verdict(self.valid, reason, *sigmas, astray)

    def _astray(self, reason: str, health: Mapping[str, float], deviation: Floats) -> float:
        """The size of the innovations as a displacement [m]; of an observer of one's own, what they are of what it
        takes its positions for; infinite for one that has lost the device."""
        if reason.startswith(LOST):
            return inf
        values = self.design.all_values
        found = health["innovation"] / abs(values["sense_gain_x"])
        if isnan(found) and not isinstance(self.observer, CoreObserver):
            found = sqrt(max(health["chi2"], 1.0)) * float(np.max(deviation[[0, 2]]))
        return found if isfinite(found) else inf

    def _mending(self, t: float, bending: float) -> float:
        """Deviation of the rate at which the reading of the angle moves while it is learnt how it bends [rad/s]: what a
        variance falls by is the square of a way, and over WINDOW such squares add up."""
        while len(self._bent) > 1 and self._bent[1][0] <= t - WINDOW:
            self._bent.pop(0)
        self._bent.append((t, bending))
        since, was = self._bent[0]
        return sqrt(max(was**2 - bending**2, 0.0) / ((t - since) * WINDOW)) if t > since else 0.0

    def _straying(self, t: float, variance: float) -> float:
        """Deviation of the slope over WINDOW that what the pattern strays by gives the angle's error [rad/s],
        ``variance`` being that of all so far. No drift that goes on: it is in no limit."""
        while len(self._strayed) > 1 and self._strayed[1][0] <= t - WINDOW:
            self._strayed.pop(0)
        self._strayed.append((t, variance))
        return strayed_slope(variance - self._strayed[0][1], WINDOW)

    def _lagging(self, t: float, behind: float, *, alone: bool) -> float:
        """Mean over WINDOW of the rate at which gains older than the constants turn the pattern [rad/s], ``alone``: of
        the last block: what a start has done is over with it."""
        if alone:
            self._behind.clear()
        while len(self._behind) > 1 and self._behind[1][0] <= t - WINDOW:
            self._behind.pop(0)
        self._behind.append((t, behind))
        return sum(rate for _, rate in self._behind) / len(self._behind)

    def _doubt(
        self,
        t: float,
        health: Mapping[str, float],
        estimate: Floats,
        deviation: Floats,
        turning: float,
        unseen: float,
    ) -> str:
        set_ = self.settings
        if not all(map(isfinite, estimate.tolist())):
            return "an estimate is no number"
        if health["restarted_at"] >= 0 and t - health["restarted_at"] < set_["patience"]:
            return "the observer lost the device and began again from the design"
        # Pink noise below a hundred hertz is another one in each window, up to a few times its mean.
        pink = max(health["pink_x"], health["pink_y"])
        if health["chi2"] < min(self._chi2_low, NOTHING):
            return f"the observer has lost the device{self._hint()}"
        if not self._chi2_low <= health["chi2"] <= set_["chi2_high"] + pink:
            return f"{INNOVATIONS} are {sqrt(max(health['chi2'], 0)):.3g} times what they should be{self._hint()}"
        if not health["start"] <= set_["start_high"] + pink:
            left = f": it left innovations {sqrt(health['start']):.3g} times what they should be"
            return "the start has not found its fit" + (left if isfinite(health["start"]) else " yet")
        for axis in ("x", "y"):
            if not abs(health[f"white_{axis}"]) <= set_["whiteness"] + pink:
                return f"{INNOVATIONS} of {axis} are not white: neighbours correlate by {health[f'white_{axis}']:.2g}"
        # Lists: of seven numbers an array takes several times as long.
        seven, sigma = estimate[KXX : M + 1].tolist(), deviation[KXX : M + 1].tolist()
        tolerance = self._tolerance(seven)
        i, share = _largest(sigma, tolerance)
        if share > 1:
            relative = sigma[i] / self._size(seven)[i]
            return f"{PARAMETER_NAMES[i]} is not sure: its standard deviation is {relative:.2g} of it"
        while len(self._previous) > 1 and self._previous[1][0] <= t - set_["patience"]:
            self._previous.pop(0)
        was = self._previous[0][1] if self._previous else [inf] * len(seven)
        i, share = _largest([abs(now - then) for now, then in zip(seven, was, strict=True)], tolerance)
        if share > 1:
            return f"{PARAMETER_NAMES[i]} is not steady"
        if not turning <= set_["drift_limit"]:
            most = "gauge: turn the device or the pattern" if unseen > 0.5 * turning else "weak tones"
            return f"{DRIFTS} by {degrees(turning):.2g} deg/s (1 sigma): {most}"
        return ""

    def _force_doubt(self, orbit: Orbit, lagging: float) -> str:
        """What is wrong of the force; empty where nothing is."""
        if not orbit.pushed <= self.settings["drift_limit"]:
            by = f"what it lacks may turn the pattern by {degrees(orbit.pushed):.2g} deg/s"
            return f"the force meets its limit, {by}: raise controller.force_limit, or use weaker tones"
        if not lagging <= self.settings["drift_limit"]:
            return (
                f"the force lags what the observer knows and turns the pattern by {degrees(lagging):.2g} deg/s: "
                "give a shorter controller.update_period"
            )
        own = sqrt(max(orbit.omega_squared, 0.0)) / (2 * pi)
        for tone in self.tones:
            if abs(tone - own) < NEAR * own:
                return (
                    f"a tone of {tone:.4g} Hz is too near the pattern's own frequency, {own:.4g} Hz: give another "
                    "controller.tone_x, tone_y, tone2_x or tone2_y"
                )
        return ""

    def _lasting_doubt(self, t: float, health: Mapping[str, float]) -> str:
        """What is wrong of the innovations in the mean over LASTING; empty where nothing is, over less than half of it,
        and for an observer of one's own, whose innovations are measured on a device that is known less."""
        if not isinstance(self.observer, CoreObserver):
            return ""
        self._lately.append((t, (health["chi2"], health["white_x"], health["white_y"])))
        while self._lately[0][0] <= t - LASTING:
            self._lately.pop(0)
        if t - self._lately[0][0] < 0.5 * LASTING:
            return ""
        # A plain sum: those of an observer that has lost the device may be of any size.
        chi2, *white = (sum(column) / len(column) for column in zip(*(found for _, found in self._lately), strict=True))
        pink = max(health["pink_x"], health["pink_y"])
        over = f"over {1e3 * LASTING:g} ms"
        if not chi2 <= self.settings["lasting_chi2"] + pink:
            return f"{INNOVATIONS} are {sqrt(chi2):.3g} times what they should be {over}{self._hint()}"
        for axis, product in zip(("x", "y"), white, strict=True):
            if not abs(product) <= self.settings["lasting_whiteness"] + pink:
                return f"{INNOVATIONS} of {axis} are not white: neighbours correlate by {product:.2g} {over}"
        return ""

    def health(self) -> dict[str, float]:
        """What is known of the innovations."""
        found = filter_health if isinstance(self.observer, CoreObserver) else plain_health
        return found(self.lib, self.part)

    def _hint(self) -> str:
        """What a user might try where the loop knows too little."""
        alone = not any(name not in PARAMETER_NAMES for name in self.design.deviations)
        return "; something acts that the design does not know, try --design lab" if alone else ""

    @cached_property
    def _chi2_low(self) -> float:
        """What innovations must reach at least; nothing where the noise that the filter is told is only its floor."""
        values = self.design.all_values
        known = known_values(self.design, self.lib, self.period)
        names = [symbol.name for symbol in self.lib.known.constants]
        floored = known[names.index("sense_noise")] > values["sense_noise"]
        return 0.0 if floored else self.settings["chi2_low"]

    def _size(self, seven: Sequence[float]) -> list[float]:
        size = [abs(value) for value in seven]
        size[2] = sqrt(abs(seven[0] * seven[1]))
        size[5] = sqrt(abs(seven[3] * seven[4]))
        return [max(value, 1e-300) for value in size]

    def _tolerance(self, seven: Sequence[float]) -> list[float]:
        tolerance = [self.settings["agreement"] * size for size in self._size(seven)]
        # At a high Q a share of the damping would ask for more than the record can tell, and than the angle needs.
        turning_mass = abs(seven[-1]) * self.settings["turn_limit"]
        for i, factor in ((3, 4.0), (4, 4.0), (5, 2.0)):
            tolerance[i] = max(tolerance[i], turning_mass * factor)
        return tolerance

    def _drift(self, estimate: Floats, deviation: Floats, inputs: Floats, orbit: Orbit) -> dict[str, float]:
        """Standard deviations by DRIFT_NAMES, of the angle; infinite where they are no numbers."""
        stiffness, phi = orbit.omega_squared * float(estimate[M]), orbit.phi
        if isinstance(self.observer, CoreObserver):
            found = filter_drift(self.lib, self.part.memory, stiffness, phi)
        else:
            known = known_values(self.design.without_estimates(), self.lib, self.period)
            found = estimate_drift(self.lib, known, estimate, deviation, inputs, stiffness, phi)
        if not all(map(isfinite, found.values())):
            return dict.fromkeys(found, inf) | {"unseen": 0.0}
        return {name: value / self._gain for name, value in found.items()}

    @cached_property
    def _gain(self) -> float:
        """The angle is read as the pattern's over the angular gain."""
        return max(abs(self.design.all_values["angular_gain"]), 1e-300)


def _largest(values: Sequence[float], allowed: Sequence[float]) -> tuple[int, float]:
    """Which value is most of what it may be, and how much of it; what is no number is too much."""
    shares = [inf if isnan(value) else value / most for value, most in zip(values, allowed, strict=True)]
    share = max(shares)
    return shares.index(share), share
