"""What a method of mode matching states about itself, and what it does block by block."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

from calibration.matching.known import Known, Sensed


class Plan(NamedTuple):
    """The coming block. settle: in which the bias goes to its new value [s]; measure: in which it stays [s]; tone: of
    the dither [Hz]; force: of each of its sides [N], 0 for none; closed: whether the sense loop rebalances; rest: that
    it stays before the measurement [s]."""

    settle: float
    measure: float
    tone: float = 0.0
    force: float = 0.0
    closed: bool = True
    rest: float = 0.0

    @property
    def before(self) -> float:
        """From the end of the last block to the measurement [s]."""
        return self.settle + self.rest


class Answer(NamedTuple):
    """The split of a block and its deviation [Hz]; bound: the least that any estimate could have [Hz], None where the
    method has no such bound."""

    split: float
    deviation: float
    bound: float | None = None


class Estimator(Protocol):
    """A method at work."""

    def plan(self) -> Plan:
        """What the coming block needs."""

    def measure(self, sensed: Sensed, expected: tuple[float, float]) -> Answer | None:
        """The split in a block, ``expected`` with its deviation [Hz]; None where nothing is found."""


class Asked(NamedTuple):
    """What is asked for; None: by the method. dither: virtual rate of the tone [rad/s]; block: [s] of a measurement."""

    dither: float | None = None
    block: float | None = None


class Method(NamedTuple):
    """One way to match the modes.

    name; source: where it is published; closed: whether the sense loop rebalances while it holds; start: the estimator
    for what is known, which raises InputError where it can't work with what is asked.
    """

    name: str
    source: str
    closed: bool
    start: Callable[[Known, Asked], Estimator]
