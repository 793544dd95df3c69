"""`gyrotwin dataset init` and `gyrotwin diagnose` on tables of which nothing is known but the columns: sensors that are
connected the other way round, and a defect of the record that is fitted."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.interpolate import CubicSpline

from discrepancy.data.record import make_record
from discrepancy.fit.simulate import Simulator
from gyro_model.model import load_model
from gyrotwin.cli import main

RATE = 200_000.0
SAMPLES = 3000
DELAY = 1e-6
TRUE = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
        "sense_gain_x": -1e6, "sense_gain_y": -4e5}  # fmt: skip


def tables(folder: Path) -> list[Path]:
    """Three runs in noise of 1e-5 of the signal, v_y a fifth of a sample late."""
    rng = np.random.default_rng(6)
    t = np.arange(SAMPLES) / RATE
    paths = []
    with Simulator(load_model(), jobs=1) as simulator:
        for number in range(3):
            f = rng.uniform(200, 6000, (40, 2))
            u = 5e-6 * np.sin(2 * np.pi * f * t[:, None, None] + rng.uniform(0, 6.28, (40, 2))).sum(axis=1)
            blank = make_record("blank", t, u, np.ones_like(u), sample_rate=RATE)
            v = simulator.run(blank, {**TRUE, "sense_noise": 2e-5, "seed": 60 + number})
            late = CubicSpline(t, v[:, 1])(t - DELAY)
            path = folder / f"run-{number}.csv"
            pl.DataFrame({"t": t, "u_x": u[:, 0], "u_y": u[:, 1], "v_x": v[:, 0], "v_y": late}).write_csv(path)
            paths.append(path)
    return paths


def typed(*arguments: str) -> None:
    with pytest.raises(SystemExit) as ending:
        main(list(arguments))
    assert not ending.value.code


def test_what_init_writes_diagnose_takes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data, out = tmp_path / "data", tmp_path / "out"
    typed("dataset", "init", *map(str, tables(tmp_path)), "--out", str(data))
    typed("diagnose", str(data), "--out", str(out), "--jobs", "1", "--max-effects", "2")
    assert "connected the other way round" in " ".join(capsys.readouterr().out.split())
    report = json.loads((out / "report.json").read_text(encoding="utf-8"))
    assert report["effects"] == []
    [defect] = report["record"]
    assert defect["id"] == "channel_delay"
    own = defect["parameters"]["channel_delay"]
    assert own["low"] < DELAY < own["high"]
    # Seven deviations of what one sample of noise turns the phase by: far from 0.
    assert own["low"] > DELAY / 2
    assert "channel_delay" in (out / "report.html").read_text(encoding="utf-8")
