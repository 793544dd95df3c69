"""Runs that a device would give, as a data set."""

from pathlib import Path

import numpy as np
import polars as pl
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


def test_a_table_is_played_as_a_further_run_to_fit(tmp_path: Path) -> None:
    t = np.arange(300) / 1e5
    table = pl.DataFrame({"t": t, "u_x": 1e-6 * np.sin(2e4 * t), "u_y": 0 * t, "v_bias": np.where(t < 1e-3, 0.0, 10.0)})
    table.write_csv(tmp_path / "next-x.csv")
    hidden = {"softening": 1e-3}
    path = write_trial(
        load_device("reference"), hidden, tmp_path / "trial", samples=1000, runs=2, play=[tmp_path / "next-x.csv"]
    )
    data = load_dataset(path.parent)
    first, played = data.fit
    assert (len(first.t), len(played.t), len(data.held_out)) == (1000, 300, 1)
    assert played.sample_rate == pytest.approx(1e5, rel=1e-6)
    # A CSV keeps every digit.
    assert np.array_equal(played.u[:, 0], table["u_x"].to_numpy())
    assert np.array_equal(played.conditions["v_bias"], table["v_bias"].to_numpy())


def test_a_table_that_is_no_run_is_refused(tmp_path: Path) -> None:
    pl.DataFrame({"t": [0.0, 1.0], "u_x": [0.0, 1.0]}).write_csv(tmp_path / "half.csv")
    with pytest.raises(InputError, match="column u_y is missing"):
        write_trial(load_device("reference"), {}, tmp_path / "trial", samples=1000, play=[tmp_path / "half.csv"])
