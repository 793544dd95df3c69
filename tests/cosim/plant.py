"""A plant of its own for the tests of the loop: the matrix exponential, one sample at a time."""

import numpy as np
from scipy.linalg import expm

REFERENCE = np.array([63.955, 95.92, 12.779, 1.8e-6, 1.8e-6, 3.6e-7, 1.8e-7])
"""kxx, kyy, kxy, dxx, dyy, dxy, m of the reference device (SYSTEM.md section 1)."""
PERIOD = 5e-6
NOISE = 20e-6
GAIN = 1e6


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


def sense(state, noise, defects=None):
    """Return v of SYSTEM.md section 8; defects = (1/g, e, gain mismatch, ratio r, offset at t)."""
    q = state[::2]
    gain = np.array([GAIN, GAIN])
    offset = 0.0
    if defects is not None:
        inverse_gap, e, mismatch, ratio, offset = defects
        p = q * inverse_gap
        q = q * (1.0 + e * p) / (1.0 - p * p)
        gain = gain * np.array([1.0, 1.0 + mismatch]) / (1.0 + ratio)
    return gain * q + offset + noise


def first_estimates(seed):
    """Return start f8[17] and its deviation f8[17]: the seven off by 10 to 50 %."""
    rng = np.random.default_rng(seed)
    start = np.zeros(17)
    start[5:12] = REFERENCE * (1.0 + rng.choice([-1, 1], 7) * rng.uniform(0.1, 0.5, 7))
    start[16] = 1.0
    deviation = np.zeros(17)
    deviation[:4] = [1e-6, 0.019, 1e-6, 0.019]
    deviation[4] = 10.0
    deviation[5:12] = 0.3 * start[5:12]
    deviation[12:16] = 0.05
    deviation[16] = 0.1
    return start, deviation


def close_loop(observer, controller, omega_z, seed, defects=None, scale_damping=None, **settings):
    """Run the loop; return estimates (n, 17), deviations (n, 17), outputs (n, 9), states (n, 4).

    omega_z f8[n] takes few values; scale_damping = (sample, factor) changes all damping there.
    """
    n = len(omega_z)
    rng = np.random.default_rng(seed + 1000)
    noise = NOISE * rng.standard_normal((n, 2))
    start, deviation = first_estimates(seed)
    inverse_gap = 0.0 if defects is None else defects[0]
    sensor = np.array([GAIN, GAIN, NOISE, inverse_gap, 0.0])
    observe = observer.settings_array()
    control = controller.settings_array(**settings)
    observer_memory = np.zeros(observer.memory_size)
    controller_memory = np.zeros(controller.memory_size)
    observer.init(observer_memory, observe, start, deviation, sensor, PERIOD)
    controller.init(controller_memory, control, PERIOD)
    estimates, deviations = np.zeros((n, 17)), np.zeros((n, 17))
    outputs, states = np.zeros((n, 9)), np.zeros((n, 4))
    plants = {}
    state = np.array([1e-6, 0.0, 0.0, 0.0])
    u = np.zeros(2)
    for k in range(n):
        factor = 1.0
        if scale_damping is not None and k >= scale_damping[0]:
            factor = scale_damping[1]
        v = sense(state, noise[k], defects)
        states[k] = state
        observer.step(observer_memory, observe, u[0], u[1], v[0], v[1], estimates[k], deviations[k])
        controller.step(controller_memory, control, k * PERIOD, estimates[k], deviations[k], outputs[k])
        u = outputs[k, :2]
        key = (omega_z[k], factor)
        if key not in plants:
            scale = np.array([1, 1, 1, factor, factor, factor, 1])
            plants[key] = sampled(REFERENCE * scale, omega_z[k])
        phi, gamma = plants[key]
        state = phi @ state + gamma @ u
    return estimates, deviations, outputs, states
