"""What `gyrotwin export sensor` gives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gyro_model.build import Fmus
from gyro_model.sensor import SensorModel
from gyrotwin.numbers import significant
from gyrotwin.results import Saved, Writer

if TYPE_CHECKING:
    from calibration.sensor.numbers import Sensor

POOR_FILTER = 0.02
"""Packaged devices and devices of 3 to 35 kHz with Q of 100 to 100,000 stay below 0.01."""


@dataclass(frozen=True)
class SensorResult(Saved):
    """A sensor in the formats of other programs, and as an FMU; see `gyrotwin.export_sensor`."""

    sensor: "Sensor"
    files: Mapping[str, str] = field(repr=False)
    """Text of each file by name."""
    parameters: Mapping[str, float] = field(default_factory=dict, repr=False)
    """Those of GyroscopeSensor.fmu, SI; empty where no FMU is asked for."""
    filter_error: float = 0.0
    """Largest difference of the FMU's filter from the measured transfer function, over the gain at rest, or over the
    gain where that is larger."""

    @property
    def summary(self) -> Mapping[str, Any]:
        """The numbers of the sensor, SI."""
        return self.sensor._asdict()

    def writers(self) -> Mapping[str, Writer]:
        """One file a format; the FMUs in a folder for each standard."""
        texts = {name: _writer(text) for name, text in self.files.items()}
        standards = Fmus._fields if self.parameters else ()
        return texts | {f"{fmi}/{SensorModel.NAME}.fmu": self._fmu_writer(fmi) for fmi in standards}

    def _fmu_writer(self, fmi: str) -> Writer:
        def write(path: Path) -> None:
            from gyro_model.sensor_fmu import write_sensor_fmu

            write_sensor_fmu(self.parameters, fmi, path)

        return write

    @property
    def doubts(self) -> Sequence[str]:
        """What is not as the datasheet has it."""
        if self.filter_error <= POOR_FILTER:
            return []
        return [
            f"the FMU's filter is up to {significant(100 * self.filter_error, 2)} % off the transfer function of the "
            "datasheet: two sections of second order don't make it"
        ]

    def headline(self) -> Sequence[tuple[str, str]]:
        """Noise density and bias."""
        return [
            ("noise density", f"{significant(degrees(self.sensor.noise_density), 4)} °/s/√Hz"),
            ("bias", f"{significant(degrees(self.sensor.bias), 4)} °/s"),
        ]


def _writer(text: str) -> Writer:
    def write(path: Path) -> None:
        path.write_text(text, encoding="utf-8")

    return write
