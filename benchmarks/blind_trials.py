"""``python -m benchmarks.blind_trials``: effects hidden by a generator of its own, and what the diagnosis finds.

Labels stay sealed until the answers are in; one result file a trial, so that an interrupted run goes on where it was.
"""

import sys
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console

from benchmarks.blind.grade import grade
from benchmarks.blind.plan import KINDS, Entry, entries
from benchmarks.blind.runner import Ask, run_all
from benchmarks.blind.summary import summarise
from benchmarks.blind.trial import BLOCKS
from benchmarks.report import RESULTS, show, write
from gyro_model.errors import InputError, nearest

NAME = "blind_trials"
console = Console(width=None if sys.stdout.isatty() else 160)


def main(
    kind: Annotated[str, typer.Option(help=f"Of {','.join(KINDS)}.")] = ",".join(KINDS),
    limit: Annotated[int | None, typer.Option(min=1, help="At most so many trials of each kind.")] = None,
    every: Annotated[int, typer.Option(min=1, help="Of each kind one trial in so many, drawn by a fixed seed.")] = 1,
    beyond: Annotated[
        int | None, typer.Option(min=2, help="Without those that --every N draws, for so large an N.")
    ] = None,
    only: Annotated[str, typer.Option(help="Trials whose name contains this.")] = "",
    seed_block: Annotated[str, typer.Option(help="tune, to choose thresholds on, or report.")] = "report",
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time.")] = 2,
    folder: Annotated[Path, typer.Option(help="Where data, labels and results go.")] = Path("blind-trials"),
    tool: Annotated[str, typer.Option(help="module:function, from a folder to a report.")] = Ask(Path()).tool,
    keep: Annotated[bool, typer.Option(help="Leave the tables on disk.")] = True,
) -> None:
    """Run trials, print the rates, and write them: to benchmarks/results/ for the report block, else into the
    folder."""
    try:
        if seed_block not in BLOCKS:
            raise InputError(f"--seed-block {seed_block!r}: use {', '.join(BLOCKS)}{nearest(seed_block, BLOCKS)}")
        kinds = tuple(kind.split(","))
        chosen = [entry for own in kinds for entry in _drawn(own, seed_block, only, (beyond, every), limit)]
        if not chosen:
            raise InputError(f"--only {only!r} leaves no trial: their names begin with {', '.join(KINDS)}")
        told = seed_block == "report" and not only and limit is None and set(kinds) == set(KINDS)
        run(chosen, jobs, Ask(folder / seed_block, tool, keep), RESULTS if told else folder / seed_block)
    except InputError as error:
        console.print(f"blind_trials: {error}", markup=False, highlight=False, style="red")
        sys.exit(2)


def _drawn(kind: str, block: str, only: str, shares: tuple[int | None, int], limit: int | None) -> Iterator[Entry]:
    """One trial in the second of ``shares``, without one in the first. Drawn: the plan goes through effects and
    difficulties in turn, and equal strides from trial to trial would always meet the same ones. A larger share holds
    every smaller one."""
    named = [entry for entry in entries((kind,), block) if only in entry.name]
    known, end = (-(-len(named) // share) if share else 0 for share in shares)
    drawn = np.random.default_rng(1).permutation(len(named)) if shares[1] > 1 else range(len(named))
    return islice((named[i] for i in drawn[known:end]), limit)


def run(chosen: Sequence[Entry], jobs: int, ask: Ask, target: Path) -> None:
    """The trials ``chosen``, then the tables, written to ``target``."""
    results = []
    for number, result in enumerate(run_all(chosen, ask, jobs), 1):
        results.append(result)
        found = grade(result)
        said = "not made" if found is None else f"{'right' if found.right else 'WRONG'}: {found.verdict} {found.named}"
        console.print(f"{number}/{len(chosen)} {result['id']}: {said}", markup=False, highlight=False, soft_wrap=True)
    results.sort(key=lambda result: result["id"])
    report = summarise(NAME, results)
    show(report, console)
    write(report, " ".join(["python -m benchmarks.blind_trials", *sys.argv[1:]]), target)
    console.print(f"written: {target / NAME}.json, .md", soft_wrap=True, highlight=False)


if __name__ == "__main__":
    typer.run(main)
