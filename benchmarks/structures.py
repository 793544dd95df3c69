"""Structures of several masses, drawn by seed: does the diagnosis name what a mass carries, to the noise?

Chains of masses, springs and dampers with a force on one and a sensor on one, simulated exactly between samples: no
line of it is the FMU's.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple, get_args

import numpy as np
from scipy.linalg import eigh, expm

from benchmarks.loop_runs import in_processes
from benchmarks.report import Options, Report, Row, Table, row, spread
from discrepancy.data.dataset import Dataset
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Floats, Hold, Record, Senses, make_record
from discrepancy.diagnose import diagnose
from discrepancy.tell.answer import Diagnosis
from gyro_model.model import load_model

SEEDS: Final = 12
FIRST: Final = 4601
"""The first seed, of which nothing was chosen."""
SAMPLES, NOISE = 8000, 3e-3
"""Of a run; over the motion, rms."""
PER_PERIOD: Final = 24.0
"""Samples in a period of the highest mode."""
LOWEST: Final = (3.0, 30.0)
"""Hz, of the lowest mode."""
LEFT: Final = 1e-2
"""Of the motion, that held-out runs may be off by."""
NOISE_REACHED: Final = 1.1
"""Times the noise within which nothing else is left. Damping between two resonators, which a chain of four masses and
more has, is in no file."""
SHARE: Final = 0.9


class Structure(NamedTuple):
    """matrices (n, n) of mass [kg], damping [N.s/m] and stiffness [N/m]; places of the force and of the sensor."""

    mass: Floats
    damping: Floats
    stiffness: Floats
    driven: int
    sensed: int

    @property
    def modes(self) -> Floats:
        """Frequencies [Hz]."""
        # That of what nothing holds is zero, but for its rounding.
        squares = eigh(self.stiffness, self.mass, eigvals_only=True)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi))


class Outcome(NamedTuple):
    """Of one structure: what it is, its modes [Hz], the verdict with its names, misfits and time."""

    what: str
    modes: Sequence[float]
    said: str
    right: bool
    values: dict[str, float]


def drawn(rng: np.random.Generator) -> Structure:
    """A chain of two to five masses, forced and sensed anywhere."""
    n = int(rng.integers(2, 6))
    own = chain(rng, n)
    return own._replace(driven=int(rng.integers(n)), sensed=int(rng.integers(n)))


def chain(rng: np.random.Generator, n: int) -> Structure:
    """``n`` masses, the first on the ground, damped against the ground and along its springs; forced and sensed at the
    first."""
    mass, k = np.exp(rng.uniform(np.log(0.5), np.log(2.0), n)), np.exp(rng.uniform(np.log(0.5), np.log(2.0), n))
    # The spring of each mass to the one before, the first to the ground.
    between = np.eye(n) - np.eye(n, k=-1)
    stiffness = between.T @ np.diag(k) @ between
    lowest = 2 * np.pi * np.exp(rng.uniform(*np.log(LOWEST)))
    scale = lowest**2 / eigh(stiffness, np.diag(mass), eigvals_only=True)[0]
    along = rng.uniform(0, 2e-2) / lowest
    damping = rng.uniform(5e-3, 3e-2) * lowest * np.diag(mass) + along * scale * stiffness
    return Structure(np.diag(mass), damping, scale * stiffness, 0, 0)


def motion(structure: Structure, u: Floats, step: float, hold: Hold) -> Floats:
    """Displacement, speed and acceleration (samples, 3) at the sensor, from rest, under forces at samples ``step``
    apart; the acceleration is that before a held force changes."""
    n = len(structure.mass)
    own = np.block([[np.zeros((n, n)), np.eye(n)],
                    [-np.linalg.solve(structure.mass, structure.stiffness),
                     -np.linalg.solve(structure.mass, structure.damping)]])  # fmt: skip
    pushed = np.concatenate((np.zeros(n), np.linalg.inv(structure.mass)[:, structure.driven]))
    # The force and how it rises, as states of their own.
    whole = np.zeros((2 * n + 2, 2 * n + 2))
    whole[: 2 * n, : 2 * n], whole[: 2 * n, 2 * n], whole[2 * n, 2 * n + 1] = own, pushed, 1.0
    passage, state, found = expm(whole * step)[: 2 * n], np.zeros(2 * n), np.empty((len(u), 3))
    rises = np.zeros(len(u)) if hold == "zero" else np.append(np.diff(u), 0.0) / step
    for i, force in enumerate(u):
        acting = u[max(i - 1, 0)] if hold == "zero" else force
        rates = own @ state + pushed * acting
        found[i] = state[structure.sensed], state[n + structure.sensed], rates[n + structure.sensed]
        state = passage @ np.concatenate((state, (force, rises[i])))
    return found


def runs(structure: Structure, rng: np.random.Generator, senses: Senses, hold: Hold) -> list[Record]:
    """Two runs to fit and one held out, each under a multisine of its own over the modes."""
    return runs_of(structure.modes, rng, senses, hold, NOISE, lambda u, step: motion(structure, u, step, hold))


def runs_of(modes: Floats, rng: np.random.Generator, senses: Senses, hold: Hold, noise: float,
            moved: Callable[[Floats, float], Floats]) -> list[Record]:  # fmt: skip
    """The same of anything with such ``modes`` [Hz]: ``moved`` gives displacement, speed and acceleration (samples, 3)
    at the sensor under forces [N] so many seconds apart."""
    rate = PER_PERIOD * float(modes[-1])
    t = np.arange(SAMPLES) / rate
    order, found = get_args(Senses).index(senses), []
    for name in ("a", "b", "c"):
        f = np.arange(1, SAMPLES // 2) * rate / SAMPLES
        lines = f[(f > 0.5 * modes[0]) & (f < 1.2 * modes[-1])]
        u = np.cos(2 * np.pi * np.outer(t, lines) + rng.uniform(0, 2 * np.pi, len(lines))).sum(axis=1)
        v = moved(u / u.std(), 1 / rate)[:, order]
        v = v + noise * v.std() * rng.standard_normal(len(v))
        role = "held-out" if name == "c" else "fit"
        found.append(make_record(name, t, (u / u.std())[:, None], v[:, None], role=role, sample_rate=rate, hold=hold,
                                 senses=senses))  # fmt: skip
    # Gains are those of one frequency.
    return [replace(record, reference=found[0].reference) for record in found]


def diagnosed(
    records: Sequence[Record], noise: float, *, hold_stated: bool = True
) -> tuple[Diagnosis, dict[str, float]] | None:
    """What the diagnosis says of runs of one axis without nominal values, with misfits and time; None where it finds no
    linear start. hold_stated: whether it may trust them in how the force ran between samples."""
    nominal = linear_start(records[:2], (records[0].reference ** records[0].order,))
    if nominal is None:
        return None
    data = Dataset(Path("here"), nominal, tuple(records), estimated=("m", "kxx", "dxx"), hold_stated=hold_stated)
    begun, cpu = time.perf_counter(), time.process_time()
    found = diagnose(data, load_model(), jobs=1)
    return found, {
        "refit": float(found.misfit["refit"]),
        "final": float(found.misfit["final"]),
        "over noise": float(found.misfit["final"]) / noise,
        "s": time.perf_counter() - begun,
        "s of processor": time.process_time() - cpu,
    }


def drawn_record(rng: np.random.Generator) -> tuple[Senses, Hold]:
    """What the sensor shows, and how the force runs between samples."""
    senses: Senses = get_args(Senses)[int(rng.integers(3))]
    hold: Hold = ("zero", "first")[int(rng.integers(2))]
    return senses, hold


def told(structure: Structure, senses: Senses, hold: Hold) -> str:
    """What is measured, in words."""
    at = "at the sensor" if structure.driven == structure.sensed else "elsewhere"
    return f"{len(structure.mass)} masses, force {at}, {senses}, hold {hold}"


def outcome(structure: Structure, what: str, records: Sequence[Record]) -> Outcome:
    """The diagnosis of a structure's records."""
    answer = diagnosed(records, NOISE)
    if answer is None:
        return Outcome(what, structure.modes.tolist(), "no linear start", False, {})
    found, values = answer
    names = [effect.id for effect in found.effects]
    resonators = all(name.startswith("parasitic_mode") for name in names) and len(names) < len(structure.mass)
    right = found.verdict == "missing effects" and resonators and values["final"] < LEFT
    return Outcome(what, structure.modes.tolist(), f"{found.verdict}: {len(names)} resonators" if resonators else
                   f"{found.verdict}: {', '.join(names)}", right, values)  # fmt: skip


def measure(seed: int) -> Outcome:
    """The diagnosis of one structure. Whatever goes wrong is an outcome."""
    rng = np.random.default_rng(seed)
    structure = drawn(rng)
    senses, hold = drawn_record(rng)
    return outcome(structure, f"{told(structure, senses, hold)}, seed {seed}", runs(structure, rng, senses, hold))


def reported(name: str, title: str, kind: str, measure: Callable[[int], Outcome], seeds: Sequence[int],
             jobs: int, said: str = f"resonators alone named, less than {LEFT:.0%} of the motion left"
             ) -> Report:  # fmt: skip
    """The report of what ``measure`` says of each seed; ``said``: what is right."""
    outcomes = in_processes(measure, list(seeds), jobs)
    share = {"share": sum(o.right for o in outcomes) / len(outcomes)}
    clean = {"share": sum(o.values.get("over noise", np.inf) < NOISE_REACHED for o in outcomes) / len(outcomes)}
    overall = [
        Row(said, "1", share, SHARE, at_least=True, note=f"of {len(outcomes)}"),
        Row("nothing but noise left", "1", clean),
    ]  # fmt: skip
    names = ("refit", "final", "over noise", "s", "s of processor")
    spreads = [row(name, "", spread(o.values.get(name, np.inf) for o in outcomes)) for name in names]
    each = [row(o.what, "", o.values, note=f"{', '.join(f'{f:.3g}' for f in o.modes)} Hz: {o.said}") for o in outcomes]
    notes = [
        f"{kind}, {NOISE:g} of noise, {SAMPLES:,} samples a run, {PER_PERIOD:g} in a period of the highest mode; two "
        "runs to fit, one held out, from rest. Final: misfit on the held-out run.",
    ]
    tables = [Table("all", overall), Table("spread", spreads), Table("each", each)]
    return Report(name, title, tables, notes)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a structure for each seed."""
    title = f"Structures of several masses, seeds from {seeds[0]}"
    return reported("structures", title, "Chains of two to five masses", measure, seeds, jobs)


def run(options: Options) -> Report:
    """Twelve structures."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
