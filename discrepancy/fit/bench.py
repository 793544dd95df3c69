"""A plant under measured inputs: the loop over its steps is compiled."""

import ctypes
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

import numpy as np
from llvmlite import ir
from numba import njit

from cosim.exchange import exchange, pointer_call
from cosim.fmu import HANDLE_SIZE, INSTANCE, Plant
from discrepancy.data.record import Floats
from discrepancy.fit.forced import Forced
from gyro_model.errors import InputError

OUTPUTS: Final = ("v_x", "v_y")
SPEEDS: Final = ("x_dot", "y_dot")
"""Outputs for a sensor of velocity or acceleration: none of the model's, so that nothing acts on it."""


@njit(cache=True, nogil=True)
def _run(handle, inputs, values, outputs, start, step, stride, v, first, last):  # type: ignore[no-untyped-def]
    """Steps through values (steps, inputs) from sample first to last and puts v (samples, 2) after each; gives the
    sample it failed at, or last."""
    flags = np.zeros(HANDLE_SIZE)
    for k in range(first, last):
        for i in range(stride):
            n = k * stride + i
            if exchange(handle, inputs, values[n], outputs, v[k + 1], flags, start + n * step, step) > 0:
                return k
    return last


_acceleration_of = pointer_call("gyro_acceleration", 3 * (ir.IntType(8).as_pointer(),))
NONE: Final = np.zeros((0, 2))


@njit(cache=True, nogil=True)
def _run_accelerations(handle, function, inputs, values, command, start, step, stride, v, first, last):  # type: ignore[no-untyped-def]
    """The same with accelerations for v, by the C function at an address, under the command at samples if there is
    one."""
    flags, none, nothing = np.zeros(HANDLE_SIZE), np.zeros(0, np.uint32), np.zeros(0)
    for k in range(first, last):
        for i in range(stride):
            n = k * stride + i
            if exchange(handle, inputs, values[n], none, nothing, flags, start + n * step, step) > 0:
                return k
        now = command[k + 1].ctypes.data if len(command) else np.uintp(0)
        _acceleration_of(function, (handle[INSTANCE], now, v[k + 1].ctypes.data))
    return last


class Bench(Plant):
    """A plant that starts anew without loading the FMU again."""

    @property
    def library(self) -> Any:
        """The FMU's, with the functions of fmu_src/varied."""
        return self._fmu.dll

    @property
    def instance(self) -> int:
        """Its address."""
        return int(self.handle[INSTANCE])

    @property
    def _acceleration(self) -> int:
        """The address of the function that gives both accelerations."""
        return int(ctypes.cast(self.library.gyro_acceleration, ctypes.c_void_p).value or 0)

    def _accelerations(self, command: Floats | None) -> Floats:
        """Both, at present [m/s2]."""
        found = np.zeros(2)
        addresses = (self.instance, command.ctypes.data if command is not None else None, found.ctypes.data)
        self.library.gyro_acceleration(*map(ctypes.c_void_p, addresses))
        return found

    def restart(self, parameters: Mapping[str, float], start: float) -> None:
        """Initialises it anew with these parameters at ``start`` [s]. Raises InputError where the FMU refuses one."""
        self._fmu.reset()
        try:
            self._set(parameters)
            self._fmu.enterInitializationMode(startTime=start)
            self._fmu.exitInitializationMode()
        except InputError:
            raise
        except Exception as error:  # fmpy raises Exception itself
            raise InputError(self.complaint() or str(error)) from None

    def begin(self, device: Mapping[str, float], driven: Forced, start: float, each: int = 1) -> None:
        """Initialises it for a run from ``start`` [s], sampled every ``each`` steps. Raises InputError where the FMU
        refuses a parameter."""
        values, names, step = driven
        clock = {"internal_step": step, "sample_period": step * each}
        first = dict(zip(names, values[0].tolist(), strict=True))
        self.restart({**device, **clock, **first}, start)

    def play(
        self, device: Mapping[str, float], driven: Forced, start: float, each: int, order: int, command: Floats | None
    ) -> tuple[Floats, Callable[[int, int], int]]:
        """Begins a run of which the voltage, or by ``order`` speeds or accelerations, are read every ``each`` steps:
        what is read (samples, 2), of which only the first is known, and what fills it from one sample to another and
        gives the one it failed at. command: at samples [N], for accelerations where it is not held from one to another.
        """
        self.begin(device, driven, start, each)
        values, names, step = driven
        v, references = np.full((len(values) // each, 2), np.nan), self.value_references(names)
        if order == 2:
            v[0] = self._accelerations(command)
            own = self.handle, self._acceleration, references, values, NONE if command is None else command
            return v, partial(_run_accelerations, *own, start, step, each, v)
        outputs = OUTPUTS if order == 0 else SPEEDS
        v[0] = self.get(outputs)
        return v, partial(_run, self.handle, references, values, self.value_references(outputs), start, step, each, v)
