"""`gyrotwin match`, `gyrotwin rate --scenario` and `--split-estimate`, as a user types them."""

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import gyrotwin as gt
from gyrotwin.cli import main

DEVICE = ("mode_matched_as_built", "--design", "mode_matched")


def gyrotwin(*arguments: object) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*map(str, arguments)])
    assert not ended.value.code


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    with pytest.raises(SystemExit) as ended:
        main([*map(str, arguments)])
    assert ended.value.code == 2
    return capsys.readouterr().err.strip().splitlines()[-1]


@pytest.fixture(scope="module")
def matched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("matched") / "match"
    gyrotwin("match", *DEVICE, "--duration", 20, "--out", out)
    return out


def test_match_writes_json_trace_and_page(matched: Path) -> None:
    summary = json.loads((matched / "match.json").read_text())
    trace = pl.read_parquet(matched / "trace.parquet")
    assert summary["design"] == "mode_matched"
    assert summary["split"]["matched_at"] < 5
    assert summary["bias_v"]["last"] == pytest.approx(trace["v_bias"][-1])
    held = trace.filter(pl.col("t") > summary["split"]["since"])["split_true"].to_numpy()
    assert summary["split"]["rms_hz"] == pytest.approx(np.sqrt(np.mean(held**2)), rel=1e-9)
    estimate = trace["split_estimate"].to_numpy()
    assert np.isnan(estimate[0])
    assert abs(estimate[-1]) < 0.02
    noise = summary["rate_noise"]
    # 15 s of rate know the walk to a quarter; the dither adds nothing to the design's limit, which lots spread about.
    assert 0 < noise["angle_random_walk_error_deg_rth"] < 0.5 * noise["angle_random_walk_deg_rth"]
    page = (matched / "report.html").read_text()
    assert "Mode matching: mode_matched_as_built" in page


def test_the_library_gives_what_the_command_gives(matched: Path) -> None:
    found = gt.match("mode_matched_as_built", design="mode_matched", duration=20)
    assert json.loads((matched / "match.json").read_text()) == json.loads(json.dumps(found.summary))
    assert len(found.blocks) == found.summary["block"]["count"]
    # A second result takes the place of the first: its names are known for those of commands.
    assert found.save(matched) == matched


def test_a_scenario_gives_rate_temperature_and_first_bias(tmp_path: Path) -> None:
    scenario = tmp_path / "mine.toml"
    scenario.write_text(
        'format = 1\nname = "mine"\ndescription = "a turn in a ramp"\nduration = 8.0\nv_bias = 14.0\n'
        'omega_z = {kind = "sine", amplitude = 0.2, frequency = 0.5}\n'
        'temperature = {kind = "ramps", times = [0.0, 8.0], values = [20.0, 20.2], unit = "degC"}\n'
    )
    found = gt.match("mode_matched_as_built", design="mode_matched", scenario=scenario)
    assert found.summary["bias_v"]["first"] == 14.0
    # A row is a mean over a twentieth of a period, and may miss the crest by half of that: 0.4 % and 1.2 %.
    assert found.trace["rate_true"].to_numpy().max() == pytest.approx(0.2, rel=0.02)
    assert found.summary["split"]["largest_hz"] < 0.02


def test_acceleration_and_bias_reach_the_plant_of_rate_mode(tmp_path: Path) -> None:
    scenario = tmp_path / "mine.toml"
    scenario.write_text('format = 1\nname = "mine"\ndescription = "biased"\nduration = 1.0\nv_bias = 5.0\na_x = 9.81\n')
    with_bias = gt.rate(plant="envelope", scenario=scenario, parameters={"softening": 2e-3})
    alone = gt.rate(plant="envelope", duration=1.0, parameters={"softening": 2e-3})
    f, f0 = (run.trace["drive_frequency"].to_numpy().mean() for run in (with_bias, alone))
    # Softening of 2e-3 · 25 · (1 - 0.4²)^(-3/2) = 0.0649 N/m of 19.74: half of that of 5000 Hz, pulled by the parasitic
    # mode 0.1 Hz differently at the other place.
    assert f - f0 == pytest.approx(-0.5 * 0.0649 / 19.74 * f0, abs=0.5)
    expected = with_bias.summary["harmonic_balance"]["drive_frequency_hz"]
    assert f == pytest.approx(expected, abs=0.01)


def test_split_block_by_block_in_normal_operation() -> None:
    found = gt.rate(plant="envelope", duration=40, split_estimate=10)
    steps = found.summary["split"]["estimates"]
    assert [step["t"] for step in steps] == [10.0, 20.0, 30.0, 40.0]
    # 50.698 Hz by eigenvalues (benchmarks/rate_mode.py); four deviations of each.
    for step in steps:
        assert abs(step["split_hz"] - 50.698) < 4 * (step["high_hz"] - step["low_hz"]) / 3.92


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("match", "rate-mode"), "no electrodes that tune"),
        (("match", *DEVICE, "--method", "activ"), "active"),
        (("match", *DEVICE, "--plant", "half"), "envelope"),
        (("match", *DEVICE, "--dither", "500"), "full scale, 300"),
        (("match", *DEVICE, "--block", "0.01"), "--block 0.01 s: the dither"),
        (("match", *DEVICE, "--block", "nan"), "--block nan: give a positive time"),
        (("match", *DEVICE, "--block", "1e9"), "a block lasts 1e+09 s"),
        (("match", *DEVICE, "--highest-bias", "9"), "first bias"),
        (("match", *DEVICE, "--scenario", "varying"), "sets"),
        (("rate", "--split-estimate", "0.001"), "too short to resolve"),
        (("rate", "--split-estimate", "15"), "fewer than 3 blocks"),
        (("rate", "--split-estimate", "nan"), "--split-estimate"),
        (("rate", "--split-estimate", "5", "--sense", "closed"), "give open"),
    ],
)
def test_what_can_not_be_is_refused(
    arguments: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert said in refused(capsys, *arguments, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_input_that_is_given_twice_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    scenario = tmp_path / "mine.toml"
    scenario.write_text('format = 1\nname = "mine"\ndescription = "warm"\nduration = 1.0\ntemperature = 300.0\n')
    said = refused(capsys, "rate", "--scenario", scenario, "--temperature", "25", "--out", tmp_path / "out")
    assert "--temperature" in said
    assert "leave one of them out" in said
