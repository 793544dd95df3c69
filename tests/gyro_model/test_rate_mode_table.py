"""The optional table [rate_mode] of a device file."""

from pathlib import Path

import pytest

from gyro_model.device import load_device, write_device
from gyro_model.errors import InputError


def test_table_survives_writing_and_a_change_of_parameters(tmp_path: Path) -> None:
    device = load_device("rate-mode")
    write_device(device.with_parameters({"tcd": 1e-3}), tmp_path / "d.toml")
    read = load_device(str(tmp_path / "d.toml"))
    assert read.rate_mode == device.rate_mode
    assert read.parameters["tcd"] == 1e-3


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("drive_amplitud = 1e-6", "did you mean 'drive_amplitude'"),
        ("drive_amplitude = 0", "give a positive number in m"),
        ('phase_bandwidth = "fast"', "give a positive number in Hz"),
    ],
)
def test_wrong_entries_are_refused(tmp_path: Path, line: str, says: str) -> None:
    path = tmp_path / "d.toml"
    path.write_text(f'format = 1\nname = "d"\n[rate_mode]\n{line}\n', encoding="utf-8")
    with pytest.raises(InputError, match=says):
        load_device(str(path))
