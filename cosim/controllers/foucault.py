"""The controller of source 000 (eqs. 5-7): an isotropic lossless oscillator and two tones.

force u = K q + D q' - k q + w(t) from the current estimates, w a sine along either axis. The free
part of the motion then turns like a Foucault pendulum. Beside the source: the hold is undone
(cosim.controllers.hold), the Coriolis force on the forced motion is cancelled, without which every
change of omega_z would kick the pattern, and an optional loop holds the energy of the pattern.
"""

from math import cos, nan, pi, sin, sqrt
from typing import Final

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.controllers.hold import HOLD_SIZE, feedback, forced_response
from cosim.controllers.record import (
    CONVERGED,
    CONVERGED_AT,
    FORCE_X,
    FORCE_Y,
    FORCED,
    INIT_SIGNATURE,
    OMEGA_SQUARED,
    STEP_SIGNATURE,
    Controller,
)
from cosim.layout import KXX, OMEGA_Z, M

Array = npt.NDArray[np.float64]

SETTINGS: Final = {
    "k": 63.955,
    "tone_amplitude": 32e-6,
    "tone_x": 450.0,
    "tone_y": 500.0,
    "amplitude": 1e-6,
    "update_period": 0.01,
    "agreement": 0.01,
    "jump": 0.05,
    "turn_limit": 5e-3,
    "energy_loop": 0.0,
    "energy_rate": 20.0,
    "force_limit": 4.0,
    "hold_compensation": 1.0,
    "coriolis_compensation": 1.0,
}
"""What the controller can be told.

k: stiffness of the isotropic oscillator [N/m]; tone_amplitude [N], tone_x, tone_y [Hz]: the tones;
amplitude: of the pattern [m]; update_period: between two U_n [s]; agreement: largest relative
change of a constant from U_n to U_n+1, and its largest relative standard deviation, at which the
estimates count as converged; jump: once converged, a relative change of a constant that is worth
a new U_n at a tenth of the period; turn_limit: an error of the damping that turns the pattern by no
more than this [rad/s] counts as none (5e-3 rad/s is half of what 1 % of the reference device's dxy
does); energy_loop: 1 holds the energy at that of `amplitude`;
energy_rate: its rate [1/s]; force_limit: largest feedback force over k * amplitude;
hold_compensation, coriolis_compensation: 0 leaves them out.
"""

(
    _K,
    _TONE_AMPLITUDE,
    _TONE_X,
    _TONE_Y,
    _AMPLITUDE,
    _UPDATE_PERIOD,
    _AGREEMENT,
    _JUMP,
    _TURN_LIMIT,
    _ENERGY_LOOP,
    _ENERGY_RATE,
    _FORCE_LIMIT,
    _HOLD,
    _CORIOLIS,
) = range(14)

_CROSS: Final = 0.1

_GAIN: Final = 0  # 2 x 4: force on the state
_MIX: Final = 8  # 2 x 2: force on what is added to the feedback
_PHASOR: Final = 12  # forced response: 2 tones x 4 states x (sine part, cosine part)
_PREVIOUS: Final = 28  # the seven constants at the last check
_IN_USE: Final = 35  # the seven constants in the gains
_BY_OMEGA: Final = 42  # 2 x 4: change of _GAIN with omega_z
_COUNT, _CONVERGED, _CONVERGED_AT, _PERIOD, _CHECKED = range(50, 55)
_SCRATCH: Final = 55
MEMORY_SIZE: Final = _SCRATCH + HOLD_SIZE


@njit(cache=True)
def _tolerance(settings: Array, estimate: Array, i: int, share: float) -> float:
    """Return the change of constant i that `share` of it stands for.

    A cross term may be zero: it counts as no smaller than a tenth of its geometric mean. An error of
    dxy turns the pattern by dxy/(2 m) at most, one of dxx or dyy by half of that: at a high Q a
    share of the damping would ask for more than the record can tell, and than the angle needs.
    """
    size = abs(estimate[KXX + i])
    if i == 2 or i == 5:
        size = max(size, _CROSS * sqrt(abs(estimate[KXX + i - 2] * estimate[KXX + i - 1])))
    tolerance = share * size
    if 3 <= i <= 5:
        turning_mass = (2.0 if i == 5 else 4.0) * abs(estimate[M])
        tolerance = max(tolerance, turning_mass * settings[_TURN_LIMIT])
    return tolerance


@njit(cache=True)
def _check(memory: Array, settings: Array, t: float, estimate: Array, deviation: Array) -> None:
    """Set `converged` once the constants agree with those of the last update and are known."""
    agree = memory[_CHECKED] != 0.0
    for i in range(7):
        value = estimate[KXX + i]
        tolerance = _tolerance(settings, estimate, i, settings[_AGREEMENT])
        change = abs(value - memory[_PREVIOUS + i])
        if not (change <= tolerance and deviation[KXX + i] <= tolerance):
            agree = False
        memory[_PREVIOUS + i] = value
    memory[_CHECKED] = 1.0
    if agree and memory[_CONVERGED] == 0.0:
        memory[_CONVERGED] = 1.0
        memory[_CONVERGED_AT] = t


@njit(cache=True)
def _has_jumped(memory: Array, settings: Array, estimate: Array, deviation: Array) -> bool:
    """Tell whether a constant has left the one in use by `jump` of it and 3 standard deviations."""
    for i in range(7):
        change = abs(estimate[KXX + i] - memory[_IN_USE + i])
        limit = _tolerance(settings, memory[_IN_USE - KXX :], i, settings[_JUMP])
        if change > max(limit, 3.0 * deviation[KXX + i]):
            return True
    return False


@njit(cache=True)
def _form(memory: Array, settings: Array, estimate: Array) -> None:
    """Form the control signal U_n from the current estimates."""
    # A positive mass and stiffness are all the formulas need; until then keep the last signal.
    if not (estimate[M] > 0.0):
        return
    for i in range(7):
        memory[_IN_USE + i] = estimate[KXX + i]
    gain = memory[_GAIN:_MIX]
    mix = memory[_MIX:_PHASOR]
    scratch = memory[_SCRATCH:]
    period = memory[_PERIOD]
    compensate = settings[_HOLD] != 0.0
    # The gain for omega_z = 0 and its slope: omega_z changes faster than U_n.
    by_omega = memory[_BY_OMEGA:_COUNT]
    probe = 1e-3 * sqrt(settings[_K] / estimate[M])
    feedback(estimate, probe, settings[_K], period, compensate, by_omega, mix, scratch)
    feedback(estimate, 0.0, settings[_K], period, compensate, gain, mix, scratch)
    for i in range(8):
        by_omega[i] = (by_omega[i] - gain[i]) / probe
    lead = 0.5 * period if compensate else 0.0
    for tone in range(2):
        phasor = memory[_PHASOR + 8 * tone : _PHASOR + 8 * tone + 8]
        forced_response(
            settings[_TONE_X + tone],
            tone,
            settings[_TONE_AMPLITUDE],
            period,
            lead,
            gain,
            mix,
            phasor,
            scratch,
        )


@njit(cache=True)
def _push(memory: Array, settings: Array, estimate: Array, output: Array) -> float:
    """Return the force per velocity [N s/m] that brings the energy back at `energy_rate`."""
    x = estimate[0] - output[FORCED]
    x_dot = estimate[1] - output[FORCED + 1]
    y = estimate[2] - output[FORCED + 2]
    y_dot = estimate[3] - output[FORCED + 3]
    mass = memory[_IN_USE + 6]
    omega_squared = settings[_K] / mass
    wanted = omega_squared * settings[_AMPLITUDE] ** 2
    energy = omega_squared * (x * x + y * y) + x_dot * x_dot + y_dot * y_dot
    return settings[_ENERGY_RATE] * mass * min(max(1.0 - energy / wanted, -1.0), 1.0)


@njit(INIT_SIGNATURE, cache=True)
def _init(memory, settings, period):  # type: ignore[no-untyped-def]
    memory[:] = 0.0
    memory[_PERIOD] = period
    memory[_CONVERGED_AT] = nan


@njit(STEP_SIGNATURE, cache=True)
def _step(memory, settings, t, estimate, deviation, output):  # type: ignore[no-untyped-def]
    every = max(round(settings[_UPDATE_PERIOD] / memory[_PERIOD]), 1)
    if memory[_COUNT] % every == 0.0:
        _check(memory, settings, t, estimate, deviation)
        _form(memory, settings, estimate)
    elif (
        memory[_CONVERGED] != 0.0
        and memory[_COUNT] % max(every // 10, 1) == 0.0
        and _has_jumped(memory, settings, estimate, deviation)
    ):
        _form(memory, settings, estimate)
    memory[_COUNT] += 1.0
    mass = memory[_IN_USE + 6]
    omega_z = estimate[OMEGA_Z]
    half = pi * memory[_PERIOD] if settings[_HOLD] != 0.0 else 0.0
    output[FORCED : FORCED + 4] = 0.0
    added_x = 0.0
    added_y = 0.0
    for tone in range(2):
        frequency = settings[_TONE_X + tone]
        sine = sin(2.0 * pi * frequency * t)
        cosine = cos(2.0 * pi * frequency * t)
        for i in range(4):
            part = _PHASOR + 8 * tone + 2 * i
            output[FORCED + i] += memory[part] * sine + memory[part + 1] * cosine
        # The tones are taken at mid-hold, so that the held staircase has their true phase.
        w = sine * cos(half * frequency) + cosine * sin(half * frequency)
        if tone == 0:
            added_x = settings[_TONE_AMPLITUDE] * w
        else:
            added_y = settings[_TONE_AMPLITUDE] * w
    if settings[_CORIOLIS] != 0.0:
        coriolis = 2.0 * mass * omega_z
        added_x -= coriolis * output[FORCED + 3]
        added_y += coriolis * output[FORCED + 1]
    feedback_x = 0.0
    feedback_y = 0.0
    for i in range(4):
        gain_x = memory[_GAIN + i] + omega_z * memory[_BY_OMEGA + i]
        gain_y = memory[_GAIN + 4 + i] + omega_z * memory[_BY_OMEGA + 4 + i]
        feedback_x += gain_x * estimate[i]
        feedback_y += gain_y * estimate[i]
    if settings[_ENERGY_LOOP] != 0.0:
        push = _push(memory, settings, estimate, output)
        feedback_x += push * (estimate[1] - output[FORCED + 1])
        feedback_y += push * (estimate[3] - output[FORCED + 3])
    # Wrong first estimates must not drive the device away.
    limit = settings[_FORCE_LIMIT] * settings[_K] * settings[_AMPLITUDE]
    size = sqrt(feedback_x * feedback_x + feedback_y * feedback_y)
    if size > limit:
        feedback_x *= limit / size
        feedback_y *= limit / size
    output[FORCE_X] = feedback_x + memory[_MIX] * added_x + memory[_MIX + 1] * added_y
    output[FORCE_Y] = feedback_y + memory[_MIX + 2] * added_x + memory[_MIX + 3] * added_y
    output[CONVERGED] = memory[_CONVERGED]
    output[CONVERGED_AT] = memory[_CONVERGED_AT]
    output[OMEGA_SQUARED] = settings[_K] / mass


CONTROLLER: Final = Controller("foucault", MEMORY_SIZE, SETTINGS, _init, _step)
