"""Datasheets of simulated gyroscopes."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gyro_model.device import Device
from gyro_model.errors import InputError
from gyro_model.progress import Progress
from gyrotwin.api.files import DeviceSource, load_device

if TYPE_CHECKING:
    from cosim.design import Design
    from gyrotwin.datasheet_result import DatasheetResult
    from gyrotwin.sensor_result import SensorResult


def datasheet(
    device: DeviceSource = "rate-mode",
    *,
    mode: str = "rate-open",
    standard: str = "ieee1431",
    design: "str | Path | Device | Design | None" = None,
    parameters: Mapping[str, float] | None = None,
    seed: int = 1,
    quick: bool = False,
    progress: Progress | None = None,
    checkpoint: str | Path | None = None,
) -> "DatasheetResult":
    """Measure the datasheet of a device by the tests of IEEE Std 1431 and the Allan analysis of IEEE Std 952.

    Parameters
    ----------
    device : str, Path or Device
        What is on the bench.
    mode : {"rate-open", "rate-closed", "whole-angle"}
        How it is run.
    standard : {"ieee1431"}
        Whose tests.
    design : str, Path, Device or Design
        All that loops and calibration know: a device in rate mode, a design in whole-angle mode; None: in rate mode the
        device itself, else what goes with the device.
    parameters : mapping of str to float
        Parameters of the device to change, SI, and settings ``rate_mode.NAME``.
    seed : int
        Of the first turn-on; each next one has the next seed.
    quick : bool
        Fewer and shorter records: half a minute, wider errors.
    progress : callable
        Called with the share done and the whole.
    checkpoint : str or Path
        File in which tests that are done are kept, and from which an interrupted datasheet goes on.

    Returns
    -------
    DatasheetResult
        With ``figures`` by id (value, unit, error, expected), ``summary``, ``save(folder)``.

    Raises
    ------
    InputError
        If an argument is wrong; the message names the remedy.

    Examples
    --------
    >>> import gyrotwin as gt
    >>> sheet = gt.datasheet("rate-mode", quick=True)
    >>> 60 < sheet.figures["bandwidth"].value < 70  # Hz
    True

    """
    from gyrotwin.tasks.datasheet import Request, find
    from gyrotwin.tasks.run import split_settings

    own, entries = split_settings([f"{n}={float(v)!r}" for n, v in (parameters or {}).items()], "rate_mode")
    plant = load_device(device).with_parameters(own)
    plant = replace(plant, rate_mode={**plant.rate_mode, **entries["rate_mode"]})
    kept = None if checkpoint is None else Path(checkpoint)
    return find(Request(plant, mode, standard, design, seed, quick), progress, kept)


def export_sensor(
    datasheet: "str | Path | Mapping[str, Any] | DatasheetResult",
    *,
    formats: Sequence[str] = (),
    sample_rate: float = 100.0,
) -> "SensorResult":
    """Give the sensor of a datasheet in the formats of other programs, and as GyroscopeSensor.fmu.

    The FMU (FMI 2.0 and 3.0) takes rate, acceleration, temperature and supply at any step and gives the rate, analogue
    and sampled, with the errors that the datasheet has; it is compiled once, not for each sensor.

    Parameters
    ----------
    datasheet : str, Path, mapping or DatasheetResult
        A datasheet.json, its content, or the result itself; of rate mode.
    formats : sequence of str
        Of fmu, kalibr, gnss_ins_sim, matlab, gazebo, px4; none: all.
    sample_rate : float
        At which the sensor is read there [Hz].

    Returns
    -------
    SensorResult
        With ``sensor`` (SI), ``files`` by name, ``parameters`` of the FMU (SI), ``save(folder)``.

    Raises
    ------
    InputError
        If the datasheet is none, is of whole-angle mode, lacks a figure, or a format is unknown.

    """
    from calibration.sensor.format import chosen, files_of
    from calibration.sensor.model import fitted_sensor
    from calibration.sensor.numbers import sensor_of
    from gyrotwin.datasheet_result import DatasheetResult
    from gyrotwin.sensor_result import SensorResult

    if isinstance(datasheet, DatasheetResult):
        content: Any = datasheet.summary
    elif isinstance(datasheet, Mapping):
        content = datasheet
    else:
        content = _read(Path(datasheet))
    sensor = sensor_of(content)
    texts, fmu = chosen(formats)
    files = files_of(sensor, sample_rate, texts)
    if not fmu:
        return SensorResult(sensor, files)
    fitted = fitted_sensor(content, sample_rate)
    return SensorResult(sensor, files, fitted.parameters, fitted.filter_error)


def _read(path: Path) -> Any:
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise InputError(
            f"datasheet {path}: {why}; give the datasheet.json that `gyrotwin datasheet DEVICE` wrote"
        ) from None
