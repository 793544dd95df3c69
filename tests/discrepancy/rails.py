"""A mass on rails with viscous and dry friction, in steps so fine that it stops where it would turn."""

from typing import NamedTuple

import numpy as np


class Rails(NamedTuple):
    """Mass [kg], viscous friction [N s/m], dry friction [N]; length of a step [s]."""

    mass: float
    viscous: float
    dry: float
    step: float

    def slide(self, x: float, v: float, force: float, steps: int) -> tuple[float, float]:
        """Position [m] and velocity [m/s] after ``steps`` under a held force [N]."""
        for _ in range(steps):
            f = force - self.viscous * v
            if v == 0 and abs(f) <= self.dry:
                break
            after = v + (f - self.dry * np.sign(v or f)) / self.mass * self.step
            # Where it would turn it stops: friction holds it until the force exceeds that.
            after = 0.0 if v * after < 0 else after
            x, v = x + 0.5 * (v + after) * self.step, after
        return x, v
