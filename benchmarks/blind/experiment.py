"""Devices and experiments drawn by seed: true values, what the lab believes, and the runs that it takes."""

import math
from typing import Final, NamedTuple

import numpy as np

from benchmarks.blind.physics import Floats, Plant, Run, simulate

ROOM: Final = 298.15
TOLERANCE: Final = {"m": 0.02, "kxx": 0.03, "kyy": 0.03, "kxy": 0.05, "dxx": 0.05, "dyy": 0.05, "dxy": 0.1}
"""Largest relative error of a nominal value; the sense gains are exact."""
BADLY: Final = 0.3
"""Largest relative error of every nominal value of a badly calibrated device."""
SIGNALS: Final = ("multisine", "chirp", "noise", "steps")
RUNS: Final = 4
"""The last is held out."""
HOSTS: Final = ("temperature", "v_bias", "omega_z", "acceleration")


class Device(NamedTuple):
    """true: the device without any effect; nominal: what the lab believes; low, high: its modes [Hz]."""

    true: Plant
    nominal: dict[str, float]
    low: float
    high: float


def draw_device(
    rng: np.random.Generator, *, badly: bool = False, symmetric: bool = False, coupled: bool = True
) -> Device:
    """Half of the time near the reference device, else 1.5 to 12 kHz and Q 300 to 30,000. symmetric: equal axes."""
    if rng.random() < 0.5:
        p = Plant()
        p = p._replace(**{name: getattr(p, name) * rng.uniform(0.9, 1.1) for name in TOLERANCE})
    else:
        m, f, q = 10 ** rng.uniform(-7.5, -6), 1500 * 8 ** rng.uniform(), 10 ** rng.uniform(2.5, 4.48)
        k, d = m * (2 * math.pi * f) ** 2, 2 * math.pi * f * m / q
        kyy = k * rng.uniform(1.02, 1.3) ** 2
        p = Plant(m=m, kxx=k, kyy=kyy, kxy=math.sqrt(k * kyy) * rng.uniform(-0.15, 0.15), dxx=d,
                  dyy=d * rng.uniform(0.7, 1.4), dxy=d * rng.uniform(-0.3, 0.3))  # fmt: skip
    if symmetric:
        p = p._replace(kyy=p.kxx, dyy=p.dxx)
    if not coupled:
        p = p._replace(kxy=0.0, dxy=0.0)
    bound = {name: BADLY for name in TOLERANCE} if badly else TOLERANCE
    nominal = {name: getattr(p, name) * (1 + tol * rng.uniform(-1, 1)) for name, tol in bound.items()}
    nominal |= {"sense_gain_x": p.sense_gain_x, "sense_gain_y": p.sense_gain_y}
    modes = np.sqrt(np.linalg.eigvalsh(np.array([[p.kxx, p.kxy], [p.kxy, p.kyy]]) / p.m)) / (2 * math.pi)
    return Device(p, nominal, float(modes[0]), float(modes[1]))


def signal(rng: np.random.Generator, kind: str, t: Floats, low: float, high: float) -> Floats:
    """One drive of rms 1, (n,): its band reaches from 0.4 of the lower to 1.5 of the higher mode and some DC."""
    duration = t[-1]
    if kind == "multisine":
        f = np.concatenate([rng.uniform(0.4 * low, 1.5 * high, 30), rng.uniform(1 / duration, 0.2 * low, 4)])
        s = np.sin(2 * math.pi * np.outer(t, f) + rng.uniform(0, 2 * math.pi, len(f))).sum(axis=1)
    elif kind == "chirp":
        f0, f1 = 0.6 * low, 1.4 * high
        sweeps = rng.integers(1, 4)
        part = np.mod(t * sweeps / duration, 1.0)
        s = np.sin(2 * math.pi * np.cumsum(f0 + (f1 - f0) * part) * t[1] + rng.uniform(0, 2 * math.pi))
    elif kind == "noise":
        f = np.fft.rfftfreq(len(t), t[1])
        band = ((f > 0.4 * low) & (f < 1.5 * high)) + 0.2 * (f < 0.2 * low)
        s = np.fft.irfft(band * np.exp(2j * math.pi * rng.uniform(size=len(f))), len(t))
    else:
        # Dwell of about half a period: levels change at random, so both modes ring.
        hold = np.maximum(1, rng.exponential(0.5 / (low * t[1]), len(t))).astype(int)
        s = np.repeat(rng.normal(size=len(t)), hold)[: len(t)]
    rms: Floats = s / np.sqrt(np.mean(s**2))
    return rms


def _varied(rng: np.random.Generator, t: Floats) -> Floats:
    """A course over a run, (n,), between -1 and 1: constant, a step, a ramp, a sine or a relaxation."""
    kind, part = rng.integers(5), t / t[-1]
    at = rng.uniform(0.25, 0.75)
    if kind == 0:
        return np.zeros_like(t)
    if kind == 1:
        return np.where(part < at, -1.0, 1.0)
    if kind == 2:
        return 2 * part - 1
    if kind == 3:
        return np.sin(2 * math.pi * (rng.uniform(1, 4) * part + rng.uniform()))
    return 1 - 2 * np.exp(-part / rng.uniform(0.1, 0.5))


def conditions(rng: np.random.Generator, t: Floats, host: tuple[str, ...], number: int) -> dict[str, Floats]:
    """omega, temperature, acceleration, v_bias of one run; what is no part of the host stands still at its neutral
    value. Every run has a level of its own."""
    n, level = len(t), (number + rng.uniform()) / RUNS
    result = {"omega": np.zeros(n), "temperature": np.full(n, ROOM), "acceleration": np.zeros((n, 2)),
              "v_bias": np.zeros(n)}  # fmt: skip
    if "temperature" in host:
        result["temperature"] = ROOM + 15 + 20 * level + rng.uniform(5, 12) * _varied(rng, t)
    if "v_bias" in host:
        result["v_bias"] = 5 + 8 * level + rng.uniform(1, 3) * _varied(rng, t)
    if "omega_z" in host:
        result["omega"] = 40 * (level - 0.5) + rng.uniform(4, 12) * _varied(rng, t)
    if "acceleration" in host:
        tones = rng.uniform(20, 2000, (8, 2))
        shake = np.sin(2 * math.pi * t[:, None, None] * tones + rng.uniform(0, 6.28, (8, 2))).sum(axis=1)
        result["acceleration"] = 20 * shake + 50 * np.stack([_varied(rng, t), _varied(rng, t)], axis=1)
    return result


class Plan(NamedTuple):
    """What an experiment is like. host: of HOSTS; samples: fixed number, or None for 150 to 300 periods of the lower
    mode; amplitude: range of the peak displacement [m]; signals: kinds of drive."""

    host: tuple[str, ...] = ()
    samples: int | None = None
    amplitude: tuple[float, float] = (3e-7, 1.5e-6)
    signals: tuple[str, ...] = SIGNALS


def draw_runs(rng: np.random.Generator, device: Device, plan: Plan) -> list[Run]:
    """RUNS runs at 200 kHz, the drive scaled so that the device without effects reaches the drawn amplitude."""
    rate = 200_000.0
    samples = plan.samples or int(np.clip(rng.uniform(150, 300) / device.low * rate, 8000, 16000))
    return [draw_run(rng, device, plan, number, samples, rate) for number in range(RUNS)]


def draw_run(rng: np.random.Generator, device: Device, plan: Plan, number: int, samples: int, rate: float) -> Run:
    """One run; every third one begins with a free motion."""
    t = np.arange(samples) / rate
    kind = str(rng.choice(plan.signals))
    shape = np.stack([signal(rng, kind, t, device.low, device.high) * rng.uniform(0.5, 1.0) for _ in range(2)], axis=1)
    around = conditions(rng, t, plan.host, number)
    amplitude = plan.amplitude[0] * (plan.amplitude[1] / plan.amplitude[0]) ** rng.uniform()
    still = Run(
        rate, shape, around["omega"], around["temperature"], around["acceleration"], around["v_bias"], np.zeros(4)
    )
    unit = np.abs(simulate(device.true, still).state[:, :2]).max()
    start = np.zeros(4)
    if rng.random() < 1 / 3:
        start[:2] = 0.5 * amplitude * rng.uniform(-1, 1, 2)
        start[2:] = 0.5 * amplitude * 2 * math.pi * device.low * rng.uniform(-1, 1, 2)
    return still._replace(u=shape * amplitude / unit, start=start)
