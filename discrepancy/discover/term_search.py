"""What no name explains: the further search that ``diagnose`` calls when it has named all it can.

A name in whose place a term of the library fits better is a wrong one, so the search goes on from the fit without it;
where every name stands, from the fit as it is, if that leaves anything but noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from discrepancy.discover.discovery import discover
from discrepancy.discover.refutation import rivals, without
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.locate import located
from discrepancy.fit.refit import Fitter
from discrepancy.name.further import Wider
from gyro_model.progress import Steps


@dataclass
class TermSearch:
    """Finds terms that are in no effect file, and writes each as one to ``folder``."""

    folder: Path
    progress: Steps = lambda _: None

    def __call__(self, fitter: Fitter, at: Fitted, named: Sequence[str], room: int, least: float = 0.0) -> Wider | None:
        """The term, or the wrong names alone where an effect of the model fits best in their place; None where there
        is neither, the term takes less than the share ``least`` of what is surely no noise, or there is no ``room`` for
        one but in the place of a wrong name. Raises InputError where the FMU can't be built or the folder not
        written."""
        # Before a name is taken in none is questioned, and that something is left is known.
        against = None if least else rivals(fitter, at, named, self.progress)
        wrong = tuple(against.names) if against else ()
        start = without(fitter, at, wrong) if wrong else at
        if not wrong and (room < 1 or (against and not (against.beside or is_open(fitter, start)))):
            return None
        found = discover(fitter, start, self.folder, self.progress, least)
        if found is None:
            return None
        if found.known:
            return Wider(wrong=wrong) if wrong and found.effect.id not in wrong else None
        return Wider(found.terms, wrong)


def is_open(fitter: Fitter, at: Fitted) -> bool:
    """Whether the fit leaves anything but noise. A tracked motion is not taken out: what is missing shakes the mass as
    well."""
    return bool(located(at.residuals, fitter.records, at.parameters, at.whiten.setting))
