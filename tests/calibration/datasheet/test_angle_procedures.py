"""Figures in whole-angle mode, and devices whose angle never is valid."""

import numpy as np
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


def test_where_the_pattern_stands_is_what_the_loop_can_know() -> None:
    # The design takes the gain for 1: where the pattern is seen does not depend on what the plant's is.
    device = load_device("reference").with_parameters({"angular_gain": 0.8})
    record = AngleBench(device, plan=PLAN).record(0.2)
    assert len(record.angle) > 0
    # It begins on x, where the noise of a sample, 20 pm in 1 um, turns it by 2e-5 rad and more.
    assert abs(record.pattern[0]) < 0.1
    np.testing.assert_allclose(record.pattern - record.pattern[0], -record.angle, rtol=0, atol=1e-12)
