"""The state of a run on disk, so that an interrupted run goes on from there and gives the same, bit for bit.

The file (npz) is data: arrays that must have the names, types and shapes of a run that begins. Its key is the digest of
all that drives the run but its courses; these are held against the kept ones by the run itself.
"""

import hashlib
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from time import monotonic
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from cosim.rate.run import RateRun
from gyro_model.build import model_token
from gyro_model.digest import digest_of
from gyro_model.envelope import envelope_model
from gyro_model.errors import InputError
from gyro_model.whole_file import whole_file

Arrays = Mapping[str, NDArray[Any]]

EVERY: Final = 10.0
"""Computing between two writings at least [s]: what an interruption costs. Shorter runs write nothing."""
SHARE: Final = 0.05
"""Writing takes this share of the time at most: the file grows with the record."""


def key_of(run: RateRun) -> str:
    """Names a run: device, loops, steps and code; SHA-256 in hexadecimal. Courses are not in it."""
    model = run.device.model
    token = model_token(envelope_model(model) if run.envelope else model)
    plant = sorted((run.device.all_parameters | run.plant_parameters()).items())
    loops = (run.blocks(), run.nominal, run.settling, run.first_inputs.tolist())
    steps = (run.envelope, run.period, run.per_row, run.rows, run.sense_rate)
    code = digest_of(Path(__file__).parents[1])
    return hashlib.sha256(repr((token, code, plant, loops, steps)).encode()).hexdigest()


class Keeper:
    """Keeps a run in the file ``path``, its folder made where there is none; ``say`` takes lines for the user.

    ``seconds``: of the run that the file holds; 0 where it holds none of this run.
    """

    def __init__(self, path: Path, say: Callable[[str], None]) -> None:
        self.path, self._say = path, say
        self.seconds = 0.0
        self._made = not path.parent.exists()
        self._due = monotonic() + EVERY

    def found(self, run: RateRun, begin: Arrays) -> Arrays | None:
        """The arrays kept of ``run``, None where there is no file. begin: those of a run that begins; what is empty
        there grows along its first axis. Raises InputError for a file that this run has not written."""
        if not self.path.is_file():
            return None
        try:
            with np.load(self.path, allow_pickle=False) as file:
                key = str(file["key"])
                kept = {name: file[name] for name in begin} if key == key_of(run) else None
        except (OSError, ValueError, KeyError, TypeError, MemoryError, EOFError, zipfile.BadZipFile):
            raise InputError("can't be read") from None
        if kept is None:
            raise InputError("of another run or version")
        if not all(_alike(kept[name], start) for name, start in begin.items()):
            raise InputError("damaged")
        return kept

    def goes_anew(self, why: InputError) -> None:
        """Says that the file is not used."""
        self._say(f"{self.path}: {why}; the run starts anew")

    def goes_on(self, seconds: float) -> None:
        """The run goes on from the file, at ``seconds``."""
        self.seconds = seconds
        self._say(f"going on from {self.path} at t = {seconds:g} s")

    def offer(self, run: RateRun, seconds: float, arrays: Callable[[], Arrays]) -> None:
        """Writes ``arrays()`` as the state of ``run`` at ``seconds`` where that is due; an older file is replaced
        whole. Where it can't be written the run goes on all the same."""
        began = monotonic()
        if began < self._due:
            return
        try:
            self._write({"key": np.array(key_of(run)), **arrays()})
            self.seconds = seconds
        except OSError as error:
            self._say(f"{self.path}: {error.strerror}; an interrupted run would start anew")
        now = monotonic()
        self._due = now + max(EVERY, (now - began) / SHARE)

    def _write(self, arrays: Arrays) -> None:
        with whole_file(self.path) as file:
            np.savez(file, allow_pickle=False, **arrays)

    def forget(self) -> None:
        """Removes the file, and its folder where that was made for it and is empty."""
        self.path.unlink(missing_ok=True)
        if self._made and self.path.parent.is_dir() and not any(self.path.parent.iterdir()):
            self.path.parent.rmdir()


def _alike(kept: NDArray[Any], begin: NDArray[Any]) -> bool:
    """Whether an array is of the kind of that at the begin."""
    grows = begin.ndim > 0 and len(begin) == 0
    return kept.dtype == begin.dtype and kept.ndim == begin.ndim and kept.shape[grows:] == begin.shape[grows:]
