"""A scenario file's inputs as the courses of a run of rate mode."""

from collections.abc import Mapping
from functools import partial
from math import inf

from cosim.rate.courses import Course
from cosim.scenarios import Scenario
from gyro_model.errors import InputError
from gyro_model.model import load_model


def courses_of(scenario: Scenario) -> Mapping[str, Course]:
    """The inputs that ``scenario`` gives, by name. Where the mass begins does not matter: the drive loop brings it to
    its amplitude. Raises InputError where it sets other parameters: the device does that."""
    starts = load_model().start_of.values()
    others = [name for name in scenario.parameters if name not in starts]
    if others:
        raise InputError(
            f"scenario {scenario.name} sets {', '.join(others)}: rate mode takes inputs alone from a "
            "scenario; put parameters into the device file, or give --set"
        )
    text = f"scenario {scenario.name}"
    return {
        name: Course(partial(scenario.values, name), inf, text, means=partial(scenario.held, name))
        for name in scenario.courses
    }
