"""Devices and finished runs side by side."""

import json
from pathlib import Path

import pytest

import gyrotwin as gt
from gyrotwin.comparison import Number, shown


def test_two_devices_with_the_noise_of_their_differences(tmp_path: Path) -> None:
    first = gt.Device.from_designer(frequency=3000, split=30, q=2000, mass=1e-7, name="first")
    other = gt.Device.from_designer(frequency=3000, split=30, q=4000, mass=1e-7, name="other")
    found = gt.compare(first, other, seeds=2, duration=0.1)
    rows = {row.name: row for row in found.rows}
    assert rows["lower mode"].numbers[0].value == pytest.approx(3000)
    assert rows["Q of the lower mode"].difference(1).value == pytest.approx(2000)
    rate = rows["rate error, rms"]
    assert rate.difference(1).error > 0
    saved = found.save(tmp_path / "out")
    table = json.loads((saved / "summary.json").read_text())
    assert table["candidates"] == ["first", "other"]
    assert "other<br>less first" in (saved / "report.html").read_text()
    assert found.figures()


def test_finished_runs_by_their_folders(tmp_path: Path) -> None:
    for seed in (1, 2):
        gt.run("constant", seed=seed, duration=0.1).save(tmp_path / f"seed{seed}")
    found = gt.compare(tmp_path / "seed1", tmp_path / "seed2")
    assert found.names == ("seed1", "seed2")
    assert all(len(row.numbers) == 2 for row in found.rows)


def test_what_is_wrong_is_said(tmp_path: Path) -> None:
    with pytest.raises(gt.InputError, match="at least two"):
        gt.compare("reference")
    with pytest.raises(gt.InputError, match=r"summary\.json"):
        gt.compare(tmp_path, tmp_path)


def test_no_number_is_finer_than_its_error() -> None:
    assert shown(Number(0.013663, 0.0221)) == "0.014 ± 0.022"
    assert shown(Number(0.0536812, 0.000331)) == "0.05368 ± 0.00033"
    assert shown(None) == "–"
