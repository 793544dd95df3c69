"""What the first run compiles: the FMU, the loop for the structure that its design has, and observers or controllers in
numba. It is done before the run, and said."""

import logging

from cosim.core.library import is_built, library
from cosim.observers.record import CoreObserver
from cosim.run import Run
from cosim.running import design_for
from gyro_model.build import build

LOGGER = logging.getLogger("gyrotwin")


def compile_once(run: Run) -> None:
    """Compiles what the run needs and is not there yet."""
    known = design_for(run.observer, run.design).known_model
    own = not isinstance(run.observer, CoreObserver)
    build(run.device.model)
    if is_built(known) and not own:
        return
    what = "the loop and the observer" if own else "the loop"
    LOGGER.info("compiling %s, once for this kind of design, some 5 s ...", what)
    library(known)
