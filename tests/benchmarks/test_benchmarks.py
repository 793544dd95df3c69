"""The benchmarks run and give rows; the targets are theirs to judge."""

import importlib
import json
from itertools import pairwise

import numpy as np
import pytest

from benchmarks import (
    angle_lag,
    loop_measures,
    mode_split,
    plant_call,
    plant_cost,
    quadrature,
    sensor,
    split_envelope,
    split_fmu,
    split_matching,
    startup,
    work_precision,
)
from benchmarks.__main__ import NAMES, command_of
from benchmarks.c_driver import CPlants
from benchmarks.closed_loop import compiled_loop, fmpy_loop
from benchmarks.integrators import METHODS, Integrators
from benchmarks.report import Options, Report, Row, Table, row, spread, write
from gyro_model.build import build
from gyro_model.device import load_device
from gyro_model.sensor import SensorModel
from gyrotwin.tasks.run import Request, prepare


def test_row_says_which_columns_meet_the_target():
    assert Row("", "s", {"median": 1.0, "worst": 3.0}, limit=2.0).met == "median only"
    assert Row("", "s", {"median": 1.0, "worst": 2.0}, limit=2.0).met == "yes"
    assert Row("", "1", {"best": 3.0}, limit=2.0, at_least=True).met == "yes"
    assert Row("", "1", {"plain": 9.0, "ratio": 1.0}, limit=2.0, judged=("ratio",)).met == "yes"
    assert row("", "s", {"median": np.inf}, limit=2.0).met == "no"


def test_spread_counts_what_was_never_reached():
    assert spread([1.0, -3.0, 2.0]) == {"median": 2.0, "95 %": 2.9, "worst": 3.0}
    assert spread([1.0, np.inf, np.nan]) == {"median": np.inf, "95 %": np.inf, "worst": np.inf}


def test_results_are_written_as_json_and_markdown(tmp_path):
    table = Table("t", [row("never", "s", {"median": np.inf}, limit=1.0)])
    more = {"runs": [{"walk": np.nan, "seed": 3}]}
    write(Report("name", "Title", [table], ["a note"], more), command_of("name", Options()), tmp_path)
    written = json.loads((tmp_path / "name.json").read_text(encoding="utf-8"))
    assert written["tables"][0]["rows"][0]["values"] == {"median": None}
    assert written["runs"] == [{"walk": None, "seed": 3}]
    assert "| never | s | – | ≤ 1 | no |  |" in (tmp_path / "name.md").read_text(encoding="utf-8")


def test_every_benchmark_can_be_run_by_name():
    modules = [importlib.import_module(f"benchmarks.{name}") for name in NAMES]
    assert all(callable(module.run) for module in modules)


def test_loop_measures_give_rows():
    study = loop_measures.Study([1], observers=("ekf",), windows=(), duration=0.06)
    report = loop_measures.make_report(study, jobs=1)
    assert [table.title for table in report.tables][:2] == ["constant", "varying"]
    assert all(table.rows for table in report.tables)


def test_angle_lag_gives_rows():
    # Two periods of the sine: enough to fit it.
    assert len(angle_lag.rows([1], ["ekf"], duration=0.12, jobs=1)) == 3


def test_plant_call_gives_rows():
    rows = plant_call.plant_rows(calls=200, repeats=1)
    assert all(value for line in rows for value in line.values.values())


def test_plant_cost_says_what_no_method_spares():
    chosen = {name: plant_cost.cases()[name] for name in (plant_cost.NOTHING, "hysteresis", plant_cost.EVERY)}
    times = {name: [(100.0, 100.0)] for name in chosen}
    parts = plant_cost.measure_parts(chosen, calls=2000, repeats=3)
    # Two powers; the laws and noises of all effects.
    assert parts["hysteresis"].rates > 2.0 * parts[plant_cost.NOTHING].rates > 0.0
    assert parts[plant_cost.EVERY].numbers > 5.0 * parts["hysteresis"].numbers
    [first, *_] = plant_cost.part_rows(times, parts, dict.fromkeys(chosen, 3))
    left = 0.6 * 100.0 - 100.0 - parts[plant_cost.NOTHING].laws - parts[plant_cost.NOTHING].numbers
    rates = parts[plant_cost.NOTHING].rates
    assert first.values["rates in what the target leaves"] == pytest.approx(left / rates)
    assert first.values["least over the yardstick"] == pytest.approx(0.6 + (3 * rates - left) / 100.0)


def test_a_quadrature_asks_for_as_many_values_as_the_force_bends():
    """What two values leave of a cubic spring is (3 w h)^5/4320 of it, 1e-7 of 0.35 rad at 3.8 kHz and 5 us, and turns
    with the motion; a cut gives twice the parts; a kink asks for more."""
    own = {**load_device("reference").parameters, "sense_noise": 0.0, **plant_cost.START}
    cubic = {**own, **plant_cost.cases()["cubic_stiffness"]}
    assert quadrature.values_needed(cubic, plant_cost.inputs(), plant_cost.STEP) == (1, 2)
    parts, fewer = quadrature.values_needed(cubic | {"actuator_delay": 2e-6}, plant_cost.inputs(), plant_cost.STEP)
    assert (parts, fewer <= 2) == (2, True)
    kinked = {**own, **plant_cost.cases()["hysteresis"]}
    assert quadrature.values_needed(kinked, plant_cost.inputs(), plant_cost.STEP)[1] > 3


def test_plant_cost_gives_rows_and_the_dearest():
    chosen = {name: plant_cost.cases()[name] for name in (plant_cost.NOTHING, "hysteresis", "cubic_stiffness")}
    measured = plant_cost.measure(chosen, calls=100, repeats=2)
    rows = plant_cost.cost_rows(measured)
    assert rows[0].limit == plant_cost.LIMITS[plant_cost.NOTHING]
    assert all(value > 0 for line in rows for value in line.values.values())
    # Which is the dearest is told by times that no other process changes.
    times = {name: [(cost, 120.0)] * 2 for name, cost in zip(measured, (60.0, 370.0, 180.0), strict=True)}
    assert plant_cost.cost_rows(times)[-1].note == "hysteresis"


def test_the_yardstick_moves_as_the_plant(tmp_path):
    device = {**load_device("reference").parameters, "sense_noise": 0.0, **plant_cost.START}
    table = plant_cost.inputs()
    yardstick = plant_cost.Yardstick(tmp_path, device, table)
    yardstick(200)
    with plant_cost.CPlants(build().fmi3) as plants, plants.start(device, table, plant_cost.STEP) as plant:
        assert plant(200) == 200
    # 1 ms in steps of 1 us by order 4: (w h)^5/120 of 24 krad/s a step, 7e-11, a thousand times, and a margin.
    size = np.array([1e-6, 2e-2] * 2)
    np.testing.assert_allclose(yardstick.state / size, plant.outputs[2:] / size, rtol=0, atol=1e-6)


def test_both_loops_compute_the_same():
    run = prepare(Request("constant"))
    np.testing.assert_array_equal(compiled_loop(run, 50)[0], fmpy_loop(run, 50)[0])


def test_startup_commands_run():
    if startup.sys.platform != "win32":
        [base] = startup.memory_rows(startup.SHORT, ["ekf"])[:1]
        assert base.values["measured"] is not None


@pytest.mark.parametrize("name", METHODS)
def test_methods_have_their_order(name):
    integrators = Integrators()
    truth = work_precision.find_truth(integrators, 1e-3)
    points = [
        work_precision.measure_method(integrators, name, step, truth, 1e-3, repeats=1).duffing
        for step in (20e-6, 10e-6)
    ]
    [slope] = [np.log2(coarse / fine) for coarse, fine in pairwise(points)]
    # The next order in the step adds its share: w h = 0.5 at 20 us, so up to one order off.
    assert abs(slope - METHODS[name].order) < 1.0


def test_work_precision_gives_rows_and_a_diagram():
    points, truth = work_precision.measure([5.0, 10.0], duration=4e-3, repeats=1)
    assert len(work_precision.rows_of(points)) == 10
    assert work_precision.diagram(points).startswith("<svg")
    # 4 ms are 90 rad: extended precision keeps 1e-17 of it, the comparison in double 1e-16.
    assert max(truth.values()) < 1e-14


def test_mode_split_measures_a_record():
    outcome = mode_split.measure(mode_split.Point(5000, 20, 5), 1)
    # Errors in units of the bound.
    assert abs(outcome.likelihood) < 4
    assert abs(outcome.cut) < 8
    # 300 °/s of line five line widths away.
    assert np.isnan(outcome.printed)


def test_split_is_found_in_records_of_both_plants():
    nearby = split_envelope.point_of(5000.0, 6.0, 5.0)
    for plant, point in ((split_envelope, nearby), (split_fmu, split_fmu.POINTS[1])):
        outcome = plant.measure(point, 1)
        # One record within four deviations of what is at most a quarter over the bound.
        assert abs(outcome.likelihood) < 5
        assert outcome.held


def test_bias_takes_the_split_away_in_the_envelope_plant():
    splits, missed = split_matching.match(1, minutes=3.0)
    assert missed == 0
    # Half of what is left goes with each block of 10 s; a block knows the split to 0.17 Hz, of which the loop leaves
    # 0.17 √(0.5/1.5) = 0.1 Hz: five of that.
    assert abs(splits[0]) > 3
    assert np.all(np.abs(splits[8:]) < 0.5)


def test_sensor_gives_rows():
    with CPlants(build(SensorModel()).fmi3, ("rate",)) as plants:
        found = sensor.Sensor(plants, {"angle_random_walk": 1e-3, "bias_instability": 0.0, "rate_random_walk": 0.0})
        tau, variances = sensor.rest_variances(found, seeds=3, duration=12.0, row_length=1e-2)
        own = sensor.deviation_of(variances)
        assert sensor.compared("itself", tau, own, own).met == "yes"
        assert sensor.compared("twice", tau, (3 * own[0], own[1]), own).met == "no"
        speeds = sensor.speed_rows(plants, {}, repeats=1)
    assert [line.limit for line in speeds] == [10_000.0, 500.0]
    assert all(value > 0 for line in speeds for value in line.values.values())
