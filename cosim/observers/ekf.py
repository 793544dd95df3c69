"""Kalman filter for the state, the rate, the seven constants and whatever effects the design names
(cosim/core/filter.c)."""

from typing import Final

from cosim.core.settings import FILTER, check_filter
from cosim.observers.record import CoreObserver

OBSERVER: Final = CoreObserver("ekf", FILTER, check_filter)
