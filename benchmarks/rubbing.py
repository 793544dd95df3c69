"""Dry friction at a mass that carries others: does the diagnosis name it beside the modes, with its value?

Chains of one to three masses, forced and sensed at the first, which rubs on the ground. The motion is found in steps of
a thousandth of a sample in which the friction stops a mass or holds it, by no line of the FMU.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from benchmarks.loop_runs import in_processes
from benchmarks.named import CLOSE
from benchmarks.report import Options, Report, Row, Table, row, spread
from benchmarks.structures import NOISE_REACHED, SHARE, Outcome, Structure, chain, diagnosed, drawn_record, runs_of
from discrepancy.data.record import Floats, Hold, Record

SEEDS: Final = 20
FIRST: Final = 7201
"""The first seed, of which nothing was chosen."""
STEPS: Final = 1000
"""Of a sample. With 200 effects were looked for in what the steps left beside 1e-3 of noise."""
FRICTION, NOISES = (0.02, 0.3), (1e-3, 1e-2)
"""Of the force, rms; of the motion, rms."""
BREAKAWAY: Final = (0.0, 0.0, 0.3)
"""By which friction at rest exceeds that at speed."""
FADED: Final = 0.1
"""Of about the speed without friction, rms, at which that excess is down to 1/e."""


class Rubbing(NamedTuple):
    """friction [N] at speed; ``excess`` of that at rest, relative, which fades over ``speed`` [m/s]; ``k3`` [N/m³]: of
    the spring of the first mass."""

    structure: Structure
    friction: float
    excess: float
    speed: float
    k3: float = 0.0


@njit(cache=True)
def _moved(own: tuple[Floats, Floats, Floats], resistance: tuple[float, float, float, float], state: Floats, u: Floats,
           step: float, first: bool, count: int) -> Floats:  # fmt: skip
    """``motion``, from displacements and speeds (2, n), which change."""
    mass, damping, stiffness = own
    friction, excess, speed, k3 = resistance
    n, h, found = len(mass), step / count, np.zeros((len(u), 3))
    rates = np.zeros(n)
    found[0] = state[0, 0], state[1, 0], u[0] / mass[0]
    for i in range(1, len(u)):
        for part in range(count):
            force = u[i - 1] + (u[i] - u[i - 1]) * (part + 0.5) / count if first else u[i - 1]
            state[0] += 0.5 * h * state[1]
            for k in range(n):
                rates[k] = (force if k == 0 else 0.0) / mass[k]
                for j in range(n):
                    rates[k] -= (stiffness[k, j] * state[0, j] + damping[k, j] * state[1, j]) / mass[k]
            rates[0] -= k3 * state[0, 0] ** 3 / mass[0]
            own_speed = state[1, 0]
            most = h * friction * (1 + excess * np.exp(-((own_speed / speed) ** 2))) / mass[0]
            free = own_speed + h * rates[0]
            # What would carry the mass through rest stops it.
            rates[0] = (0.0 if abs(free) <= most else free - most * np.sign(free)) / h - own_speed / h
            state[1] += h * rates
            state[0] += 0.5 * h * state[1]
        # At the sample, just before a held force changes: the rate over the last step is that of half a step before.
        force = u[i] if first else u[i - 1]
        own_speed = state[1, 0]
        acting = force - k3 * state[0, 0] ** 3
        for j in range(n):
            acting -= stiffness[0, j] * state[0, j] + damping[0, j] * state[1, j]
        acting -= friction * (1 + excess * np.exp(-((own_speed / speed) ** 2))) * np.sign(own_speed)
        found[i] = state[0, 0], own_speed, acting / mass[0] if own_speed != 0.0 or friction == 0.0 else 0.0
    return found


def motion(own: Rubbing, u: Floats, step: float, hold: Hold, begin: Floats | None = None) -> Floats:
    """Displacement, speed and acceleration (samples, 3) of the first mass under forces [N] ``step`` [s] apart, from
    rest or from displacements and speeds ``begin`` (2, n)."""
    structure = own.structure
    matrices = np.diag(structure.mass).copy(), structure.damping, structure.stiffness
    state = np.zeros((2, len(structure.mass))) if begin is None else begin.copy()
    resistance = own.friction, own.excess, own.speed, own.k3
    found: Floats = _moved(matrices, resistance, state, u, step, hold == "first", STEPS)
    return found


def fading(structure: Structure) -> float:
    """The speed [m/s] over which what friction has more at rest fades."""
    # Under a white force of 1 N rms over the modes a mass has a mean squared speed of 1/(4 d m band).
    return FADED / float(np.sqrt(4 * structure.damping[0, 0] * structure.mass[0, 0] * structure.modes[-1]))


def drawn(rng: np.random.Generator) -> Rubbing:
    """A chain and its friction."""
    structure = chain(rng, int(rng.integers(1, 4)))
    friction, excess = float(np.exp(rng.uniform(*np.log(FRICTION)))), float(rng.choice(BREAKAWAY))
    return Rubbing(structure, friction, excess, fading(structure))


def measure(seed: int) -> Outcome:
    """The diagnosis of one. Whatever goes wrong is an outcome."""
    rng = np.random.default_rng(seed)
    own = drawn(rng)
    senses, hold = drawn_record(rng)
    noise, n = float(np.exp(rng.uniform(*np.log(NOISES)))), len(own.structure.mass)
    what = (f"{n} masses, {own.friction:.3f} N, excess {own.excess:g}, {senses}, hold {hold}, noise {noise:.1e}, "
            f"seed {seed}")  # fmt: skip
    records = runs_of(own.structure.modes, rng, senses, hold, noise, lambda u, step: motion(own, u, step, hold))
    return outcome(own, what, records, noise)


def outcome(own: Rubbing, what: str, records: Sequence[Record], noise: float) -> Outcome:
    """The diagnosis of records of what rubs."""
    answer = diagnosed(records, noise)
    if answer is None:
        return Outcome(what, own.structure.modes.tolist(), "no linear start", False, {})
    found, values = answer
    friction = (e.parameters["friction_x"].value for e in found.effects if "friction_x" in e.parameters)
    values["friction off"] = abs(next(friction, np.inf) / own.friction - 1)
    names = sorted(effect.id for effect in found.effects)
    wanted = ["dry_friction", *(("parasitic_mode", "parasitic_mode_2")[: len(own.structure.mass) - 1])]
    right = found.verdict == "missing effects" and names == wanted and values["friction off"] < CLOSE
    return Outcome(what, own.structure.modes.tolist(), f"{found.verdict}: {', '.join(names)}", right, values)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a structure for each seed."""
    note = ("An accelerometer sees friction jump where a mass turns; between samples nobody knows where. Two runs to "
            "fit, one held out, from rest. Final: misfit on the held-out run.")  # fmt: skip
    outcomes = in_processes(measure, list(seeds), jobs)
    return report_of("rubbing", f"Dry friction beside modes, seeds from {seeds[0]}", outcomes, note)


def report_of(name: str, title: str, outcomes: Sequence[Outcome], note: str) -> Report:
    """What came out, over all and of each."""
    of = f"of {len(outcomes)}"
    right = {"share": sum(o.right for o in outcomes) / len(outcomes)}
    clean = {"share": sum(o.values.get("over noise", np.inf) < NOISE_REACHED for o in outcomes) / len(outcomes)}
    overall = [
        Row(f"friction, to {CLOSE:.0%}, and as many modes as there are alone named", "1", right, SHARE, at_least=True,
            note=of),
        Row("nothing but noise left", "1", clean, note=of),
    ]  # fmt: skip
    kinds = ("refit", "final", "over noise", "friction off", "s", "s of processor")
    spreads = [row(kind, "", spread(o.values.get(kind, np.inf) for o in outcomes)) for kind in kinds]
    each = [row(o.what, "", o.values, note=o.said) for o in outcomes]
    return Report(name, title, [Table("all", overall), Table("spread", spreads), Table("each", each)], [note])


def run(options: Options) -> Report:
    """Twenty structures."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
