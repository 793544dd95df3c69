"""The settings of the packaged observer and controller: names, defaults and what they mean, from which the C structures
are written."""

from collections.abc import Mapping
from math import pi
from typing import Final

from gyro_model.errors import InputError

FILTER: Final = {
    "omega_walk_min": 0.3,
    "omega_walk_max": 100.0,
    "omega_walk_rate": 0.5,
    "slope_walk_min": 300.0,
    "slope_walk_max": 1e5,
    "omega_jump": 10.0,
    "surprise": 30.0,
    "surprise_limit": 2.5,
    "surprise_memory": 400.0,
    "settle": 10.0,
    "restart_stiffness": 1e-3,
    "restart_damping": 1.0,
    "restart_limit": 2.5,
    "forget_max": 10.0,
    "forget_rate": 0.5,
    "block": 200.0,
    "start": 16384.0,
}
"""omega_walk_min, _max: limits of the random walk of the rate [rad/s per sqrt(s)]; omega_walk_rate: how fast it adapts
[1 per 64 samples]; slope_walk_min, _max: limits of the random walk of its slope [rad/s2 per sqrt(s)]; omega_jump: size
of a sudden change of the rate [rad/s]; surprise: squared innovation over its variance, both axes, that counts as one;
surprise_limit: so many within surprise_memory [samples] reopen the constants; settle: samples that a surprise may have
taken to show; restart_stiffness, _damping: standard deviation, relative, of reopened k and m, and of reopened d;
restart_limit: so many reopenings within 10 surprise_memory begin anew from the design; forget_max: the fastest at
which constants are forgotten where the data say that they move [1/s]; forget_rate: how fast that adapts [1/block];
block: samples of a block at most; start: samples that are filtered again as the first block doubles, at most 16384."""

FILTER_LIMITS: Final = {"block": (16.0, 200.0), "settle": (0.0, 1000.0), "start": (16.0, 16384.0)}
"""What the arrays of the filter hold [samples]: BLOCK_MAX, a part of START_MAX, START_MAX of filter.h."""

FOUCAULT: Final = {
    "k": 63.955,
    "found_stiffness": 0.0,
    "amplitude": 1e-6,
    "tone_amplitude": 0.0,
    "tone_x": 0.0,
    "tone_y": 0.0,
    "tone2_amplitude": 0.0,
    "tone2_x": 0.0,
    "tone2_y": 0.0,
    "tone_x_ratio": 0.15,
    "tone_y_ratio": 1 / 6,
    "tone2_x_ratio": 0.73,
    "tone2_y_ratio": 1.3,
    "update_period": 0.01,
    "jump": 0.05,
    "turn_limit": 5e-3,
    "trust": 0.02,
    "energy_loop": 0.0,
    "energy_rate": 20.0,
    "quadrature_loop": 1.0,
    "quadrature_rate": 50.0,
    "loop_smoothing": 2e-3,
    "carousel_rate": 0.0,
    "reversal_period": 0.0,
    "reversal_rate": 20.0,
    "force_limit": 20.0,
    "hold_compensation": 1.0,
    "coriolis_compensation": 1.0,
    "first_frequency": 3000.0,
}
"""k: stiffness of the isotropic oscillator [N/m]; found_stiffness: where not zero, so many times the mean of kxx and
kyy in its place, as they are found when they are first known; amplitude: of the pattern [m]; tone_amplitude,
tone2_amplitude: of the tones along either axis [N], at a stiffness of k; tone_x, tone_y, tone2_x, tone2_y: their
frequencies [Hz], where zero the loop's own frequency times the ratio of that name; update_period: between two U_n
[s]; jump: a relative change of a constant that is worth a new U_n at a tenth of the period; turn_limit: an error of
the damping that turns the pattern by no more than this counts as none [rad/s] (half of what 1 % of the reference
device's dxy does); trust: stiffness and mass are cancelled once their standard deviation is below this share;
energy_loop: 1 holds the energy at that of `amplitude`, at energy_rate [1/s]; quadrature_loop: 1 keeps the orbit
straight, at quadrature_rate [1/s]; loop_smoothing: time constant of what both act on [s]; carousel_rate: turns the
pattern electronically [rad/s]; reversal_period: time from one reversal of the modes to the next, none where zero
[s]; reversal_rate: at which the pattern then turns by a right angle, in the mean [rad/s]; force_limit: largest
feedback over k times amplitude; hold_compensation, coriolis_compensation: 0 leaves them out; first_frequency: of the
oscillator by the nominal mass [Hz]."""

FOUCAULT_LIMITS: Final = {"reversal_period": (0.0, 1e5), "reversal_rate": (1e-3, 1e3)}


def check_reversal(settings: Mapping[str, float]) -> None:
    """Raises InputError where a reversal takes longer than the time to the next."""
    period, rate = settings["reversal_period"], settings["reversal_rate"]
    if 0 < period < 0.5 * pi / rate:
        raise InputError(
            f"foucault: setting reversal_period = {period:g} s is shorter than a right angle takes at reversal_rate = "
            f"{rate:g} rad/s: give {0.5 * pi / rate:.3g} s or more, or a higher rate"
        )


STRUCTURES: Final = {"filter_settings": FILTER, "foucault_settings": FOUCAULT}


def settings_header(structures: Mapping[str, Mapping[str, float]] = STRUCTURES) -> str:
    """The C header ``settings.h``: a structure of doubles for each table, in its order."""
    lines = ["/* Written by cosim/core/settings.py. */", "#ifndef SETTINGS_H", "#define SETTINGS_H"]
    for name, entries in structures.items():
        lines += ["typedef struct {", *(f"    double {entry};" for entry in entries), f"}} {name};"]
    return "\n".join([*lines, "#endif", ""])
