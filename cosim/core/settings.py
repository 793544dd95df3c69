"""The settings of the packaged observer and controller: names, defaults, what they can be and what they mean. The C
structures are written from them."""

from collections.abc import Mapping
from math import inf, pi
from typing import Final

from cosim.setting import Setting, Table, switch
from gyro_model.errors import InputError

_MEMORY: Final = "what the memory of the filter is made for"
_SHARE_A_BLOCK: Final = "it is the exponent of a growth"

FILTER: Final[Table] = {
    "omega_walk_min": Setting(0.3, 0.0, 1e4, "rad/s/√s"),
    "omega_walk_max": Setting(100.0, 0.0, 1e4, "rad/s/√s"),
    "omega_walk_rate": Setting(0.5, 0.0, 10.0, why=_SHARE_A_BLOCK),
    "slope_walk_min": Setting(300.0, 0.0, 1e9, "rad/s²/√s"),
    "slope_walk_max": Setting(1e5, 0.0, 1e9, "rad/s²/√s"),
    "omega_jump": Setting(10.0, 0.0, 1e4, "rad/s"),
    "surprise": Setting(30.0, 0.0, why="it is a square"),
    "surprise_limit": Setting(2.5, 0.0, why="it is a number of surprises"),
    "surprise_memory": Setting(400.0, 1.0, 1e9, "samples", why="a memory of less than a sample is none"),
    "settle": Setting(10.0, 0.0, 1000.0, "samples", why=_MEMORY),
    "restart_stiffness": Setting(1e-3, 0.0, 10.0),
    "restart_damping": Setting(1.0, 0.0, 100.0),
    "restart_limit": Setting(2.5, 0.0, why="it is a number of restarts"),
    "forget_max": Setting(10.0, 0.0, 1e4, "1/s"),
    "forget_rate": Setting(0.5, 0.0, 10.0, why=_SHARE_A_BLOCK),
    "block": Setting(200.0, 16.0, 200.0, "samples", why=_MEMORY),
    "start": Setting(16384.0, 16.0, 16384.0, "samples", why=_MEMORY),
}
"""omega_walk_min, _max: limits of the random walk of the rate [rad/s per sqrt(s)]; omega_walk_rate: how fast it adapts
[1 per 64 samples]; slope_walk_min, _max: limits of the random walk of its slope [rad/s2 per sqrt(s)]; omega_jump: size
of a sudden change of the rate [rad/s]; surprise: squared innovation over its variance, both axes, that counts as one;
surprise_limit: so many within surprise_memory [samples] reopen the constants; settle: samples that a surprise may have
taken to show; restart_stiffness, _damping: standard deviation, relative, of reopened k and m, and of reopened d;
restart_limit: so many reopenings within 10 surprise_memory begin anew from the design; forget_max: the fastest at
which constants are forgotten where the data say that they move [1/s]; forget_rate: how fast that adapts [1/block];
block: samples of a block at most; start: samples that are filtered again as the first block doubles, at most 16384."""


def check_filter(settings: Mapping[str, float]) -> None:
    """Raises InputError where the least of a walk is above its most."""
    for walk in ("omega_walk", "slope_walk"):
        least, most = settings[f"{walk}_min"], settings[f"{walk}_max"]
        if least > most:
            raise InputError(
                f"ekf: setting {walk}_min = {least:g} is above {walk}_max = {most:g}: give a lower {walk}_min"
            )


_PUSH: Final = "a negative one drives what it should hold away, a faster one is late by `loop_smoothing`"
_TONE: Final = Setting(0.0, 0.0, 1.0, "N", why="the sign of a tone is its phase, which no one sees")
_HERTZ: Final = Setting(0.0, 0.1, 5e6, "Hz", zero=True)

FOUCAULT: Final[Table] = {
    "k": Setting(63.955, 1e-9, 1e9, "N/m", why="an oscillator has a spring"),
    "found_stiffness": Setting(0.0, 0.1, 10.0, zero=True, why="the force has to make up for what the device lacks"),
    "amplitude": Setting(1e-6, 1e-12, 1e-2, "m", why="the pattern is what shows the angle"),
    "tone_amplitude": _TONE,
    "tone_x": _HERTZ,
    "tone_y": _HERTZ,
    "tone2_amplitude": _TONE,
    "tone2_x": _HERTZ,
    "tone2_y": _HERTZ,
    "tone_x_ratio": Setting(0.15, 1e-3, 10.0),
    "tone_y_ratio": Setting(1 / 6, 1e-3, 10.0),
    "tone2_x_ratio": Setting(0.73, 1e-3, 10.0),
    "tone2_y_ratio": Setting(1.3, 1e-3, 10.0),
    "update_period": Setting(0.01, 0.0, 1.0, "s"),
    "jump": Setting(0.05, 0.0, 10.0),
    "turn_limit": Setting(5e-3, 0.0, 1.0, "rad/s"),
    "trust": Setting(0.02, 1e-6, 0.5, why="what is cancelled has to be known"),
    "energy_loop": switch(0.0),
    "energy_rate": Setting(20.0, 0.0, 2000.0, "1/s", why=_PUSH),
    "quadrature_loop": switch(1.0),
    "quadrature_rate": Setting(50.0, 0.0, 2000.0, "1/s", why=_PUSH),
    "loop_smoothing": Setting(2e-3, 0.0, 0.1, "s"),
    "carousel_rate": Setting(0.0, -1e4, 1e4, "rad/s"),
    "reversal_period": Setting(0.0, 1e-4, 1e5, "s", zero=True),
    "reversal_rate": Setting(20.0, 1e-3, 1e3, "rad/s"),
    "force_limit": Setting(20.0, 0.01, 1e6, why="without a force nothing is cancelled"),
    "hold_compensation": switch(1.0),
    "coriolis_compensation": switch(1.0),
    "first_frequency": Setting(3000.0, 1.0, 5e6, "Hz"),
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


TONES: Final = {"tone_x": "tone", "tone_y": "tone", "tone2_x": "tone2", "tone2_y": "tone2"}
"""The tones, and the pair that each is one of."""
NEAR: Final = 0.08
"""How far from the loop's own frequency a tone has to be, relative. What comes of its beginning beats with it for long,
the oscillator having no losses, and looks like the pattern: on the reference device under `constant` the drift was 0.6
of what is told at 0.1 beside it, 1.7 at 0.08, 3.4 at 0.05, 5.6 at 0.033 and 70 at none."""
TURNING: Final = 0.01
"""Fastest electronic turn over the oscillation's angular frequency. It is formed to first order in the rate: on the
reference device 150 rad/s left up to 0.32 deg/s of drift, 370 rad/s 0.45, 600 rad/s 0.68 and 1000 rad/s 1.4 deg/s, and
3000 rad/s no pattern."""


def check_foucault(settings: Mapping[str, float], sample_rate: float = inf) -> None:
    """Raises InputError where settings can't be together, or not at ``sample_rate`` [Hz]."""
    _check_reversal(settings)
    _check_tones(settings, sample_rate)
    rate, first = settings["carousel_rate"], settings["first_frequency"]
    most = TURNING * 2 * pi * first
    if abs(rate) > most:
        raise InputError(
            f"foucault: setting carousel_rate = {rate:g} rad/s is too fast for an oscillation of {first:.4g} Hz: give "
            f"a size of {most:.3g} rad/s or less"
        )


def _check_reversal(settings: Mapping[str, float]) -> None:
    """A reversal must not take longer than the time to the next."""
    period, rate = settings["reversal_period"], settings["reversal_rate"]
    if 0 < period < 0.5 * pi / rate:
        raise InputError(
            f"foucault: setting reversal_period = {period:g} s is shorter than a right angle takes at reversal_rate = "
            f"{rate:g} rad/s: give {0.5 * pi / rate:.3g} s or more, or a higher rate"
        )


def _check_tones(settings: Mapping[str, float], sample_rate: float) -> None:
    """A tone has to be below half the sample rate, and beside the loop's own frequency."""
    for name, pair in TONES.items():
        told, ratio, first = settings[name], settings[f"{name}_ratio"], settings["first_frequency"]
        if not settings[f"{pair}_amplitude"]:
            continue
        if (told or ratio * first) >= 0.5 * sample_rate:
            most = 0.5 * sample_rate
            what = f"{name} = {told:g}" if told else f"{name}_ratio = {ratio:g}"
            less = f"{most:g} Hz" if told else f"{most / first:.3g}"
            raise InputError(
                f"foucault: setting {what}: samples at {sample_rate:g} Hz show no tone at half their rate and above; "
                f"give less than {less}, or a higher sample rate"
            )
        if not told and abs(ratio - 1) < NEAR:
            raise InputError(
                f"foucault: setting {name}_ratio = {ratio:g}: a tone so near the loop's own frequency can't be told "
                f"from the pattern; give {1 - NEAR:g} or less, or {1 + NEAR:g} or more"
            )


STRUCTURES: Final[Mapping[str, Table]] = {"filter_settings": FILTER, "foucault_settings": FOUCAULT}


def settings_header(structures: Mapping[str, Table] = STRUCTURES) -> str:
    """The C header ``settings.h``: a structure of doubles for each table, in its order."""
    lines = ["/* Written by cosim/core/settings.py. */", "#ifndef SETTINGS_H", "#define SETTINGS_H"]
    for name, entries in structures.items():
        lines += ["typedef struct {", *(f"    double {entry};" for entry in entries), f"}} {name};"]
    return "\n".join([*lines, "#endif", ""])
