"""`gyrotwin sweep`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from gyrotwin.terminal_table import Table

console = Console()


def sweep(
    plan: Annotated[Path, typer.Argument(help="Plan file: task, parameters, sampling, seeds, outputs, limits.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder for rows, sweep.json, report.html; default results/PLAN.")
    ] = None,
    workers: Annotated[int | None, typer.Option(help="Processes on this machine; default one a core.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler, as in tcp://host:8786.")
    ] = None,
    point: Annotated[int | None, typer.Option(help="Only replay the point of this number, here.")] = None,
    simulate_scale: Annotated[
        bool, typer.Option("--simulate-scale", help="Only print what 10,000 points cost on 2, 100 and 1,000 cores.")
    ] = False,
    force: Annotated[
        bool,
        typer.Option(
            "--force", help="Write even into a folder that holds other files or another plan's rows; retry failures."
        ),
    ] = False,
) -> None:
    """Run a task at many points: grids, lists, distributions; on Dask.

    Exit code 1: all points failed.
    """
    from gyrotwin.progress import shown_progress
    from gyrotwin.tasks import sweep as task

    if point is not None:
        done = task.replay(plan, point)
        for name, value in {**done.point.values, "seed": done.point.seed, **done.outputs, "error": done.error}.items():
            console.print(f"{name} = {value}", highlight=False, markup=False)
        return
    if simulate_scale:
        console.print("timing the first points, then a scheduler with stub tasks, some 10 s ...", highlight=False)
        console.print(_scale(task.simulate_scale(plan)))
        return
    folder = out or Path("results") / plan.stem
    with shown_progress(console, plan.stem) as progress:
        result = task.sweep(plan, folder, workers=workers, scheduler=scheduler, force=force, progress=progress)
    summary = result.summary
    y = summary["yield"]
    reached = f"yield {y['value']:.1%} ({y['low']:.1%} to {y['high']:.1%})"
    told = reached if result.plan.limits else "no yield: the plan has no limits"
    console.print(f"{summary['points']} points, {summary['failed']} failed; {told}", highlight=False)
    if summary["failed"]:
        first = result.failed.row(0, named=True)
        given = ", ".join(f"{name} = {first[name]}" for name in result.plan.parameters)
        console.print(
            f"point {first['point']} ({given}): {first['error']}", soft_wrap=True, highlight=False, markup=False
        )
    console.print(f"report: {folder / 'report.html'}", soft_wrap=True, highlight=False)
    if summary["failed"] == summary["points"]:
        raise typer.Exit(1)


def _scale(scale: object) -> Table:
    from gyrotwin.sweeping.scale import DEVICES, Scale

    assert isinstance(scale, Scale)
    table = Table(
        title=f"{DEVICES} points of {scale.task_seconds:.3g} s, {scale.batch} a batch",
        title_justify="left",
        caption_justify="left",
    )
    for heading in ("cores", "hours", "scheduler, ms a batch", "limited by"):
        table.add_column(heading, justify="right")
    for cost in scale.costs:
        table.add_row(str(cost.cores), f"{cost.hours:.3g}", f"{1e3 * cost.scheduler_seconds:.2g}", cost.limit)
    table.caption = f"the scheduler limits beyond {scale.scheduler_limit} cores"
    return table
