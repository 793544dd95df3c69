"""How a search for a missing effect tries a shape parameter: what an effect file says beside the parameter."""

from dataclasses import dataclass
from math import inf, isfinite
from typing import ClassVar, Literal

from gyro_model.errors import InputError, nearest

Kind = Literal["log", "resonance", "quality", "instant", "usual", "rest"]
SCALES = (
    "itself", "1", "duration", "radian", "x", "y", "x_dot", "y_dot", "u_x", "u_y", "temperature", "v_bias",
    "omega_z", "dxx",
)  # fmt: skip


@dataclass(frozen=True)
class Grid:
    """The values of a parameter that a search tries before a fit moves it on from the best.

    ``kind`` log: ``points`` in equal ratios from ``low`` to ``high``, times the scale ``of``. resonance: likewise,
    times the highest mode's frequency, and ever finer about the best. quality: the quality factor ``low`` of such a
    resonance, as broad as its grid is coarse. instant: ``points`` over a run, likewise finer. usual: none but the
    parameter's own, which a fit moves once the effect is in the model and the data ask for it. rest: what moves so that
    its sum with the shape ``of`` stays; where it may be ``alone``, within these bounds, it is tried so too, in their
    middle, while ``of`` stays as usual. ``below``: by how many times a fit may go below the lowest of a grid, where an
    effect is mostly at its limit to 1e-3, as a hysteresis at dry friction.

    Scales: ``itself``, the parameter's own typical value; ``1``, as it stands; ``duration`` of the longest run [s];
    ``radian``, in which the highest mode goes through one [s]; by how much a signal moves in the runs at most: ``x``,
    ``y`` and their rates count for either axis, an input for itself; ``dxx``, the damping of the device.
    """

    kind: Kind
    low: float = 1.0
    high: float = 1.0
    points: int = 1
    of: str = "itself"
    alone: tuple[float, float] | None = None
    below: float = 30.0

    instant: ClassVar["Grid"]
    usual: ClassVar["Grid"]
    around: ClassVar["Grid"]

    def __post_init__(self) -> None:
        if not (isfinite(self.high) and 0 < self.low <= self.high and self.points >= 1):
            raise InputError(f"grid from {self.low} to {self.high}: give 0 < low <= high and a number of points")
        if not 1 <= self.below < inf:
            raise InputError(f"grid that may go {self.below} times below its lowest: give 1 or more")
        if self.kind != "rest" and self.of not in SCALES:
            raise InputError(f"grid of {self.of!r}: no such scale{nearest(self.of, SCALES)}")
        if self.alone and not -inf < self.alone[0] < self.alone[1] < inf:
            raise InputError(f"grid alone within {self.alone}: give two finite bounds, the lower one first")

    @classmethod
    def log(cls, low: float, high: float, of: str = "itself", points: int = 5, below: float = below) -> "Grid":
        """``points`` in equal ratios from ``low`` to ``high`` times the scale ``of``; a fit may go ``below`` times
        lower."""
        return cls("log", low, high, points, of, below=below)

    @classmethod
    def resonance(cls, low: float = 0.2, high: float = 3.0, points: int = 30) -> "Grid":
        """A frequency, between ``low`` and ``high`` times that of the highest mode."""
        return cls("resonance", low, high, points)

    @classmethod
    def quality(cls, coarse: float = 10.0) -> "Grid":
        """The quality factor of the searched resonance: as broad as its grid is ``coarse``."""
        return cls("quality", coarse, coarse)

    @classmethod
    def rest(cls, of: str, alone: tuple[float, float] | None = None) -> "Grid":
        """What moves against the shape ``of`` of the same effect, so that their sum stays: where a scale that no sample
        shows is held by it; ``alone``: bounds within which no scale makes that sum what it is."""
        return cls("rest", of=of, alone=alone)

    @property
    def begins(self) -> float:
        """Where what moves alone sets out."""
        assert self.alone is not None
        return sum(self.alone) / 2

    @property
    def tried(self) -> bool:
        """Whether a search tries values of it."""
        return self.kind not in ("usual", "rest")


Grid.instant = Grid("instant", points=16)
Grid.usual = Grid("usual")
Grid.around = Grid.log(0.1, 10.0)
