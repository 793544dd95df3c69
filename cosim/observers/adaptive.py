"""The extended Kalman filter behind `ekf` and `ekf_extended`, for either size.

State [x, x', y, y', theta] (theta of cosim.propagation) and, in the extended one, the sensor's
[offset_x, offset_y, drift_x, drift_y, gain ratio, pair mismatch, 1/gap]. Lengths are metres of the
nominal gains, and y is kept as gain ratio * y, what the pickoff sees: then the unknown ratio enters
the dynamics, where its error grows slowly, and not the measurement. The acceleration is linear in
theta, so all that linearising leaves out are products of two errors; early on, and with an unknown
offset, they exceed the noise, so their variance is added to it.

Three things let the estimates move. The random walk of omega_z follows the data: it grows while the
corrections of omega_z keep one sign for a block of samples, and shrinks while they cancel. A sample
that is too far off reopens omega_z and the state over the last few samples. Surprises that go on
say that the constants have changed: theirs are reopened too. Beside that, old samples are forgotten.
"""

from math import exp, sqrt

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.layout import KXX, OFFSET_X, OMEGA_Z, M
from cosim.observers.adaptive_layout import (
    ANEW_DAMPING,
    ANEW_STIFFNESS,
    BLOCK,
    BOLTZMANN,
    COUNT,
    DESIGN,
    DRIFT,
    EXTENDED,
    GAIN,
    GAIN_X,
    GAIN_Y,
    GAP,
    GAP_DEVIATION,
    JUMP,
    LAG,
    MEMORY,
    MISMATCH,
    MISMATCH_DEVIATION,
    NOISE_X,
    NOISE_Y,
    OFFSET,
    ORDER,
    PERIOD,
    PLAIN,
    RATIO,
    RATIO_MAX,
    RESTART_DAMPING,
    RESTART_LIMIT,
    RESTART_STIFFNESS,
    RESTARTS,
    ROW,
    SETTLE,
    SLACK,
    START,
    STROKE_MAX,
    SUM,
    SUM_VARIANCE,
    SURPRISE,
    SURPRISE_LIMIT,
    SURPRISE_MEMORY,
    SURPRISES,
    TEMPERATURE,
    THERMAL,
    VARIANCE,
    VELOCITY,
    WAIT,
    WALK,
    WALK_MAX,
    WALK_MIN,
    WALK_RATE,
    WORK,
    D,
    U,
)
from cosim.observers.kalman import (
    add_variance,
    correct_factors,
    inflate,
    predict_factors,
    variance_of,
)
from cosim.observers.record import (
    INVERSE_GAP,
    NOISE_RMS,
    SENSE_GAIN_X,
    SENSE_GAIN_Y,
    SENSES_VELOCITY,
)
from cosim.propagation import (
    PHI,
    STATE,
    WIDTH,
    linearise,
    parameters_of,
    taylor_order,
    theta_of,
)

Array = npt.NDArray[np.float64]


@njit(cache=True)
def start_filter(
    memory: Array,
    settings: Array,
    start: Array,
    start_deviation: Array,
    sensor: Array,
    period: float,
    size: int,
) -> None:
    """Do `init` of cosim.observers.record for a filter of `size` states."""
    memory[:] = 0.0
    # Element by element: an assignment of slices takes numba a second longer to compile.
    for i in range(4):
        memory[i] = start[i]
    theta_of(start, memory[4:12])
    mass = start[M]
    d = memory[D:U]
    u = memory[U:WORK]
    for i in range(size):
        u[i * size + i] = 1.0
    for i in range(5):
        d[i] = start_deviation[i] ** 2
    # k/m and d/m share the error of 1/m, which comes last.
    for i in range(6):
        d[5 + i] = (start_deviation[KXX + i] / mass) ** 2
        u[11 * size + 5 + i] = start[KXX + i]
    d[11] = (start_deviation[M] / mass**2) ** 2
    memory[GAIN_X] = sensor[SENSE_GAIN_X]
    memory[GAIN_Y] = sensor[SENSE_GAIN_Y]
    memory[NOISE_X] = (sensor[NOISE_RMS] / sensor[SENSE_GAIN_X]) ** 2
    memory[NOISE_Y] = (sensor[NOISE_RMS] / sensor[SENSE_GAIN_Y]) ** 2
    memory[VELOCITY] = sensor[SENSES_VELOCITY]
    memory[PERIOD] = period
    memory[ORDER] = taylor_order(memory[4:12], period) + 2
    memory[WALK] = settings[WALK_MAX]
    for i in range(5):
        memory[START + i] = start[OFFSET_X + i]
        memory[START + 5 + i] = start_deviation[OFFSET_X + i]
    for i in range(2):
        gain = sensor[SENSE_GAIN_X + i]
        memory[OFFSET + i] = start[OFFSET_X + i] / gain
        memory[DRIFT + i] = start[OFFSET_X + 2 + i] / gain
    memory[RATIO] = start[OFFSET_X + 4]
    memory[2] *= memory[RATIO]
    memory[3] *= memory[RATIO]
    if sensor[SENSES_VELOCITY] == 0.0:
        memory[GAP] = sensor[INVERSE_GAP]
    if size == EXTENDED:
        _open_sensor(memory, settings)
    _refresh(memory, size)


@njit(cache=True)
def _open_sensor(memory: Array, settings: Array) -> None:
    """Set the variances of the sensor's states to those of the start."""
    d = memory[D:U]
    for i in range(2):
        d[OFFSET + i] = (memory[START + 5 + i] / memory[GAIN_X + i]) ** 2
        d[DRIFT + i] = (memory[START + 7 + i] / memory[GAIN_X + i]) ** 2
    d[RATIO] = memory[START + 9] ** 2
    if memory[GAP] > 0.0:
        d[MISMATCH] = settings[MISMATCH_DEVIATION] ** 2
        d[GAP] = (settings[GAP_DEVIATION] * memory[GAP]) ** 2


@njit(cache=True)
def step_filter(
    memory: Array,
    settings: Array,
    u_x: float,
    u_y: float,
    v_x: float,
    v_y: float,
    estimate: Array,
    deviation: Array,
    size: int,
) -> None:
    """Do `step` of cosim.observers.record for a filter of `size` states."""
    if memory[COUNT] > 0.0:
        _predict(memory, settings, u_x, u_y, size)
    memory[COUNT] += 1.0
    surprise = _correct_axis(memory, 0, v_x / memory[GAIN_X], size)
    surprise += _correct_axis(memory, 1, v_y / memory[GAIN_Y], size)
    memory[SURPRISES] *= 1.0 - 1.0 / settings[SURPRISE_MEMORY]
    memory[RESTARTS] *= 1.0 - 0.1 / settings[SURPRISE_MEMORY]
    memory[WAIT] -= 1.0
    if surprise > settings[SURPRISE] and memory[WAIT] < 0.0:
        _reopen(memory, settings, size)
    if memory[COUNT] % BLOCK == 0.0:
        _adapt(memory, settings, size)
    _write(memory, estimate, deviation, size)


@njit(cache=True)
def _predict(memory: Array, settings: Array, u_x: float, u_y: float, size: int) -> None:
    u = memory[U:WORK]
    d = memory[D:U]
    work = memory[WORK:ROW]
    row = memory[ROW:GAIN]
    period = memory[PERIOD]
    ratio = memory[RATIO]
    y = memory[2] / ratio
    y_dot = memory[3] / ratio
    memory[2] = y
    memory[3] = y_dot
    linearise(memory, memory[4:12], u_x, u_y, period, int(memory[ORDER]), work)
    for i in range(4):
        memory[i] = work[i * WIDTH + STATE]
        row[i] = 0.0
    row[4] = 1.0
    add_variance(u, d, size, 4, memory[WALK] ** 2 * period, row)
    for i in range(4):
        row[i] = -work[i * WIDTH + PHI + 2] * y - work[i * WIDTH + PHI + 3] * y_dot
    _scale_y(memory, work, row, ratio)
    predict_factors(u, d, size, work)
    if size == EXTENDED:
        _predict_sensor(memory, u, row, period, size)
    _kick(memory, settings, u_y, size)


@njit(cache=True)
def _kick(memory: Array, settings: Array, u_y: float, size: int) -> None:
    """Add the unmodelled acceleration: thermal, and the products of errors that F leaves out.

    Early on the error of k/m times that of x is far above the noise where an offset hides x.
    """
    u = memory[U:WORK]
    d = memory[D:U]
    row = memory[ROW:GAIN]
    period = memory[PERIOD]
    thermal = 0.0
    if settings[THERMAL] != 0.0:
        # Two-sided density 2 k_B T d of the force, over the mean damping of the axes.
        damping = 0.5 * (abs(memory[8]) + abs(memory[9])) * abs(memory[11])
        thermal = 2.0 * BOLTZMANN * settings[TEMPERATURE] * damping / period
    v = memory[VARIANCE:START]
    cross = 4.0 * v[4] + v[10]
    product_x = v[5] * v[0] + v[7] * v[2] + v[8] * v[1] + cross * v[3]
    product_y = v[7] * v[0] + v[6] * v[2] + v[9] * v[3] + cross * v[1]
    if size == EXTENDED:
        product_x += v[RATIO] * v[7] * memory[2] ** 2
        product_y += v[RATIO] * (v[7] * memory[0] ** 2 + v[11] * u_y * u_y)
    row[0] = 0.5 * period
    row[1] = 1.0
    add_variance(u, d, size, 1, (thermal + 2.0 * product_x) * period * period, row)
    row[0] = 0.0
    row[1] = 0.0
    row[2] = 0.5 * period
    row[3] = 1.0
    add_variance(u, d, size, 3, (thermal + 2.0 * product_y) * period * period, row)


@njit(cache=True)
def _scale_y(memory: Array, work: Array, by_ratio: Array, ratio: float) -> None:
    """Turn a prediction of x, y into one of x, ratio * y; by_ratio f8[4] is d / d ratio.

    by_ratio comes in as the part by way of the y that a given ratio * y means, times ratio.
    """
    by_ratio[0] /= ratio
    by_ratio[1] /= ratio
    by_ratio[2] += memory[2]
    by_ratio[3] += memory[3]
    memory[2] *= ratio
    memory[3] *= ratio
    for j in range(STATE):
        work[2 * WIDTH + j] *= ratio
        work[3 * WIDTH + j] *= ratio
    for i in range(4):
        work[i * WIDTH + PHI + 2] /= ratio
        work[i * WIDTH + PHI + 3] /= ratio


@njit(cache=True)
def _predict_sensor(memory: Array, u: Array, by_ratio: Array, period: float, size: int) -> None:
    for j in range(RATIO, size):
        for i in range(4):
            u[j * size + i] += by_ratio[i] * u[j * size + RATIO]
    for i in range(2):
        memory[OFFSET + i] += period * memory[DRIFT + i]
        for j in range(DRIFT + i, size):
            u[j * size + OFFSET + i] += period * u[j * size + DRIFT + i]


@njit(cache=True)
def _correct_axis(memory: Array, axis: int, value: float, size: int) -> float:
    """Correct with one sample [m]; return its squared innovation over the variance."""
    u = memory[U:WORK]
    row = memory[ROW:GAIN]
    gain = memory[GAIN:DESIGN]
    index = 2 * axis + int(memory[VELOCITY])
    ratio = memory[RATIO] if axis == 1 else 1.0
    e = memory[MISMATCH]
    inverse_gap = memory[GAP]
    # The gap curve of SYSTEM.md section 8, q (1 + e p) / (1 - p^2) with p = q/g, times the ratio.
    q = memory[index]
    p = min(max(inverse_gap * q / ratio, -STROKE_MAX), STROKE_MAX)
    shape = 1.0 / (1.0 - p * p)
    slope = (1.0 + 2.0 * e * p + p * p) * shape * shape
    innovation = value - q * (1.0 + e * p) * shape - memory[OFFSET + axis]
    for j in range(size):
        row[j] = slope * u[j * size + index]
    if size == EXTENDED:
        by_mismatch = q * p * shape
        by_gap = q * q / ratio * (e + 2.0 * p + e * p * p) * shape * shape
        by_ratio = -by_gap * inverse_gap / ratio if axis == 1 else 0.0
        for j in range(OFFSET + axis, size):
            column = j * size
            row[j] += u[column + OFFSET + axis] + by_ratio * u[column + RATIO]
            row[j] += by_mismatch * u[column + MISMATCH] + by_gap * u[column + GAP]
    d = memory[D:U]
    noise = memory[NOISE_X + axis]
    if size == EXTENDED:
        # Products of errors that the linear curve leaves out: of its slope and of q, and of q.
        v = memory[VARIANCE:START]
        by_mismatch = 2.0 * p
        by_gap = 6.0 * p * q / ratio
        slope_variance = by_mismatch * by_mismatch * v[MISMATCH] + by_gap * by_gap * v[GAP]
        bend = 2.0 * inverse_gap * (e + 3.0 * p)
        slope_variance += 0.25 * bend * bend * v[index]
        noise += 2.0 * slope_variance * v[index]
    variance = correct_factors(memory, u, d, size, row, noise, innovation, gain)
    memory[SUM] += gain[4] * innovation / variance
    memory[SUM_VARIANCE] += gain[4] * gain[4] / variance
    return innovation * innovation / variance


@njit(cache=True)
def _reopen(memory: Array, settings: Array, size: int) -> None:
    """Reopen omega_z, and the state by what a jump of it did in `settle` samples."""
    u = memory[U:WORK]
    d = memory[D:U]
    row = memory[ROW:GAIN]
    memory[SURPRISES] += 1.0
    memory[WAIT] = settings[SETTLE]
    span = settings[SETTLE] * memory[PERIOD]
    energy = memory[1] ** 2 + memory[3] ** 2
    energy += abs(memory[5]) * memory[0] ** 2 + abs(memory[6]) * memory[2] ** 2
    velocity = (2.0 * settings[JUMP] * span) ** 2 * energy
    for i in range(4):
        row[:] = 0.0
        row[i] = 1.0
        variance = velocity if i % 2 == 1 else velocity * (0.5 * span) ** 2
        add_variance(u, d, size, 4, SLACK * SLACK * variance, row)
    # What a jump of omega_z did since: a held Coriolis acceleration for half that time.
    lag = LAG * settings[SETTLE]
    for i in range(4):
        row[i] = memory[WORK + i * WIDTH] * (lag if i % 2 == 1 else lag * lag)
    row[4] = 1.0
    add_variance(u, d, size, 4, settings[JUMP] ** 2, row)
    if memory[SURPRISES] > settings[SURPRISE_LIMIT]:
        memory[SURPRISES] = 0.0
        _restart(memory, settings, size)


@njit(cache=True)
def _refresh(memory: Array, size: int) -> None:
    for i in range(4, size):
        memory[VARIANCE + i] = variance_of(memory[U:WORK], memory[D:U], size, i)


@njit(cache=True)
def _restart(memory: Array, settings: Array, size: int) -> None:
    """Begin again with theta from its present value; what the sensor is stays known.

    Where that does not help, several times in a row, the filter has settled on a wrong sensor or
    wrong stiffnesses and is sure of them: then everything is open again.
    """
    u = memory[U:WORK]
    d = memory[D:U]
    memory[RESTARTS] += 1.0
    anew = memory[RESTARTS] > settings[RESTART_LIMIT]
    for j in range(PLAIN, size):
        d[j] = variance_of(u, d, size, j)
    for j in range(5, size):
        for i in range(j):
            u[j * size + i] = 0.0
    for i in range(5, PLAIN):
        relative = settings[RESTART_DAMPING] if 8 <= i <= 10 else settings[RESTART_STIFFNESS]
        deviation = relative * abs(memory[i])
        if anew and 8 <= i <= 10:
            deviation = max(deviation, ANEW_DAMPING * sqrt(abs(memory[5])))
        elif anew:
            deviation = ANEW_STIFFNESS * abs(memory[i])
        d[i] = deviation**2
        u[11 * size + i] = memory[i] / memory[11]
    u[11 * size + 11] = 1.0
    if anew:
        memory[RESTARTS] = 0.0
        if size == EXTENDED:
            _open_sensor(memory, settings)
    _refresh(memory, size)


@njit(cache=True)
def _adapt(memory: Array, settings: Array, size: int) -> None:
    """Fit the random walk of omega_z to the last block, and forget a little."""
    ratio = RATIO_MAX
    if memory[SUM_VARIANCE] > 0.0:
        ratio = min(memory[SUM] ** 2 / memory[SUM_VARIANCE], RATIO_MAX)
    memory[SUM] = 0.0
    memory[SUM_VARIANCE] = 0.0
    walk = memory[WALK] * exp(0.5 * settings[WALK_RATE] * (ratio - 1.0))
    memory[WALK] = min(max(walk, settings[WALK_MIN]), settings[WALK_MAX])
    memory[ORDER] = taylor_order(memory[4:12], memory[PERIOD])
    factor = 1.0 + 0.5 * BLOCK * memory[PERIOD] / settings[MEMORY]
    for i in range(5, size):
        inflate(memory[U:WORK], memory[D:U], size, i, factor)
    _refresh(memory, size)


@njit(cache=True)
def _write_y(memory: Array, u: Array, d: Array, estimate: Array, deviation: Array, size: int) -> None:
    """Write y and y' from ratio * y, ratio * y'."""
    ratio = memory[RATIO]
    for i in range(2, 4):
        value = memory[i] / ratio
        variance = 0.0
        for j in range(size):
            slope = u[j * size + i]
            if size == EXTENDED:
                slope -= value * u[j * size + RATIO]
            variance += slope * slope * d[j]
        estimate[i] = value
        deviation[i] = sqrt(variance) / abs(ratio)


@njit(cache=True)
def _write(memory: Array, estimate: Array, deviation: Array, size: int) -> None:
    u = memory[U:WORK]
    d = memory[D:U]
    parameters_of(memory[4:12], estimate)
    mass = estimate[M]
    for i in range(4):
        estimate[i] = memory[i]
        memory[VARIANCE + i] = variance_of(u, d, size, i)
        deviation[i] = sqrt(memory[VARIANCE + i])
    if memory[RATIO] != 1.0:
        _write_y(memory, u, d, estimate, deviation, size)
    deviation[OMEGA_Z] = sqrt(variance_of(u, d, size, 4))
    for i in range(6):
        value = estimate[KXX + i]
        variance = 0.0
        for j in range(5 + i, size):
            slope = u[j * size + 5 + i] - value * u[j * size + 11]
            variance += slope * slope * d[j]
        deviation[KXX + i] = abs(mass) * sqrt(variance)
    deviation[M] = mass * mass * sqrt(variance_of(u, d, size, 11))
    for i in range(5):
        estimate[OFFSET_X + i] = memory[START + i]
        deviation[OFFSET_X + i] = memory[START + 5 + i]
    if size == EXTENDED:
        for i in range(5):
            gain = 1.0
            if i < 4:
                gain = memory[GAIN_X + i % 2]
            estimate[OFFSET_X + i] = gain * memory[OFFSET + i]
            deviation[OFFSET_X + i] = gain * sqrt(variance_of(u, d, size, OFFSET + i))
