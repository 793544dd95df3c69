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
from gyro_model.compiling import compile_library

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
    """The library of the FMI 3.0 FMU at ``path``, for any number of instances that give ``outputs``; a context
    manager."""

    def __init__(self, path: Path, outputs: Sequence[str] = OUTPUT_NAMES) -> None:
        self.outputs = outputs
        self._folder = tempfile.TemporaryDirectory(prefix="gyrotwin-")
        folder = Path(self._folder.name)
        extract(path, folder)
        [self._binary] = [
            file
            for file in (folder / "binaries" / platform_tuple).iterdir()
            if file.suffix in (".so", ".dll", ".dylib")
        ]
        description = read_model_description(folder)
        self.references = {v.name: v.valueReference for v in description.modelVariables}
        self.token = str(description.instantiationToken)
        self.functions = compiled("plant_driver.c", folder)
        self.functions.driver_open.restype = ctypes.c_void_p
        self.functions.driver_run.restype = ctypes.c_int64
        self.functions.driver_means.restype = ctypes.c_int64

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
    latest, in the order of those asked for."""

    def __init__(
        self, plants: CPlants, parameters: Mapping[str, float], inputs: Mapping[str, Floats], step: float
    ) -> None:
        self._functions, self._done = plants.functions, 0
        self._inputs, self._outputs = plants.of(list(inputs)), plants.of(plants.outputs)
        self._table = np.ascontiguousarray(np.array(list(inputs.values())).T)
        self.outputs = np.zeros(len(plants.outputs))
        real = {name: value for name, value in parameters.items() if name != "seed"}
        values, references = np.array(list(real.values()), dtype=float), plants.of(list(real))
        seeded = plants.references["seed"] if "seed" in parameters else 2**32 - 1
        seed = ctypes.c_uint32(seeded), ctypes.c_int32(int(parameters.get("seed", 0)))
        token = plants.token.encode()
        size = ctypes.c_size_t(len(values))
        opened = self._functions.driver_open(plants.binary, token, at(references), at(values), size, *seed)
        if not opened:
            raise RuntimeError("the C driver could not start the plant")
        self._instance = ctypes.c_void_p(opened)
        rows, width = ctypes.c_int64(len(self._table)), ctypes.c_size_t(len(self._inputs))
        read = at(self._outputs), ctypes.c_size_t(len(self.outputs))
        self._arguments = ctypes.c_double(step), at(self._inputs), at(self._table), rows, width, *read

    def __call__(self, count: int) -> int:
        first, total = ctypes.c_int64(self._done), ctypes.c_int64(count)
        done = self._functions.driver_run(self._instance, first, total, *self._arguments, at(self.outputs))
        self._done += int(done)
        return int(done)

    def means(self, rows: int, per_row: int) -> Floats:
        """Means of each output over ``per_row`` steps, for so many ``rows``, shape (rows, outputs)."""
        means = np.zeros((rows, len(self.outputs)))
        first, count = ctypes.c_int64(self._done), ctypes.c_int64(rows)
        done = self._functions.driver_means(
            self._instance, first, count, ctypes.c_int64(per_row), *self._arguments, at(means)
        )
        if done != rows:
            raise RuntimeError(f"the FMU stopped after {done} of {rows} rows")
        self._done += rows * per_row
        return means

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._functions.driver_close(self._instance)
