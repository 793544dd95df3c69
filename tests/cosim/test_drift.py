"""How far a wrong constant turns the pattern: the formula against the closed loop, simulated slowly."""

import ctypes
from functools import cache

import numpy as np
import pytest
from plant import MEASURED, PERIOD, REFERENCE, K, begin, device_with, sampled, told

from cosim.core.library import CONTROL_NAMES, library, pointer
from cosim.running import known_values

EFFECTS = {"actuator_delay": 1e-12, "actuator_misalignment": 1e-9}
WRONG = {"dxy": 3.6e-8, "actuator_delay": 20e-9, "actuator_misalignment": 3e-5}
"""By how much the device has more of it than the loop takes it for: 10 % of dxy; 20 ns; 30 ppm."""
COUNT = 4000
TURNED = CONTROL_NAMES.index("turned")


def harmonics(name):
    """Turning of a straight pattern [rad/s]: constant, cos 2 phi, sin 2 phi."""
    design = told(device_with(), EFFECTS)
    lib = library(design.known_model)
    taken = np.array([design.values[key] for key in lib.known.value_names])
    values = taken.copy()
    values[lib.known.value_names.index(name)] += WRONG[name]
    rate, bend = np.zeros(3), np.zeros(3)
    arrays = (known_values(design, lib, PERIOD), values, taken, MEASURED)
    lib.call.core_drift_of(*map(pointer, arrays), ctypes.c_double(K), pointer(rate), pointer(bend))
    return rate


def predicted(name, phi):
    """Turning of a straight pattern along ``phi`` [rad/s]."""
    return harmonics(name) @ [1.0, np.cos(2 * phi), np.sin(2 * phi)]


def orientations(name, phi, count=COUNT, **changes):
    """Where the pattern of the loop on the device as it is, told every state, stands beyond what the controller turns
    it by [rad], at ``count`` samples."""
    parameters = REFERENCE.copy()
    mixed, delay = 0.0, 0.0
    if name == "dxy":
        parameters[5] += WRONG[name]
    elif name == "actuator_delay":
        delay = WRONG[name]
    elif name is not None:
        mixed = WRONG[name]
    moved = cache(lambda duration: sampled(parameters, 0.0, duration))
    loop = begin(told(device_with()), tone_amplitude=0.0, quadrature_rate=500.0, **changes)
    estimate, deviation = np.zeros(12), np.zeros(12)
    estimate[5:] = REFERENCE
    state = 1e-6 * np.array([np.cos(phi), 0.0, np.sin(phi), 0.0])
    before, angles, turned = np.zeros(2), np.zeros(count), np.zeros(count)
    for k in range(count):
        estimate[:4] = state
        x, x_dot, y, y_dot = state
        omega_squared = K / REFERENCE[6]
        cross = 2 * (omega_squared * x * y + x_dot * y_dot)
        angles[k] = 0.5 * np.arctan2(cross, omega_squared * (x * x - y * y) + x_dot**2 - y_dot**2)
        u = loop.control(k, estimate, deviation)
        turned[k] = loop.output[TURNED]
        force = u + mixed * u[::-1]
        for duration, acting in ((delay, before), (PERIOD - delay, force)):
            if duration > 0:
                part, push = moved(duration)
                state = part @ state + push @ acting
        before = force
    return np.unwrap(angles, period=np.pi) - turned


def simulated(name, phi):
    """The turning of the loop on the device as it is [rad/s]."""
    return np.polyfit(np.arange(COUNT) * PERIOD, orientations(name, phi), 1)[0]


@pytest.mark.parametrize("phi", [0.0, np.pi / 4, 2.0])
@pytest.mark.parametrize("name", WRONG)
def test_drift_is_that_of_the_closed_loop(name, phi, residual):
    found, expected = simulated(name, phi), predicted(name, phi)
    # The formula holds for a straight pattern where it is. The quadrature loop keeps it straight to 1 %, over 20 ms
    # it turns
    # by up to 1.3 deg (20 ns), which moves the rate by twice that angle, and 5 % more at the delay's own square. A
    # misalignment also splits the two frequencies: what it bends times that split goes with its square, a tenth at 30
    # ppm.
    # 0.002 deg/s is the ripple at 6 kHz in the fit.
    largest = max(abs(predicted(name, angle)) for angle in np.linspace(0, np.pi, 12))
    limit = np.rad2deg(0.2 * largest) + 0.002
    residual(f"{name} at {phi:.2f} [deg/s]", np.rad2deg(abs(found - expected)), limit)
    # Of a size that the comparison sees.
    assert np.rad2deg(largest) > 2 * limit


@pytest.mark.parametrize("name", ["dxy", "actuator_delay"])
def test_reversal_of_the_modes_leaves_the_bias_that_goes_with_no_angle(name, residual):
    # Four reversals are the whole of what cancels; before and after them the pattern rests for 2000 samples alike.
    every, rest = 4000, 2000
    settings = {"reversal_period": every * PERIOD, "reversal_rate": 200.0}

    def drift(which):
        stands = orientations(which, 0.0, 4 * every + rest, **settings)
        return (stands[-rest:].mean() - stands[:rest].mean()) / (4 * every * PERIOD)

    # Of these errors the formula has no constant part: all goes with 2 phi.
    assert harmonics(name)[0] == 0.0
    alone = drift(None)
    # The gains take the rate of the turn to first order: (200/omega)^2 = 1e-4 of a turn would be 0.02 rad/s, and what
    # is wrong one way comes back on the other.
    residual("turning by the reversal itself [rad/s]", abs(alone), 1e-3)
    # The delay's own square, which goes with no angle.
    residual(f"{name}, of the bias without", abs((drift(name) - alone) / predicted(name, 0.0)), 0.005)
