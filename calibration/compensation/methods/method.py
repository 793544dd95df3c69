"""What a method of compensation states about itself."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from calibration.compensation.model import Compensation
from calibration.compensation.record import Blocks

Fit = Callable[[Blocks], Compensation]


class Asked(NamedTuple):
    """What is asked for; None: chosen by inner validation. method: a name, or "best" of all; sensor of the piecewise
    one, structure or circuit; segments of it; hidden neurons and seed of the network; sampling_time [s]."""

    method: str = "best"
    sensor: str | None = None
    segments: int | None = None
    hidden: int | None = None
    seed: int = 1
    sampling_time: float = 10.0


class Candidate(NamedTuple):
    """A method with its shape in words, as a function of the blocks that are fitted.

    inputs: those that remember, to be made on whole records before any part of them is fitted; held_out: score by inner
    validation; bias_error: rms of what it left of the bias at the blocks left out [unit].
    """

    family: str
    shape: str
    fit: Fit
    inputs: tuple[str, ...] = ()
    held_out: float = np.inf
    bias_error: float = np.nan


class Method(NamedTuple):
    """One way to compensate.

    name; source: where it is published; candidates: its shapes for blocks and what is asked; it gives none where the
    record lacks its inputs, and raises InputError where it is asked for by name.
    """

    name: str
    source: str
    candidates: Callable[[Blocks, Asked], Iterable[Candidate]]


def holds(blocks: Blocks, names: Iterable[str]) -> bool:
    """Whether the record has the inputs ``names``."""
    return all(name in blocks.inputs for name in names)
