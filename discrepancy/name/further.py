"""What a search asks of another that goes on where no effect file helps."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter
from discrepancy.terms.effect_file import Term


class Wider(NamedTuple):
    """What a further search changes. wrong: names to give up; terms: one for what is left, or for what those names
    explain badly, then others that the search could not tell from it; empty: the model stays, and an effect that it
    has gets its turn."""

    terms: tuple[Term, ...] = ()
    wrong: tuple[str, ...] = ()


class Further(Protocol):
    """A search for terms that are in no effect file, which writes those it finds to ``folder`` as such."""

    folder: Path

    def __call__(self, fitter: Fitter, at: Fitted, named: Sequence[str], room: int, least: float) -> Wider | None:
        """What it finds beside the effects ``named`` in the fit ``at``, where there is ``room`` for so many more, or in
        their place; None where nothing is, or a new term takes less than the share ``least`` of what is surely no
        noise."""
