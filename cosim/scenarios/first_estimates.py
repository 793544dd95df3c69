"""First estimates of the loop: how far from the truth a run begins."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from cosim.layout import M

Floats = NDArray[np.float64]

FIRST_ERROR: Final = (0.1, 0.5)
"""First estimates are off by this much, relative, least and most."""


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
