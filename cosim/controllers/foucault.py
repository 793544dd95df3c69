"""The controller of source 000 (eqs. 5-7): an isotropic lossless oscillator with two tones.

force u = K_hat q + D_hat q' - k q + w(t). The feedback part acts through a hold: it is evaluated
half a period ahead, with the force about to be applied, and divided by the gain of the hold.
"""

from math import cos, nan, pi, sin, sqrt
from typing import Final

import numpy as np
from numba import njit

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
from cosim.layout import DXX, DXY, DYY, KXX, KXY, KYY, M
from cosim.propagation import (
    PHI,
    STATE,
    WIDTH,
    WORK_SIZE,
    linearise,
    taylor_order,
    theta_of,
)

SETTINGS: Final = {
    "k": 63.955,
    "tone_amplitude": 32e-6,
    "tone_x": 450.0,
    "tone_y": 500.0,
    "amplitude": 1e-6,
    "update_period": 0.01,
    "agreement": 0.01,
    "energy_loop": 0.0,
    "energy_rate": 20.0,
    "force_limit": 4.0,
    "hold_compensation": 1.0,
    "jump": 0.05,
}

(
    _K,
    _TONE_AMPLITUDE,
    _TONE_X,
    _TONE_Y,
    _AMPLITUDE,
    _UPDATE_PERIOD,
    _AGREEMENT,
    _ENERGY_LOOP,
    _ENERGY_RATE,
    _FORCE_LIMIT,
    _HOLD,
    _JUMP,
) = range(12)

_GAIN: Final = 0  # 2 x 4: feedback force on the state
_MIX: Final = 8  # 2 x 2: force on the tones
_PHASOR: Final = 12  # forced response, 2 tones x 4 states x (sine part, cosine part)
_PREVIOUS: Final = 28  # the seven constants at the last update
_COUNT, _CONVERGED, _CONVERGED_AT, _PERIOD, _MASS, _FORMED = range(35, 41)
_IN_USE: Final = 41  # the seven constants in the gains
_THETA: Final = 48
_WORK: Final = 56
_LINEAR: Final = _WORK + WORK_SIZE  # 8 x 9 system of the forced response
MEMORY_SIZE: Final = _LINEAR + 72


@njit(cache=True)
def _push(memory, settings, estimate, output):  # type: ignore[no-untyped-def]
    """Return the force per velocity [N s/m] that brings the energy back at `energy_rate`."""
    x = estimate[0] - output[FORCED]
    x_dot = estimate[1] - output[FORCED + 1]
    y = estimate[2] - output[FORCED + 2]
    y_dot = estimate[3] - output[FORCED + 3]
    omega_squared = settings[_K] / memory[_MASS]
    wanted = omega_squared * settings[_AMPLITUDE] ** 2
    energy = omega_squared * (x * x + y * y) + x_dot * x_dot + y_dot * y_dot
    return settings[_ENERGY_RATE] * memory[_MASS] * min(max(1.0 - energy / wanted, -1.0), 1.0)


@njit(cache=True)
def _check(memory, settings, t, estimate, deviation):  # type: ignore[no-untyped-def]
    """Set `converged` once the constants agree with those of the last update and are known."""
    agree = memory[_FORMED] > 0.0
    for i in range(7):
        value = estimate[KXX + i]
        tolerance = settings[_AGREEMENT] * abs(value)
        if abs(value - memory[_PREVIOUS + i]) > tolerance or deviation[KXX + i] > tolerance:
            agree = False
        memory[_PREVIOUS + i] = value
    if agree and memory[_CONVERGED] == 0.0:
        memory[_CONVERGED] = 1.0
        memory[_CONVERGED_AT] = t
    memory[_FORMED] = 1.0


@njit(cache=True)
def _transition(memory, theta, duration):  # type: ignore[no-untyped-def]
    """Return phi (4, 4) and the responses (4,) to a unit force along x and y held `duration` s."""
    work = memory[_WORK : _WORK + WORK_SIZE]
    order = taylor_order(theta, duration)
    rest = np.zeros(4)
    linearise(rest, theta, 0.0, 1.0, duration, order, work)
    force_y = np.empty(4)
    force_x = np.empty(4)
    phi = np.empty((4, 4))
    for i in range(4):
        force_y[i] = work[i * WIDTH + STATE]
    linearise(rest, theta, 1.0, 0.0, duration, order, work)
    for i in range(4):
        force_x[i] = work[i * WIDTH + STATE]
        for j in range(4):
            phi[i, j] = work[i * WIDTH + PHI + j]
    return phi, force_x, force_y


@njit(cache=True)
def _forced_response(memory, settings, theta):  # type: ignore[no-untyped-def]
    """Solve the sampled closed loop for its steady response to each tone."""
    phi, force_x, force_y = _transition(memory, theta, memory[_PERIOD])
    for i in range(4):
        for j in range(4):
            phi[i, j] += force_x[i] * memory[_GAIN + j] + force_y[i] * memory[_GAIN + 4 + j]
    for tone in range(2):
        omega = 2.0 * pi * settings[_TONE_X + tone]
        shift = np.exp(1j * omega * memory[_PERIOD])
        lead = np.exp(0.5j * settings[_HOLD] * omega * memory[_PERIOD])
        a = np.zeros((4, 4), dtype=np.complex128)
        b = np.zeros(4, dtype=np.complex128)
        for i in range(4):
            for j in range(4):
                a[i, j] = -phi[i, j]
            a[i, i] += shift
            mix = force_x[i] * memory[_MIX + tone] + force_y[i] * memory[_MIX + 2 + tone]
            b[i] = mix * settings[_TONE_AMPLITUDE] * lead
        response = np.linalg.solve(a, b)
        for i in range(4):
            memory[_PHASOR + 8 * tone + 2 * i] = response[i].real
            memory[_PHASOR + 8 * tone + 2 * i + 1] = response[i].imag


@njit(cache=True)
def _form(memory, settings, estimate):  # type: ignore[no-untyped-def]
    """Form the control signal from the current estimates."""
    theta = memory[_THETA : _THETA + 8]
    theta_of(estimate, theta)
    memory[_IN_USE : _IN_USE + 7] = estimate[KXX : M + 1]
    memory[_MASS] = estimate[M]
    half = 0.5 * memory[_PERIOD] * settings[_HOLD]
    angle = sqrt(settings[_K] / estimate[M]) * half
    boost = 1.0
    if angle > 0.0:
        boost = angle / sin(angle)
    g = np.empty(8)
    g[0] = boost * (estimate[KXX] - settings[_K])
    g[1] = boost * estimate[DXX]
    g[2] = boost * estimate[KXY]
    g[3] = boost * estimate[DXY]
    g[4] = boost * estimate[KXY]
    g[5] = boost * estimate[DXY]
    g[6] = boost * (estimate[KYY] - settings[_K])
    g[7] = boost * estimate[DYY]
    phi, force_x, force_y = _transition(memory, theta, half)
    # u = g (phi s + gamma u) + w: solve for u.
    a = np.eye(2)
    for i in range(2):
        for j in range(4):
            a[i, 0] -= g[4 * i + j] * force_x[j]
            a[i, 1] -= g[4 * i + j] * force_y[j]
    det = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    memory[_MIX] = a[1, 1] / det
    memory[_MIX + 1] = -a[0, 1] / det
    memory[_MIX + 2] = -a[1, 0] / det
    memory[_MIX + 3] = a[0, 0] / det
    for j in range(4):
        f_x = 0.0
        f_y = 0.0
        for i in range(4):
            f_x += g[i] * phi[i, j]
            f_y += g[4 + i] * phi[i, j]
        memory[_GAIN + j] = memory[_MIX] * f_x + memory[_MIX + 1] * f_y
        memory[_GAIN + 4 + j] = memory[_MIX + 2] * f_x + memory[_MIX + 3] * f_y
    _forced_response(memory, settings, theta)


@njit(cache=True)
def _has_jumped(memory, settings, estimate, deviation):  # type: ignore[no-untyped-def]
    """Tell whether a constant has left the one in use by `jump` of it and 3 standard deviations."""
    for i in range(7):
        change = abs(estimate[KXX + i] - memory[_IN_USE + i])
        limit = settings[_JUMP] * abs(memory[_IN_USE + i])
        if change > max(limit, 3.0 * deviation[KXX + i]):
            return True
    return False


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
    elif memory[_COUNT] % max(every // 10, 1) == 0.0 and memory[_CONVERGED] != 0.0:
        if _has_jumped(memory, settings, estimate, deviation):
            _form(memory, settings, estimate)
    memory[_COUNT] += 1.0
    sin_x = sin(2.0 * pi * settings[_TONE_X] * t)
    cos_x = cos(2.0 * pi * settings[_TONE_X] * t)
    sin_y = sin(2.0 * pi * settings[_TONE_Y] * t)
    cos_y = cos(2.0 * pi * settings[_TONE_Y] * t)
    for i in range(4):
        output[FORCED + i] = (
            memory[_PHASOR + 2 * i] * sin_x
            + memory[_PHASOR + 2 * i + 1] * cos_x
            + memory[_PHASOR + 8 + 2 * i] * sin_y
            + memory[_PHASOR + 8 + 2 * i + 1] * cos_y
        )
    feedback_x = 0.0
    feedback_y = 0.0
    for i in range(4):
        feedback_x += memory[_GAIN + i] * estimate[i]
        feedback_y += memory[_GAIN + 4 + i] * estimate[i]
    if settings[_ENERGY_LOOP] != 0.0:
        push = _push(memory, settings, estimate, output)
        feedback_x += push * (estimate[1] - output[FORCED + 1])
        feedback_y += push * (estimate[3] - output[FORCED + 3])
    limit = settings[_FORCE_LIMIT] * settings[_K] * settings[_AMPLITUDE]
    size = sqrt(feedback_x * feedback_x + feedback_y * feedback_y)
    if size > limit:
        feedback_x *= limit / size
        feedback_y *= limit / size
    # The tones are sampled at mid-hold, so that the held staircase has their true phase.
    half = settings[_HOLD] * pi * memory[_PERIOD]
    tone_x = sin_x * cos(half * settings[_TONE_X]) + cos_x * sin(half * settings[_TONE_X])
    tone_y = sin_y * cos(half * settings[_TONE_Y]) + cos_y * sin(half * settings[_TONE_Y])
    tone_x *= settings[_TONE_AMPLITUDE]
    tone_y *= settings[_TONE_AMPLITUDE]
    output[FORCE_X] = feedback_x + memory[_MIX] * tone_x + memory[_MIX + 1] * tone_y
    output[FORCE_Y] = feedback_y + memory[_MIX + 2] * tone_x + memory[_MIX + 3] * tone_y
    output[CONVERGED] = memory[_CONVERGED]
    output[CONVERGED_AT] = memory[_CONVERGED_AT]
    output[OMEGA_SQUARED] = settings[_K] / memory[_MASS]


CONTROLLER: Final = Controller("foucault", MEMORY_SIZE, SETTINGS, _init, _step)
