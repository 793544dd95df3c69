"""Frequencies, split and quality factors of the modes, from their free decay."""

from math import pi

from calibration.analysis.decay import modes
from calibration.datasheet.figure import Figure, Outcome, mean
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import Bench
from cosim.rate.free_decay import PLUCKED, free_decay, linear_modes
from cosim.rate.steady_state import parameters_at

ORDER = 4
"""Modes looked for: two, a parasitic one, and one for what noise and bent springs leave."""
MATCHED = "the modes match within half the width of their line: a free decay shows one"
PASSES = 2
"""A second pass has the carrier on the mode."""


def measure(bench: Bench) -> Outcome:
    """Both axes are plucked and left alone, on the envelope FMU."""
    amplitude = PLUCKED * bench.typical.settings.drive_amplitude
    found: list[tuple[float | None, ...]] = []
    lower, upper = linear_modes(parameters_at(bench.device, bench.reference_temperature))
    matched = upper.frequency - lower.frequency < 0.5 * lower.frequency / lower.q
    for seed in bench.seeds(bench.plan.repeats):
        if matched:
            common, q_common = _mode(bench, amplitude, seed, 0, 1)
            found.append((common, None, None, q_common, None))
            continue
        (low, q_low), (high, q_high) = (_mode(bench, amplitude, seed, which, 2) for which in (0, 1))
        found.append((low, high, high - low, q_low, q_high))
    expected = (lower.frequency, upper.frequency, upper.frequency - lower.frequency, lower.q, upper.q)
    rule = "eigenvalues of m s² + D s + K, with what a parasitic mode adds there"
    figures = []
    for (name, title, unit), values, true in zip(NAMES, zip(*found, strict=True), expected, strict=True):
        seen = [value for value in values if value is not None]
        if not seen:
            figures.append(Figure(name, title, None, unit, note=MATCHED))
            continue
        value, error = mean(seen)
        note = MATCHED if matched else ""
        figures.append(Figure(name, title, value, unit, error, len(seen), true, rule, note=note))
    return Outcome(figures)


def _mode(bench: Bench, amplitude: float, seed: int, which: int, seen: int) -> tuple[float, float]:
    """Frequency [Hz] and quality factor of the lower (0) or the upper mode (1) of so many that are ``seen``."""
    carrier = bench.device.frequencies[which]
    for _ in range(PASSES):
        decay = free_decay(bench.device, amplitude, seed, carrier, bench.sample_rate)
        bench.advance(decay.interval * decay.records.shape[1])
        strongest = sorted(modes(decay.records, decay.interval, ORDER)[:seen], key=lambda mode: mode.frequency)
        carrier += strongest[which].frequency
    return carrier, pi * carrier / strongest[which].decay


NAMES = (
    ("mode_frequency_lower", "frequency of the lower mode", "Hz"),
    ("mode_frequency_upper", "frequency of the upper mode", "Hz"),
    ("mode_split", "split of the modes", "Hz"),
    ("quality_factor_lower", "quality factor of the lower mode", "1"),
    ("quality_factor_upper", "quality factor of the upper mode", "1"),
)

PROCEDURE = Procedure("Modes by free decay", "12.2", RATE, measure)
