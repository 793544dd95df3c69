"""A small importer over ctypes that calls FMI 2 and FMI 3 alike and shows every status and message."""

import ctypes as ct
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fmpy

OK, DISCARD, ERROR = 0, 2, 3  # the same in fmi2Status and fmi3Status

# Every stage that keeps something between steps: noises, delay line, lag, an event, a mode of its own, memories.
NOISY = {
    "seed": 7,
    "sense_noise": 1e-3,
    "thermal_force": 1.0,
    "actuator_delay": 3.4e-6,
    "amplifier_time_constant": 2e-6,
    "damping_step_time": 1.5e-4,
    "damping_step_factor": 2.0,
    "parasitic_coupling": 0.5,
    "structure_lag": 3e-4,
    "circuit_lag": 1e-4,
    "tck": 1e-4,
    "tcp": 1e-8,
    "frame_rotation": 1.0,
    "sampling_jitter": 1e-9,
    "flicker_noise": 1e-4,
    "play": 3e-7,
    "thermal_hysteresis": 0.003,
    "relaxation": 1e-4,
    "relaxation_time": 1e-3,
    "turn_on": 0.01,
    "bias_walk": 0.1,
    "x_start": 1e-6,
}
OUTPUTS = ("v_x", "v_y", "x", "y", "x_dot", "y_dot")

_LOG_2 = ct.CFUNCTYPE(None, ct.c_void_p, ct.c_char_p, ct.c_int, ct.c_char_p, ct.c_char_p)
_LOG_3 = ct.CFUNCTYPE(None, ct.c_void_p, ct.c_int, ct.c_char_p, ct.c_char_p)


class _Callbacks(ct.Structure):
    _fields_ = [("log", _LOG_2), *((name, ct.c_void_p) for name in ("allocate", "free", "done", "environment"))]


class Fmu:
    """A loaded FMU: its library, token and value references by name."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.path = path
        self.folder = Path(fmpy.extract(str(path), unzipdir=str(folder)))
        self.description = fmpy.read_model_description(str(path))
        self.version = int(self.description.fmiVersion[0])
        self.token = self.description.guid if self.version == 2 else self.description.instantiationToken
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        platform = fmpy.platform if self.version == 2 else fmpy.platform_tuple
        library = f"{self.description.coSimulation.modelIdentifier}{fmpy.sharedLibraryExtension}"
        self.library = ct.CDLL(str(self.folder / "binaries" / platform / library))

    @property
    def resources(self) -> bytes:
        """The folder resources/ as the standard wants it: a URI, or a path that ends in a separator."""
        folder = self.folder / "resources"
        return (folder.as_uri() if self.version == 2 else f"{folder}{os.sep}").encode()

    def function(self, name: str) -> Any:
        """The exported function ``fmi2<name>`` or ``fmi3<name>``."""
        return getattr(self.library, f"fmi{self.version}{name}")

    def log_callback(self, log: list[tuple[int, str, str]]) -> Any:
        """A log function of the standard's signature that appends (status, category, message)."""

        def append(status: int, category: bytes, text: bytes) -> None:
            log.append((status, category.decode(), text.decode()))

        if self.version == 2:
            return _LOG_2(lambda environment, name, *entry: append(*entry))
        return _LOG_3(lambda environment, *entry: append(*entry))

    def instantiate(
        self,
        callback: Any,
        token: str,
        *,
        logging: bool = False,
        co_simulation: bool = True,
        events: bool = False,
        early: bool = False,
        resources: str | None = None,
    ) -> Any:
        """The address of a new instance, an int; None when refused. ``resources``: "" says that there are none, None
        names the folder as the standard asks."""
        place = self.resources if resources is None else resources.encode()
        if self.version == 2:
            # The record ends with this call: the FMU must have copied what it needs.
            record = _Callbacks(callback, None, None, None, None)
            make = self.function("Instantiate")
            make.restype = ct.c_void_p
            return make(b"gyro", ct.c_int(int(co_simulation)), token.encode(), place, ct.byref(record), 0, int(logging))
        if not co_simulation:
            make = self.function("InstantiateModelExchange")
            make.restype = ct.c_void_p
            return make(b"gyro", token.encode(), place, False, logging, None, callback)
        make = self.function("InstantiateCoSimulation")
        make.restype = ct.c_void_p
        options = (False, logging, ct.c_bool(events), ct.c_bool(early), None, ct.c_size_t(0))
        return make(b"gyro", token.encode(), place, *options, None, callback, None)


class Instance:
    """One instance of an FMU and what it has logged."""

    def __init__(
        self, fmu: Fmu, *, logging: bool = False, co_simulation: bool = True, events: bool = False, early: bool = False
    ) -> None:
        self.fmu = fmu
        self.log: list[tuple[int, str, str]] = []
        self._callback = fmu.log_callback(self.log)
        purpose = {"co_simulation": co_simulation, "events": events, "early": early}
        address = fmu.instantiate(self._callback, fmu.token, logging=logging, **purpose)
        assert address is not None, self.log
        self.address = ct.c_void_p(address)
        self._step_results = (ct.c_bool(), ct.c_bool(), ct.c_bool(), ct.c_double())

    def __enter__(self) -> "Instance":
        """The instance itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Frees it."""
        self.fmu.function("FreeInstance")(self.address)

    @property
    def message(self) -> str:
        """The latest message."""
        return self.log[-1][2]

    def call(self, name: str, *arguments: Any) -> int:
        """The status of ``fmi2<name>`` or ``fmi3<name>``."""
        return int(self.fmu.function(name)(self.address, *arguments))

    def set_up(self, start: float = 0.0, stop: float | None = None) -> int:
        """Enters initialization mode; times in s."""
        times = (0, ct.c_double(0.0), ct.c_double(start), int(stop is not None), ct.c_double(stop or 0.0))
        if self.fmu.version == 3:
            return self.call("EnterInitializationMode", *times)
        return self.call("SetupExperiment", *times) or self.call("EnterInitializationMode")

    def start(self, start: float = 0.0, stop: float | None = None, **values: float) -> None:
        """Sets ``values`` and initializes."""
        self.set(**values)
        assert self.set_up(start, stop) == OK, self.log
        assert self.call("ExitInitializationMode") == OK, self.log

    def set_by_reference(self, kind: str, references: Sequence[int], values: Any) -> int:
        """One call of a setter; kind is Real, Integer, Float64, Int32 ...; values is a ctypes array."""
        n = len(references)
        count = () if self.fmu.version == 2 else (ct.c_size_t(len(values)),)
        return self.call(f"Set{kind}", (ct.c_uint32 * n)(*references), ct.c_size_t(n), values, *count)

    def kind(self, name: str) -> str:
        """The type in the name of the functions for this variable."""
        return str(self.fmu.variables[name].type)

    def try_set(self, name: str, value: float) -> int:
        """The status of setting one variable."""
        real = self.kind(name) in ("Real", "Float64")
        array = (ct.c_double * 1)(value) if real else (ct.c_int32 * 1)(int(value))
        return self.set_by_reference(self.kind(name), [self.fmu.variables[name].valueReference], array)

    def set(self, **values: float) -> None:
        """Sets variables that must be accepted."""
        for name, value in values.items():
            assert self.try_set(name, value) == OK, self.log

    def try_get(self, *names: str) -> tuple[int, list[float]]:
        """Status and values of variables of one type."""
        n = len(names)
        real = self.kind(names[0]) in ("Real", "Float64")
        values = ((ct.c_double if real else ct.c_int32) * n)()
        references = (ct.c_uint32 * n)(*(self.fmu.variables[name].valueReference for name in names))
        count = () if self.fmu.version == 2 else (ct.c_size_t(n),)
        status = self.call(f"Get{self.kind(names[0])}", references, ct.c_size_t(n), values, *count)
        return status, list(values)

    def get(self, *names: str) -> list[float]:
        """Values of variables of one type, which must be readable."""
        status, values = self.try_get(*names)
        assert status == OK, self.log
        return values

    def step(self, time: float, step: float) -> int:
        """The status of a step, s."""
        results = () if self.fmu.version == 2 else tuple(ct.byref(result) for result in self._step_results)
        return self.call("DoStep", ct.c_double(time), ct.c_double(step), 1, *results)

    def run(self, first: int, last: int, step: float = 1e-5) -> list[list[float]]:
        """Steps number ``first`` to ``last`` - 1 under a force that changes with each; the outputs after each."""
        trace = []
        for k in range(first, last):
            self.set(u_x=1e-6 * (k % 7), omega_z=0.1 * (k % 3))
            assert self.step(k * step, step) == OK, self.log
            trace.append(self.get(*OUTPUTS))
        return trace

    def save(self, handle: ct.c_void_p | None = None) -> ct.c_void_p:
        """The state, in a new block or the given one."""
        handle = handle or ct.c_void_p()
        assert self.call("GetFMUstate" if self.fmu.version == 2 else "GetFMUState", ct.byref(handle)) == OK
        return handle

    def restore(self, handle: ct.c_void_p) -> int:
        """The status of setting a saved state."""
        return self.call("SetFMUstate" if self.fmu.version == 2 else "SetFMUState", handle)

    def free_saved(self, handle: ct.c_void_p) -> None:
        """Frees a saved state."""
        assert self.call("FreeFMUstate" if self.fmu.version == 2 else "FreeFMUState", ct.byref(handle)) == OK
        assert handle.value is None

    def serialize(self, handle: ct.c_void_p) -> bytes:
        """A saved state as bytes."""
        size = ct.c_size_t()
        state = "FMUstate" if self.fmu.version == 2 else "FMUState"
        assert self.call(f"Serialized{state}Size", handle, ct.byref(size)) == OK
        array = (ct.c_ubyte * size.value)()
        assert self.call(f"Serialize{state}", handle, array, size) == OK
        return bytes(array)

    def deserialize(self, data: bytes) -> tuple[int, ct.c_void_p]:
        """Status and the saved state that ``data`` holds."""
        handle = ct.c_void_p()
        name = "DeSerializeFMUstate" if self.fmu.version == 2 else "DeserializeFMUState"
        array = (ct.c_ubyte * len(data)).from_buffer_copy(data) if data else (ct.c_ubyte * 1)()
        return self.call(name, array, ct.c_size_t(len(data)), ct.byref(handle)), handle


class _EventInfo(ct.Structure):
    _fields_ = [(name, ct.c_int) for name in ("again", "terminate", "nominals", "values", "defined")]
    _fields_ += [("next", ct.c_double)]


class Exchange(Instance):
    """An instance of model exchange: its modes, states and rates."""

    def __init__(self, fmu: Fmu) -> None:
        super().__init__(fmu, co_simulation=False)
        states = (v.derivative for v in fmu.description.modelVariables if v.derivative is not None)
        self.states = [state.name for state in states]

    def update(self) -> tuple[bool, float]:
        """Event iteration: whether states have jumped, and the time of the next event [s]."""
        return update(self)

    def array(self, name: str) -> list[float]:
        """What ``fmi2<name>`` or ``fmi3<name>`` fills in for the continuous states."""
        values = (ct.c_double * len(self.states))()
        assert self.call(name, values, ct.c_size_t(len(values))) == OK, self.log
        return list(values)

    def rates(self) -> list[float]:
        """Rates of the states [SI/s]."""
        return self.array("GetDerivatives" if self.fmu.version == 2 else "GetContinuousStateDerivatives")

    def move(self, time: float, states: Sequence[float]) -> None:
        """Sets time and states."""
        assert self.call("SetTime", ct.c_double(time)) == OK, self.log
        n = len(states)
        assert self.call("SetContinuousStates", (ct.c_double * n)(*states), ct.c_size_t(n)) == OK, self.log


def update(instance: Instance) -> tuple[bool, float]:
    """Event iteration of any instance: whether states have jumped, and the time of the next event [s]."""
    if instance.fmu.version == 2:
        info = _EventInfo()
        assert instance.call("NewDiscreteStates", ct.byref(info)) == OK, instance.log
        assert not info.again and info.defined
        return bool(info.values), float(info.next)
    flags, time = [ct.c_bool() for _ in range(5)], ct.c_double()
    assert instance.call("UpdateDiscreteStates", *map(ct.byref, (*flags, time))) == OK, instance.log
    assert not flags[0].value and flags[4].value
    return flags[3].value, time.value


def declared_functions(version: int) -> list[str]:
    """The names of all functions that the standard's header declares."""
    header = (Path(fmpy.__file__).parent / "c-code" / f"fmi{version}Functions.h").read_text(encoding="utf-8")
    # A declaration reads `FMI3_Export fmi3GetVersionTYPE fmi3GetVersion;`
    return re.findall(rf"FMI{version}_Export\s+fmi{version}\w+TYPE\s+(fmi{version}\w+);", header)
