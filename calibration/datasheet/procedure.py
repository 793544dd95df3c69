"""A procedure: one test of the datasheet. Each is a file of ``procedures`` with ``PROCEDURE``, found by a scan."""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

from calibration.datasheet.figure import Outcome
from gyro_model.errors import InputError, nearest

FOLDER: Final = Path(__file__).parent / "procedures"
MODES: Final = ("rate-open", "rate-closed", "whole-angle")
RATE: Final = ("rate-open", "rate-closed")
WHOLE_ANGLE: Final = ("whole-angle",)
STANDARDS: Final = {"ieee1431": "IEEE Std 1431-2004"}
"""Standards by the name that --standard takes."""


class Procedure(NamedTuple):
    """A test. title; clause: of the test in IEEE Std 1431-2004, by which the tests are ordered; modes in which it is
    done; measure: takes the bench; share: of the time that all take, roughly."""

    title: str
    clause: str
    modes: tuple[str, ...]
    measure: Callable[[Any], Outcome]
    share: float = 1.0

    @property
    def order(self) -> tuple[int, ...]:
        """Numbers of the clause."""
        return tuple(map(int, self.clause.split(".")))


def procedures(mode: str) -> dict[str, Procedure]:
    """The tests of a mode by name, in the standard's order. Raises InputError for a mode that is none."""
    if mode not in MODES:
        raise InputError(f"mode {mode!r}: give {', '.join(MODES)}{nearest(mode, MODES)}")
    names = sorted(path.stem for path in FOLDER.glob("[a-z]*.py"))
    found = {name: importlib.import_module(f"calibration.datasheet.procedures.{name}").PROCEDURE for name in names}
    chosen = {name: procedure for name, procedure in found.items() if mode in procedure.modes}
    return dict(sorted(chosen.items(), key=lambda item: (item[1].order, item[0])))
