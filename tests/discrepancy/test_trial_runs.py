"""Runs that a device would give, as a data set."""

from pathlib import Path

import numpy as np
import pytest

from discrepancy.data.checks import check
from discrepancy.data.dataset import load_dataset
from discrepancy.trial_runs import SPREAD, write_trial
from gyro_model.device import load_device
from gyro_model.errors import InputError


def test_runs_are_a_sound_data_set_of_the_device(tmp_path: Path) -> None:
    device = load_device("reference")
    path = write_trial(device, {"k3_x": 2e9}, tmp_path / "trial", samples=2000)
    data = load_dataset(path.parent)
    assert [len(record.t) for record in data.records] == [2000] * 3
    assert len(data.held_out) == 1
    check(data)
    assert all(1e-7 < np.sqrt(np.mean(record.v**2)) / 1e6 < 2e-6 for record in data.records)
    true = device.all_parameters
    assert "k3_x" not in data.nominal
    assert all(abs(data.nominal[name] / true[name] - 1) <= SPREAD for name in ("m", "kxx", "dxy"))
    with pytest.raises(InputError, match="exists"):
        write_trial(device, {}, path.parent)


def test_unknown_parameters_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="k3_x"):
        write_trial(load_device("reference"), {"k3x": 1.0}, tmp_path / "trial")
    assert not (tmp_path / "trial").exists()
