"""The plant as the loop sees it: the FMU, its variables by name, and compiled calls of its functions.

A step through fmpy's classes costs microseconds. Here fmpy loads the FMU and initialises it; the loop then calls the
three FMI functions of a step by their addresses from compiled code.
"""

import ctypes
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import numpy as np
from numpy.typing import NDArray

from gyro_model.build import build, model_token
from gyro_model.errors import InputError, nearest
from gyro_model.model import Model, load_model

FMI_ERROR: Final = 3
"""fmi3Error: the step was refused or failed; what lies below is usable."""

INPUT_NAMES: Final = ("u_x", "u_y", "omega_z")
OUTPUT_NAMES: Final = ("v_x", "v_y", "x", "x_dot", "y", "y_dot")

SET, STEP, GET, INSTANCE, HANDLE_SIZE = range(5)
"""Layout of a plant's handle, int64: the addresses of fmi3SetFloat64, fmi3DoStep, fmi3GetFloat64 and of the
instance."""


class Plant:
    """An initialised FMU instance, to be used as a context manager.

    ``handle``, ``inputs`` and ``outputs`` (value references, uint32) are what the compiled ``exchange`` takes.
    """

    input_names: tuple[str, ...] = INPUT_NAMES
    output_names: tuple[str, ...] = OUTPUT_NAMES

    def __init__(self, path: Path, parameters: Mapping[str, float], model: Model | None = None) -> None:
        """Loads the FMU at ``path`` and initialises it with ``parameters`` (SI).

        Raises InputError where the FMU is of another model, a parameter is unknown, or the FMU refuses a value.
        """
        from fmpy import extract, read_model_description
        from fmpy.fmi3 import FMU3Slave

        self._complaints: list[str] = []
        self._folder: str | None = None
        try:
            description = read_model_description(path)
        except Exception as error:  # fmpy raises Exception itself
            raise InputError(f"FMU {path}: not a readable FMU ({error}); build it anew with `gyrotwin build`") from None
        token = model_token(model or load_model())
        if description.guid != token and description.instantiationToken != token:
            raise InputError(f"FMU {path}: is of another model than this program; build it anew with `gyrotwin build`")
        self.references = {variable.name: variable.valueReference for variable in description.modelVariables}
        self._integers = {variable.name for variable in description.modelVariables if variable.type == "Int32"}
        self._folder = extract(path)
        self._fmu: Any = FMU3Slave(
            guid=token,
            unzipDirectory=self._folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="plant",
        )
        try:
            self._start(parameters)
        except BaseException:
            self.close()
            raise

    def _start(self, parameters: Mapping[str, float]) -> None:
        self._fmu.instantiate(loggingOn=False, logMessage=self._log)
        try:
            self._set(parameters)
            self._fmu.enterInitializationMode()
            self._fmu.exitInitializationMode()
        except InputError:
            raise
        except Exception as error:  # fmpy raises Exception itself
            raise InputError(self.complaint() or str(error)) from None
        self.handle = np.zeros(HANDLE_SIZE, dtype=np.int64)
        for slot, name in ((SET, "fmi3SetFloat64"), (STEP, "fmi3DoStep"), (GET, "fmi3GetFloat64")):
            self.handle[slot] = ctypes.cast(getattr(self._fmu.dll, name), ctypes.c_void_p).value or 0
        self.handle[INSTANCE] = self._fmu.component
        self.inputs = self.value_references(self.input_names)
        self.outputs = self.value_references(self.output_names)

    def _set(self, values: Mapping[str, float]) -> None:
        """Sets variables by name, in one call for each type: a call costs as much as some fifty steps."""
        for name in values:
            if name not in self.references:
                raise InputError(f"parameter {name!r} is unknown to the FMU{nearest(name, self.references)}")
        whole = {self.references[name]: int(value) for name, value in values.items() if name in self._integers}
        real = {self.references[name]: value for name, value in values.items() if name not in self._integers}
        if whole:
            self._fmu.setInt32(list(whole), list(whole.values()))
        if real:
            self._fmu.setFloat64(list(real), list(real.values()))

    def _log(self, environment: Any, status: int, category: bytes, message: bytes) -> None:
        self._complaints.append(message.decode(errors="replace"))

    def value_references(self, names: Sequence[str]) -> NDArray[np.uint32]:
        """The value references of variables by name."""
        return np.array([self.references[name] for name in names], dtype=np.uint32)

    def get(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Present values of variables by name."""
        return np.array(self._fmu.getFloat64(self.value_references(names).tolist()))

    def complaint(self) -> str:
        """What the FMU said last, without the name of the FMI function."""
        return self._complaints[-1].partition(": ")[2] if self._complaints else ""

    def saved(self) -> bytes:
        """The whole state of the instance, as the FMU writes it."""
        state = self._fmu.getFMUState()
        try:
            return bytes(self._fmu.serializeFMUState(state))
        finally:
            self._fmu.freeFMUState(state)

    def restore(self, saved: bytes) -> None:
        """Sets the state that ``saved`` gave. Raises InputError where the FMU refuses it, and stays as it is."""
        state = None
        try:
            state = self._fmu.deserializeFMUState(saved)
            self._fmu.setFMUState(state)
        except Exception as error:  # fmpy raises Exception itself
            raise InputError(self.complaint() or str(error)) from None
        finally:
            if state is not None:
                self._fmu.freeFMUState(state)

    def close(self) -> None:
        """Frees the instance and removes the extracted FMU."""
        if getattr(self, "_fmu", None) is not None and self._fmu.component:
            self._fmu.freeInstance()
            self._fmu.component = None
        if self._folder:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def open_plant(
    parameters: Mapping[str, float], model: Model | None = None, inputs: Mapping[str, float] | None = None
) -> Plant:
    """The plant of the present model, its FMU built where that has not been done; ``inputs``: what it finds when it
    starts, by name."""
    return Plant(build(model).fmi3, {**parameters, **(inputs or {})}, model)
