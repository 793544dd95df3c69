"""A record is checked before it is believed: what would mislead without a word is refused or asked about."""

from typing import Final

import numpy as np

from calibration.analysis.clipping import is_clipped
from calibration.mode_split.model import SplitModel
from calibration.mode_split.record import Complexes, Envelope, Floats, VoltageRecord, find_line
from calibration.mode_split.spectrum import line_reach
from gyro_model.errors import InputError
from gyro_model.symbols import BOLTZMANN

SLOWEST: Final = 2000.0
"""No drive of a vibratory gyroscope, 1 kHz and more, is seen in a voltage with fewer samples a second [Hz]."""
SLOWEST_PAIR: Final = 20.0
"""Of I and Q [Hz]: a demodulator of a gyroscope gives 20 kHz at most, which read in ms is this."""
REPEATED: Final = 0.3
"""Share of neighbouring samples that may be equal. Noise of one step rms repeats in 28 %: below that the error of
rounding is no longer white and independent of the signal (B. Widrow and I. Kollár, Quantization Noise, 2008)."""
RETURNS: Final = 100
"""Samples after which a carrier is looked for at the same phase: one that comes back later moves through the steps in
between and whitens the error of rounding: of steps of 5 times the noise 29 of 32 intervals cover, as of half of it."""
COLDEST: Final = 100.0
"""Of a structure [K]: a temperature below it was meant in °C."""
FEW_LEVELS: Final = 32
"""Values that a voltage takes at least where its noise is far below a step: of up to 17 half of the intervals missed,
13 of 26, of 33 and more 2 of 26."""
BLURRED: Final = 0.58
"""Of a step: noise of half a step makes rounding white, and the two together are √(1/4 + 1/12) of one."""
CLEAR: Final = 0.45
"""Half-width of the band that is analysed about an unfolded line, of its distance from its own image."""
OTHER: Final = 100.0
"""A line that is so much stronger than the drive's, in power, is told: it may be the drive's."""
THERMAL: Final = 4.0
"""A hump is called thermal whose power lies within this factor of kT/k: mass and gain are known to some 20 %."""


def check_rate(record: VoltageRecord, drive_frequency: float | None) -> None:
    """Raises InputError for so few samples a second that the time must be in another unit."""
    if record.is_complex and record.rate < SLOWEST_PAIR and drive_frequency is None:
        raise InputError(
            f"{record.rate:.4g} pairs a second show ±{record.rate / 2:.4g} Hz about the carrier, which no split of two "
            "modes lies in. Is the time in ms or µs? Name its column t [ms]; else give --drive-frequency"
        )
    if not record.is_complex and record.rate < SLOWEST and drive_frequency is None:
        raise InputError(
            f"{record.rate:.4g} samples a second: a gyroscope's drive lies above 1 kHz. Is the time in ms or µs? Name "
            "its column t [ms]; else give --drive-frequency"
        )


def check_steps(record: VoltageRecord) -> None:
    """Raises InputError for samples that never change, are clipped, or repeat: rounded in steps wider than their noise.

    Under a carrier they repeat where it comes back to the same phase after some samples, all through the record.
    """
    for part in (record.values.real, record.values.imag) if record.is_complex else (record.values.real,):
        if np.ptp(part) == 0:
            raise InputError(
                "I or Q never changes: without it either side of the drive looks the same; mend the record"
            )
        if is_clipped(part):
            raise InputError(
                "the voltage stays at the end of its range: it is clipped, and no interval would hold; record at a "
                "lower gain"
            )
        lag, share = _return(part)
        if share > REPEATED:
            step = np.diff(np.unique(part))
            before = "the one before" if lag == 1 else f"that {lag} before, where the carrier is back at its phase"
            remedy = "record with finer steps" + ("" if lag == 1 else ", or at a slightly different sample rate")
            raise InputError(
                f"{100 * share:.0f} % of the samples equal {before}: they are rounded in steps of {step.min():.3g} V, "
                f"wider than their noise, and no interval would hold; {remedy}"
            )


def check_levels(values: Floats, turn: float) -> None:
    """Raises InputError for a voltage (n,) of few steps under a carrier of ``turn`` cycles a sample, whose noise is too
    small to blur them: what rounding makes of the carrier then stands like a hump, anywhere."""
    levels = np.unique(values)
    if not 1 < len(levels) <= FEW_LEVELS:
        return
    step = float(np.diff(levels).min())
    phase = 2 * np.pi * (turn * np.arange(len(values)) % 1)
    design = np.stack([np.ones(len(values)), np.cos(phase), np.sin(phase)], axis=1)
    fitted = design @ np.linalg.lstsq(design, values, rcond=None)[0]
    if float(np.std(values - fitted)) < BLURRED * step:
        raise InputError(
            f"the voltage takes {len(levels)} values, {step:.3g} V apart, and its noise is below that: what rounding "
            f"leaves of the carrier looks like a hump, and no interval would hold; use {FEW_LEVELS} steps and more"
        )


def _return(part: Floats | Complexes) -> tuple[int, float]:
    """After how many samples the most are equal, and which share; of those beyond the next, the least share at that
    lag, at a third and at half of the record, through which a carrier that returns only nearly drifts on."""

    def equal(lag: int) -> float:
        return float(np.mean(part[lag:] == part[:-lag])) if 0 < lag < len(part) else 0.0

    shares = [equal(lag) for lag in range(1, RETURNS + 1)]
    lag = 1 + int(np.argmax(shares))
    far = [equal(lag * (len(part) // (parts * lag))) for parts in (2, 3)]
    return (1, shares[0]) if shares[0] > REPEATED else (lag, min(shares[lag - 1], *far))


def unfolded(record: VoltageRecord, drive_frequency: float | None, unfold: bool) -> tuple[VoltageRecord, float | None]:
    """The record as it is, or about the drive line that it shows folded, and the half-width of the band then [Hz].

    Raises InputError where the drive lies beyond half the sample rate and nobody has confirmed that the record is
    folded, and where the line falls on its own image.
    """
    if record.is_complex or drive_frequency is None or drive_frequency < 0.5 * record.rate:
        if unfold:
            raise InputError("--unfold: the drive lies below half the sample rate, or none is given: leave it out")
        return record, None
    shown = drive_frequency - record.rate * round(drive_frequency / record.rate)
    if not unfold:
        mirrored = ", and mirrored" if shown < 0 else ""
        raise InputError(
            f"drive at {drive_frequency:g} Hz, {record.rate:g} samples a second: the record shows it folded to "
            f"{abs(shown):g} Hz{mirrored}. Was it sampled without a filter? Then give --unfold; else check both numbers"
        )
    image = abs(2 * shown - record.rate * round(2 * shown / record.rate))
    if image < 0.02 * record.rate:
        raise InputError(f"--unfold: at {record.rate:g} Hz the line falls on its own image: take another sample rate")
    turns = shown / record.rate * np.arange(len(record.values))
    values = 2 * record.values * np.exp(-2j * np.pi * (turns % 1))
    return VoltageRecord(values, record.rate, drive_frequency), CLEAR * image


def thermal_ratio(model: SplitModel, mass: float, gain: float, temperature: float) -> float:
    """Power of the hump over that of thermal motion, G² kT/(m ω²); mass [kg], gain [V/m], temperature [K]."""
    power = model.hump * 0.5 * np.pi * model.f_y / model.q
    return float(power / (gain**2 * float(BOLTZMANN) * temperature / (mass * (2 * np.pi * model.f_y) ** 2)))


def unchecked(mass: float | None, gain: float | None) -> list[str]:
    """What a user must know of a hump whose power could not be held against kT; nothing where both are given."""
    missing = [option for option, value in (("--mass", mass), ("--sense-gain", gain)) if value is None]
    if not missing:
        return []
    return [
        "the power of the hump is not checked against kT: any resonance near the drive, such as a mode of the package "
        f"that is shaken, would be read as the sense mode; give {' and '.join(missing)}"
    ]


def taken_drive(record: VoltageRecord, f_x: float) -> tuple[str, ...]:
    """What to know of a drive line at ``f_x`` [Hz] that nobody has given: it may be the image of a faster one, and the
    split is then mirrored or not as the sample rate has it."""
    if record.is_complex:
        return ()
    return (
        f"the strongest line, at {f_x:.7g} Hz, is taken for the drive's: of a drive beyond {record.rate / 2:.6g} Hz, "
        "sampled without a filter, it would be the image, and the sign of the split could be wrong; give "
        "--drive-frequency",
    )


def check_thermal(ratio: float) -> None:
    """Raises InputError for a hump that is not thermal."""
    if not 1 / THERMAL <= ratio <= THERMAL:
        raise InputError(
            f"the hump is not thermal: it holds {ratio:.3g} times what kT gives at this mass and gain; it may be a "
            "mode of the package, driven, or --mass or --sense-gain is wrong"
        )


def other_line(record: VoltageRecord, part: Envelope, given: float) -> tuple[str, ...]:
    """What to know of a drive line that was ``given`` [Hz]: that another in the ``part`` is much stronger."""
    try:
        strongest = find_line(record)
    except InputError:
        return ()
    turns = np.arange(len(part.values)) / part.rate
    windowed = part.values * np.hanning(len(part.values))

    def power(frequency: float) -> float:
        return float(abs(windowed @ np.exp(-2j * np.pi * (frequency - part.centre) * turns)) ** 2)

    away = abs(strongest - given)
    if away <= line_reach(part, given) or away > part.band or power(strongest) < OTHER * power(given):
        return ()
    return (
        f"--drive-frequency {given:.7g}, from which the split is counted: the line at {strongest:.7g} Hz is more than "
        "20 dB stronger; is that the drive's?",
    )
