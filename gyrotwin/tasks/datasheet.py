"""A datasheet from a device to the result: which bench, which tests."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from gyro_model.device import Device, load_device
from gyro_model.errors import InputError, nearest
from gyro_model.progress import Progress
from gyrotwin.datasheet_result import DatasheetResult
from gyrotwin.interrupt import Interrupted
from gyrotwin.notice import LOGGER

if TYPE_CHECKING:
    from cosim.design import Design


FORMAT: Final = 1


class Request(NamedTuple):
    """A datasheet as asked for. design: what loops and calibration know: a device in rate mode, a design in whole-angle
    mode."""

    device: Device
    mode: str = "rate-open"
    standard: str = "ieee1431"
    design: "str | Path | Device | Design | None" = None
    seed: int = 1
    quick: bool = False


def find(request: Request, progress: Progress | None = None, checkpoint: Path | None = None) -> DatasheetResult:
    """Runs the tests. Raises InputError, with a remedy, for whatever is wrong in the request. checkpoint: file from
    which an interrupted datasheet goes on, and in which it is kept; None: none."""
    from calibration.datasheet.kept import KeptTests
    from calibration.datasheet.measure import measure
    from calibration.datasheet.procedure import STANDARDS, procedures

    if request.standard not in STANDARDS:
        raise InputError(
            f"--standard {request.standard}: there is {', '.join(STANDARDS)}{nearest(request.standard, STANDARDS)}"
        )
    procedures(request.mode)
    seed = int(request.device.model.parameter("seed").check(request.seed))
    make = _angle_bench if request.mode == "whole-angle" else _rate_bench
    benches: list[Any] = []

    def bench(advance: Callable[[float], None]) -> Any:
        benches.append(make(request._replace(seed=seed), advance))
        return benches[0]

    kept = None if checkpoint is None else KeptTests(checkpoint, LOGGER.info)
    try:
        tests = measure(bench, request.mode, progress, kept)
    except Interrupted as stop:
        if kept is not None and kept.count:
            stop.left = f"{kept.path} keeps {kept.count} tests: the same command goes on behind them"
        raise
    head = {
        "format": FORMAT,
        "standard": STANDARDS[request.standard],
        "device": request.device.name,
        "design": _name(request.design),
        "mode": request.mode,
        "seed": seed,
        "plan": "quick" if request.quick else "whole",
        "plant": _plant(benches[0]),
    }
    return DatasheetResult(head, tests)


def _rate_bench(request: Request, advance: Callable[[float], None]) -> Any:
    from cosim.rate.bench import QUICK, WHOLE, Bench
    from cosim.rate.settings import design_for

    design = request.design
    if design is not None:
        given = design if isinstance(design, Device) else load_device(str(design))
        design = design_for(given, request.device)
    plan = QUICK if request.quick else WHOLE
    bench = Bench(request.device, design, request.mode == "rate-closed", request.seed, plan, advance)
    bench.typical  # noqa: B018  (refuses what can't be before anything runs)
    return bench


def _angle_bench(request: Request, advance: Callable[[float], None]) -> Any:
    from cosim.angle_bench import QUICK, WHOLE, AngleBench
    from gyrotwin.api.files import load_design

    design = request.design
    given = None if design is None else load_design(design, request.device, request.seed)
    return AngleBench(request.device, given, request.seed, QUICK if request.quick else WHOLE, advance)


def _plant(bench: Any) -> dict[str, Any]:
    """What the long tests ran on, and how far the envelope is from the full FMU."""
    if not hasattr(bench, "agreement"):
        return {"long_tests": "full", "note": "whole-angle mode runs on the full FMU"}
    found = bench.agreement
    if found is None:
        note = "the device settles too slowly or swings too fast for the full FMU: nothing was compared"
        return {"long_tests": "envelope", "note": note}
    note = "envelope less full FMU: bias over full scale, scale factor, each with its standard error"
    return {
        "long_tests": "envelope" if found.agree else "full",
        "note": note,
        "bias": found.bias / bench.full_scale,
        "bias_error": found.bias_error / bench.full_scale,
        "scale_factor": found.scale_factor,
        "scale_factor_error": found.scale_factor_error,
    }


def _name(design: Any) -> str | None:
    return None if design is None else str(getattr(design, "name", design))
