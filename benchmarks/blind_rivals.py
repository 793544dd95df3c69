"""``python -m benchmarks.blind_rivals``: what others would say of the data of the blind trials, beside the diagnosis.

Trials are drawn by seed from those that ``python -m benchmarks.blind_trials`` has answered and kept. One answer file a
trial and rival, so that an interrupted run goes on where it was.
"""

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
import typer
from rich.console import Console

from benchmarks.blind.grade import DISCOVERED, Grade, grade
from benchmarks.blind.runner import data_folder, result_file
from benchmarks.report import RESULTS, Report, Row, Table, show, write
from benchmarks.rivals import symbolic, weak_form
from gyro_model.errors import InputError
from gyro_model.whole_file import whole_file

NAME = "blind_rivals"
OWN: Final = "gyrotwin"
RIVALS: Final[Mapping[str, Callable[[Path], dict[str, Any]]]] = {
    "pysindy, weak form": weak_form.diagnosis,
    "gplearn, on the linear residual": symbolic.diagnosis,
}
console = Console(width=None if sys.stdout.isatty() else 160)


def main(
    folder: Annotated[Path, typer.Option(help="Of blind_trials: data, labels and results, as it was run with --keep.")],
    count: Annotated[int, typer.Option(min=1, help="Trials, drawn from those in the folder.")] = 100,
    seed: Annotated[int, typer.Option(min=0, help="Of the draw.")] = 1,
    jobs: Annotated[int, typer.Option(min=1, help="Processes at a time.")] = 2,
    target: Annotated[Path, typer.Option(help="Where the tables go.")] = RESULTS,
) -> None:
    """Draw trials, ask every rival, grade all answers by the same labels, and write the table."""
    try:
        report = compare(folder / "report", count, seed, jobs)
        show(report, console)
        write(report, " ".join(["python -m benchmarks.blind_rivals", *sys.argv[1:]]), target)
    except InputError as error:
        console.print(f"blind_rivals: {error}", markup=False, highlight=False, style="red")
        sys.exit(2)


def compare(folder: Path, count: int, seed: int, jobs: int) -> Report:
    """The report on ``count`` trials in ``folder``. Raises InputError where it holds none whose data were kept."""
    names = drawn(folder, count, seed)
    questions = [(folder, name, rival) for name in names for rival in RIVALS]
    answers = {}
    # Spawned: the threads of numba and polars do not survive a fork.
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for done, (_, name, rival) in zip(pool.map(ask, *zip(*questions, strict=True)), questions, strict=True):
            answers[name, rival] = done
            console.print(f"{name}, {rival}: {_said(done)}", markup=False, highlight=False, soft_wrap=True)
    results = {name: json.loads(result_file(folder, name).read_text(encoding="utf-8")) for name in names}
    answers = {(name, OWN): result["answer"] for name, result in results.items()} | answers
    notes = [
        f"{len(names)} trials drawn by seed {seed} from those that were kept. All answers are graded by one function.",
        "The rivals get the diagnosis' own library of 170 products of states and forces, and every effect that such a "
        "product is to first order counts as named. What is no product (a delay, a lag, friction, play, hysteresis, a "
        "stop, the sense chain) they cannot name; the row of the terms in no file is the one where all can be right.",
        f"Code that answered for {OWN}: {', '.join(sorted({r['code'][:12] for r in results.values()}))} (SHA-256).",
    ]
    return Report(NAME, "The diagnosis and others on the same blind trials", tables(results, answers), notes)


def drawn(folder: Path, count: int, seed: int) -> list[str]:
    """Names of ``count`` trials that have a result and their data, by a seed."""
    kept = [path.stem for path in sorted(result_file(folder, "x").parent.glob("*.json"))
            if any(data_folder(folder, path.stem).glob("*.parquet"))]  # fmt: skip
    if not kept:
        raise InputError(f"--folder {folder.parent}: no trial with its data: run benchmarks.blind_trials --keep first")
    return sorted(np.random.default_rng(seed).permutation(kept)[:count].tolist())


def ask(folder: Path, name: str, rival: str) -> dict[str, Any]:
    """A rival's answer on a trial, from its file where it was asked before."""
    file = folder / "rivals" / f"{name}-{list(RIVALS).index(rival)}.json"
    if not file.is_file():
        try:
            answer = RIVALS[rival](data_folder(folder, name))
        except InputError:
            raise
        except Exception as error:  # a rival's every failure is an answer
            answer = {"error": f"{type(error).__name__}: {error}"}
        with whole_file(file) as written:
            written.write(json.dumps(answer, indent=1).encode())
    said: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return said


def tables(results: Mapping[str, Mapping[str, Any]], answers: Mapping[tuple[str, str], dict[str, Any]]) -> list[Table]:
    """Shares side by side, of all trials and by kind: right answers, false names, right formulas."""
    whose = (OWN, *RIVALS)
    graded = {(name, who): own for name, result in results.items() for who in whose
              if (own := grade({**result, "answer": answers[name, who]}))}  # fmt: skip
    kinds = {"all": list(results)}
    for name in sorted(results):
        kinds.setdefault(results[name]["kind"], []).append(name)

    def table(title: str, counts: Callable[[Grade], bool]) -> Table:
        return Table(title, [_row(kind, {who: [counts(graded[n, who]) for n in names] for who in whose})
                             for kind, names in kinds.items()])  # fmt: skip

    made = [table("right answers", lambda g: g.right), table("an effect is named that is not there", _false)]
    kinds = {kind: names for kind, names in kinds.items() if kind == "unknown"}
    return [*made, table("a term in no file: the formula is right", lambda g: bool(g.formula))]


def _row(kind: str, counted: Mapping[str, Sequence[bool]]) -> Row:
    shares = {who: sum(hits) / len(hits) for who, hits in counted.items()}
    return Row(kind, "1", {**shares, "of": float(len(counted[OWN]))})


def _false(g: Grade) -> bool:
    """Whether an effect file is named that neither acts nor is what a rightly told one may also be."""
    return not g.right and any(not name.startswith(DISCOVERED) and name not in g.truth for name in g.named)


def _said(answer: Mapping[str, Any]) -> str:
    return str(answer.get("error") or ", ".join(f["id"] for f in answer["effects"]) or answer["verdict"])


if __name__ == "__main__":
    typer.run(main)
