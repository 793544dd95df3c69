"""A spring that bends far: does the diagnosis name it, with its value, also where the motion is chaotic?

A mass on a hardening spring, in some with a damping that grows with the square of the place, under multisines so strong
that the spring is a twentieth to twice as stiff again. Found by fine steps of a Runge-Kutta method, by no line of the
FMU.
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
FIRST: Final = 8201
"""The first seed, of which nothing was chosen."""
STEPS: Final = 60
"""Of a sample, each right to 1e-12 of the motion by its error term, (w h)^5/120."""
RATES, QUALITIES, PER_PERIOD = (0.02, 1e4), (5.0, 100.0), (24.0, 60.0)
"""Frequency of the spring without its bend [Hz]; quality factor; samples in a period of that frequency."""
BENDS: Final = (0.05, 2.0)
"""The spring's stiffness by its bend over that without, if the motion were that of the straight one, rms."""
DAMPED: Final = 0.3
"""Chance of a damping that grows, twice the constant one at the same motion."""
NOISES: Final = (1e-3, 1e-2)
SAMPLES: Final = 4000
TONES, BAND = 60, (0.1, 3.0)
"""Of the force, over the frequency of the spring."""
CHAOTIC: Final = 1e3
"""Times a change of the first place that a motion is changed by later, from which it counts as chaotic."""


class Bent(NamedTuple):
    """m x'' + (d + d2 x²) x' + k x + k3 x³ = F, SI."""

    m: float
    d: float
    k: float
    k3: float
    d2: float


@njit(cache=True)
def _moved(own: tuple[float, float, float, float, float], u: Floats, step: float, first: bool, begin: float,
           count: int) -> Floats:  # fmt: skip
    """``motion`` from a place."""
    m, d, k, k3, d2 = own
    found, h = np.zeros((len(u), 3)), step / count
    x, v = begin, 0.0
    stages = np.zeros((4, 2))
    parts = np.array([0.0, 0.5, 0.5, 1.0])
    found[0] = x, v, (u[0] - k * x - k3 * x**3) / m
    for i in range(1, len(u)):
        slope = (u[i] - u[i - 1]) / step if first else 0.0
        for part in range(count):
            for s in range(4):
                at = parts[s] * h
                xs = x + (at * stages[s - 1, 0] if s else 0.0)
                vs = v + (at * stages[s - 1, 1] if s else 0.0)
                force = u[i - 1] + slope * (part * h + at)
                stages[s] = vs, (force - (d + d2 * xs**2) * vs - k * xs - k3 * xs**3) / m
            x += h / 6 * (stages[0, 0] + 2 * stages[1, 0] + 2 * stages[2, 0] + stages[3, 0])
            v += h / 6 * (stages[0, 1] + 2 * stages[1, 1] + 2 * stages[2, 1] + stages[3, 1])
        acting = u[i] if first else u[i - 1]
        found[i] = x, v, (acting - (d + d2 * x**2) * v - k * x - k3 * x**3) / m
    return found


def motion(own: Bent, u: Floats, step: float, hold: Hold, begin: float = 0.0) -> Floats:
    """Displacement, speed and acceleration (samples, 3) under forces [N] ``step`` [s] apart, from rest at ``begin``
    [m]."""
    found: Floats = _moved(tuple(own), u, step, hold == "first", begin, STEPS)
    return found


def drawn(rng: np.random.Generator) -> tuple[Bent, float]:
    """A mass on its spring, and the frequency of that [Hz]."""
    f, q = (float(np.exp(rng.uniform(*np.log(own)))) for own in (RATES, QUALITIES))
    m, w = float(np.exp(rng.uniform(-2, 2))), 2 * np.pi * f
    k, d = m * w**2, m * w / q
    # Of a straight spring under a force of 1 N rms over the band.
    square = 1 / ((BAND[1] - BAND[0]) * f) / (4 * k * d)
    bend = float(np.exp(rng.uniform(*np.log(BENDS))))
    return Bent(m, d, k, bend * k / square, 2 * d / square if rng.random() < DAMPED else 0.0), f


def runs(own: Bent, f: float, rng: np.random.Generator, senses: Senses, hold: Hold, noise: float
         ) -> tuple[list[Record], float]:  # fmt: skip
    """Two runs to fit and one held out; and how many times another first place is as far off later, in any of them."""
    rate = f * float(rng.uniform(*PER_PERIOD))
    t, order, found, grown = np.arange(SAMPLES) / rate, get_args(Senses).index(senses), [], 0.0
    for name in ("a", "b", "c"):
        tones = 2 * np.pi * f * np.linspace(*BAND, TONES)
        u = np.cos(np.outer(t, tones) + rng.uniform(0, 2 * np.pi, TONES)).sum(axis=1)
        u /= u.std()
        moved = motion(own, u, 1 / rate, hold)
        nudge = 1e-9 * moved[:, 0].std()
        off = np.abs(motion(own, u, 1 / rate, hold, nudge)[:, 0] - moved[:, 0])
        grown = max(grown, float(off.max()) / nudge)
        v = moved[:, order] + noise * moved[:, order].std() * rng.standard_normal(SAMPLES)
        role = "held-out" if name == "c" else "fit"
        found.append(make_record(name, t, u[:, None], v[:, None], role=role, sample_rate=rate, hold=hold,
                                 senses=senses))  # fmt: skip
    # Gains are those of one frequency.
    return [replace(record, reference=found[0].reference) for record in found], grown


def measure(seed: int) -> Outcome:
    """The diagnosis of one. Whatever goes wrong is an outcome."""
    rng = np.random.default_rng(seed)
    own, f = drawn(rng)
    senses, hold = drawn_record(rng)
    noise = float(np.exp(rng.uniform(*np.log(NOISES))))
    records, grown = runs(own, f, rng, senses, hold, noise)
    kind = "chaotic" if grown > CHAOTIC else "regular"
    damped = ", damping that grows" if own.d2 else ""
    q = 2 * np.pi * f * own.m / own.d
    what = f"{f:.3g} Hz, Q {q:.0f}{damped}, {kind}, {senses}, hold {hold}, noise {noise:.1e}, seed {seed}"
    answer = diagnosed(records, noise)
    if answer is None:
        return Outcome(what, [f], "no linear start", False, {})
    found, values = answer
    wanted = {"k3_x": own.k3} | ({"d2_x": own.d2} if own.d2 else {})
    sizes = {n: p.value for e in found.effects for n, p in e.parameters.items()}
    values["size off"] = max(abs(sizes.get(name, np.inf) / value - 1) for name, value in wanted.items())
    names = sorted(effect.id for effect in found.effects)
    right = found.verdict == "missing effects" and sizes.keys() == wanted.keys() and values["size off"] < CLOSE
    return Outcome(what, [f], f"{found.verdict}: {', '.join(names)}", right, values)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a spring for each seed."""
    outcomes = in_processes(measure, list(seeds), jobs)
    note = (
        f"Chaotic: another first place is {CHAOTIC:g} times as far off later. No model follows such a run from start "
        "to end; the misfit on the held-out run, final, is over all of it."
    )
    return report_of("bent", f"A spring that bends far, seeds from {seeds[0]}", outcomes, ("regular", "chaotic"), note)


def run(options: Options) -> Report:
    """Twenty springs."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
