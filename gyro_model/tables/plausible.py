"""Whether a temperature can be one that a gyroscope was tested at, or was read in another unit than it is in."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gyro_model.units import ZERO_CELSIUS

Floats = NDArray[np.float64]

COLDEST: Final = -120.0
HOTTEST: Final = 250.0
"""Temperatures beyond these [°C] are taken for a wrong unit: high-temperature parts are rated to 225 °C."""


class Doubt(NamedTuple):
    """text: what the temperatures read as; likely: the unit in which they would be plausible, None for none."""

    text: str
    likely: str | None


def misread(kelvin: Floats) -> Doubt | None:
    """What is wrong with temperatures [K], shape (n,); None where nothing is."""
    celsius = np.array([kelvin.min(), kelvin.max()]) - ZERO_CELSIUS
    if _plausible(celsius):
        return None
    # °C taken for K comes out 273.15 too low, K taken for °C as much too high.
    units = {"degC": celsius + ZERO_CELSIUS, "K": celsius - ZERO_CELSIUS}
    likely = next((unit for unit, values in units.items() if _plausible(values)), None)
    return Doubt(f"reads as {celsius[0]:.4g} to {celsius[1]:.4g} °C, at which no gyroscope is tested", likely)


def _plausible(celsius: Floats) -> bool:
    return bool(celsius[0] >= COLDEST and celsius[1] <= HOTTEST)
