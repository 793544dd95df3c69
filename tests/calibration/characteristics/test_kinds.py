"""What a run shows by what its rate does: made-up records by hand, then runs of the loop."""

import json
from pathlib import Path

import numpy as np
import pytest

from calibration.characteristics.kind import Course, characteristics, course, kinds
from calibration.datasheet.figure import Outcome
from cosim.angle_record import AngleRecord
from cosim.scenarios import load_scenario
from gyrotwin.tasks.run import Request, prepare, summary_of

ROW = 1e-3


def through(name: str, carousel: float = 0.0) -> Course:
    chosen = load_scenario(name)
    rate = chosen.omega_z(0, round(chosen.duration / ROW), ROW)
    t = np.arange(len(rate)) * ROW
    return course(t, rate, -carousel * t, 1.0)


@pytest.mark.parametrize(
    ("name", "carousel", "expected"),
    [
        ("constant", 0.0, []),
        ("varying", 0.0, []),
        ("motion", 0.0, []),
        ("rest", 0.0, ["rest"]),
        ("rest", 3.0, ["rest", "spin"]),
        ("spin", 0.0, ["spin"]),
        ("staircase", 0.0, ["staircase"]),
    ],
)
def test_the_kind_follows_from_the_rate(name: str, carousel: float, expected: list[str]) -> None:
    chosen = through(name, carousel)
    assert [kind for kind, what in kinds().items() if what.is_of(chosen)] == expected


def record(rate: np.ndarray, error_rate: np.ndarray, valid: np.ndarray | None = None, zero: float = 0.3) -> AngleRecord:
    """An angle that is wrong by the integral of ``error_rate``."""
    t = np.arange(len(rate)) * ROW
    true = np.cumsum(rate) * ROW
    angle = true + np.cumsum(error_rate) * ROW
    flags = np.ones(len(t), bool) if valid is None else valid
    return AngleRecord(t, angle, true, rate, zero - angle, flags, 0.0, "", {})


def found_of(one: AngleRecord) -> dict[str, Outcome]:
    chosen = course(one.t, one.rate, np.zeros(len(one.t)), 1.0)
    return {name: outcome for name, (_, outcome) in characteristics(one, chosen).items()}


def value(outcome: Outcome, name: str) -> tuple[float, float]:
    figure = next(figure for figure in outcome.figures if figure.id == name)
    assert figure.value is not None
    return figure.value, figure.error or 0.0


def levels(values: list[float], rows: int = 1000) -> np.ndarray:
    return np.repeat(np.array(values), rows)


def test_scale_factor_of_the_plateaus_that_are_valid() -> None:
    rate = levels([0.0, 1.0, 2.0, 0.0, -1.0, -2.0])
    # The last plateau but one is valid for a part: wrong there, and left out.
    valid = np.ones(len(rate), bool)
    valid[4500:4700] = False
    error = 200e-6 * rate + np.where((np.arange(len(rate)) >= 4000) & (np.arange(len(rate)) < 5000), 0.5, 0.0)
    outcome = found_of(record(rate, error, valid))["staircase"]
    assert value(outcome, "scale_factor_error")[0] == pytest.approx(200.0, abs=1e-3)
    assert value(outcome, "threshold")[0] == pytest.approx(np.degrees(1.0))
    assert "1 of 6 plateaus left out" in outcome.figures[0].note


def test_bias_over_the_angle_of_a_pattern_that_goes_round() -> None:
    rate = np.full(8000, 2.0)
    pattern = 0.3 - np.cumsum(rate) * ROW
    bias, size, where = 1e-3, 2e-3, 0.5
    outcome = found_of(record(rate, bias + size * np.cos(2 * (pattern - where))))["spin"]
    # The pattern is read with the error in it, 2 mrad: second order.
    assert value(outcome, "bias_mean")[0] == pytest.approx(np.degrees(bias), rel=1e-2)
    assert value(outcome, "bias_harmonic_2")[0] == pytest.approx(np.degrees(size), rel=1e-2)
    at = float(outcome.figures[1].note.partition("largest at ")[2].partition("°")[0])
    assert at == pytest.approx(np.degrees(where), abs=0.3)
    assert value(outcome, "bias_harmonic_4")[0] < 1e-2 * np.degrees(size)


def test_random_walk_at_rest_within_its_error(residual) -> None:
    rng = np.random.default_rng(8)
    walk = 1e-4
    # A square wave first: what is about rest is the rest of it.
    rate = np.concatenate([np.tile(levels([5.0, -5.0], 50), 10), np.zeros(20_000)])
    outcome = found_of(record(rate, walk / np.sqrt(ROW) * rng.standard_normal(len(rate))))["rest"]
    found, error = value(outcome, "angle_random_walk")
    expected = walk * np.degrees(1) * 60
    assert 0 < error < 0.2 * expected
    residual("standard errors off", abs(found - expected) / error, 3.0)
    drift, drift_error = value(outcome, "bias")
    residual("drift, standard errors off", abs(drift) / drift_error, 3.0)
    lowest, lowest_error = value(outcome, "bias_instability")
    assert 0 < lowest_error < lowest


def test_a_run_without_a_valid_angle_says_why() -> None:
    rate = levels([0.0, 1.0, 2.0])
    one = record(rate, 0 * rate)._replace(valid_at=None, reason="gauge: turn the device")
    assert found_of(one)["staircase"].reason == "no valid angle: gauge: turn the device"
    late = record(np.zeros(5000), np.zeros(5000), np.arange(5000) > 4950)
    assert "an Allan deviation needs" in found_of(late)["rest"].reason


OWN = """
format = 1
name = "own"
description = "five plateaus of a quarter second after a wave"
duration = 1.75

[parameters]
x_start = 1e-6

[[omega_z]]
kind = "square"
amplitude = 4.0
frequency = 10.0
until = 0.5

[[omega_z]]
kind = "steps"
from = 0.5
times = [0.5, 0.75, 1.0, 1.25, 1.5]
values = [2.0, 4.0, 0.0, -2.0, -4.0]
"""


@pytest.mark.parametrize(("device", "design", "seed"), [("reference", "plain", 31), ("reference_as_built", "lab", 32)])
def test_a_scenario_of_ones_own_is_evaluated_by_its_character(device, design, seed, tmp_path: Path, residual) -> None:
    from cosim.master import simulate

    path = tmp_path / "own.toml"
    path.write_text(OWN)
    run = prepare(Request(str(path), device, design, seed=seed))
    summary = summary_of(run, simulate(run))
    found = summary["characteristics"]
    assert list(found) == ["staircase"]
    assert not found["staircase"]["not_done"]
    json.dumps(found, allow_nan=False)
    figures = found["staircase"]["figures"]
    assert figures["scale_factor"]["tests"] == 5
    # What the loop itself predicts for the drift, over the largest rate, is what a scale factor of 0.15 s can show.
    sigma = np.deg2rad(summary["predicted"]["drift_sigma_deg_per_s"]) / 4.0
    residual("scale factor, predicted deviations off", abs(figures["scale_factor"]["value"] - 1) / sigma, 4.0)
