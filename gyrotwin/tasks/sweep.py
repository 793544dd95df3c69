"""A sweep from its plan to rows, sweep.json and a page; resumed where rows are there already."""

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from gyro_model.errors import InputError
from gyro_model.progress import Progress
from gyrotwin.interrupt import Interrupted
from gyrotwin.output import check_writable, publish
from gyrotwin.results import write_json
from gyrotwin.sweeping import rows
from gyrotwin.sweeping.engine import BATCH_SECONDS, check_dask, cluster
from gyrotwin.sweeping.engine import sweep as work_off
from gyrotwin.sweeping.plan import Plan, load_plan
from gyrotwin.sweeping.result import SweepResult
from gyrotwin.sweeping.scale import Scale, simulate
from gyrotwin.sweeping.work import Done, job_of, work

STATE: Final = "sweep.json"
TRIED: Final = 3
"""Points by which the time of a task is measured."""


def sweep(
    plan: str | Path | Mapping[str, Any] | Plan,
    out: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> SweepResult:
    """Run a task at many points, on the cores of this machine or of a Dask cluster.

    Parameters
    ----------
    plan : str, Path, mapping or Plan
        Plan file, or its content: task, parameters, sampling, seeds, outputs, limits.
    out : str or Path
        Folder for the rows (Parquet, one file a batch), sweep.json and report.html. Rows of the same plan that are
        there are kept: an interrupted sweep goes on.
    workers : int
        Processes; None: one a core.
    scheduler : str
        Address of a Dask scheduler, whose workers have the same version of this package.
    force : bool
        Write even into a folder that holds other files, put the rows of this plan in the place of another's, and try
        failed points again.
    progress : callable
        Called with the points done and all points.

    Returns
    -------
    SweepResult
        With ``rows``, ``summary``, ``sensitivity``, ``worst()``.

    Raises
    ------
    InputError
        If the plan is wrong, Dask is missing, or ``out`` holds the rows of another plan or of another text of the
        task's file.

    """
    chosen = load_plan(plan)
    job = job_of(chosen)
    points = chosen.points()
    folder = Path(out)
    check_writable(folder, force=force)
    digest = chosen.digest(job.source)
    _claim(folder, digest, force=force)
    if force:
        rows.drop_failed(folder)
    there = set(rows.read(folder)["point"].to_list())
    missing = [point for point in points if point.number not in there]
    if missing:
        try:
            with cluster(workers, scheduler) as client:
                if progress is not None:
                    progress(0, len(missing))
                work_off(client, job, missing, folder, progress)
        except Interrupted as stop:
            if kept := len(rows.read(folder)):
                stop.left = f"{folder} keeps {kept} of {len(points)} points: the same command goes on from there"
            raise
    rows.level(folder)
    result = SweepResult(chosen, folder, digest)
    from gyrotwin.sweeping.page import render

    publish(folder, {STATE: write_json(result.summary), "report.html": lambda path: render(result, path)}, force=force)
    return result


def _claim(folder: Path, digest: str, *, force: bool) -> None:
    """Makes ``folder`` that of the plan of this digest. Raises InputError where it is another's; with ``force`` the
    other's rows are deleted."""
    state = folder / STATE
    try:
        there = json.loads(state.read_text(encoding="utf-8")).get("plan") if state.is_file() else None
    except (OSError, ValueError, RecursionError):
        there = "unreadable"
    other = there not in (None, digest) and len(rows.read(folder)) > 0
    if other and not force:
        raise InputError(
            f"output folder {folder}: holds the rows of another plan or version of gyrotwin, "
            f"or a file that it names was changed; name another with --out, or --force to compute them anew"
        )
    try:
        for kind in (rows.ROWS, rows.TIMES):
            if other and (folder / kind).exists():
                shutil.rmtree(folder / kind)
        folder.mkdir(parents=True, exist_ok=True)
        if there != digest:
            state.write_text(json.dumps({"plan": digest}) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"output folder {folder}: {error.strerror}; name another with --out") from None


def replay(plan: str | Path | Plan, number: int) -> Done:
    """One point of a plan again, in this process. Raises InputError where there is no such point."""
    chosen = load_plan(plan)
    points = chosen.points()
    if not 0 <= number < len(points):
        raise InputError(f"--point {number}: the plan has points 0 to {len(points) - 1}")
    return work(job_of(chosen), [points[number]])[0]


def simulate_scale(plan: str | Path | Plan) -> Scale:
    """What 10,000 points of the plan would cost on more cores, from the measured time of its first ones."""
    check_dask()
    chosen = load_plan(plan)
    # The first call loads and compiles what later ones find.
    done = work(job_of(chosen), chosen.points()[: TRIED + 1])
    failed = [d.error for d in done if d.error is not None]
    if failed:
        raise InputError(f"plan: a point fails, so that its time says nothing: {failed[0]}")
    later = done[1:] or done
    return simulate(min(d.seconds for d in later), BATCH_SECONDS)
