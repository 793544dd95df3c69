"""A run of rate mode whose bias is to be tuned, and what its tuner is told."""

from collections.abc import Mapping
from math import floor, inf
from typing import Final, NamedTuple

import numpy as np

from calibration.matching.known import Known, designed_bias, known_of
from calibration.matching.methods import methods
from calibration.matching.methods.method import Asked, Method
from cosim.rate.courses import Course, constant
from cosim.rate.resonance import sense_resonance
from cosim.rate.run import ENVELOPE_PERIOD, RateRun
from cosim.rate.settings import settings_of
from gyro_model.device import Device
from gyro_model.errors import InputError, nearest

ROWS: Final = 10.0
"""Rows of the record a second [Hz]."""
UNASKED: Final = Asked()
HIGHEST: Final = 2.0
"""Largest bias where nothing is said, over that at which the design matches: four times its tuning."""


class Asking(NamedTuple):
    """A run with the method that tunes it, what is asked of the method, and what it is told."""

    run: RateRun
    method: Method
    asked: Asked
    known: Known


def ask(
    device: Device,
    design: Device,
    method: str,
    courses: Mapping[str, Course],
    duration: float,
    *,
    seed: int = 1,
    envelope: bool = True,
    highest_bias: float | None = None,
    asked: Asked = UNASKED,
) -> Asking:
    """The run of ``device`` through ``courses`` (by input; v_bias: the first bias, by default that of ``design``).

    Raises InputError for an unknown method or a block that is no time, and where the design can't be tuned.
    """
    if method not in methods():
        raise InputError(f"--method {method}: give {', '.join(methods())}{nearest(method, methods())}")
    if asked.block is not None and not 0 < asked.block < inf:
        raise InputError(f"--block {asked.block:g}: give a positive time in s")
    chosen = methods()[method]
    others = {name: course for name, course in courses.items() if name not in ("omega_z", "temperature")}
    bias = designed_bias(design, settings_of(design).drive_amplitude)
    others.setdefault("v_bias", constant(bias, "as designed"))
    run = RateRun(
        device, courses["omega_z"], courses["temperature"], chosen.closed, duration, seed, output_rate=ROWS,
        envelope=envelope, design=design, others=others, envelope_period=step_for(design, bias),
    )  # fmt: skip
    known = known_of(run, HIGHEST * bias if highest_bias is None else highest_bias)
    chosen.start(known, asked)
    return Asking(run, chosen, asked, known)


def step_for(design: Device, bias: float) -> float:
    """Step of the loops on the envelope [s]: a whole number of half periods of the carrier and a quarter more.

    A force whose envelope jumps holds images of itself at multiples of 1/T from the drive, and about minus the drive
    frequency too. At such a step those fall half of 1/T from the tones instead of onto one, where they would shift the
    split found by up to its ν²/2ω, 0.3 Hz.
    """
    at = design.all_parameters["t_ref"], bias
    frequency = float(sense_resonance(design, *np.array(at).reshape(2, 1))[0])
    return (floor(2 * frequency * ENVELOPE_PERIOD - 0.5) + 0.5) / (2 * frequency)
