"""Writes GyroscopeSensor.fmu of a gyroscope: the libraries of the package's, start values of its own; no compiler."""

import struct
import zipfile
from collections.abc import Mapping
from pathlib import Path

from gyro_model import generate_package, generate_xml
from gyro_model.build import Fmus, build, issue_date, model_token, pack
from gyro_model.sensor import SensorModel

STARTS = "resources/starts.txt"


def write_sensor(parameters: Mapping[str, float], folder: Path, libraries: Fmus | None = None) -> Fmus:
    """The FMUs ``fmi2/GyroscopeSensor.fmu`` and ``fmi3/GyroscopeSensor.fmu`` in ``folder`` that start with
    ``parameters`` [SI].

    libraries: FMUs of the sensor to take libraries and sources from; None: the package's, which are compiled where they
    are missing. Raises InputError for an unknown parameter, a value out of bounds, or where compiling fails.
    """
    sensor = SensorModel().starting_at(parameters)
    libraries = libraries or build(SensorModel())
    written = Fmus(*(folder / fmi / f"{sensor.NAME}.fmu" for fmi in Fmus._fields))
    starts = starts_file(sensor)
    token = f"{model_token(SensorModel())}+{hash_of(starts):016x}"
    for fmi, path in written._asdict().items():
        with zipfile.ZipFile(getattr(libraries, fmi)) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
        if fmi == "fmi2":
            sources = [name.removeprefix("sources/") for name in files if name.endswith(".c")]
            description = generate_xml.fmi2(sensor, token, issue_date(), sorted(sources))
        else:
            description = generate_xml.fmi3(sensor, token, issue_date())
        own = {"modelDescription.xml": description.encode(), STARTS: starts}
        pack(files | generate_package.package_files(sensor, fmi) | own, path)
    return written


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
