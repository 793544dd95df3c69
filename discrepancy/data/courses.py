"""Forces that the motion makes itself where the sensors are: a friction, what a spring bends by.

Their courses are known from what the sensors measured, and so they are inputs of unknown size of a structure that is
linear in them (S. Marchesiello, L. Garibaldi, A time domain approach for identifying nonlinear vibrating structures by
subspace methods, Mechanical Systems and Signal Processing 22, 2008).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final

from discrepancy.data.cubes import bowed
from discrepancy.data.modes import LEAST, Mode
from discrepancy.data.record import Course, Record, is_driven
from discrepancy.data.residues import answered
from discrepancy.data.rubbed import rubbed

MADE: Final[Mapping[Course, Callable[[Sequence[Record]], list[Record]]]] = {"friction": rubbed, "cube": bowed}
KINDS: Final[tuple[tuple[Course, ...], ...]] = (("friction",), ("cube",), ("friction", "cube"))
"""What is tried, in this order."""
PLAINLY: Final = 0.8
"""Of what modes leave without a course (rms), that they leave at most with one that is plain: 0.05 to 0.53 where
chains and shafts rub, 0.76 where an accelerometer sees friction jump between samples; 1.00 of chains that do not, 0.93
and 0.95 of a measured arm and wing, whose joints are elsewhere. With the cube of a spring that bends 0.03 and 0.18."""
SOMEWHAT: Final = 0.985
"""Of what modes leave (rms), that they leave with a course beside them, where it is worth while to look for others
beside it: 0.70 to 0.96 where a mass rubs, since their damping has made up for most of it; 1.00 of chains that do
not."""
MUCH: Final = 0.1
"""Of the voltage (rms), that modes leave where that is worth while in any case: a strong friction may leave none that a
shaft's turns with."""
HARDLY: Final = 1.25
"""Times what more modes leave (rms), up to which fewer are enough: what a course is off by looks like another mode.
1.01 of a spring that bends and rubs, 9 and more of structures of two to five modes."""


def beside(records: Sequence[Record], kinds: Sequence[Course]) -> list[Record]:
    """The records with the courses of those ``kinds``."""
    found = list(records)
    for kind in kinds:
        found = MADE[kind](found)
    return found


def left_by(records: Sequence[Record], modes: Sequence[Mode]) -> float:
    """Of the voltage (rms), that ``modes`` leave, which may be none."""
    return answered(records, modes).left if modes else 1.0


def may_act(before: float, acting: Sequence[Record], modes: Sequence[Mode]) -> bool:
    """Whether it is worth while to look for others than these ``modes``, which may be none and leave ``before``, beside
    the courses that the same records ``acting`` have."""
    return before > MUCH or (before**2 > LEAST and left_by(acting, modes) < SOMEWHAT * before)


def plainly_act(before: float, acting: Sequence[Record], modes: Sequence[Mode]) -> bool:
    """Whether ``modes`` beside the courses that records ``acting`` have leave plainly less than ``before``, what others
    leave without."""
    return bool(modes) and left_by(acting, modes) < PLAINLY * before


def leave_as_little(records: Sequence[Record], few: Sequence[Mode], more: Sequence[Mode]) -> bool:
    """Whether driven ``records`` with the courses of all kinds show hardly ``more`` than those ``few`` modes."""
    if not is_driven(records):
        return False
    acting = beside(records, KINDS[-1])
    return left_by(acting, few) < HARDLY * min(left_by(own, more) for own in views(records, more))


def views(records: Sequence[Record], modes: Sequence[Mode]) -> Iterator[Sequence[Record]]:
    """The records, and the same with courses that may act beside ``modes``."""
    yield records
    before = left_by(records, modes)
    for kinds in KINDS:
        acting = beside(records, kinds)
        if may_act(before, acting, modes):
            yield acting
