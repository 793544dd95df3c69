"""What a worker does with a point: the task is called, and whatever happens becomes a row."""

import hashlib
import inspect
import math
import sys
import time
import types
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

from gyro_model.device import Device
from gyro_model.errors import InputError, nearest
from gyrotwin.sweeping.plan import Plan, Point

DEFAULT_OUTPUTS: Final = {
    "run": ("angle.rms_deg", "angle.drift_deg_per_s", "omega.rms_error", "converged_at", "valid.share"),
    "rate": ("bias_deg_s", "scale_factor", "quadrature_deg_s", "drive_frequency_hz.mean"),
    "diagnose": ("verdict", "misfit.final", "misfit.noise_floor"),
}
DESIGNER: Final = "designer."
"""Parameters of this prefix are what ``Device.from_designer`` takes."""


class Job(NamedTuple):
    """A task in a form that travels: a name, or the source text of a user's file with the function's name."""

    task: str
    source: bytes
    fixed: Mapping[str, Any]
    outputs: tuple[str, ...]


class Done(NamedTuple):
    """A point with its outputs, or with the error in one line; seconds: of processor and user."""

    point: Point
    outputs: Mapping[str, float | str | None]
    error: str | None
    seconds: float


def job_of(plan: Plan) -> Job:
    """The task of ``plan``. Raises InputError where there is none of that name."""
    if ".py:" in plan.task:
        path = Path(plan.task.rpartition(":")[0])
        if not path.is_file():
            raise InputError(f"task {plan.task}: there is no file {path}")
        job = Job(plan.task, path.read_bytes(), dict(plan.fixed), tuple(plan.outputs))
        _function(job)
        return job
    if plan.task not in DEFAULT_OUTPUTS:
        hint = nearest(plan.task, DEFAULT_OUTPUTS)
        raise InputError(f"task {plan.task!r}: give {', '.join(DEFAULT_OUTPUTS)} or FILE.py:FUNCTION{hint}")
    return Job(plan.task, b"", dict(plan.fixed), tuple(plan.outputs) or DEFAULT_OUTPUTS[plan.task])


def work(job: Job, points: Sequence[Point]) -> list[Done]:
    """The points of a batch, one after the other; products of matrices on one thread, so that rows are the same
    everywhere."""
    from threadpoolctl import threadpool_limits

    with threadpool_limits(1):
        return [_one(job, point) for point in points]


def _one(job: Job, point: Point) -> Done:
    start = time.perf_counter()
    try:
        result = _call(job, point)
        outputs = {name: _plain(_picked(result, name)) for name in job.outputs or sorted(result)}
        error = None
    except (Exception, SystemExit) as failure:
        outputs = {}
        error = f"{type(failure).__name__}: {failure}".splitlines()[0]
    return Done(point, outputs, error, time.perf_counter() - start)


def _call(job: Job, point: Point) -> Mapping[str, Any]:
    if job.source:
        function = _function(job)
        takes = inspect.signature(function).parameters
        seed = {"seed": point.seed} if "seed" in takes else {}
        result = function(**job.fixed, **point.values, **seed)
        return result if isinstance(result, Mapping) else {"value": result}
    from gyrotwin import api

    function = getattr(api, job.task)
    takes = inspect.signature(function).parameters
    arguments: dict[str, Any] = {**job.fixed, "seed": point.seed}
    designer = {}
    for name, value in point.values.items():
        if name.startswith(DESIGNER):
            designer[name.removeprefix(DESIGNER)] = value
        elif name in takes:
            arguments[name] = value
        else:
            arguments["parameters"] = {**arguments.get("parameters", {}), name: value}
    designer = {**arguments.pop("designer", {}), **designer}
    if designer:
        arguments["device"] = Device.from_designer(**designer)
    return function(**arguments).summary


_LOADED: dict[str, types.ModuleType] = {}
"""Users' files of this worker, by the hash of their text."""


def _function(job: Job) -> Callable[..., Any]:
    digest = hashlib.sha256(job.source).hexdigest()
    path, _, name = job.task.rpartition(":")
    if digest not in _LOADED:
        module = types.ModuleType(f"_sweep_{digest[:12]}")
        sys.modules[module.__name__] = module
        try:
            exec(compile(job.source, path, "exec"), module.__dict__)
        except (Exception, SystemExit) as error:
            raise InputError(f"task file {path}: {type(error).__name__}: {error}") from error
        _LOADED[digest] = module
    function = getattr(_LOADED[digest], name, None)
    if not callable(function):
        raise InputError(f"task {job.task}: the file defines no function {name}")
    return function


def _picked(result: Mapping[str, Any], name: str) -> Any:
    """The entry of a summary by its dotted name."""
    value: Any = result
    group = ""
    for key in name.split("."):
        if not isinstance(value, Mapping) or key not in value:
            known = [f"{group}{k}" for k in value] if isinstance(value, Mapping) else []
            there = f"; there are {', '.join(known)}" if known else f"; {group.rstrip('.')} is a single value"
            raise InputError(f"output {name!r} is unknown{there}{nearest(group + key, known)}")
        value = value[key]
        group += f"{key}."
    if isinstance(value, Mapping):
        raise InputError(f"output {name!r} is a group; there are {', '.join(f'{group}{k}' for k in value)}")
    return value


def _plain(value: Any) -> float | str | None:
    if value is None or isinstance(value, str):
        return value
    number = float(value)
    return number if math.isfinite(number) else None
