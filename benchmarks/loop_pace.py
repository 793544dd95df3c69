"""Processor time of a sample of the loop with all that a run does for it, beside the loop as it was before designs."""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.report import Options, Report, Row, Table, load, row
from gyro_model.build import build
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

BEFORE: Final = "5d13ef1^"
"""The last commit whose loop is compiled by numba and knows of no design."""
SAMPLE_RATE: Final = 200e3
"""Of the reference device [Hz]."""
DURATION: Final = 4.0
SETTLED: Final = 0.5
"""From where on samples count [s]: a start takes longer."""
WINDOW: Final = 0.08
"""Over which a time is taken [s]: what is recorded is so in blocks of this length, or shorter ones that it is a
multiple of."""
ROUNDS: Final = 5
ROOT: Final = Path(__file__).parents[1]

# Runs in a process of its own, with the code before as with the present one: each calls back after a block. Nothing is
# drawn, so that the library which the code before drew with need not be there.
_PROGRAM: Final = """
import json, sys, time, types
sys.modules.update({name: types.ModuleType(name) for name in ("plotly", "plotly.offline")})
from cosim.master import simulate
try:
    from gyrotwin.tasks.run import Request, prepare
except ImportError:
    from gyrotwin.run import Request, prepare
times = []
run = prepare(Request("constant", seed=4, **json.loads(sys.argv[1])))
simulate(run, lambda t, _: times.append((t, time.process_time())))
print(json.dumps(times))
"""


class Kind(NamedTuple):
    """What is run: fields of its Request; before: by the code of BEFORE; limit: of its time over that of the plain run
    there."""

    asked: Mapping[str, Any] = {}
    before: bool = False
    limit: float | None = None


PLAIN_BEFORE: Final = "before designs, plain"
KINDS: Final[Mapping[str, Kind]] = {
    PLAIN_BEFORE: Kind(before=True),
    "before designs, sensing defects": Kind({"sensing_defects": True}, before=True),
    "plain": Kind({"design": "plain"}, limit=0.5),
    "lab": Kind({"design": "lab"}, limit=1.0),
    "lab, reference_as_built": Kind({"design": "lab", "device": "reference_as_built"}),
}


def sample_times(kind: Kind, root: Path, duration: float = DURATION) -> Floats:
    """Processor times of a sample [us], a mean over each WINDOW, of a run by the code in ``root``. Raises InputError
    where it fails."""
    asked = json.dumps({**kind.asked, "duration": duration})
    t, spent = np.array(json.loads(_python(root, "-c", _PROGRAM, asked))).T
    ends = np.arange(SETTLED, duration, WINDOW)
    found: Floats = np.diff(np.interp(ends, t, spent)) / (WINDOW * SAMPLE_RATE) * 1e6
    return found


def _python(root: Path, *arguments: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(root)}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=root, env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise InputError(f"a run of the code in {root} failed: {done.stderr.strip()[-300:]}")
    return done.stdout


def extract(folder: Path) -> None:
    """Puts the code of BEFORE into ``folder`` and builds its FMUs. Raises InputError where the history is not there."""
    archive = subprocess.run(["git", "archive", BEFORE], cwd=ROOT, capture_output=True, check=False)
    if archive.returncode:
        raise InputError(f"{BEFORE}: not in the history; run in a full clone of the repository")
    subprocess.run(["tar", "-x", "-C", str(folder)], input=archive.stdout, check=True)
    _python(folder, "build_fmu.py")


def measure(rounds: int, folder: Path) -> dict[str, Floats]:
    """Times of a sample [us] of each kind, which take turns, so that all meet the same machine."""
    times: dict[str, list[Floats]] = {name: [] for name in KINDS}
    for _ in range(rounds):
        for name, kind in KINDS.items():
            times[name].append(sample_times(kind, folder if kind.before else ROOT))
    return {name: np.concatenate(found) for name, found in times.items()}


def rows_of(times: Mapping[str, Sequence[float] | Floats]) -> list[Row]:
    """A row a kind. Compared are quartiles: whatever disturbs makes a window longer."""
    quartile = {name: float(np.quantile(found, 0.25)) for name, found in times.items()}
    return [
        row(
            name,
            "µs",
            {
                "25 %": quartile[name],
                "median": float(np.median(found)),
                "over before": quartile[name] / quartile[PLAIN_BEFORE],
            },
            limit=KINDS[name].limit,
            judged=("over before",),
        )
        for name, found in times.items()
    ]


def run(options: Options) -> Report:
    """Five rounds, alone."""
    rounds, before = options.seeds_or(ROUNDS), load()
    build()
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as folder:
        extract(Path(folder))
        times = measure(rounds, Path(folder))
    notes = [
        f"`constant`, seed 4, {DURATION:g} s: plant, observer, controller, flag, angle units and trace, without start "
        f"and report; means over {WINDOW:g} s from {SETTLED:g} s on, {rounds} rounds.",
        f"Before designs: commit {BEFORE}, with the same interpreter and libraries. Over before: the quartile over "
        "that of its plain run.",
        "Before: " + before,
        "After: " + load(),
    ]
    table = Table("processor time of a sample", rows_of(times))
    return Report("loop_pace", "Time of a sample of the loop", [table], notes)
