"""What `gyrotwin export sensor` gives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gyrotwin.numbers import significant
from gyrotwin.results import Saved, Writer

if TYPE_CHECKING:
    from calibration.sensor.numbers import Sensor


@dataclass(frozen=True)
class SensorResult(Saved):
    """A sensor in the formats of other programs; see `gyrotwin.export_sensor`."""

    sensor: "Sensor"
    files: Mapping[str, str] = field(repr=False)
    """Text of each file by name."""

    @property
    def summary(self) -> Mapping[str, Any]:
        """The numbers of the sensor, SI."""
        return self.sensor._asdict()

    def writers(self) -> Mapping[str, Writer]:
        """One file a format."""
        return {name: _writer(text) for name, text in self.files.items()}

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
