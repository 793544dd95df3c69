"""From a record to the split with its interval, or to the reason why there is none."""

from dataclasses import dataclass, replace
from math import isfinite
from typing import Final

import numpy as np

from calibration.mode_split.checks import (
    COLDEST,
    check_levels,
    check_rate,
    check_steps,
    check_thermal,
    other_line,
    taken_drive,
    thermal_ratio,
    unfolded,
)
from calibration.mode_split.correlation import (
    Correlation,
    correlate,
    correlate_without_line,
    measured_spectrum,
    peak_uncertainty,
)
from calibration.mode_split.model import F_Y, LOG_Q, SplitModel, frequency_bound, kept_information
from calibration.mode_split.record import Envelope, VoltageRecord, envelope, find_line
from calibration.mode_split.search import NARROWEST, Found, detectable, find_hump
from calibration.mode_split.spectrum import Spectrum, line_spectrum
from calibration.mode_split.whittle import profile_interval
from gyro_model.errors import InputError
from gyro_model.units import ZERO_CELSIUS

SPAN: Final = 1 / 3
"""Half-width of the band searched, of the drive frequency: the reference device's modes lie 0.3 apart."""
DECAYS: Final = 2 * np.pi * NARROWEST
"""Decay times Q/(π f) below which the line width lies within the resolution 1/T of the record."""
NORMAL_95: Final = 1.959964


MOVES: Final = 3.5
"""Halves of a record that differ by more of their standard errors show a mode that moves: by chance one in 2000."""
ABOUT: Final = 6.0
"""In halves the hump is looked for within so many half-widths of where the whole record has it."""


INSIDE_GUARD: Final = 1.0
INSIDE_BAND: Final = 2.0
"""Half-widths by which the top of a hump must lie inside what is searched: of a skirt alone the fit tells neither place
nor width (one of half-width 1.9 Hz at 40 Hz comes out at 75 ± 8 Hz behind a guard of 70 Hz, in 4 of 60 records, with a
top 0.5 to 0.8 half-widths beyond it; one 50 Hz above the band in 6 of 100, 0.6 to 1.3 inside). A larger band costs
nothing, a smaller guard lets the rate in."""
LOWEST_Q: Final = 10.0
"""Of a resonance; a broader hump is no mode of a gyroscope."""


class NothingFoundError(InputError):
    """No hump stands out of the floor, or not with its top."""


@dataclass(frozen=True)
class Question:
    """What is known of the device and asked of the record.

    q: of the sense mode, or None where it is to be found; drive_frequency [Hz] or None; span: half-width of the band
    searched [Hz], default a third of the drive frequency; guard: half-width [Hz] of the band around the line where the
    rate modulates it; resolution: half-width of the 95 % interval asked for [Hz]; clean_line: the line
    has no phase noise beside its mask. Otherwise a skirt ∝ (f - f_x)⁻² is fitted, and a hump closer to the line than
    its own width can't be told from that.
    """

    q: float | None = None
    drive_frequency: float | None = None
    span: float | None = None
    guard: float = 0.0
    resolution: float | None = None
    clean_line: bool = False
    unfold: bool = False
    mass: float | None = None
    sense_gain: float | None = None
    temperature: float = 298.15

    def __post_init__(self) -> None:
        for name in ("q", "drive_frequency", "span", "resolution", "mass", "sense_gain", "temperature"):
            value = getattr(self, name)
            if value is not None and not (isfinite(value) and value > 0):
                raise InputError(f"--{name.replace('_', '-')} {value:g}: give a positive number")
        if self.temperature < COLDEST:
            celsius = f"{self.temperature:g} °C is {self.temperature + ZERO_CELSIUS:g} K"
            raise InputError(f"--temperature {self.temperature:g}: in K; {celsius}")
        if self.q is not None and self.q < LOWEST_Q:
            raise InputError(f"--q {self.q:g}: a resonance has at least {LOWEST_Q:g}")
        if not (isfinite(self.guard) and self.guard >= 0):
            raise InputError(f"--guard {self.guard:g}: give a frequency in Hz, zero or more")

    def span_about(self, f_x: float) -> float:
        """Half-width [Hz] of the band searched around ``f_x`` [Hz]."""
        return self.span or SPAN * f_x


@dataclass(frozen=True)
class Split:
    """The answer. f_x, f_y [Hz]; deviation of f_y by Fisher information [Hz]; interval of f_y, 95 %, by likelihood
    profile [Hz]; q with its interval (equal to it where it was given); hump_over_floor at f_y [1]; bound: Cramér–Rao,
    σ_f = √(Γ/(T g))/2π [Hz]; g; chance: that the floor alone gives such a hump; duration [s]; found: the fit."""

    f_x: float
    f_y: float
    deviation: float
    interval: tuple[float, float]
    q: float
    q_interval: tuple[float, float]
    hump_over_floor: float
    g: float
    bound: float
    chance: float
    duration: float
    found: Found

    @property
    def model(self) -> SplitModel:
        """The spectrum at the maximum of the likelihood."""
        return self.found.fit.model

    @property
    def split(self) -> float:
        """Δf = f_y - f_x [Hz]."""
        return self.f_y - self.f_x

    @property
    def half_interval(self) -> float:
        """Half the length of the 95 % interval [Hz]."""
        return 0.5 * (self.interval[1] - self.interval[0])


@dataclass(frozen=True)
class Analysis:
    """The answer with what it was found in, for figures. doubts: what to know of it first."""

    split: Split
    part: Envelope
    spectrum: Spectrum
    doubts: tuple[str, ...] = ()


def find_split(record: VoltageRecord, question: Question = Question()) -> Analysis:
    """The split of a record of normal operation.

    Raises InputError where the record is too short for Q or for the resolution asked (it says how long it must be),
    and NothingFoundError where no hump stands out.
    """
    part, f_x, doubts = about_line(record, question, record.duration, "the record")
    if question.guard >= 0.9 * part.band:
        raise InputError(
            f"--guard {question.guard:g}: it leaves nothing of the band of ±{part.band:.4g} Hz that is searched; give "
            "the bandwidth of the rate, some tens of Hz"
        )
    try:
        spectrum = line_spectrum(part, f_x, question.guard)
    except InputError as error:
        raise InputError("; ".join((str(error), *(doubts if question.drive_frequency else ())))) from None
    split = estimate(spectrum, question)
    check_steady(part, split, question)
    check_resolution(split, question.resolution)
    if question.mass is not None and question.sense_gain is not None:
        check_thermal(thermal_ratio(split.model, question.mass, question.sense_gain, question.temperature))
    return Analysis(split, part, spectrum, doubts)


def about_line(
    record: VoltageRecord, question: Question, length: float, what: str
) -> tuple[Envelope, float, tuple[str, ...]]:
    """The part of a record about its drive line, where that is [Hz], and what to know of it.

    Raises InputError for a record that would give a wrong answer without a word, and where a ``length`` [s] of it,
    named by ``what``, can't resolve the line width.
    """
    given = question.drive_frequency
    check_rate(record, given)
    check_steps(record)
    record, clear = unfolded(record, given, question.unfold)
    f_x = find_line(record) if given is None else given
    if not record.is_complex:
        check_levels(record.values.real, f_x / record.rate)
    check_length(length, f_x, question.q, what)
    part = envelope(record, f_x, min(question.span_about(f_x), clear or np.inf))
    return part, f_x, taken_drive(record, f_x) if given is None else other_line(record, part, f_x)


def estimate(spectrum: Spectrum, question: Question, near: tuple[float, float] | None = None) -> Split:
    """Maximum likelihood on a spectrum. near: (f_y, reach) [Hz]. Raises NothingFoundError."""
    found = find_hump(spectrum, question.q, question.clean_line, near)
    if not found.is_hump:
        raise NothingFoundError(_nothing(spectrum, question, found))
    model, fit = found.fit.model, found.fit
    check_top(spectrum, model, question.guard)
    check_skirt(model, question.clean_line)
    low, high = profile_interval(found.likelihood, fit)
    if not (isfinite(low) and isfinite(high)):
        raise NothingFoundError(_unbounded(spectrum, float(model.f_y)))
    if not model.half_width > 0.5 * NARROWEST * spectrum.bin:
        raise NothingFoundError(_unresolved(spectrum, float(model.f_y)))
    ratio = model.hump / float(model.floor(np.array([model.f_y]))[0])
    q = question.q or model.q
    # e^±50 of Q, where the fit does not tell it, is any.
    spread = min(NORMAL_95 * float(fit.deviation[LOG_Q]), 50.0)
    return Split(
        spectrum.drive_line,
        float(model.f_y),
        float(fit.deviation[F_Y]),
        (low, high),
        q,
        (q * float(np.exp(-spread)), q * float(np.exp(spread))),
        ratio,
        kept_information(ratio),
        frequency_bound(model.f_y, model.q, spectrum.duration, ratio),
        found.chance,
        spectrum.duration,
        found,
    )


def correlations(analysis: Analysis) -> tuple[tuple[Correlation, float], tuple[Correlation, float]]:
    """The cross-correlation as printed in CN 111272193, and with the line removed, each with the half-width of its 95 %
    interval [Hz]. Preset at f_x, so that the lag of the hump is the split."""
    split, spectrum = analysis.split, analysis.spectrum
    f, m = measured_spectrum(analysis.part)
    on_line = np.abs(f - split.f_x) < spectrum.guard
    printed = correlate(f, m, split.f_x, split.q, split.f_x)
    cut = correlate_without_line(spectrum, split.q, split.f_x)
    power = float(m[on_line].sum()) * spectrum.bin
    return (
        (printed, peak_uncertainty(printed, split.model, spectrum, power)),
        (cut, peak_uncertainty(cut, split.model, spectrum, 0.0)),
    )


def check_length(duration: float, f_x: float, q: float | None, what: str = "the record") -> None:
    """Raises InputError where ``what``, ``duration`` [s] long, can't resolve the line width f/Q."""
    if q is not None and duration < (needed := DECAYS * q / (np.pi * f_x)):
        raise InputError(
            f"{what} is {duration:.4g} s long: too short to resolve the line width {f_x / q:.3g} Hz of Q = {q:.5g}; "
            f"record at least {needed:.3g} s, better {150 / DECAYS * needed:.3g} s"
        )


def check_top(spectrum: Spectrum, model: SplitModel, guard: float) -> None:
    """Raises NothingFoundError for a hump too broad for a resonance, and where its top lies in the ``guard`` [Hz] or at
    the end of the band: of such a skirt a fit tells neither place nor width, so this is asked before both."""
    f_y = float(model.f_y)
    if model.q < LOWEST_Q:
        raise NothingFoundError(
            f"the hump at {f_y:.6g} Hz is as broad as one of Q = {model.q:.3g}: no resonance of a gyroscope is; give "
            "--q or a smaller --span"
        )
    if guard and abs(f_y - spectrum.drive_line) - guard < INSIDE_GUARD * model.half_width:
        raise NothingFoundError(
            f"the hump at {f_y:.6g} Hz reaches into the guard of {guard:g} Hz about the line: where its top is does "
            "not show; give a smaller --guard"
        )
    if min(f_y - spectrum.f[0], spectrum.f[-1] - f_y) < INSIDE_BAND * model.half_width:
        raise NothingFoundError(
            f"the hump at {f_y:.6g} Hz lies at the end of the band of {spectrum.f[0]:.6g} to {spectrum.f[-1]:.6g} Hz: "
            "where its top is does not show; give a larger --span, or more samples a second"
        )


def check_skirt(model: SplitModel, clean_line: bool) -> None:
    """Raises NothingFoundError for a hump closer to the line than its half-width, unless the line is clean."""
    if not clean_line and abs(away := float(model.f_y) - model.drive_line) < model.half_width:
        raise NothingFoundError(
            f"a hump lies under the drive line, {away:.3g} Hz beside it and {2 * model.half_width:.3g} Hz wide; "
            "noise of the drive, or the rate, makes such a one of the line: give --clean-line if the device stood "
            "still and its drive has no noise, or --guard to look for a hump further out"
        )


def check_steady(part: Envelope, split: Split, question: Question) -> None:
    """Raises InputError where the mode moves through the record: the hump is then no resonance, and its interval too
    narrow. A half that shows no hump by itself tells nothing."""
    known, middle = replace(question, q=split.q), 0.5 * part.duration
    halves = []
    for start, stop in ((0.0, middle), (middle, part.duration)):
        spectrum = line_spectrum(part.part(start, stop), split.f_x, question.guard)
        try:
            halves.append(estimate(spectrum, known, (split.f_y, ABOUT * split.model.half_width)))
        except NothingFoundError:
            return
    first, second = halves
    moved, error = second.f_y - first.f_y, float(np.hypot(first.deviation, second.deviation))
    if abs(moved) > MOVES * error:
        raise InputError(
            f"the sense mode moves through the record, by {moved:.3g} ± {error:.2g} Hz from half to half, beside "
            f"a line width of {2 * split.model.half_width:.3g} Hz: no interval would hold; follow it by "
            f"--track {split.duration / 10:.3g}, or record at a steady temperature"
        )


def check_resolution(split: Split, resolution: float | None) -> None:
    """Raises InputError where the interval is wider than asked: it falls with the root of the length."""
    if resolution is not None and split.half_interval > resolution:
        needed = split.duration * (split.half_interval / resolution) ** 2
        raise InputError(
            f"the record of {split.duration:.4g} s gives the split within ±{split.half_interval:.3g} Hz (95 %), not "
            f"±{resolution:g} Hz: record at least {needed:.3g} s"
        )


def _unresolved(spectrum: Spectrum, f_y: float) -> str:
    width = NARROWEST * spectrum.bin
    return (
        f"what stands out at {f_y:.6g} Hz is narrower than {width:.2g} Hz, which is all that {spectrum.duration:.4g} s "
        f"resolve: a line from elsewhere, or a sense mode with Q above {f_y / width:.3g}; record three times as long"
    )


def _unbounded(spectrum: Spectrum, f_y: float) -> str:
    return (
        f"something stands out at {f_y:.6g} Hz, but {spectrum.duration:.4g} s do not bound where its top is: it may be "
        "no hump of a resonance; record for longer, give --q, or another --span"
    )


def _nothing(spectrum: Spectrum, question: Question, found: Found) -> str:
    # Where Q is not known: one that the record resolves as well as the bound asks, T = 150 Q/(π f).
    q = question.q or np.pi * spectrum.drive_line * spectrum.duration / 150
    height = 10 * np.log10(detectable(spectrum, found, q))
    return (
        f"no thermal hump found from {spectrum.f[0]:.6g} to {spectrum.f[-1]:.6g} Hz in {spectrum.duration:.4g} s "
        f"(chance gives the best place with probability {found.chance:.2g}): one of Q = {q:.3g} would have been found "
        f"from {height:.1f} dB over the floor on; record for longer, give --q, or another --span"
    )
