"""What no name explains: the further search that ``naming.diagnose`` calls when it has named all it can.

A name in whose place a term of the library fits better is a wrong one, so the search goes on from the fit without it;
where every name stands, from the fit as it is, if that leaves anything but noise.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from discrepancy.discovery import Rivals, discover, rivals
from discrepancy.locate import located
from discrepancy.naming import Wider
from discrepancy.refit import Fitted, Fitter


@dataclass
class TermSearch:
    """Finds terms that are in no effect file, and writes each as one to ``folder``."""

    folder: Path
    progress: Callable[[str], None] = lambda _: None
    tried: list[str] = field(default_factory=list)

    def __call__(self, fitter: Fitter, at: Fitted, named: Sequence[str], room: int) -> Wider | None:
        """The model of ``fitter`` with one effect more, None where there is none to add, or no ``room`` for one but in
        the place of a wrong name. Raises InputError where the FMU can't be built or the folder not written."""
        if self.tried and self.tried[-1] not in named:
            return None
        against = rivals(fitter, at, named, self.progress) if named else Rivals({}, {})
        wrong = against.names
        start = without(fitter, at, wrong) if wrong else at
        if not wrong and (room < 1 or not (against.beside or is_open(fitter, start))):
            return None
        found = discover(fitter, start, self.folder, self.progress)
        if found is None or found.known:
            return None
        self.tried.append(found.effect.id)
        return Wider(found.model, tuple(wrong))


def without(fitter: Fitter, at: Fitted, ids: Sequence[str]) -> Fitted:
    """``at`` refitted with the effects ``ids`` switched off."""
    own = [q for effect in ids for q in fitter.simulator.model.effect(effect).parameters]
    off = {q.name: q.start for q in own if q.role == "size"}
    free = tuple(f for f in at.free if f.name not in {q.name for q in own})
    return fitter.fit(fitter.evaluated(replace(at, parameters={**at.parameters, **off}, free=free)))


def is_open(fitter: Fitter, at: Fitted) -> bool:
    """Whether the fit leaves anything but noise. A tracked motion is not taken out: what is missing shakes the mass as
    well."""
    return bool(located(at.residuals, fitter.records, at.parameters, at.whiten.setting.corner))
