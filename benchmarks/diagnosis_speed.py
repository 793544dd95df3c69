"""What a diagnosis costs: time and memory on 4 runs of 40,000 samples, and on ten times the samples and the runs.

Each measurement is a process of its own, so that the peak of the memory is its own; the FMUs are built and the code is
loaded and compiled before the clock starts.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final, NamedTuple

from benchmarks.report import Options, Report, Row, Table, load
from discrepancy.criteria import Criteria
from discrepancy.data.dataset import load_dataset
from discrepancy.diagnose import diagnose
from discrepancy.discover.term_search import TermSearch
from discrepancy.trial_runs import write_trial
from gyro_model.device import load_device
from gyro_model.model import load_model

HIDDEN: Final = {"k3_x": 2e8, "k3_y": 2e8, "angular_gain": 0.8}
"""A cubic stiffness and an angular gain."""
SIZES: Final = ((4, 40_000), (4, 400_000), (31, 40_000))
"""Runs, the last of them held out, and samples a run: the others have ten times the samples of the first."""
UNHURRIED: Final = Criteria(time_limit=3600.0)
"""The whole search is measured, however many the runs."""
WITHIN_S: Final = 8.0
GROWTH: Final = 0.9
"""Of the time, over that of the data."""
WITHIN_GB: Final = 2.0


class Cost(NamedTuple):
    """Of one diagnosis: wall and CPU time [s], peak of the resident memory [GB], and what was named."""

    wall_s: float
    cpu_s: float
    memory_gb: float
    named: tuple[str, ...]


def main() -> None:
    """Measures the diagnosis of the data set named on the command line; prints a ``Cost`` as JSON."""
    dataset, model = load_dataset(Path(sys.argv[1])), load_model()
    with tempfile.TemporaryDirectory() as terms:
        _warm(Path(terms))
        wall, cpu = time.perf_counter(), time.process_time()
        found = diagnose(dataset, model, further=TermSearch(Path(terms)), criteria=UNHURRIED)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(json.dumps(Cost(wall, cpu, peak, tuple(e["id"] for e in found.report()["effects"]))))


def _warm(folder: Path) -> None:
    """A small diagnosis, so that everything is loaded and compiled."""
    small = write_trial(load_device("reference"), {"k3_x": 2e9}, folder / "small", samples=2000)
    diagnose(load_dataset(small.parent), load_model(), further=TermSearch(folder))


def measured(runs: int, samples: int) -> Cost:
    """The cost of ``runs`` runs of ``samples`` samples, from a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        path = write_trial(load_device("reference"), HIDDEN, Path(folder) / "trial", runs=runs, samples=samples)
        command = [sys.executable, "-m", "benchmarks.diagnosis_speed", str(path.parent)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    return Cost(*json.loads(done.stdout.splitlines()[-1]))


def run(options: Options) -> Report:
    """The measures of this benchmark."""
    rows = []
    base: Cost | None = None
    for runs, samples in SIZES:
        cost = measured(runs, samples)
        base = base or cost
        grown = (runs - 1) * samples / ((SIZES[0][0] - 1) * SIZES[0][1])
        what = f"{runs} runs of {samples:,} samples"
        note = f"{', '.join(cost.named)}; {cost.cpu_s:.1f} s CPU"
        if grown > 1:
            note += f"; {grown:g} times the data in {cost.wall_s / base.wall_s:.3g} times the time"
        limit = WITHIN_S if grown == 1 else GROWTH * grown * base.wall_s
        rows.append(Row(what, "s", {"measured": cost.wall_s}, limit, note=note))
        rows.append(Row(what, "GB", {"measured": cost.memory_gb}, WITHIN_GB if grown == 1 else None))
    notes = [
        load(),
        f"One process, {os.cpu_count()} cores; hidden: {', '.join(f'{k} = {v:g}' for k, v in HIDDEN.items())}.",
    ]
    return Report("diagnosis_speed", "What a diagnosis costs", [Table("cost of a diagnosis", rows)], notes)


if __name__ == "__main__":
    main()
