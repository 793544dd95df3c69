"""A model with more resonances than its effect files have: copies of a resonant force stand ready.

A copy acts on the other axis, or is a second one of its kind, which gets its turn when the one before is in the model.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from discrepancy.fit.defect import Defect
from discrepancy.terms.effect_file import joined
from gyro_model.anatomy import Effect, Force
from gyro_model.copies import copied
from gyro_model.errors import InputError
from gyro_model.model import EFFECTS_FOLDER, Model

MOST: Final = 2
"""Resonances on an axis beside its own mode: with two axes six modes in all. A record of one axis has as many as it
shows."""

_TEXT: Final = '''"""{title}"""

from gyro_model.copies import copied
from gyro_model.effects import {original}

EFFECT = copied({original}.EFFECT, "{suffix}"{turned})
'''


@dataclass(frozen=True)
class Copy:
    """A copy of the force ``original``; after: the id of the force that comes before it, "" where none does; further:
    whether it is a further one on the same axis, so that it can't stand in that one's place."""

    original: Force
    suffix: str
    turned: bool
    after: str
    further: bool

    @property
    def effect(self) -> Force:
        """As an effect of a model."""
        return copied(self.original, self.suffix, turned=self.turned)

    def write(self, folder: Path) -> Path:
        """Writes the effect file, and its folder where there is none. Raises InputError where that can't be."""
        path = folder / f"{self.original.id}{self.suffix}.py"
        title = f"{self.original.doc.splitlines()[0].rstrip('.')}: " + (
            "x and y exchanged." if self.turned else "a further one."
        )
        text = _TEXT.format(title=title, original=self.original.id, suffix=self.suffix,
                            turned=", turned=True" if self.turned else "")  # fmt: skip
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        except OSError as error:
            raise InputError(f"effect file {path}: can't be written ({error}); choose another folder") from None
        return path


def resonator_axis(effect: Effect | Defect) -> int | None:
    """The axis on which it is a resonator and nothing else; None where it is none."""
    if not isinstance(effect, Force) or len(effect.sizes) != 1 or not effect.states:
        return None
    kinds = [q.search.kind for q in effect.parameters if q.search is not None and q.search.tried]
    acting: Sequence[int] = [axis for axis, term in enumerate(effect.force) if term != 0]
    return acting[0] if sorted(kinds) == ["quality", "resonance"] and len(acting) == 1 else None


def copies(model: Model, axes: int, seen: int) -> Mapping[str, Copy]:
    """Copies of the packaged resonant forces of ``model`` that it does not have yet, by id: for the modes that records
    of so many ``axes`` show beside one an axis, ``seen``, from the first, others for when the force itself is in the
    model."""
    turns, most = ((False,), max(MOST, seen)) if axes == 1 else ((False, True), MOST)
    own, found = {e.id for e in model.effects}, {}
    for effect in (e for e in model.effects if isinstance(e, Force) and _resonates(e)):
        for turned in turns:
            before = "" if turned and seen else effect.id
            for place in range(1 if turned else 2, most + 1):
                suffix = ("_y" if turned else "") + (f"_{place}" if place > 1 else "")
                if effect.id + suffix not in own:
                    found[effect.id + suffix] = Copy(effect, suffix, turned, before, place > 1)
                before = effect.id + suffix
    return found


def with_copies(model: Model, added: Mapping[str, Copy]) -> Model:
    """The model with them."""
    return joined(model, [copy.effect for copy in added.values()])


def _resonates(effect: Effect) -> bool:
    packaged = (EFFECTS_FOLDER / f"{effect.id}.py").is_file()
    return packaged and any(q.search is not None and q.search.kind == "resonance" for q in effect.parameters)
