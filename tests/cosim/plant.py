"""What the tests of the loop share: the reference device by the matrix exponential, designs that are told the truth,
and
a step-by-step loop of the packaged parts."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from cosim.controllers.foucault import CONTROLLER
from cosim.controllers.record import CoreController
from cosim.core.library import CONTROL_NAMES, Library
from cosim.design import Design, load_design
from cosim.layout import PARAMETER_NAMES
from cosim.observers.ekf import OBSERVER
from cosim.observers.record import CoreObserver
from cosim.running import Part, begin_controller, begin_observer, control, observe
from gyro_model.device import Device, load_device

REFERENCE = np.array([63.955, 95.92, 12.779, 1.8e-6, 1.8e-6, 3.6e-7, 1.8e-7])
"""kxx, kyy, kxy, dxx, dyy, dxy, m of the reference device."""
PERIOD = 5e-6
NOISE = 20e-6
GAIN = 1e6
K = 63.955
"""Stiffness of the isotropic oscillator [N/m]."""
TONES = {"tone_amplitude": 32e-6, "tone_x": 450.0, "tone_y": 500.0}
MEASURED = np.array([298.15, 0.0, 0.0, 0.0, 298.15, 298.15])
"""What the loop measures where nothing is said: temperature, a_x, a_y, v_bias, temperatures of structure and
circuit."""


def matrix(parameters, omega_z):
    """Return A and B of [x, x', y, y']' = A s + B u."""
    kxx, kyy, kxy, dxx, dyy, dxy, m = parameters
    a = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-kxx / m, -dxx / m, -kxy / m, 2.0 * omega_z - dxy / m],
            [0.0, 0.0, 0.0, 1.0],
            [-kxy / m, -2.0 * omega_z - dxy / m, -kyy / m, -dyy / m],
        ]
    )
    b = np.array([[0.0, 0.0], [1.0 / m, 0.0], [0.0, 0.0], [0.0, 1.0 / m]])
    return a, b


def sampled(parameters, omega_z, period=PERIOD):
    """Return phi (4, 4) and gamma (4, 2) over one held period."""
    a, b = matrix(parameters, omega_z)
    block = np.zeros((6, 6))
    block[:4, :4] = a
    block[:4, 4:] = b
    result = expm(block * period)
    return result[:4, :4], result[:4, 4:]


def device_with(**changes: float) -> Device:
    """The reference device with 1 um at the start and some parameters changed."""
    return load_device("reference").with_parameters({"x_start": 1e-6, **changes})


def told(device: Device, deviations: dict[str, float] | None = None, **changes) -> Design:
    """A design that is told the truth of ``device``: everything known, the seven within 1 % and what ``deviations``
    says besides."""
    drawn = load_design("plain", device, 1)
    values = {name: value for name, value in device.all_parameters.items() if name not in ("seed", "internal_step")}
    sure = {name: 0.01 * abs(device.all_parameters[name]) for name in PARAMETER_NAMES}
    made = replace(drawn, values=values, deviations=sure | (deviations or {}), controller={"k": K, **TONES})
    return replace(made, **changes)


class Loop(NamedTuple):
    """Observer and controller side by side, ready for the first sample."""

    lib: Library
    observer: Part
    controller: Part
    estimate: np.ndarray
    deviation: np.ndarray
    output: np.ndarray

    def observe(self, u, v, inputs=MEASURED) -> None:
        """One step of the observer, into ``estimate`` and ``deviation``."""
        u, v = np.ascontiguousarray(u, dtype=float), np.ascontiguousarray(v, dtype=float)
        observe(self.observer, u, v, inputs, self.estimate, self.deviation)

    def control(self, k, estimate=None, deviation=None, inputs=MEASURED):
        """One step of the controller at sample ``k``; gives the command."""
        estimate = self.estimate if estimate is None else estimate
        deviation = self.deviation if deviation is None else deviation
        control(self.controller, k * PERIOD, estimate, deviation, inputs, self.output)
        return self.output[:2].copy()


def begin(
    design: Design,
    observer: CoreObserver = OBSERVER,
    controller: CoreController = CONTROLLER,
    settings: dict[str, float] | None = None,
    **changes: float,
) -> Loop:
    """The parts of a loop under ``design``; ``settings`` of the observer, ``changes`` of the controller."""
    lib, part = begin_observer(observer, design, PERIOD, settings or {})
    told = {"k": design.stiffness, "amplitude": design.amplitude, "first_frequency": design.oscillation_hz}
    told |= {name: value for name, value in design.controller.items() if name in controller.settings}
    steers = begin_controller(controller, design, lib, PERIOD, told | changes)
    size = len(lib.estimate_names)
    return Loop(lib, part, steers, np.zeros(size), np.zeros(size), np.zeros(len(CONTROL_NAMES)))


class Course(NamedTuple):
    """What a loop did: estimates and deviations (n, size), commands (n, 2), samples (n, 2), true states (n, 4)."""

    estimates: np.ndarray
    deviations: np.ndarray
    commands: np.ndarray
    samples: np.ndarray
    states: np.ndarray


def close_loop(loop: Loop, omega_z, seed, scale_damping=None) -> Course:
    """Close the loop round the reference device with white noise.

    omega_z f8[n] takes few values; scale_damping = (sample, factor) changes all damping there.
    """
    n, size = len(omega_z), len(loop.estimate)
    noise = NOISE * np.random.default_rng(seed + 1000).standard_normal((n, 2))
    course = Course(np.zeros((n, size)), np.zeros((n, size)), np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 4)))
    plants = {}
    state, u = np.array([1e-6, 0.0, 0.0, 0.0]), np.zeros(2)
    for k in range(n):
        factor = scale_damping[1] if scale_damping is not None and k >= scale_damping[0] else 1.0
        v = GAIN * state[::2] + noise[k]
        loop.observe(u, v)
        u = loop.control(k)
        course.states[k], course.samples[k], course.commands[k] = state, v, u
        course.estimates[k], course.deviations[k] = loop.estimate, loop.deviation
        key = (omega_z[k], factor)
        if key not in plants:
            plants[key] = sampled(REFERENCE * [1, 1, 1, factor, factor, factor, 1], omega_z[k])
        phi, gamma = plants[key]
        state = phi @ state + gamma @ u
    return course
