"""What a laboratory's record does to force and voltage, drawn by seed: written without a line of the tool's own
defects."""

import math
from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, cont2discrete, lfilter, lfilter_zi

from benchmarks.blind.experiment import Device
from benchmarks.blind.physics import Floats, Plant, Run, simulate

WHITE: Final = 2e-5
"""V rms a sample of the sensor's noise: 20 pm at 1e6 V/m."""
FINE: Final = 8
"""Steps a sample on which a filter before the device is followed."""
PAD: Final = 8
"""Samples by which a run is longer than what is kept, for a clock that runs ahead."""


class Difficulty(NamedTuple):
    """id: of the tool's answer; value: its size, as the label has it; acts: the clean voltage of a run by a plant whose
    force or clock is not as recorded; louder: how much stronger the noise at the modes is than the sensor's; marks:
    what is done to the voltage after noise, with numbers of its own."""

    id: str
    value: float
    acts: Callable[[Plant, Run], Floats] | None = None
    louder: float = 1.0
    marks: Callable[[np.random.Generator, Floats, Run], Floats] | None = None


Draw = Callable[[np.random.Generator, Device, list[Run]], Difficulty]


def _clock_skew(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    skew = float(rng.choice([-1, 1]) * 10 ** rng.uniform(-5, -4.2))

    def acts(plant: Plant, run: Run) -> Floats:
        k = np.arange(len(run.u))
        return _at(simulate(plant, _padded(run)).v, k * (1 + skew))

    return Difficulty("clock_skew", skew, acts)


def _channel_delay(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    late = float(rng.uniform(0.03, 0.5) / runs[0].rate)

    def acts(plant: Plant, run: Run) -> Floats:
        v = simulate(plant, run).v
        k = np.arange(len(run.u))
        return np.column_stack([v[:, 0], _at(v, k - late * run.rate)[:, 1]])

    return Difficulty("channel_delay", late, acts)


def _force_filter(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    corner = device.high * rng.uniform(4, 12)

    def acts(plant: Plant, run: Run) -> Floats:
        fine = _finer(run)
        u = _filtered(corner, 2 * fine.rate, "zoh", np.repeat(fine.u, 2, axis=0))
        begin, middle = u[::2], u[1::2]
        # Simpson's mean over a fine step; held, it has less of what curves.
        mean = (begin + 4 * middle + np.vstack([begin[1:], begin[-1:]])) / 6
        return simulate(plant, fine._replace(u=_curved(mean))).v[::FINE]

    return Difficulty("force_filter", 1 / (2 * math.pi * corner), acts)


def _force_saturation(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    limit = rng.uniform(0.6, 0.9) * max(float(np.abs(run.u).max()) for run in runs[:-1])

    def acts(plant: Plant, run: Run) -> Floats:
        return simulate(plant, run._replace(u=np.clip(run.u, -limit, limit))).v

    return Difficulty("force_saturation", 1 / limit, acts)


def _force_scale(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    scale = float(rng.choice([-1, 1]) * rng.uniform(0.01, 0.08))

    def acts(plant: Plant, run: Run) -> Floats:
        return simulate(plant, run._replace(u=(1 + scale) * run.u)).v

    return Difficulty("force_scale", scale, acts)


def _voltage_filter(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    corner = device.high * rng.uniform(4, 12)

    def acts(plant: Plant, run: Run) -> Floats:
        fine = _finer(run)
        return _filtered(corner, fine.rate, "foh", _curved(simulate(plant, fine).v))[::FINE]

    return Difficulty("voltage_filter", 1 / (2 * math.pi * corner), acts)


def _mains(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    frequency = float(rng.choice([50.0, 60.0]) + rng.uniform(-0.03, 0.03))
    amplitude = WHITE * 10 ** rng.uniform(0.5, 1.7)
    harmonics = [1, *(n for n in (2, 3, 5) if rng.random() < 0.6)]
    shares = rng.uniform(0.1, 0.8, (len(harmonics), 2))
    shares[0] = 1, rng.uniform(0.3, 1)

    def marks(draw: np.random.Generator, v: Floats, run: Run) -> Floats:
        for n, share in zip(harmonics, shares, strict=True):
            phase = draw.uniform(0, 2 * math.pi) + np.array([0.0, 0.3])
            v = v + amplitude * share * np.sin(2 * math.pi * n * frequency * run.t[:, None] + phase)
        return v

    return Difficulty("mains", float(amplitude), marks=marks)


def _missing_samples(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    number = int(rng.integers(1, 3))

    def marks(draw: np.random.Generator, v: Floats, run: Run) -> Floats:
        lost = draw.choice(np.arange(len(v) // 10, 9 * len(v) // 10), number, replace=False)
        kept = np.delete(v, lost, axis=0)
        # The recorder goes on until it has its number: the last samples come again.
        return np.vstack([kept, v[-number:]])

    return Difficulty("missing_samples", float(number), marks=marks)


def _timestamp_jitter(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    scatter, seed = float(10 ** rng.uniform(-1.8, -1.0)), int(rng.integers(2**31))

    def acts(plant: Plant, run: Run) -> Floats:
        v = simulate(plant, run).v
        k = np.arange(len(v)) + scatter * np.random.default_rng([seed, len(v)]).standard_normal(len(v))
        return _at(v, np.clip(k, 0, len(v) - 1))

    slope = [np.mean(np.diff(simulate(device.true, run).v, axis=0) ** 2) for run in runs]
    louder = math.sqrt(1 + scatter**2 * float(np.mean(slope)) / WHITE**2)
    return Difficulty("timestamp_jitter", scatter / runs[0].rate, acts, louder)


def _coloured_noise(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    pole, rms = float(rng.uniform(0.5, 0.97)), WHITE * 10 ** rng.uniform(0.3, 1.0)

    def marks(draw: np.random.Generator, v: Floats, run: Run) -> Floats:
        white = draw.standard_normal((len(v) + 1000, 2))
        return v + rms * math.sqrt(1 - pole**2) * lfilter([1.0], [1.0, -pole], white, axis=0)[1000:]

    # A first-order noise is strongest at low frequency, where the modes are.
    louder = math.sqrt(1 + (rms / WHITE) ** 2 * (1 + pole) / (1 - pole))
    return Difficulty("coloured_noise", float(rms), louder=louder, marks=marks)


def _outliers(rng: np.random.Generator, device: Device, runs: list[Run]) -> Difficulty:
    share, size = 10 ** rng.uniform(-3.5, -2.3), WHITE * 10 ** rng.uniform(1.3, 2.5)

    def marks(draw: np.random.Generator, v: Floats, run: Run) -> Floats:
        hit = draw.random(v.shape) < share
        return v + np.where(hit, size * draw.standard_normal(v.shape), 0.0)

    return Difficulty("outliers", float(size), marks=marks)


def _at(v: Floats, k: np.ndarray) -> Floats:
    """Voltages (n, 2) between samples, at ``k``."""
    spline = make_interp_spline(np.arange(len(v)), v, k=5)
    return np.asarray(spline(k))


def _filtered(corner: float, rate: float, hold: str, signal: Floats) -> Floats:
    """``signal`` (n, 2), held or straight between samples, behind a Butterworth filter of second order."""
    b, a, _ = cont2discrete(butter(2, 2 * math.pi * corner, analog=True), 1 / rate, hold)
    start = lfilter_zi(b.ravel(), a)
    return np.column_stack([lfilter(b.ravel(), a, column, zi=start * column[0])[0] for column in signal.T])


def _curved(signal: Floats) -> Floats:
    """``signal`` (n, 2) with what a mean that is held, or a straight line, takes from its curvature."""
    more = signal.copy()
    more[1:-1] -= np.diff(signal, 2, axis=0) / 12
    return more


def _padded(run: Run) -> Run:
    """The run with its last sample held on."""

    def longer(a: Floats) -> Floats:
        return np.concatenate([a, np.repeat(a[-1:], PAD, axis=0)])

    return run._replace(u=longer(run.u), omega=longer(run.omega), temperature=longer(run.temperature),
                        acceleration=longer(run.acceleration), v_bias=longer(run.v_bias))  # fmt: skip


def _finer(run: Run) -> Run:
    """The same run in FINE steps a sample."""

    def each(a: Floats) -> Floats:
        return np.repeat(a, FINE, axis=0)

    return Run(run.rate * FINE, each(run.u), each(run.omega), each(run.temperature), each(run.acceleration),
               each(run.v_bias), run.start)  # fmt: skip


DIFFICULTIES: Final[dict[str, Draw]] = {
    "clock_skew": _clock_skew,
    "channel_delay": _channel_delay,
    "force_filter": _force_filter,
    "force_saturation": _force_saturation,
    "force_scale": _force_scale,
    "voltage_filter": _voltage_filter,
    "mains": _mains,
    "missing_samples": _missing_samples,
    "timestamp_jitter": _timestamp_jitter,
    "coloured_noise": _coloured_noise,
    "outliers": _outliers,
}
"""By the id under which an answer is to have it."""
UNSEEN: Final = frozenset({"force_scale"})
"""Those that no sample shows: an answer is right without them."""
CONFUSED: Final = {
    "force_filter": {"actuator_delay", "drive_feedthrough", "amplifier_bandwidth", "thermal_phase"},
    "voltage_filter": {"actuator_delay", "drive_feedthrough", "amplifier_bandwidth", "thermal_phase"},
    "clock_skew": {"damping_step"},
}
"""Effects with which a difficulty is not drawn: together they are one to first order."""
