"""What a mass carries and what rubs on it, by the force that its own motion asks for.

    u = m x'' + d x' + k x + f (1 + e exp(-(x'/v)²)) sign x' - c + Σ (a_i + b_i s) / (s² + l_i s + w_i²) x''

A friction where force and sensor are holds back that mass alone. What hangs on it is driven by the motion that was
measured, and answers to it linearly, also while the mass stands still and the friction has any size; only these samples
are left out. Of given loads (w_i, l_i) all else is linear, and they are found by trial, one after the other (variable
projection: G. Golub and V. Pereyra, SIAM Journal on Numerical Analysis 10, 1973). A response of the motion to the force
shows no modes where friction holds the mass for a part of the time. Both sides are smoothed by one kernel, and its
derivatives stand for those of the motion (inverse dynamic identification: A. Janot, P.-O. Vandanjon, M. Gautier, A
generic instrumental variable approach for industrial robot identification, IEEE Transactions on Control Systems
Technology 22, 2014).
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import fftconvolve, lfilter

from discrepancy.data.absorbers import Absorber, Carried
from discrepancy.data.modal import Complexes
from discrepancy.data.modes import BROAD
from discrepancy.data.record import Floats, Record
from discrepancy.data.rubbed import speed_of

WIDTHS: Final = (3, 6, 12, 24, 48, 96)
"""Samples to either side of the kernel's middle."""
PASSED: Final = 0.5
"""Share of the force's power that a kernel lets through at least: what it takes away tells nothing of loads."""
MOVES: Final = 0.1
"""Of the speed's rms: what is slower may as well be at rest, where friction has any size."""
FEWEST: Final = 100
"""Samples that move, at least."""
ROWS: Final = 4_000
"""Of all runs, at most: what is smoothed needs no more."""
MOST: Final = 3
"""Loads that are looked for."""
POINTS: Final = 60
"""Frequencies at which a load is tried."""
QUALITY: Final = 15.0
"""Of a load that is tried."""
PERIODS: Final = 4.0
"""Of the slowest load in the shortest run."""
FASTEST: Final = 6.0
"""Samples in a period of the fastest load."""
FADED: Final = np.geomspace(0.1, 1.0, 7)
"""Of the speed's rms, at which what friction has more near rest may have faded."""
PLAINLY: Final = 0.8
"""Share of what is left (power) without it, that is left at most with a load, with a spring to the ground, and with a
friction that is higher near rest."""
RUBS: Final = 0.9
"""The same with a friction: 0.87 of an accelerometer, whose speed wanders, where friction is half of the force; 1.00 of
shafts that do not rub."""
BADLY: Final = 0.3
"""Share of the force's power that is left, from which nothing is told."""
ROOM: Final = 0.5, 4.0
"""Logarithms by which the frequency and the damping of a load may end elsewhere than they begin."""


class Inverse(NamedTuple):
    """mass [kg], damping [N s/m], stiffness to the ground [N/m], friction [N]; near_rest: as that of ``Carried``;
    loads: the pole [1/s] of each, and the a and b of its answer to the acceleration; left: share of the force's
    power."""

    m: float
    d: float
    k: float
    friction: float
    near_rest: tuple[float, float] | None
    loads: tuple[tuple[complex, float, float], ...]
    left: float


class _Trial(NamedTuple):
    """Poles [1/s] of loads; held: whether a spring holds the mass; faded: the speed [m/s] at which a friction is no
    longer higher than elsewhere, None where it never is; rubs: whether there is one."""

    poles: tuple[complex, ...] = ()
    held: bool = False
    faded: float | None = None
    rubs: bool = True


def structures(records: Sequence[Record], gain: float) -> list[Carried]:
    """What a mass with a friction carries by driven ``records`` of one axis, for a sensor of ``gain`` [V/m]:
    with ever more loads, the fewest first. Empty where its motion asks for another force, or for no load."""
    if any(record.axes > 1 or not record.u.any() for record in records):
        return []
    found = (_with_loads(runs) for half in WIDTHS if (runs := _runs(records, gain, half)))
    best = min((own for own in found if own), key=lambda own: own[-1].left, default=[])
    told = (_carried(own) for own in best if own.left < BADLY and own.friction > 0)
    return [own for own in told if own is not None]


class _Run:
    """What a run shows of the mass, smoothed by ``half`` samples to either side: its acceleration, and at those
    samples, ``number`` of which is one, all about which it moves one way: the acceleration, speed, place and way, and
    the force."""

    def __init__(self, record: Record, gain: float, half: int, number: int) -> None:
        self.step = 1 / record.sample_rate
        kernels = _kernel(half, self.step)
        place, speed, self.acceleration = (
            np.asarray(fftconvolve(signal, kernels[order], "same")) for signal, order in _motion(record, gain)
        )
        u, before = record.u[:, 0], np.append(record.u[:1, 0], record.u[:-1, 0])
        if record.hold == "zero":
            # At a sample the force changes: an accelerometer sees what acted before, the kernel as much of either.
            u = before if record.order == 2 else 0.5 * (u + before)
        force = fftconvolve(u, kernels[0], "same")
        self.passed = float(np.sum(force**2)), float(np.sum(u**2))
        way = np.sign(speed) * (np.abs(speed) > MOVES * np.sqrt(np.mean(speed**2)))
        moves = record.valid & (np.abs(np.convolve(way, np.ones(2 * half + 1), "same")) > 2 * half + 0.5)
        # A kernel at an end is none about its sample.
        moves[: 2 * half] = moves[len(moves) - 2 * half :] = False
        self.at = np.flatnonzero(moves)[::number]
        self.seen = np.column_stack((self.acceleration, speed, place, way))[self.at]
        self.force, self.starts_anywhere = force[self.at], record.order > 0

    def columns(self, trial: _Trial) -> tuple[Floats, Floats]:
        """What each unknown makes, (samples, unknowns), and the force, without what loads that move, and a place that
        is not known, are from the run's start on."""
        acceleration, speed, place, way = self.seen.T
        one = np.ones_like(way)
        columns = [acceleration, speed, one, *([way] if trial.rubs else [])]
        columns += [] if trial.faded is None else [way * np.exp(-((speed / trial.faded) ** 2))]
        columns += [place] if trial.held else []
        begun = [one] if trial.held and self.starts_anywhere else []
        for pole in trial.poles:
            made, alone = self._response(pole), np.exp(pole * self.step * self.at)
            columns += [made.real, made.imag]
            begun += [alone.real, alone.imag]
        own, force = np.column_stack(columns), self.force
        if begun:
            start = np.linalg.qr(np.column_stack(begun))[0]
            own, force = own - start @ (start.T @ own), force - start @ (start.T @ force)
        return own, force

    def _response(self, pole: complex) -> Complexes:
        """What 1/(s - pole) makes of the acceleration, which runs straight between samples."""
        turn = np.exp(pole * self.step)
        held = (turn - 1) / pole
        rising = (held / self.step - 1) / pole
        return np.asarray(lfilter([rising, held - rising], [1.0, -turn], self.acceleration)[self.at])


def _motion(record: Record, gain: float) -> list[tuple[Floats, int]]:
    """What the kernel's derivative of so high an order makes the place [m], the speed and the acceleration of. Of an
    accelerometer the place is zero: it shows none."""
    seen = np.interp(record.t, record.t[record.valid], record.v[record.valid, 0])
    moved, step = seen * record.reference**record.order / gain, 1 / record.sample_rate
    if record.order == 0:
        # No large place beside a small motion: the kernel's derivatives are off by roundings.
        moved = moved - moved.mean()
        return [(moved, 0), (moved, 1), (moved, 2)]
    if record.order == 1:
        return [(np.cumsum(moved) * step, 0), (moved, 0), (moved, 1)]
    speed = speed_of(record)[:, 0] * (record.reference**2 / gain * step)
    return [(np.zeros_like(moved), 0), (speed, 0), (moved, 0)]


def _kernel(half: int, step: float) -> tuple[Floats, Floats, Floats]:
    """cos⁶ over so many samples to either side, of sum 1, and its first two derivatives in time."""
    rate = np.pi / (2 * (half + 1))
    angle = rate * np.arange(-half, half + 1)
    s, c = np.sin(angle), np.cos(angle)
    total, rate = float(np.sum(c**6)), rate / step
    return c**6 / total, -6 * rate * c**5 * s / total, rate**2 * (30 * c**4 * s**2 - 6 * c**6) / total


def _runs(records: Sequence[Record], gain: float, half: int) -> list[_Run]:
    """Those with samples that move; none where these are too few, or too little of the force is left."""
    number = max(sum(len(record.t) for record in records) // ROWS, 1)
    runs = [_Run(record, gain, half, number) for record in records if len(record.t) > 6 * half]
    runs = [run for run in runs if len(run.at)]
    if sum(len(run.at) for run in runs) < FEWEST:
        return []
    passed, whole = np.sum([run.passed for run in runs], axis=0)
    return runs if passed > PASSED * whole else []


def _with_loads(runs: Sequence[_Run]) -> list[Inverse]:
    """The mass with ever more loads, as long as each leaves plainly less."""
    last, held = (_left(runs, _Trial(held=own)) for own in (False, True))
    trial = _Trial(held=held < PLAINLY * last)
    last = held if trial.held else last
    low = PERIODS / min(float(run.at[-1]) * run.step for run in runs)
    high = 1 / (FASTEST * runs[0].step)
    tried = [_pole(frequency, QUALITY) for frequency in np.geomspace(low, max(low, high), POINTS)]
    found: list[Inverse] = []
    while len(trial.poles) < MOST:
        more = (trial._replace(poles=(*trial.poles, pole)) for pole in tried)
        trial = _refined(runs, min(more, key=lambda own: _left(runs, own)))
        left = _left(runs, trial)
        if left > PLAINLY * last:
            break
        last = left
        # Of a shaft that does not rub the response shows more.
        if left < RUBS * _left(runs, trial._replace(rubs=False)):
            found.append(_solved(runs, _higher_near_rest(runs, trial)))
    return found


def _pole(frequency: float, quality: float) -> complex:
    w = 2 * np.pi * frequency
    return complex(-0.5 * w / quality, w * np.sqrt(1 - 0.25 / quality**2))


def _refined(runs: Sequence[_Run], trial: _Trial) -> _Trial:
    """Its loads where they leave least."""

    def at(logarithms: Floats) -> _Trial:
        w, loss = np.exp(logarithms.reshape(2, -1))
        return trial._replace(poles=tuple(complex(-0.5 * b, a) for a, b in zip(w, loss, strict=True)))

    begin = np.log([[pole.imag for pole in trial.poles], [-2 * pole.real for pole in trial.poles]]).ravel()
    room = np.repeat(ROOM, len(trial.poles))
    end = least_squares(lambda own: _fit(runs, at(own))[1], begin, bounds=(begin - room, begin + room),
                        xtol=1e-5, ftol=1e-5, max_nfev=12)  # fmt: skip
    return at(end.x)


def _higher_near_rest(runs: Sequence[_Run], trial: _Trial) -> _Trial:
    """With a friction that is higher near rest, where that plainly shows; then its loads once more."""
    fastest = np.sqrt(max(float(np.mean(run.seen[:, 1] ** 2)) for run in runs))
    tried = (trial._replace(faded=float(share * fastest)) for share in FADED)
    best = min(tried, key=lambda own: _left(runs, own))
    if _left(runs, best) > PLAINLY * _left(runs, trial):
        return trial
    found = _solved(runs, best)
    return _refined(runs, best) if found.friction > 0 and found.near_rest and found.near_rest[0] > 0 else trial


def _fit(runs: Sequence[_Run], trial: _Trial) -> tuple[Floats, Floats]:
    """The linear unknowns, and what they leave of the force over its norm."""
    parts = [run.columns(trial) for run in runs]
    a, b = np.vstack([own for own, _ in parts]), np.concatenate([force for _, force in parts])
    size = np.linalg.norm(a, axis=0)
    size[size == 0] = 1.0
    values = np.linalg.lstsq(a / size, b, rcond=1e-10)[0]
    norm = np.sqrt(sum(float(run.force @ run.force) for run in runs))
    return values / size, (b - a / size @ values) / norm


def _left(runs: Sequence[_Run], trial: _Trial) -> float:
    error = _fit(runs, trial)[1]
    return float(error @ error)


def _solved(runs: Sequence[_Run], trial: _Trial) -> Inverse:
    values, error = _fit(runs, trial)
    m, d, _, friction, *more = values.tolist()
    near_rest = None if trial.faded is None else (more.pop(0) / friction, trial.faded)
    k, made = more.pop(0) if trial.held else 0.0, zip(trial.poles, more[::2], more[1::2], strict=True)
    # a + b s over a pair of poles as the real part of what one of them makes.
    loads = tuple((pole, pole.imag * imaginary - pole.real * real, real) for pole, real, imaginary in made)
    return Inverse(m, d, k, friction, near_rest, loads, float(error @ error))


def _carried(own: Inverse) -> Carried | None:
    """The same as mass and resonators; None where one would be no load."""
    absorbers, d, k = [], own.d, own.k
    for pole, a, b in own.loads:
        w, loss = abs(pole), -2 * pole.real
        if own.m <= 0 or a <= 0 or w < BROAD * loss:
            return None
        # Of a load a/w² of that loss, b is (2 joint - 1) loss a/w²; what is not in the joint damps all together.
        load = a / w**2
        joint = float(np.clip(0.5 * (b / (loss * load) + 1), 0.0, 1.0))
        d, k = d - (1 - joint) * loss * load, k + a
        absorbers.append(
            Absorber(w / (2 * np.pi), w / loss, np.array([-w * np.sqrt(own.m * a)]), np.array([joint]), 0.0)
        )
    absorbers.sort(key=lambda absorber: -abs(float(absorber.coupling[0])))
    of_mass = np.array([[k]]), np.array([[max(d, 0.0)]])
    return Carried(own.m, *of_mass, tuple(absorbers), np.array([own.friction]), np.zeros(1), own.near_rest)
