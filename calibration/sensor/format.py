"""What a format of another program is, and which there are."""

import importlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from calibration.sensor.numbers import Sensor
from gyro_model.errors import InputError, nearest

FOLDER: Final = Path(__file__).parent / "formats"


class Format(NamedTuple):
    """suffix: of the file, whose name is sensor_FORMAT; text: of a sensor that is read so many times a second [Hz]."""

    suffix: str
    text: Callable[[Sensor, float], str]


def format_names() -> list[str]:
    """Names of the formats."""
    return sorted(path.stem for path in FOLDER.glob("[a-z]*.py"))


FMU: Final = "fmu"
"""GyroscopeSensor.fmu, which is no text."""


def chosen(names: Sequence[str]) -> tuple[list[str], bool]:
    """Of formats by name, none meaning all: those that are texts, and whether the FMU is among them. Raises InputError
    for a format that is none."""
    known = [FMU, *format_names()]
    for name in names:
        if name not in known:
            raise InputError(f"format {name!r} is unknown{nearest(name, known)}; there are {', '.join(known)}")
    wanted = list(names) or known
    return [name for name in wanted if name != FMU], FMU in wanted


def files_of(sensor: Sensor, sample_rate: float, names: Sequence[str] | None = None) -> dict[str, str]:
    """The files by name, of the formats ``names``, None: of all. Raises InputError for a sample rate that is none."""
    if not 1e-3 <= sample_rate <= 1e7:
        raise InputError(f"sample rate {sample_rate:g} Hz: give one from 1e-3 to 1e7 Hz")
    found = {
        name: importlib.import_module(f"calibration.sensor.formats.{name}").FORMAT
        for name in (format_names() if names is None else names)
    }
    return {f"sensor_{name}.{one.suffix}": one.text(sensor, sample_rate) for name, one in found.items()}
