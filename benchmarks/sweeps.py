"""A mass that rubs, on a spring that may bend, under slow sweeps: does the diagnosis name what is there, with its
values, where nobody says how the force ran between samples?

Found by the implicit midpoint rule, by no line of the FMU.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple, get_args

import numpy as np
from numba import njit

from benchmarks.loop_runs import in_processes
from benchmarks.named import CLOSE, report_of
from benchmarks.report import Options, Report
from benchmarks.structures import Outcome, diagnosed, drawn_record
from discrepancy.data.record import Floats, Hold, Record, Senses, make_record

SEEDS: Final = 20
FIRST: Final = 7601
"""The first seed, of which nothing was chosen."""
PARTS: Final = 24
"""Steps of a sample, 1,200 a period and more: what the rule shifts a frequency by is 2e-6 of it."""
RATES, QUALITIES, PER_PERIOD = (0.5, 5e3), (15.0, 80.0), (50.0, 100.0)
"""Frequency of the spring without its bend [Hz]; quality factor; samples in a period of that frequency."""
FRICTIONS, STEEP = (0.03, 0.3), (1e-5, 1e-3)
"""Of the force; speed at which friction turns round, over the highest without it."""
BENT: Final = 0.5
"""Chance of a spring that bends."""
BENDS: Final = (0.03, 0.5)
"""The spring's force by its bend over that without, at a tenth of the motion of the straight one at its resonance."""
FROM, TO = 0.3, 2.5
"""What is swept, over the frequency of the spring."""
AMPLITUDES: Final = (0.6, 1.0, 0.8)
"""Of the three runs, the last of which is held out [N]."""
NOISES: Final = (1e-3, 1e-2)
SAMPLES: Final = 12_000


class Swept(NamedTuple):
    """m x'' + d x' + k x + k3 x³ + f tanh(x'/speed) = F, SI."""

    m: float
    d: float
    k: float
    k3: float
    friction: float
    speed: float


@njit(cache=True)
def _moved(own: tuple[float, float, float, float, float, float], u: Floats, at: Floats, step: float) -> Floats:
    """``motion``, each step by Newton's method."""
    m, d, k, k3, friction, steep = own
    x, v, found, every = 0.0, 0.0, np.empty((len(at), 3)), len(u) // len(at)
    for i in range(len(u)):
        if i % every == 0:
            left = at[i // every] - d * v - k * x - k3 * x**3 - friction * np.tanh(v / steep)
            found[i // every] = x, v, left / m
        new = v
        for _ in range(60):
            middle, speed = x + 0.25 * step * (v + new), 0.5 * (v + new)
            rubs = np.tanh(speed / steep)
            left = m * (new - v) / step + d * speed + k * middle + k3 * middle**3 + friction * rubs - u[i]
            slope = m / step + d / 2 + (k + 3 * k3 * middle**2) * step / 4 + friction * (1 - rubs**2) / (2 * steep)
            new -= left / slope
            if abs(left) < 1e-13:
                break
        x, v = x + 0.5 * step * (v + new), new
    return found


def motion(own: Swept, u: Floats, at: Floats, step: float) -> Floats:
    """Displacement, speed and acceleration (samples, 3), from rest under forces u [N] held over steps of ``step`` [s].
    ``at`` (samples,): that which acts at each of those."""
    found: Floats = _moved(tuple(own), u, at, step)
    return found


def sweep(own: Swept, rate: float, amplitude: float, count: int, hold: Hold) -> tuple[Floats, Floats]:
    """The force at samples (count,) [N] of a sweep over the resonance, held from one to another or running on, and
    what moves (count, 3)."""
    f = float(np.sqrt(own.k / own.m)) / (2 * np.pi)
    duration = count / rate

    def force(samples: Floats) -> Floats:
        t = samples / rate
        found: Floats = amplitude * np.sin(2 * np.pi * f * (FROM * t + 0.5 * (TO - FROM) * t**2 / duration))
        return found

    u, step = force(np.arange(float(count))), 1 / (rate * PARTS)
    if hold == "zero":
        # At a sample just before it changes.
        return u, motion(own, np.repeat(u, PARTS), np.append(u[:1], u[:-1]), step)
    return u, motion(own, force((np.arange(count * PARTS) + 0.5) / PARTS), u, step)


def drawn(rng: np.random.Generator) -> tuple[Swept, float]:
    """A mass that rubs, and its sample rate [Hz]."""
    f, q = (float(np.exp(rng.uniform(*np.log(own)))) for own in (RATES, QUALITIES))
    m, w = float(np.exp(rng.uniform(-2, 2))), 2 * np.pi * f
    k, d = m * w**2, m * w / q
    friction, steep, bend = (float(np.exp(rng.uniform(*np.log(own)))) for own in (FRICTIONS, STEEP, BENDS))
    k3 = bend * k / (0.1 * q / k) ** 2 if rng.random() < BENT else 0.0
    return Swept(m, d, k, k3, friction, steep * q / (m * w)), f * float(rng.uniform(*PER_PERIOD))


def runs(own: Swept, rate: float, rng: np.random.Generator, senses: Senses, hold: Hold, noise: float) -> list[Record]:
    """Two runs to fit and one held out, none of which says how the force ran."""
    order, found = get_args(Senses).index(senses), []
    for name, amplitude in zip(("a", "b", "c"), AMPLITUDES, strict=True):
        u, moved = sweep(own, rate, amplitude, SAMPLES, hold)
        v = moved[:, order] + noise * moved[:, order].std() * rng.standard_normal(SAMPLES)
        role = "held-out" if name == "c" else "fit"
        found.append(make_record(name, np.arange(SAMPLES) / rate, u, v, role=role, sample_rate=rate, senses=senses))
    # Gains are those of one frequency.
    return [replace(record, reference=found[0].reference) for record in found]


def measure(seed: int) -> Outcome:
    """The diagnosis of one. Whatever goes wrong is an outcome."""
    rng = np.random.default_rng(seed)
    own, rate = drawn(rng)
    senses, hold = drawn_record(rng)
    noise = float(np.exp(rng.uniform(*np.log(NOISES))))
    records = runs(own, rate, rng, senses, hold, noise)
    f = float(np.sqrt(own.k / own.m)) / (2 * np.pi)
    kind = "bent" if own.k3 else "straight"
    ran = "held" if hold == "zero" else "runs on"
    what = f"{f:.3g} Hz, {kind}, {own.friction:.3f} N, {senses}, {ran}, noise {noise:.1e}, seed {seed}"
    answer = diagnosed(records, noise, hold_stated=False)
    if answer is None:
        return Outcome(what, [f], "no linear start", False, {})
    found, values = answer
    wanted = {"friction_x": own.friction} | ({"k3_x": own.k3} if own.k3 else {})
    sizes = {n: p.value for e in found.effects for n, p in e.parameters.items()}
    values["size off"] = max(abs(sizes.get(name, np.inf) / value - 1) for name, value in wanted.items())
    names = sorted(effect.id for effect in found.effects)
    right = (
        found.verdict == "missing effects"
        and names == [*(["cubic_stiffness"] if own.k3 else []), "dry_friction"]
        and values["size off"] < CLOSE
    )
    return Outcome(what, [f], f"{found.verdict}: {', '.join(names)}", right, values)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a mass for each seed."""
    outcomes = in_processes(measure, list(seeds), jobs)
    note = f"Two runs to fit, one held out, {SAMPLES:,} samples each, from rest. Final: misfit on the held-out run."
    return report_of(
        "sweeps", f"Sweeps of a mass that rubs, seeds from {seeds[0]}", outcomes, ("straight", "bent"), note
    )


def run(options: Options) -> Report:
    """Twenty masses."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
