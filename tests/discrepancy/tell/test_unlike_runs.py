"""Runs of unlike gains or delays are told by what one number of each takes of a residual."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.data.record import Record, make_record
from discrepancy.diagnose import diagnose
from discrepancy.tell.unlike_runs import unlike_runs
from tests.discrepancy.hidden_sets import MODEL, made


def run(name: str, v: np.ndarray) -> Record:
    t = np.arange(len(v)) * 1e-5
    return make_record(name, t, np.ones_like(v), v, sample_rate=1e5, role="fit", conditions={})


def test_a_gain_of_each_run_is_told_and_another_gap_is_not() -> None:
    rng = np.random.default_rng(1)
    told = [rng.normal(size=(1000, 1)) for _ in range(3)]
    noise = [1e-3 * rng.normal(size=(1000, 1)) for _ in range(3)]
    gains = [1.01, 0.99, 1.0]
    runs = [run(f"r{k}", g * v + n) for k, (g, v, n) in enumerate(zip(gains, told, noise, strict=True))]
    said = unlike_runs(runs, [r.v - v for r, v in zip(runs, told, strict=True)])
    assert said is not None
    for name, gain in zip(("r0", "r1", "r2"), gains, strict=True):
        # A thousand samples with noise of 1e-3 know a gain to 3e-5.
        assert abs(float(said.split(f"{name} ")[1].split(",")[0].split()[0]) - gain) < 1.5e-4
    # A shift in time, as large, is no gain.
    late = [run(f"r{k}", v + 0.01 * np.roll(v, 1, axis=0)) for k, v in enumerate(told)]
    assert unlike_runs(late, [r.v - v for r, v in zip(late, told, strict=True)]) is None
    assert unlike_runs(runs[:1], [runs[0].v - told[0]]) is None


def test_a_delay_of_each_run_is_told() -> None:
    t, delays = np.arange(1000) * 1e-5, [2e-6, 0.0, -1e-6]
    told = [np.sin(2 * np.pi * (1500 + 100 * k) * t)[:, None] for k in range(3)]
    runs = [run(f"r{k}", np.sin(2 * np.pi * (1500 + 100 * k) * (t - late))[:, None]) for k, late in enumerate(delays)]
    said = unlike_runs(runs, [r.v - v for r, v in zip(runs, told, strict=True)])
    assert said is not None
    assert "by a delay" in said
    for name, late in zip(("r0", "r1", "r2"), delays, strict=True):
        # (w late)^2/2, 2e-4 of it, and differences of samples sixty a period: 2e-3.
        assert float(said.split(f"{name} ")[1].split(" s")[0]) == pytest.approx(late, rel=5e-3, abs=1e-12)


def test_a_diagnosis_says_which_runs_differ() -> None:
    data = made({}, samples=3000)
    unlike = (replace(data.records[0], v=1.01 * data.records[0].v), *data.records[1:])
    found = diagnose(replace(data, records=unlike), MODEL)
    assert found.verdict in ("unexplained", "partly explained")
    assert any("the runs differ by a gain" in doubt for doubt in found.doubts)
