"""Scenarios: what the device goes through in a run, as TOML files, packaged or the user's own.

A scenario gives every input of the plant but the forces, held over each sample, and the changes that it makes to the
device. A held value is the mean of the course over the hold, so that a run at any sample rate turns through the same
angle; edges that lie on the sampling grid stay sharp.
"""

from cosim.rate_profile import RateProfile, packaged_profile
from cosim.scenarios.courses import Constant, Course, Part, Sine, Square, curve, measured, ramps, steps
from cosim.scenarios.files import descriptions, load_scenario, scenario_names
from cosim.scenarios.scenario import INPUT_NAMES, Scenario
from gyro_model.errors import InputError

DESCRIPTIONS = descriptions()
"""What the packaged scenarios do, by name."""

LONGEST_MOTION = 10.0
"""A run along a measured rate lasts at most this where nothing is said [s]."""


def scenario(name: str, profile: RateProfile | None = None, start: float = 0.0) -> Scenario:
    """The scenario of a packaged name or of a file; `motion` follows ``profile`` from ``start`` [s] into the record.

    Without a profile `motion` takes the packaged one. Raises InputError for an unknown name, a file that is wrong, a
    profile given to another scenario, and a start outside the record.
    """
    chosen = load_scenario(name)
    if name != "motion":
        if profile is not None:
            raise InputError(
                f"scenario {name!r} has a rate of its own and takes no rate profile ({profile.name}): "
                "run 'motion' with it"
            )
        return chosen
    profile = profile or packaged_profile()
    return Scenario(
        name=chosen.name,
        description=f"measured rate {profile.name} from {start:g} s",
        duration=min(LONGEST_MOTION, profile.length - start),
        courses={"omega_z": (measured(profile, start),)},
        parameters=chosen.parameters,
        angle_unit=chosen.angle_unit,
    )


__all__ = [
    "DESCRIPTIONS",
    "INPUT_NAMES",
    "Constant",
    "Course",
    "Part",
    "Scenario",
    "Sine",
    "Square",
    "curve",
    "descriptions",
    "load_scenario",
    "measured",
    "ramps",
    "scenario",
    "scenario_names",
    "steps",
]
