"""Writes GyroscopeSensor.fmu of a gyroscope: the libraries of the package's, start values of its own; no compiler."""

import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path

from gyro_model import generate_package, generate_xml
from gyro_model.build import Fmus, build, issue_date, model_token, pack
from gyro_model.platforms import COMPONENT
from gyro_model.sensor import SensorModel

STARTS = "resources/starts.txt"


def write_sensor(parameters: Mapping[str, float], folder: Path) -> Fmus:
    """The FMUs ``fmi2/GyroscopeSensor.fmu`` and ``fmi3/GyroscopeSensor.fmu`` in ``folder`` that start with
    ``parameters`` [SI]. Raises InputError as ``write_sensor_fmu`` does."""
    written = Fmus(*(folder / fmi / f"{SensorModel.NAME}.fmu" for fmi in Fmus._fields))
    for fmi, path in written._asdict().items():
        write_sensor_fmu(parameters, fmi, path)
    return written


def write_sensor_fmu(parameters: Mapping[str, float], fmi: str, path: Path) -> None:
    """An FMU of ``fmi`` ("fmi2" or "fmi3") that starts with ``parameters`` [SI]: libraries and sources of the
    package's, which is compiled where it is missing, and a description and start values of its own.

    Raises InputError for an unknown parameter, a value out of bounds, or where compiling fails.
    """
    sensor = SensorModel().starting_at(parameters)
    starts = starts_file(sensor)
    token = f"{model_token(SensorModel())}+{hash_of(starts):016x}"
    # A component reads no files, so it can't have start values of its own.
    component = (f"binaries/{COMPONENT.fmi3}/", *generate_package.component_files())
    with zipfile.ZipFile(getattr(build(SensorModel()), fmi)) as archive:
        files = {name: archive.read(name) for name in archive.namelist() if not name.startswith(component)}
    if fmi == "fmi2":
        sources = sorted(name.removeprefix("sources/") for name in files if name.endswith(".c"))
        description = generate_xml.fmi2(sensor, token, issue_date(), sources)
    else:
        description = generate_xml.fmi3(sensor, token, issue_date())
    own = {"modelDescription.xml": description.encode(), STARTS: starts}
    pack(files | generate_package.package_files(sensor, fmi) | own, path)


def starts_file(sensor: SensorModel) -> bytes:
    """The file that ``fmu_src/sensor/fmi_starts.c`` reads: each start that differs, by the bits of its double."""
    rows = (f"{name} {struct.pack('>d', value).hex()} {value!r}\n" for name, value in sensor.starts)
    return "".join(rows).encode("ascii")


def hash_of(data: bytes) -> int:
    """FNV-1a, 64 bit."""
    value = 0xCBF29CE484222325
    for byte in data:
        value = (value ^ byte) * 0x100000001B3 % 2**64
    return value
