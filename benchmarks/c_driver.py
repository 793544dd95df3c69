"""The plant as a C program steps it: the FMU's library behind plant_driver.c."""

import ctypes
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from fmpy import extract, platform_tuple, read_model_description
from numpy.typing import NDArray

from cosim.fmu import OUTPUT_NAMES
from gyro_model.build import model_token
from gyro_model.compiling import compile_library
from gyro_model.model import load_model

Floats = NDArray[np.float64]


def at(array: Any) -> ctypes.c_void_p:
    """Where the numbers of ``array`` lie."""
    return ctypes.c_void_p(array.ctypes.data)


def compiled(source: str, folder: Path) -> ctypes.CDLL:
    """A C file of this package as a library in ``folder``, by the FMU's compiler and flags."""
    library = folder / f"{Path(source).stem}.bin"
    compile_library(Path(__file__).parent, [source], library)
    return ctypes.CDLL(str(library))


class CPlants:
    """The library of the FMI 3.0 FMU at ``path``, for any number of instances; a context manager."""

    def __init__(self, path: Path) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="gyrotwin-")
        folder = Path(self._folder.name)
        extract(path, folder)
        [self._binary] = [
            file
            for file in (folder / "binaries" / platform_tuple).iterdir()
            if file.suffix in (".so", ".dll", ".dylib")
        ]
        self.references = {v.name: v.valueReference for v in read_model_description(folder).modelVariables}
        self.functions = compiled("plant_driver.c", folder)
        self.functions.driver_open.restype = ctypes.c_void_p
        self.functions.driver_run.restype = ctypes.c_int64

    def of(self, names: Sequence[str]) -> NDArray[np.uint32]:
        """The value references of variables by name."""
        return np.array([self.references[name] for name in names], dtype=np.uint32)

    def start(self, parameters: Mapping[str, float], inputs: Mapping[str, Floats], step: float) -> "CPlant":
        """An instance with ``parameters`` [SI], stepped by ``step`` [s] under ``inputs`` by name [SI], shape (rows,)
        each: a row a call, in turns."""
        return CPlant(self, parameters, inputs, step)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._folder.cleanup()

    @property
    def binary(self) -> bytes:
        """The path of the library."""
        return str(self._binary).encode()


class CPlant:
    """One instance; a context manager. Called with the number of steps it gives the number done; ``outputs``: the
    latest, in the order of OUTPUT_NAMES."""

    def __init__(
        self, plants: CPlants, parameters: Mapping[str, float], inputs: Mapping[str, Floats], step: float
    ) -> None:
        self._functions, self._step, self._done = plants.functions, step, 0
        self._inputs, self._outputs = plants.of(list(inputs)), plants.of(OUTPUT_NAMES)
        self._table = np.ascontiguousarray(np.array(list(inputs.values())).T)
        self.outputs = np.zeros(len(OUTPUT_NAMES))
        values, references = np.array(list(parameters.values())), plants.of(list(parameters))
        token = model_token(load_model()).encode()
        size = ctypes.c_size_t(len(values))
        opened = self._functions.driver_open(plants.binary, token, at(references), at(values), size)
        if not opened:
            raise RuntimeError("the C driver could not start the plant")
        self._instance = ctypes.c_void_p(opened)

    def __call__(self, count: int) -> int:
        done = self._functions.driver_run(
            self._instance,
            ctypes.c_int64(self._done),
            ctypes.c_int64(count),
            ctypes.c_double(self._step),
            at(self._inputs),
            at(self._table),
            ctypes.c_int64(len(self._table)),
            ctypes.c_size_t(len(self._inputs)),
            at(self._outputs),
            at(self.outputs),
            ctypes.c_size_t(len(self.outputs)),
        )
        self._done += int(done)
        return int(done)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._functions.driver_close(self._instance)
