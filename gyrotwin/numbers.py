"""How numbers of a result are written, in the terminal and in the report."""

import re
from math import floor, isfinite, isnan, log10

MISSING = "–"
_POWERS = str.maketrans("23456789", "²³⁴⁵⁶⁷⁸⁹")


def significant(value: float | None, digits: int = 3) -> str:
    """Return `value` with so many significant digits, a dash for None or NaN; whole up to five places, never -0."""
    if value is None or isnan(value):
        return MISSING
    text = f"{value + 0.0:.{digits}g}"
    return f"{float(text):.0f}" if "e+0" in text and abs(value) < 1e5 else text


def uncertain(value: float, low: float, high: float) -> str:
    """Return `value` ± the wider half of its 95 % interval, with so many digits that the half-width shows two."""
    half = max(high - value, value - low)
    if not (isfinite(half) and half > 0):
        return significant(value, 5)
    digits = 2 + (floor(log10(abs(value))) - floor(log10(half)) if value else 0)
    shown = f"{value:#.{min(max(digits, 2), 12)}g}".rstrip(".").replace(".e", "e")
    return f"{shown} ± {half:.2g}"


def with_error(value: float | None, error: float | None) -> str:
    """Return `value` ± standard error, with so many digits that the error shows two."""
    if value is None:
        return MISSING
    if error is None or not (isfinite(error) and error > 0):
        return significant(value, 5)
    digits = 2 + (floor(log10(abs(value))) - floor(log10(error)) if value else 0)
    if digits < 2:
        # No finer than its error.
        return f"{round(value, 1 - floor(log10(error))) + 0.0:.{max(1 - floor(log10(error)), 0)}f} ± {error:.2g}"
    shown = f"{value:#.{min(max(digits, 2), 10)}g}".rstrip(".")
    return f"{shown} ± {error:.2g}"


def unit(text: str) -> str:
    """Return a unit such as N.s/m3 or 1/s0.5 as it is printed: N·s/m³, 1/√s."""
    rooted = re.sub(r"([A-Za-z]+)0\.5", r"√\1", text)
    return re.sub(r"(?<=[A-Za-z])[2-9]", lambda power: power[0].translate(_POWERS), rooted).replace(".", "·")


def in_unit(number: str, name: str) -> str:
    """Return a number with its unit as ``unit`` prints it; one without dimension, whose unit is 1, alone."""
    return number if name == "1" else f"{number} {unit(name)}"


def hertz(value: float) -> str:
    """Return a frequency [Hz] in Hz, or in kHz from 10 kHz on."""
    return f"{value / 1e3:.4g} kHz" if value >= 1e4 else f"{value:.0f} Hz" if value >= 100 else f"{value:.3g} Hz"


def relative(value: float | None) -> str:
    """Return a relative value with its sign: in percent, or in ppm below 0.01 %."""
    if value is None:
        return MISSING
    return f"{100 * value:+.2g} %" if abs(value) >= 1e-4 else f"{1e6 * value:+.2g} ppm"


def milliseconds(value: float | None) -> str:
    """Return a time [s] in ms."""
    return _fixed(value, 1e3, 1, " ms")


def microseconds(value: float | None) -> str:
    """Return a time [s] in whole µs."""
    return _fixed(value, 1e6, 0, " µs")


def degrees(value: float | None, unit: str = "°") -> str:
    """Return an angle, or its rate, in degrees with three decimals."""
    return _fixed(value, 1.0, 3, unit)


def _fixed(value: float | None, scale: float, decimals: int, unit: str) -> str:
    if value is None:
        return MISSING
    # Adding zero turns the -0.0 of a small negative number into 0.0.
    return f"{round(scale * value, decimals) + 0.0:.{decimals}f}{unit}"
