"""Figures in whole-angle mode, and devices whose angle never is valid."""

import pytest

from calibration.datasheet.procedure import procedures
from cosim.angle_bench import AngleBench, AnglePlan
from gyro_model.device import load_device

PLAN = AnglePlan(2, 1.0, 2.0, 5.0, 1, 0.3)


@pytest.fixture(scope="module")
def bench() -> AngleBench:
    return AngleBench(load_device("reference"), plan=PLAN)


def test_figures_of_the_reference_device(bench: AngleBench) -> None:
    found = {
        figure.id: figure
        for procedure in procedures("whole-angle").values()
        for figure in procedure.measure(bench).figures
    }
    assert found["turn_on_output"].value < 0.2
    assert found["mode_frequency_lower"].value == pytest.approx(load_device("reference").frequencies[0], rel=1e-5)
    # 1 s of drift of some tenths of a degree a second, over 5 rad/s.
    assert found["scale_factor"].value == pytest.approx(1.0, abs=3e-3)
    assert abs(found["bias"].value) < 1.0
    assert found["angle_random_walk"].value > 0
    assert found["bias_harmonic_2"].error is not None


def test_a_device_that_the_loop_does_not_know_gives_a_reason() -> None:
    plan = PLAN._replace(rest_records=1, rest_duration=0.2)
    bench = AngleBench(load_device("whole_angle_as_built"), plan=plan)
    outcome = procedures("whole-angle")["angle_scale_factor"].measure(bench)
    assert "no valid angle" in outcome.reason
    assert not outcome.figures
