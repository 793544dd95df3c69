"""The controller of TW 201137310 (eqs. 5-7) on the model that the loop knows (cosim/core/foucault.c)."""

from typing import Final

from cosim.controllers.record import CoreController
from cosim.core.settings import FOUCAULT, check_foucault

CONTROLLER: Final = CoreController("foucault", FOUCAULT, check_foucault)
