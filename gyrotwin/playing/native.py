"""The native FMU, called step by step: what the module in the page is compared with."""

import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NamedTuple, Self

import fmpy
import numpy as np
from fmpy.simulation import instantiate_fmu
from numpy.typing import NDArray

from gyro_model.model import Model

Floats = NDArray[np.float64]
_OFFSET: Final = 0xCBF29CE484222325
_PRIME: Final = 0x100000001B3
_WIDTH: Final = 2**64 - 1


class Score(NamedTuple):
    """What is played: ``parameters`` by name [SI], ``inputs`` by name as held over each of the steps, ``step`` [s]."""

    parameters: Mapping[str, float]
    inputs: Mapping[str, Floats]
    step: float


class NativeFmu:
    """The FMI 3.0 FMU at ``path``, of ``model``, loaded for this machine while the block runs."""

    def __init__(self, model: Model, path: Path) -> None:
        self._references = {q.name: index for index, q in enumerate(model.quantities)}
        self._whole = {q.name for q in model.quantities if q.integer}
        self._path = path

    def __enter__(self) -> Self:
        self._description: Any = fmpy.read_model_description(str(self._path))
        self._folder = fmpy.extract(str(self._path))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)

    def play(self, score: Score, outputs: Sequence[str]) -> Floats:
        """The ``outputs`` after each step, shape (steps done, outputs): fewer than asked for where the motion
        diverges."""
        steps = len(next(iter(score.inputs.values())))
        held = np.array(list(score.inputs.values())).T.tolist()
        driven, read = self._all(score.inputs), self._all(outputs)
        fmu = instantiate_fmu(self._folder, self._description, fmi_type="CoSimulation", logger=_silent)
        rows = []
        try:
            for name, value in score.parameters.items():
                if name in self._whole:
                    fmu.setInt32([self._references[name]], [int(value)])
                else:
                    fmu.setFloat64([self._references[name]], [value])
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
            for k in range(steps):
                fmu.setFloat64(driven, held[k])
                fmu.doStep(k * score.step, score.step)
                rows.append(fmu.getFloat64(read))
        except fmpy.fmi1.FMICallException:
            pass  # diverged, which is what the caller asks
        finally:
            fmu.freeInstance()
        return np.array(rows).reshape(-1, len(read))

    def _all(self, names: Sequence[str] | Mapping[str, Floats]) -> list[int]:
        return [self._references[name] for name in names]


def _silent(*_: object) -> None:
    """Takes the FMU's messages, which a trial beyond its limits gives on purpose."""


def fnv1a(data: bytes) -> str:
    """The FNV-1a hash with 64 bits, as 16 hexadecimal digits."""
    digest = _OFFSET
    for byte in data:
        digest = ((digest ^ byte) * _PRIME) & _WIDTH
    return f"{digest:016x}"
