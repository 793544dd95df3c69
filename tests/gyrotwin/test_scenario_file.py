"""A scenario of the user's own, as `gyrotwin run` takes it."""

from pathlib import Path

import pytest

from cosim.scenarios.files import load_scenario
from gyro_model.errors import InputError
from gyrotwin.tasks.run import Request, prepare

TEXT = """
format = 1
name = "bend"
description = "made here"
duration = 0.5
angle_unit = "B"
temperature = 310.0
[parameters]
x_start = 2e-6
[omega_z]
kind = "ramps"
times = [0, 0.5]
values = [0, 30]
unit = "deg/s"
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "my.toml"
    path.write_text(TEXT, encoding="utf-8")
    return path


def test_a_file_is_run_as_it_says(path: Path) -> None:
    run = prepare(Request(str(path)))
    assert (run.scenario.name, run.duration, run.scenario.angle_unit) == ("bend", 0.5, "B")
    assert run.device.all_parameters["x_start"] == 2e-6
    assert run.scenario.inputs(0, 1, run.period)[0, 1] == 310.0


def test_options_come_before_the_file(path: Path) -> None:
    run = prepare(Request(str(path), angle="C", duration=0.1, settings=("x_start=3e-6",)))
    assert (run.duration, run.scenario.angle_unit) == (0.1, "C")
    assert run.device.all_parameters["x_start"] == 3e-6


def test_a_parameter_that_the_device_has_not_is_named(path: Path) -> None:
    path.write_text(TEXT.replace("x_start", "x_strat"), encoding="utf-8")
    with pytest.raises(InputError, match=r"'x_strat' is unknown; did you mean 'x_start'\?"):
        prepare(Request(str(path)))


def test_a_profile_belongs_to_motion(path: Path) -> None:
    profile = Path(__file__).parents[2] / "cosim" / "profiles" / "hand_motion.csv"
    with pytest.raises(InputError, match="run 'motion' with it"):
        prepare(Request(str(path), rate_profile=profile, rate_column="omega_z", rate_unit="deg/s"))


def test_a_file_that_does_not_exist_is_said() -> None:
    with pytest.raises(InputError, match=r"scenario file bend\.toml does not exist: check the path"):
        load_scenario("bend.toml")
    with pytest.raises(InputError, match="is not known"):
        load_scenario("bend")
