"""Runs the FMU over arrays of inputs: fmpy loads and initialises it, the steps go straight to its C functions."""

import ctypes as ct
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from numpy.typing import NDArray

Floats = NDArray[np.float64]
OUTPUTS = ("v_x", "v_y", "x", "x_dot", "y", "y_dot")


class Runner:
    """One FMU, FMI 2 or 3, extracted into ``folder``."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.folder = extract(str(path), unzipdir=str(folder))
        self.description = read_model_description(str(path))
        self.version = int(self.description.fmiVersion[0])
        self.variables = {variable.name: variable for variable in self.description.modelVariables}

    def run(
        self,
        parameters: Mapping[str, float],
        t: Floats,
        inputs: Mapping[str, Floats] | None = None,
        outputs: Sequence[str] = OUTPUTS,
    ) -> dict[str, Floats]:
        """Outputs at ``t`` [s], shape (n,), sample k before the inputs change to their k-th values. SI, by name."""
        inputs = inputs or {}
        slave = self._started(parameters, {name: values[0] for name, values in inputs.items()})
        try:
            columns = np.array([np.asarray(values, dtype=float) for values in inputs.values()]).T
            rows = self._loop(slave, np.asarray(t), list(inputs), np.ascontiguousarray(columns), list(outputs))
        finally:
            slave.freeInstance()
        return dict(zip(outputs, rows.T, strict=True))

    def _started(self, parameters: Mapping[str, float], first: Mapping[str, float]) -> Any:
        kind, token = (FMU2Slave, self.description.guid) if self.version == 2 else (FMU3Slave, None)
        slave = kind(
            guid=token or self.description.instantiationToken,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName="test",
        )
        slave.instantiate()
        if self.version == 2:
            slave.setupExperiment()
        for name, value in {**parameters, **first}.items():
            variable = self.variables[name]
            number = int(value) if variable.type in ("Integer", "Int32") else float(value)
            getattr(slave, f"set{variable.type}")([variable.valueReference], [number])
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        return slave

    def _loop(self, slave: Any, t: Floats, names: list[str], columns: Floats, outputs: list[str]) -> Floats:
        given, taken = np.zeros(len(names)), np.zeros(len(outputs))
        put, get = self._access(slave, "Set", names, given), self._access(slave, "Get", outputs, taken)
        step = self._step(slave)
        rows = np.empty((len(t), len(outputs)))
        for k in range(len(t)):
            get()
            rows[k] = taken
            if k + 1 < len(t):
                if names:
                    given[:] = columns[k]
                    put()
                assert step(t[k], t[k + 1] - t[k]) == 0, f"step from {t[k]} s was refused"
        return rows

    def _access(self, slave: Any, verb: str, names: list[str], values: Floats) -> Callable[[], None]:
        function = getattr(slave.dll, f"fmi{self.version}{verb}{'Real' if self.version == 2 else 'Float64'}")
        references = (ct.c_uint32 * max(1, len(names)))(*(self.variables[name].valueReference for name in names))
        count, place = ct.c_size_t(len(names)), values.ctypes.data_as(ct.POINTER(ct.c_double))
        arguments = (slave.component, references, count, place) + ((count,) if self.version == 3 else ())

        def call() -> None:
            assert function(*arguments) == 0, f"{verb} {names} was refused"

        return call

    def _step(self, slave: Any) -> Callable[[float, float], int]:
        if self.version == 2:
            do_step = slave.dll.fmi2DoStep
            return lambda t, h: int(do_step(slave.component, ct.c_double(t), ct.c_double(h), 1))
        do_step = slave.dll.fmi3DoStep
        said = [ct.byref(kind()) for kind in (ct.c_bool, ct.c_bool, ct.c_bool, ct.c_double)]
        return lambda t, h: int(do_step(slave.component, ct.c_double(t), ct.c_double(h), True, *said))


class RestingRunner(Runner):
    """The FMU of the envelope form without its default motion and drive, at a carrier of 3 kHz."""

    def run(
        self,
        parameters: Mapping[str, float],
        t: Floats,
        inputs: Mapping[str, Floats] | None = None,
        outputs: Sequence[str] = OUTPUTS,
    ) -> dict[str, Floats]:
        """As ``Runner.run``."""
        rest = {"u_x_q": np.zeros(len(t)), "carrier_frequency": np.full(len(t), 3000.0)}
        return super().run({"x_start_i": 0.0, **parameters}, t, {**rest, **(inputs or {})}, outputs)
