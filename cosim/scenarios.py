"""The scenarios: what the device goes through in a run (SYSTEM.md section 5; source 000).

A scenario is data: the rate of turn, held over each sample, and the changes it makes to the
device. The held rate is the mean of the course over the hold, so that a run at any sample rate
turns through the same angle; edges that lie on the sampling grid stay sharp.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.layout import M
from cosim.rate_profile import RateProfile, packaged_profile
from gyro_model.errors import InputError, nearest

Floats = NDArray[np.float64]
HeldRate = Callable[[int, int, float], Floats]
"""(first, count, period [s]) -> rate [rad/s] held over samples first .. first + count - 1."""

RATE: Final = 5.0
"""Rate of turn of both embodiments [rad/s]."""
FREQUENCY_HZ: Final = 10.0
HALF_PERIOD: Final = 0.5 / FREQUENCY_HZ
SINE_FROM: Final = 0.55
"""`varying`: the square wave becomes a sine [s]."""
DAMPING_STEP_AT: Final = 0.45
"""`varying`: all damping doubles [s]."""

FIRST_ERROR: Final = (0.1, 0.5)
"""First estimates are off by this much, relative, least and most."""


class Scenario(NamedTuple):
    """What happens in a run.

    duration [s]: the default; omega_z: the held rate; parameters: FMU parameters that the scenario
    sets, SI; edges_until: duration [s] -> times [s] at which the rate or the device jumps, rising,
    shape (n,); angle_unit: the default.
    """

    name: str
    description: str
    duration: float
    omega_z: HeldRate
    parameters: Mapping[str, float]
    edges_until: Callable[[float], Floats]
    angle_unit: str


DESCRIPTIONS: Final = {
    "constant": "constant device; rate a 10 Hz square wave of 5 rad/s (first embodiment)",
    "varying": "as constant to 0.55 s, then a sine; all damping doubles at 0.45 s (second one)",
    "motion": "a measured rate profile; without one, 6 s of hand motion of our own making",
}


def scenario(name: str, profile: RateProfile | None = None, start: float = 0.0) -> Scenario:
    """Return a scenario by name; `motion` follows `profile` from `start` [s] into the record.

    Without a profile `motion` takes the packaged one. Raises InputError for an unknown name, a
    profile given to another scenario, and a start outside the record.
    """
    if name not in DESCRIPTIONS:
        raise InputError(
            f"scenario {name!r} is not known{nearest(name, DESCRIPTIONS)} (scenarios: {', '.join(DESCRIPTIONS)})"
        )
    if name == "motion":
        return _motion(profile or packaged_profile(), start)
    if profile is not None:
        raise InputError(
            f"scenario {name!r} has a rate of its own and takes no rate profile ({profile.name}): run 'motion' with it"
        )
    return _constant() if name == "constant" else _varying()


def first_estimates(true: Floats, rng: np.random.Generator) -> Floats:
    """Return first estimates for the true values in the order of cosim.layout, shape (17,).

    States, rate and parameters are off by 10 to 50 %, sign and size drawn from `rng`; what is
    zero stays zero. The sensing defects are left as given: the caller passes their nominal values.
    """
    low, high = FIRST_ERROR
    error = rng.uniform(low, high, M + 1) * rng.choice((-1.0, 1.0), M + 1)
    estimates = np.array(true, dtype=np.float64)
    estimates[: M + 1] *= 1 + error
    return estimates


def _constant() -> Scenario:
    return Scenario(
        name="constant",
        description=DESCRIPTIONS["constant"],
        duration=1.0,
        omega_z=_square,
        parameters={"x_start": 1e-6},
        edges_until=_square_edges,
        angle_unit="A",
    )


def _varying() -> Scenario:
    def omega_z(first: int, count: int, period: float) -> Floats:
        starts_sine = (np.arange(first, first + count) + 0.5) * period > SINE_FROM
        return np.where(starts_sine, _sine(first, count, period), _square(first, count, period))

    def edges_until(duration: float) -> Floats:
        # At 0.55 s the rate jumps from +5 to the zero of the sine.
        return _square_edges(min(duration, SINE_FROM + HALF_PERIOD))

    return Scenario(
        name="varying",
        description=DESCRIPTIONS["varying"],
        duration=1.0,
        omega_z=omega_z,
        parameters={
            "x_start": 1e-6,
            "damping_step_factor": 2.0,
            "damping_step_time": DAMPING_STEP_AT,
        },
        edges_until=edges_until,
        angle_unit="B",
    )


def _motion(profile: RateProfile, start: float) -> Scenario:
    profile.check(start, 0.0)

    def omega_z(first: int, count: int, period: float) -> Floats:
        return profile.held(start, first, count, period)

    return Scenario(
        name="motion",
        description=f"measured rate {profile.name} from {start:g} s",
        duration=min(10.0, profile.length - start),
        omega_z=omega_z,
        parameters={"x_start": 1e-6},
        edges_until=lambda duration: np.empty(0),
        angle_unit="C",
    )


def _square(first: int, count: int, period: float) -> Floats:
    """Mean over each hold of the square wave that starts at +RATE."""
    edge = np.arange(first, first + count + 1) * period / HALF_PERIOD
    # A hold boundary within 1e-9 of an edge is the edge: the rest is the rounding of k * period.
    nearest_edge = np.rint(edge)
    edge = np.where(np.abs(edge - nearest_edge) < 1e-9 * np.maximum(1, edge), nearest_edge, edge)
    begin, end = edge[:-1], edge[1:]
    index = np.floor(begin)
    sign = 1 - 2 * np.mod(index, 2)
    # A hold spans at most one edge: the sample rate is far above 20 Hz.
    after = np.maximum(end - (index + 1), 0.0) / (end - begin)
    held: Floats = RATE * sign * (1 - 2 * after)
    return held


def _sine(first: int, count: int, period: float) -> Floats:
    """Mean over each hold of the fundamental of that square wave, at amplitude RATE."""
    middle = (np.arange(first, first + count) + 0.5) * period
    amplitude = RATE * float(np.sinc(FREQUENCY_HZ * period))
    held: Floats = amplitude * np.sin(2 * np.pi * FREQUENCY_HZ * middle)
    return held


def _square_edges(duration: float) -> Floats:
    count = int(np.ceil(duration / HALF_PERIOD - 1e-9))
    return HALF_PERIOD * np.arange(1.0, count)
