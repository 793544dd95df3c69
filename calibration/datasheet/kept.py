"""The tests of a datasheet that are done, on disk, so that an interrupted datasheet goes on behind them.

The file is JSON, nothing in it is executed. Its key is the digest of bench, model and code.
"""

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from calibration.datasheet.figure import Curve, Figure, Outcome
from gyro_model.build import model_token
from gyro_model.digest import digest_of
from gyro_model.whole_file import whole_file


def key_of(bench: Any, mode: str) -> str:
    """Names a datasheet: what is on the bench, what is known of it, how much is measured, and the code; SHA-256."""
    root = Path(__file__).parents[2]
    code = digest_of(root / "calibration", root / "cosim", suffixes=(".py", ".c", ".h", ".toml"))
    what = (bench.device, bench.design, bench.seed, bench.plan)
    return hashlib.sha256(repr((mode, what, model_token(bench.device.model), code)).encode()).hexdigest()


class KeptTests:
    """Keeps what tests gave in the file ``path``, its folder made where there is none; ``say`` takes lines for the
    user."""

    def __init__(self, path: Path, say: Callable[[str], None]) -> None:
        self.path, self._say = path, say
        self._key = ""
        self._tests: dict[str, Any] = {}

    @property
    def count(self) -> int:
        """How many tests the file holds."""
        return len(self._tests)

    def begin(self, key: str) -> None:
        """Takes up the tests of the datasheet ``key`` where the file holds some."""
        self._key = key
        if not self.path.is_file():
            return
        try:
            content = json.loads(self.path.read_text(encoding="utf-8"))
            found = {name: _outcome(test) and test for name, test in content["tests"].items()}
            same = content["key"] == key
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
            self._say(f"{self.path}: can't be read; the datasheet starts anew")
            return
        if not same:
            self._say(f"{self.path}: of another datasheet or version; this one starts anew")
            return
        self._tests = found
        self._say(f"going on from {self.path}: {self.count} tests are done")

    def found(self, name: str) -> Outcome | None:
        """What the test ``name`` gave; None where it is not done."""
        return _outcome(self._tests[name]) if name in self._tests else None

    def keep(self, name: str, outcome: Outcome) -> None:
        """Writes what a test gave; an older file is replaced whole. Without figures there is nothing to keep."""
        if not outcome.figures:
            return
        self._tests[name] = {
            "figures": [figure._asdict() for figure in outcome.figures],
            "curves": [{**curve._asdict(), "columns": _listed(curve)} for curve in outcome.curves],
            "reason": outcome.reason,
        }
        try:
            with whole_file(self.path) as file:
                file.write(json.dumps({"key": self._key, "tests": self._tests}).encode())
        except OSError as error:
            self._tests.clear()
            self._say(f"{self.path}: {error.strerror}; an interrupted datasheet would start anew")


def _listed(curve: Curve) -> dict[str, list[float]]:
    return {name: np.asarray(values).tolist() for name, values in curve.columns.items()}


def _outcome(test: dict[str, Any]) -> Outcome:
    curves = [
        Curve(**{**curve, "columns": {name: np.array(values) for name, values in curve["columns"].items()}})
        for curve in test["curves"]
    ]
    return Outcome([Figure(**figure) for figure in test["figures"]], curves, test["reason"])
