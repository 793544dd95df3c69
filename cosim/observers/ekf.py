"""Kalman filter for the state, the rate, the seven constants and whatever effects the design names (cosim/core/filter.c)."""

from typing import Final

from cosim.core.settings import FILTER, FILTER_LIMITS
from cosim.observers.record import CoreObserver

OBSERVER: Final = CoreObserver("ekf", FILTER, FILTER_LIMITS)
