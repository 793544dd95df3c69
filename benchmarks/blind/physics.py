"""The device and its effects, written from their equations without a line of the model, and its motion by an 8th-order
Runge–Kutta.

Everything is held over a sample interval but the states; what switches inside one (a delayed force, a damping step)
splits it, so that no step runs over a jump.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import DOP853

from benchmarks.blind.terms import extra_force

Floats = NDArray[np.float64]

STAGES: Final = DOP853.n_stages
A: Final = np.ascontiguousarray(DOP853.A)
B: Final = np.ascontiguousarray(DOP853.B)
C: Final = np.ascontiguousarray(DOP853.C)
ORDER: Final = 8
"""States: x, y, x', y', those of the parasitic mode, those of the hysteresis."""
RADIANS: Final = 0.15
"""Longest substep in radians of the fastest mode: halving it moves v by less than 1e-9 of its peak (tested)."""


class Plant(NamedTuple):
    """Every parameter, SI, neutral where the effect is absent (names and units: those of the FMU). term, term_size: a
    force that stands in no effect file, number 1 to 20 of ``terms.TERMS`` (0: none)."""

    m: float = 1.8e-7
    kxx: float = 63.955
    kyy: float = 95.92
    kxy: float = 12.779
    dxx: float = 1.8e-6
    dyy: float = 1.8e-6
    dxy: float = 3.6e-7
    sense_gain_x: float = 1e6
    sense_gain_y: float = 1e6
    k3_x: float = 0.0
    k3_y: float = 0.0
    k2_x: float = 0.0
    k2_y: float = 0.0
    softening: float = 0.0
    electrode_gap: float = 1e-5
    d2_x: float = 0.0
    d2_y: float = 0.0
    damping_step_factor: float = 1.0
    damping_step_time: float = 0.0
    angular_gain: float = 1.0
    frame_rotation: float = 0.0
    acceleration_gain_x: float = 0.0
    acceleration_gain_y: float = 0.0
    tck: float = 0.0
    tck_split: float = 0.0
    t_ref: float = 298.15
    tcd: float = 0.0
    tcg: float = 0.0
    tcp: float = 0.0
    structure_lag: float = 0.0
    circuit_lag: float = 0.0
    parasitic_coupling: float = 0.0
    parasitic_frequency: float = 5000.0
    parasitic_q: float = 1000.0
    actuator_a2: float = 0.0
    actuator_a3: float = 0.0
    actuator_gain_mismatch: float = 0.0
    actuator_misalignment: float = 0.0
    actuator_delay: float = 0.0
    pickoff_misalignment: float = 0.0
    pickoff_inverse_gap: float = 0.0
    pickoff_mismatch: float = 0.0
    pickoff_gain_mismatch: float = 0.0
    feedthrough: float = 0.0
    amplifier_time_constant: float = 0.0
    offset_x: float = 0.0
    offset_y: float = 0.0
    offset_drift: float = 0.0
    charging_voltage: float = 0.0
    charging_time: float = 1.0
    adc_limit: float = 1e300
    friction_x: float = 0.0
    friction_y: float = 0.0
    friction_speed: float = 1e-3
    stribeck: float = 0.0
    stribeck_speed: float = 5e-3
    force_x: float = 0.0
    force_y: float = 0.0
    k22: float = 0.0
    stop_stiffness: float = 0.0
    stop_gap: float = 2e-6
    stop_damping: float = 0.0
    squeeze_x: float = 0.0
    squeeze_y: float = 0.0
    squeeze_gap: float = 5e-6
    comb_fringe: float = 0.0
    play: float = 0.0
    hysteresis_x: float = 0.0
    hysteresis_y: float = 0.0
    hysteresis_length: float = 1e-6
    hysteresis_beta: float = 0.5
    hysteresis_gamma: float = 0.5
    hysteresis_n: float = 1.0
    term: float = 0.0
    term_size: float = 0.0


class Run(NamedTuple):
    """One experiment, n samples. u, acceleration (n, 2), omega, temperature, v_bias (n,): held over [t_k, t_k+1);
    start: x, y, x', y' at t = 0."""

    rate: float
    u: Floats
    omega: Floats
    temperature: Floats
    acceleration: Floats
    v_bias: Floats
    start: Floats

    @property
    def t(self) -> Floats:
        """Sample times [s], (n,)."""
        return np.arange(len(self.u)) / self.rate


class Motion(NamedTuple):
    """What a run gives. v (n, 2) [V]: after the amplifier, before noise and converter; state (n, 4): x, y, x', y'."""

    v: Floats
    state: Floats


@njit(cache=True)
def _followed(value, target, h, lag):  # type: ignore[no-untyped-def]
    """A temperature that has followed ``target`` for h."""
    return target + (value - target) * math.exp(-h / lag) if lag > 0 else target


@njit(cache=True)
def _rubbing(speed, p):  # type: ignore[no-untyped-def]
    """Dry friction over its size: Coulomb's, smoothed, with Stribeck's excess near rest."""
    excess = p.stribeck * math.exp(-(speed * speed) / (p.stribeck_speed * p.stribeck_speed))
    return math.tanh(speed / p.friction_speed) * (1 + excess)


@njit(cache=True)
def _stopped(q, speed, p):  # type: ignore[no-untyped-def]
    """Force of the stop that q has passed, if any: a spring and a damper that take hold over 1/64 of the gap."""
    deep = abs(q) - p.stop_gap
    if deep <= 0:
        return 0.0
    soft = p.stop_gap / 64
    side = 1.0 if q > 0 else -1.0
    total = deep * deep + soft * soft
    hold = (3 * deep * deep * total - 2 * deep**4) / (total * total)
    damper = p.stop_damping * min(p.stop_stiffness / p.kxx, 1.0)
    return -side * p.stop_stiffness * deep**3 / total - damper * hold * speed


@njit(cache=True)
def _bent(z, speed, p):  # type: ignore[no-untyped-def]
    """Slope of a hysteretic force over its limit, by Bouc and Wen."""
    size = abs(z)
    bend = p.hysteresis_beta * abs(speed) * size ** (p.hysteresis_n - 1) * z
    return (speed - bend - p.hysteresis_gamma * speed * size**p.hysteresis_n) / p.hysteresis_length


@njit(cache=True)
def _slope(s, t, ux, uy, omega, ax, ay, bias, heat, worn, p, out):  # type: ignore[no-untyped-def]
    """d/dt of s = x, y, x', y', q, q' (q: parasitic mode), z_x, z_y (hysteresis) at time t; heat: where the structure's
    temperature goes to, where it was and when; worn: the factor of the damping step."""
    x, y, dx, dy, q, dq = s[0], s[1], s[2], s[3], s[4], s[5]
    warm = _followed(heat[1], heat[0], t - heat[2], p.structure_lag) - p.t_ref
    soft = 1 + p.tck * warm
    kxx, kxy = p.kxx * soft, p.kxy * soft
    kyy = p.kyy * (1 + (p.tck + p.tck_split) * warm)
    damp = worn * (1 + p.tcd * warm)
    fx = ux - damp * (p.dxx * dx + p.dxy * dy) - kxx * x - kxy * y
    fy = uy - damp * (p.dxy * dx + p.dyy * dy) - kxy * x - kyy * y
    coriolis = 2 * p.angular_gain * p.m * omega
    fx += coriolis * dy
    fy -= coriolis * dx
    spin = p.frame_rotation * p.m * omega * omega
    fx += spin * x + p.acceleration_gain_x * p.m * ax
    fy += spin * y + p.acceleration_gain_y * p.m * ay
    fx -= (p.k2_x + p.k3_x * x) * x * x + p.d2_x * x * x * dx
    fy -= (p.k2_y + p.k3_y * y) * y * y + p.d2_y * y * y * dy
    if p.softening != 0:
        volt = bias
        if p.charging_voltage != 0:
            volt += p.charging_voltage * (1 - math.exp(-t / p.charging_time))
        pull = p.softening * volt * volt
        fx += pull * x / (1 - (x / p.electrode_gap) ** 2) ** 2
        fy += pull * y / (1 - (y / p.electrode_gap) ** 2) ** 2
    fx += p.force_x + p.comb_fringe * ux * x - p.k22 * x * y * y
    fy += p.force_y + p.comb_fringe * uy * y - p.k22 * x * x * y
    if p.friction_x != 0 or p.friction_y != 0:
        fx -= p.friction_x * _rubbing(dx, p)
        fy -= p.friction_y * _rubbing(dy, p)
    if p.squeeze_x != 0 or p.squeeze_y != 0:
        fx -= p.squeeze_x * dx * (1 - (x / p.squeeze_gap) ** 2) ** -1.5
        fy -= p.squeeze_y * dy * (1 - (y / p.squeeze_gap) ** 2) ** -1.5
    if p.stop_stiffness != 0:
        fx += _stopped(x, dx, p)
        fy += _stopped(y, dy, p)
    if p.term != 0:
        gx, gy = extra_force(p.term, p.term_size, x, y, dx, dy, ux, uy)
        fx += gx
        fy += gy
    out[6] = out[7] = 0.0
    if p.hysteresis_x != 0 or p.hysteresis_y != 0:
        fx -= p.hysteresis_x * s[6]
        fy -= p.hysteresis_y * s[7]
        out[6], out[7] = _bent(s[6], dx, p), _bent(s[7], dy, p)
    w = 2 * math.pi * p.parasitic_frequency
    fx -= p.parasitic_coupling * q
    out[0], out[1], out[2], out[3] = dx, dy, fx / p.m, fy / p.m
    out[4] = dq
    out[5] = -w / p.parasitic_q * dq - w * w * q - p.parasitic_coupling / p.m * x


@njit(cache=True)
def _advance(s, t, h, steps, ux, uy, omega, ax, ay, bias, heat, worn, p, slopes, trial):  # type: ignore[no-untyped-def]
    """S from t to t + h in equal steps, in place."""
    h /= steps
    for step in range(steps):
        begin = t + step * h
        for i in range(STAGES):
            for j in range(ORDER):
                total = 0.0
                for k in range(i):
                    total += A[i, k] * slopes[k, j]
                trial[j] = s[j] + h * total
            _slope(trial, begin + C[i] * h, ux, uy, omega, ax, ay, bias, heat, worn, p, slopes[i])
        for j in range(ORDER):
            total = 0.0
            for i in range(STAGES):
                total += B[i] * slopes[i, j]
            s[j] += h * total


@njit(cache=True)
def _played(u, p):  # type: ignore[no-untyped-def]
    """Forces (n, 2) that come through the play of the actuators, at rest before the first."""
    through = np.empty_like(u)
    for j in range(2):
        left = 0.0
        for k in range(len(u)):
            left = max(u[k, j] - p.play, min(u[k, j] + p.play, left))
            through[k, j] = left
    return through


@njit(cache=True)
def _actuated(u, p):  # type: ignore[no-untyped-def]
    """Curve, gain and misalignment of the actuators on one held (or already delayed) pair of forces."""
    ux = u[0] + p.actuator_a2 * u[0] ** 2 + p.actuator_a3 * u[0] ** 3
    uy = u[1] + p.actuator_a2 * u[1] ** 2 + p.actuator_a3 * u[1] ** 3
    uy *= 1 + p.actuator_gain_mismatch
    return ux + p.actuator_misalignment * uy, uy + p.actuator_misalignment * ux


@njit(cache=True)
def _pair(q, p):  # type: ignore[no-untyped-def]
    """The gap-closing pair of electrodes, unequal where there is a mismatch."""
    r = q * p.pickoff_inverse_gap
    return q * (1 + p.pickoff_mismatch * r) / (1 - r * r)


@njit(cache=True)
def _sensed(s, u, hot, p, out):  # type: ignore[no-untyped-def]
    """Voltages and their slopes at the amplifier's input, out (2, 2); hot: circuit over t_ref [K]. Slopes by a central
    difference of the smooth map along the motion: only a cubic between samples rests on them."""
    gain = 1 + p.tcg * hot
    step = 1e-8
    for j in range(3):
        along = (0.0, step, -step)[j]
        x, y = s[0] + along * s[2], s[1] + along * s[3]
        px, py = _pair(x + p.pickoff_misalignment * y, p), _pair(y + p.pickoff_misalignment * x, p)
        vx = p.sense_gain_x * gain * px
        vy = p.sense_gain_y * gain * (1 + p.pickoff_gain_mismatch) * py
        if j == 0:
            out[0, 0], out[0, 1] = vx + p.feedthrough * u[0], vy + p.feedthrough * u[1]
            out[1, 0] = out[1, 1] = 0.0
        else:
            sign = 0.5 / along
            out[1, 0] += sign * vx
            out[1, 1] += sign * vy


@njit(cache=True)
def _lagged(v, first, last, h, tau):  # type: ignore[no-untyped-def]
    """The lag tau v' = w - v after h, exact for the cubic w through the values and slopes first, last = (w, w')."""
    if tau <= 0:
        return last[0]
    a = h / tau
    decay = math.exp(-a)
    rise, d0, d1 = last[0] - first[0], h * first[1], h * last[1]
    c1, c2, c3 = d0, 3 * rise - 2 * d0 - d1, d0 + d1 - 2 * rise
    # i_n = integral of s^n a exp(-a (1 - s)) over 0..1 = 1 - n/a i_(n-1): upwards that is stable for a > n, downwards
    # for a < n.
    if a > 3:
        i1 = 1 - (1 - decay) / a
        i2 = 1 - 2 / a * i1
        i3 = 1 - 3 / a * i2
    else:
        i3 = 0.0
        for n in range(40, 3, -1):
            i3 = (1 - i3) * a / n
        i2 = (1 - i3) * a / 3
        i1 = (1 - i2) * a / 2
    return v * decay + first[0] * (1 - decay) + c1 * i1 + c2 * i2 + c3 * i3


@njit(cache=True)
def _run(p, h, u, omega, temperature, acceleration, v_bias, start, steps, v, state):  # type: ignore[no-untyped-def]
    n, through = len(u), _played(u, p)
    s, slopes, trial = np.zeros(ORDER), np.zeros((STAGES, ORDER)), np.zeros(ORDER)
    s[:4] = start
    structure = circuit = temperature[0]
    before, after, output = np.zeros((2, 2)), np.zeros((2, 2)), np.zeros(2)
    _sensed(s, u[0], circuit - p.t_ref, p, before)
    output[:] = before[0]
    whole = int(p.actuator_delay / h)
    part = p.actuator_delay - whole * h
    cuts = np.zeros(4)
    for k in range(n):
        t = k * h
        v[k, 0] = output[0] + p.offset_x + p.offset_drift * t
        v[k, 1] = output[1] + p.offset_y + p.offset_drift * t
        state[k] = s[:4]
        if k > 0:
            # Euler force of a step of the held rate: a jump of the velocity.
            jump = p.frame_rotation * (omega[k] - omega[k - 1])
            s[2], s[3] = s[2] + jump * s[1], s[3] - jump * s[0]
        heat = (temperature[k], structure, t)
        old = _actuated(through[max(k - whole - 1, 0)], p)
        new = _actuated(through[max(k - whole, 0)], p)
        cuts[0], cuts[1], cuts[2], cuts[3] = 0.0, part, min(max(p.damping_step_time - t, 0.0), h), h
        cuts.sort()
        for i in range(3):
            length = cuts[i + 1] - cuts[i]
            if length > 1e-9 * h:
                middle = 0.5 * (cuts[i] + cuts[i + 1])
                ux, uy = new if middle > part else old
                worn = p.damping_step_factor if t + middle > p.damping_step_time else 1.0
                _sensed(s, u[k], circuit - p.t_ref, p, before)
                _advance(s, t + cuts[i], length, steps, ux, uy, omega[k], acceleration[k, 0], acceleration[k, 1],
                         v_bias[k], heat, worn, p, slopes, trial)  # fmt: skip
                earlier, circuit = circuit, _followed(circuit, temperature[k], length, p.circuit_lag)
                _sensed(s, u[k], circuit - p.t_ref, p, after)
                tau = p.amplifier_time_constant + p.tcp * (0.5 * (earlier + circuit) - p.t_ref)
                for j in range(2):
                    output[j] = _lagged(output[j], before[:, j], after[:, j], length, tau)
        structure = _followed(structure, temperature[k], h, p.structure_lag)


def fastest(p: Plant) -> float:
    """The highest angular frequency of the linear device [rad/s]."""
    stiffness = np.array([[p.kxx, p.kxy], [p.kxy, p.kyy]]) / p.m
    top = math.sqrt(float(np.linalg.eigvalsh(stiffness)[-1]))
    return max(top, 2 * math.pi * p.parasitic_frequency) if p.parasitic_coupling else top


def simulate(p: Plant, run: Run, radians: float = RADIANS) -> Motion:
    """The noise-free motion and voltages of ``run``, not clipped; not finite where the device is unstable."""
    n, h = len(run.u), 1 / run.rate
    v, state = np.empty((n, 2)), np.empty((n, 4))
    # A sign that friction or hysteresis changes, a stop that is met: far within a radian.
    fine = 16 if p.friction_x or p.friction_y or p.stop_stiffness or p.hysteresis_x or p.hysteresis_y else 1
    steps = fine * max(1, math.ceil(fastest(p) * h / radians))
    _run(p, h, run.u, run.omega, run.temperature, run.acceleration, run.v_bias, run.start, steps, v, state)
    return Motion(v, state)


def clipped(v: Floats, p: Plant) -> Floats:
    """The converter's limits, (n, 2) [V]."""
    return np.clip(v, -p.adc_limit, p.adc_limit)
