"""What the first run compiles: the FMU, the loop for the structure that its design has, and observers or controllers in
numba. It is done before the run, and said."""

import logging

from cosim.controllers.record import Controller
from cosim.core.library import is_built, library
from cosim.observers.record import Observer
from cosim.run import Run
from cosim.running import design_for
from gyro_model.build import build

LOGGER = logging.getLogger("gyrotwin")


def compile_once(run: Run) -> None:
    """Compiles what the run needs and is not there yet."""
    build(run.device.model)
    known = design_for(run.observer, run.design).known_model
    if not is_built(known):
        LOGGER.info("compiling the loop, once for this kind of design, some 5 s ...")
        library(known)
    own = [part.name for part in (run.observer, run.controller) if isinstance(part, (Observer, Controller))]
    if own:
        LOGGER.info("compiling %s, at every run, about a second ...", " and ".join(own))
