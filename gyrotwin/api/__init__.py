"""The functions of the package; each command is a thin skin over the one of its name."""

from gyro_model.progress import Progress
from gyrotwin.api.datasets import MOST_EFFECTS, diagnose, diagnose_each, load_dataset, simulate_dataset
from gyrotwin.api.datasheets import datasheet, export_sensor
from gyrotwin.api.files import DeviceSource, effects, load_design, load_device
from gyrotwin.api.fmu import build, verify
from gyrotwin.api.playing import play
from gyrotwin.api.records import compensate, split
from gyrotwin.api.simulation import match, rate, run

__all__ = [
    "MOST_EFFECTS",
    "DeviceSource",
    "Progress",
    "build",
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
    "simulate_dataset",
    "split",
    "verify",
]
