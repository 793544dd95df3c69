"""Structures of several masses, the first of which is on a spring that bends and may rub: does the diagnosis name what
bends, what rubs and each mode, with their values?

Chains of two and three masses, forced and sensed at the first. The motion is found in steps of a thousandth of a
sample, by no line of the FMU.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from benchmarks import structures
from benchmarks.loop_runs import in_processes
from benchmarks.named import CLOSE, report_of
from benchmarks.report import Options, Report
from benchmarks.rubbing import Rubbing, motion
from benchmarks.structures import Outcome, Structure, chain, diagnosed, drawn_record, runs_of

SEEDS: Final = 20
FIRST: Final = 7501
"""The first seed, of which nothing was chosen."""
BENDS: Final = (0.1, 1.0)
"""By how much of its stiffness the spring of the first mass is stiffer at the rms of the motion without the bend."""
RUBS: Final = 0.5
"""Chance of a friction."""
FRICTIONS, NOISES = (0.03, 0.2), (1e-3, 1e-2)
"""Of the force, rms; of the motion, rms."""


class Bowed(NamedTuple):
    """The structure, k3 [N/m³] of the spring of its first mass, and the friction there [N]."""

    structure: Structure
    k3: float
    friction: float


def drawn(rng: np.random.Generator) -> Bowed:
    """A chain, what bends and what rubs."""
    own = chain(rng, int(rng.integers(2, 4)))
    [straight, *_] = runs_of(own.modes, rng, "position", "zero", 0.0, lambda u, h: structures.motion(own, u, h, "zero"))
    bend, friction = (float(np.exp(rng.uniform(*np.log(sizes)))) for sizes in (BENDS, FRICTIONS))
    k3 = bend * own.stiffness[0, 0] / (3 * float(np.mean(straight.v**2)))
    return Bowed(own, k3, friction if rng.random() < RUBS else 0.0)


def measure(seed: int) -> Outcome:
    """The diagnosis of one. Whatever goes wrong is an outcome."""
    rng = np.random.default_rng(seed)
    own = drawn(rng)
    senses, hold = drawn_record(rng)
    noise, n = float(np.exp(rng.uniform(*np.log(NOISES)))), len(own.structure.mass)
    device = Rubbing(own.structure, own.friction, 0.0, 1.0, own.k3)
    records = runs_of(own.structure.modes, rng, senses, hold, noise, lambda u, step: motion(device, u, step, hold))
    kind = f"rubs with {own.friction:.3f} N" if own.friction else "smooth"
    what = f"{n} masses, {kind}, {senses}, hold {hold}, noise {noise:.1e}, seed {seed}"
    modes = own.structure.modes.tolist()
    answer = diagnosed(records, noise)
    if answer is None:
        return Outcome(what, modes, "no linear start", False, {})
    found, values = answer
    wanted = {"k3_x": own.k3} | ({"friction_x": own.friction} if own.friction else {})
    sizes = {name: p.value for e in found.effects for name, p in e.parameters.items()}
    values["size off"] = max(abs(sizes.get(name, np.inf) / value - 1) for name, value in wanted.items())
    names = sorted(effect.id for effect in found.effects)
    resonators = ["parasitic_mode", "parasitic_mode_2"][: n - 1]
    there = ["cubic_stiffness", *(["dry_friction"] if own.friction else []), *resonators]
    right = found.verdict == "missing effects" and names == there and values["size off"] < CLOSE
    return Outcome(what, modes, f"{found.verdict}: {', '.join(names)}", right, values)


def make_report(seeds: Sequence[int], jobs: int) -> Report:
    """Draws and diagnoses a structure for each seed."""
    outcomes = in_processes(measure, list(seeds), jobs)
    note = "Two runs to fit, one held out, from rest. Final: misfit on the held-out run."
    title = f"Structures on a spring that bends, seeds from {seeds[0]}"
    return report_of("bowed", title, outcomes, ("smooth", "rubs"), note)


def run(options: Options) -> Report:
    """Twenty structures."""
    return make_report(range(FIRST, FIRST + options.seeds_or(SEEDS)), options.jobs)
