"""The unknowns that balance, by Newton's method from coarse to fine, and the motion that they say."""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np

from cosim.rate.harmonic_balance.equations import Equations
from cosim.rate.harmonic_balance.residual import Balance, Unsettled, Wanted
from cosim.rate.harmonic_balance.series import Floats
from gyro_model.errors import InputError

LEVELS: Final = ((4, 32), (8, 128), (16, 512), (32, 1024))
"""Harmonics and instants, coarse to fine. Corners need many instants: a high Q keeps their harmonics out of the
motion, but not out of the force."""
MOVED: Final = 1e-10
"""The finer level is the last where it moves the first harmonics by less, over the swing of the drive, and the drive
force by less than a hundred times that, relative."""
STEP: Final = 1e-10
"""Newton's method ends with a step below this, relative: its error is then the square of that, or rounding."""
STEPS: Final = 30
SHORTEST: Final = 1 / 64
"""A Newton step is halved no further."""
UNDETERMINED: Final = 10.0
"""A Newton step of so many scales comes from what next to nothing determines, such as the mean of a hysteresis that
never turns: of the solutions the smallest is taken."""
LEAST: Final = 1e-3
"""Continuation gives up where the effects can't grow by this share at once."""


class Periodic(NamedTuple):
    """A periodic motion: ω [rad/s], force F [N], first harmonic of x [m] and of both voltages, corrected [V]; force U
    on y [N]; slope: what a rate adds to the sense channel [V or N per rad/s]; moved: by how much the last refinement
    moved the first harmonics, over the amplitude."""

    omega: float
    force: float
    x: complex
    v_x: complex
    v_y: complex
    u_y: complex
    slope: complex
    moved: float


def balanced(of: Equations, p: Mapping[str, float], neutral: Mapping[str, float], wanted: Wanted) -> Periodic:
    """The periodic motion of the device with parameters ``p`` [SI], held inputs among them.

    Where Newton's method finds none from the linear motion, the sizes of its effects grow from ``neutral``, by name.
    Raises Unsettled.
    """

    def at(share: float, level: tuple[int, int]) -> Balance:
        values = {**p, **{name: (1 - share) * n + share * p[name] for name, n in neutral.items()}}
        return Balance(of, values, wanted, scale_of(of, values), level)

    whole = at(1.0, LEVELS[0])
    try:
        z = _solved(whole, whole.started())
    except Unsettled:
        z = _grown(at)
    for level in LEVELS[1:]:
        finer = at(1.0, level)
        next_z = _solved(finer, whole.refined(z, level))
        moved = float(np.max(np.abs(_firsts(finer, next_z) - _firsts(whole, z))))
        whole, z = finer, next_z
        if moved < MOVED:
            break
    return _periodic(whole, z, moved)


def scale_of(of: Equations, p: Mapping[str, float]) -> tuple[float, float]:
    """The resonance of x [rad/s] and the gain of its pickoff [V/m], for small motions about zero.

    Raises InputError where x has no stiffness.
    """
    at = [*np.zeros(len(of.variables)), *(p[symbol.name] for symbol in of.parameters)]
    with np.errstate(all="ignore"):
        slopes = dict(zip(of.motion.places, of.motion.slopes(*at), strict=True))
    stiffness, gain = -slopes[0, 0], slopes[len(of.coordinates), 0]
    if not stiffness > 0:
        raise InputError("x has no stiffness left at rest: make softening, v_bias or what else takes it away smaller")
    return float(stiffness) ** 0.5, float(gain)


def _grown(at: Callable[[float, tuple[int, int]], Balance]) -> Floats:
    """The unknowns of the coarsest level with all effects at their sizes, by continuation from none."""
    level = LEVELS[0]
    none = at(0.0, level)
    z, share, more = _solved(none, none.started()), 0.0, 0.5
    while share < 1.0:
        more = min(more, 1.0 - share)
        try:
            z = _solved(at(share + more, level), z)
        except Unsettled:
            more /= 4
            if more < LEAST:
                raise
            continue
        share, more = share + more, 2 * more
    return z


def _solved(balance: Balance, z: Floats) -> Floats:
    """The unknowns that balance, by Newton's method from ``z``. Raises Unsettled."""
    now = balance.evaluate(z)
    for _ in range(STEPS):
        step = _solve(now.jacobian, -now.residual)
        share = 1.0
        while True:
            try:
                after = balance.evaluate(z + share * step)
                small = np.max(np.abs(step)) < STEP
                if small or np.linalg.norm(after.residual) < (1 - 0.1 * share) * np.linalg.norm(now.residual):
                    break
            except Unsettled as reached:
                if share <= SHORTEST:
                    raise reached from None
            if share <= SHORTEST:
                raise Unsettled
            share /= 2
        z, now = z + share * step, after
        if share == 1.0 and np.max(np.abs(step)) < STEP:
            return z
    raise Unsettled


def _firsts(balance: Balance, z: Floats) -> Floats:
    """The first harmonics of the coordinates and ω, scaled; the forces so that 1e-8 of the drive force counts as
    1e-10 of the amplitude: it is known to rounding times Q."""
    n = len(balance.of.coordinates)
    series, omega, forces = z[: n * balance.width].reshape(n, -1), z[n * balance.width], z[n * balance.width + 1 :]
    return np.array([*series[:, :3].ravel(), omega, *0.01 * forces / max(abs(forces[0]), 1e-12)])


def _periodic(balance: Balance, z: Floats, moved: float) -> Periodic:
    """The motion that the unknowns say."""
    now = balance.evaluate(z)
    n = len(balance.of.coordinates)
    real = z * balance.scales
    forces = real[n * balance.width + 1 :]
    by_rate = _solve(now.jacobian, -now.by_rate)
    if balance.wanted.closed:
        [re, im] = by_rate[-2:] * balance.scales[-2:]
        slope = complex(re, im)
    else:
        slope = complex(now.voltage_slopes[1] @ by_rate + now.voltage_by_rate[1])
    return Periodic(
        float(real[n * balance.width]),
        float(forces[0]),
        complex(real[1], -real[2]),
        complex(now.voltage[0]),
        complex(now.voltage[1]),
        complex(*forces[1:]) if balance.wanted.closed else 0j,
        slope,
        moved,
    )


def _solve(matrix: Floats, right: Floats) -> Floats:
    try:
        step = np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
        if np.max(np.abs(step)) < UNDETERMINED:
            return step
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=1e-12)[0], dtype=np.float64)
