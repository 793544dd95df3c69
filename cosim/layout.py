"""The order in which every observer writes its estimates (TW 201137310, eq. 3): states, rate, the seven constants.
What a design lets the packaged observer estimate beside them comes after."""

from typing import Final

X: Final = 0
X_DOT: Final = 1
Y: Final = 2
Y_DOT: Final = 3
OMEGA_Z: Final = 4
KXX: Final = 5
KYY: Final = 6
KXY: Final = 7
DXX: Final = 8
DYY: Final = 9
DXY: Final = 10
M: Final = 11

STATE_NAMES: Final = ("x", "x_dot", "y", "y_dot")
PARAMETER_NAMES: Final = ("kxx", "kyy", "kxy", "dxx", "dyy", "dxy", "m")

ESTIMATE_NAMES: Final = (*STATE_NAMES, "omega_z", *PARAMETER_NAMES)
ESTIMATE_SIZE: Final = len(ESTIMATE_NAMES)
"""Length of the estimate and deviation arrays of an observer that estimates no effects."""
