"""The order in which every observer writes its estimates (SYSTEM.md section 2, source 000 eq. 3)."""

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
OFFSET_X: Final = 12
OFFSET_Y: Final = 13
DRIFT_X: Final = 14
DRIFT_Y: Final = 15
GAIN_RATIO: Final = 16

STATE_NAMES: Final = ("x", "x_dot", "y", "y_dot")
PARAMETER_NAMES: Final = ("kxx", "kyy", "kxy", "dxx", "dyy", "dxy", "m")
DEFECT_NAMES: Final = ("offset_x", "offset_y", "drift_x", "drift_y", "gain_ratio")

ESTIMATE_NAMES: Final = (*STATE_NAMES, "omega_z", *PARAMETER_NAMES, *DEFECT_NAMES)
ESTIMATE_SIZE: Final = len(ESTIMATE_NAMES)
"""Length of every estimate and deviation array."""
