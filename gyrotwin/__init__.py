"""A MEMS vibratory gyroscope as an FMU, the loop around it, and what its measured data say about it.

    import gyrotwin as gt

    run = gt.run("constant", seed=7)
    run.summary["angle"]["rms_deg"]

Names are loaded when they are first used, so that the import itself is quick. Messages go to the logger "gyrotwin".
"""

import importlib
import logging
from typing import TYPE_CHECKING, Any, Final

from gyro_model import VERSION as __version__

if TYPE_CHECKING:
    from cosim.design import Design
    from discrepancy.data.dataset import Dataset
    from gyro_model.device import Device
    from gyro_model.errors import InputError
    from gyrotwin.api import (
        build,
        compensate,
        datasheet,
        diagnose,
        diagnose_each,
        effects,
        export_sensor,
        load_dataset,
        load_design,
        load_device,
        match,
        play,
        rate,
        run,
        simulate_dataset,
        split,
        verify,
    )
    from gyrotwin.comparison import compare
    from gyrotwin.datasheet_result import DatasheetResult
    from gyrotwin.fleet_result import FleetResult
    from gyrotwin.match_result import MatchResult
    from gyrotwin.playing.page import PlayResult
    from gyrotwin.results import CompensationResult, DiagnosisResult, RateResult, RunResult, SplitResult
    from gyrotwin.schemas import schema
    from gyrotwin.sensor_result import SensorResult
    from gyrotwin.sweeping.result import SweepResult
    from gyrotwin.tasks.sweep import sweep

_HOMES: Final = {
    "Dataset": "discrepancy.data.dataset",
    "DatasheetResult": "gyrotwin.datasheet_result",
    "Design": "cosim.design",
    "Device": "gyro_model.device",
    "FleetResult": "gyrotwin.fleet_result",
    "InputError": "gyro_model.errors",
    "MatchResult": "gyrotwin.match_result",
    "PlayResult": "gyrotwin.playing.page",
    "SensorResult": "gyrotwin.sensor_result",
    "SweepResult": "gyrotwin.sweeping.result",
    "compare": "gyrotwin.comparison",
    "schema": "gyrotwin.schemas",
    "sweep": "gyrotwin.tasks.sweep",
    **dict.fromkeys(
        (
            *("build", "compensate", "datasheet", "diagnose", "diagnose_each", "effects", "export_sensor"),
            *(
                "load_dataset",
                "load_design",
                "load_device",
                "match",
                "play",
                "rate",
                "run",
                "simulate_dataset",
                "split",
            ),
            "verify",
        ),
        "gyrotwin.api",
    ),
    **dict.fromkeys(
        ("CompensationResult", "DiagnosisResult", "RateResult", "RunResult", "SplitResult"), "gyrotwin.results"
    ),
}

__all__ = [
    "CompensationResult",
    "Dataset",
    "DatasheetResult",
    "Design",
    "Device",
    "DiagnosisResult",
    "FleetResult",
    "InputError",
    "MatchResult",
    "PlayResult",
    "RateResult",
    "RunResult",
    "SensorResult",
    "SplitResult",
    "SweepResult",
    "__version__",
    "build",
    "compare",
    "compensate",
    "datasheet",
    "diagnose",
    "diagnose_each",
    "effects",
    "export_sensor",
    "load_dataset",
    "load_design",
    "load_device",
    "match",
    "play",
    "rate",
    "run",
    "schema",
    "simulate_dataset",
    "split",
    "sweep",
    "verify",
]

logging.getLogger("gyrotwin").addHandler(logging.NullHandler())


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'gyrotwin' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
