"""When a fit is given up though it still falls: its steps bring too little."""

from dataclasses import dataclass

CREEP, CREEPING = 0.05, 5
"""A fit is given up after so many steps in a row that each brought less than this share of what was promised: along a
bound, or far from a minimum, where a fit of shorter pieces goes on."""
NEARER, SLOW = 0.5, 4
"""A fit that has a goal is given up after so many steps in a row that each left more than this share of the way to
it: near a minimum what is left falls by its square."""
JAGGED, STEPS = 0.02, 3
"""A fit is given up after so many held steps in all that each brought less than this share of the cost: an
acceleration jumps where friction changes its sign, and a sample beside the jump that goes to its other side is in no
column."""


@dataclass
class Patience:
    """What a fit with a ``goal``, a cost, has met so far: steps in a row that crept, in a row that were slow on the way
    to the goal, and jagged ones in all."""

    goal: float
    creeping: int = 0
    slow: int = 0
    jagged: int = 0

    def count(self, before: float, after: float, gained: float, *, held: bool) -> None:
        """Counts a step between two costs that brought ``gained`` of what was promised; held: only a share of one that
        holds the initial states too led down."""
        self.creeping = self.creeping + 1 if gained < CREEP else 0
        self.slow = self.slow + 1 if after - self.goal > NEARER * (before - self.goal) > 0 else 0
        self.jagged += held and after > (1 - JAGGED) * before

    @property
    def is_over(self) -> bool:
        """Whether the fit is given up."""
        return self.creeping >= CREEPING or self.slow >= SLOW or self.jagged >= STEPS
