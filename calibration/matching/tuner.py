"""The bias of the next block, from the splits of all blocks before (docs/theory/matching.md, eqs. 2 and 3)."""

from dataclasses import dataclass, field
from math import sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from calibration.matching.known import Known
from calibration.mode_split import expected_drift, expected_wander

Floats = NDArray[np.float64]

SLOPE_ERROR: Final = 0.3
"""Of the design's dΔf/dV², one deviation: gap and swing are known to some percent each, and it goes with the gap's
fifth power."""
FIRST_DRIFT: Final = 3.0
"""Prior deviation of the drift of the split, over that of the fastest ramp: devices differ."""
FIRST_SPLIT: Final = 1e3
"""Prior deviation of the split [Hz]: nothing is known."""


@dataclass
class Tuner:
    """Kalman filter for the split without bias s [Hz], its drift [Hz/s], and the slope of the tuning b [Hz/V²]:

        Δf = s + b V²

    mean (3,), covariance (3, 3).
    """

    known: Known
    mean: Floats = field(init=False)
    covariance: Floats = field(init=False)

    def __post_init__(self) -> None:
        slope = self.known.slope
        self.mean = np.array([-slope * self.known.first_bias**2, 0.0, slope])
        spread = np.diag(
            [FIRST_SPLIT**2, (FIRST_DRIFT * expected_drift(self.known.frequency)) ** 2, (SLOPE_ERROR * slope) ** 2]
        )
        self.covariance = spread

    def predict(self, step: float) -> None:
        """Moves on by ``step`` [s]."""
        move = np.array([[1.0, step, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        noise = np.zeros((3, 3))
        noise[:2, :2] = expected_wander(self.known.frequency) ** 2 * np.array(
            [[step**3 / 3, step**2 / 2], [step**2 / 2, step]]
        )
        self.mean = move @ self.mean
        self.covariance = move @ self.covariance @ move.T + noise

    def update(self, split: float, deviation: float, square: float) -> None:
        """Takes in the split of a block [Hz] with its deviation [Hz] at the mean ``square`` of its bias [V²]."""
        row = np.array([1.0, 0.0, square])
        spread = self.covariance @ row
        gain = spread / (row @ spread + deviation**2)
        self.mean = self.mean + gain * (split - row @ self.mean)
        # Joseph's form: the prior of the split is 1e6 times what a block tells.
        keep = np.eye(3) - np.outer(gain, row)
        self.covariance = keep @ self.covariance @ keep.T + deviation**2 * np.outer(gain, gain)

    def split(self, square: float) -> tuple[float, float]:
        """Split at the ``square`` of a bias [V²], and its deviation [Hz]."""
        row = np.array([1.0, 0.0, square])
        return float(row @ self.mean), sqrt(max(float(row @ self.covariance @ row), 0.0))

    def bias(self, ahead: float) -> float:
        """The bias [V] that brings the split to zero ``ahead`` [s] from now; at most the highest."""
        slope = max(float(self.mean[2]), 0.1 * self.known.slope)
        square = -float(self.mean[0] + ahead * self.mean[1]) / slope
        return sqrt(min(max(square, 0.0), self.known.highest_bias**2))
