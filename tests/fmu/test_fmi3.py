"""What is particular to FMI 3.0, and that both standards give the same numbers."""

import ctypes as ct
from collections.abc import Iterator

import fmpy
import pytest
from fmpy.validation import validate_fmu
from fmu_importer import ERROR, NOISY, OK, Fmu, Instance, declared_functions


@pytest.fixture
def fmi3(fmus: dict[int, Fmu]) -> Fmu:
    return fmus[3]


@pytest.fixture
def gyro(fmi3: Fmu) -> Iterator[Instance]:
    with Instance(fmi3) as instance:
        yield instance


def test_every_function_of_the_standard_is_exported_unprefixed(fmi3: Fmu) -> None:
    names = declared_functions(3)
    assert len(names) == 75  # counted in the header: guards against a pattern that finds fewer
    assert [name for name in names if not hasattr(fmi3.library, name)] == []
    assert not any(hasattr(fmi3.library, name) for name in ("gyro_new", "fmi_step")), "inner functions stay hidden"


def test_version(fmi3: Fmu) -> None:
    fmi3.function("GetVersion").restype = ct.c_char_p
    assert fmi3.function("GetVersion")() == b"3.0"


def test_fmpy_finds_no_fault(fmi3: Fmu) -> None:
    assert validate_fmu(str(fmi3.path)) == []


def test_fmpy_simulates_both_alike(fmus: dict[int, Fmu]) -> None:
    def simulate(fmu: Fmu) -> bytes:
        settings = {"start_values": NOISY, "output": ["v_x", "v_y"], "stop_time": 1e-3, "output_interval": 5e-6}
        return bytes(fmpy.simulate_fmu(str(fmu.path), **settings).tobytes())

    assert simulate(fmus[2]) == simulate(fmus[3])


def test_both_standards_give_equal_bits(fmus: dict[int, Fmu]) -> None:
    with Instance(fmus[2]) as old, Instance(fmus[3]) as new:
        old.start(**NOISY)
        new.start(**NOISY)
        assert old.run(0, 300) == new.run(0, 300)


LACKING = [
    "EnterEventMode",
    "EnterStepMode",
    "EvaluateDiscreteStates",
    "UpdateDiscreteStates",
    "EnterConfigurationMode",
    "ExitConfigurationMode",
    "GetIntervalDecimal",
    "GetIntervalFraction",
    "GetShiftDecimal",
    "GetShiftFraction",
    "SetIntervalDecimal",
    "SetIntervalFraction",
    "SetShiftDecimal",
    "SetShiftFraction",
    "GetNumberOfVariableDependencies",
    "GetVariableDependencies",
    "GetDirectionalDerivative",
    "GetAdjointDerivative",
    "GetOutputDerivatives",
    "EnterContinuousTimeMode",
    "CompletedIntegratorStep",
    "SetContinuousStates",
    "GetContinuousStateDerivatives",
    "GetEventIndicators",
    "GetContinuousStates",
    "GetNominalsOfContinuousStates",
    "GetNumberOfEventIndicators",
    "GetNumberOfContinuousStates",
]


@pytest.mark.parametrize("name", LACKING)
def test_what_the_fmu_lacks_is_an_error_with_a_message(gyro: Instance, name: str) -> None:
    gyro.start()
    assert gyro.call(name, *[None] * 8) == ERROR
    assert gyro.message.startswith(f"fmi3{name}: ")
    assert gyro.step(0.0, 1e-5) == OK


def test_functions_of_other_interface_types_are_errors(gyro: Instance) -> None:
    assert gyro.call("SetTime", ct.c_double(0.0)) == ERROR
    assert gyro.call("ActivateModelPartition", 0, ct.c_double(0.0)) == ERROR
    assert "clocks" in gyro.message


@pytest.mark.parametrize(
    "kind", ["Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64", "Boolean", "String"]
)
def test_types_without_variables(gyro: Instance, kind: str) -> None:
    for function in (f"Get{kind}", f"Set{kind}"):
        references, room = (ct.c_uint32 * 1)(0), ct.create_string_buffer(16)
        assert gyro.call(function, references, ct.c_size_t(1), room, ct.c_size_t(1)) == ERROR
        assert gyro.message.startswith(f"fmi3{function}: u_x is real")
        assert gyro.call(function, None, ct.c_size_t(0), None, ct.c_size_t(0)) == OK


@pytest.mark.parametrize("function", ["GetBinary", "SetBinary", "GetClock", "SetClock"])
def test_binaries_and_clocks(gyro: Instance, function: str) -> None:
    references, room = (ct.c_uint32 * 1)(0), ct.create_string_buffer(16)
    assert gyro.call(function, references, ct.c_size_t(1), room, room, ct.c_size_t(1)) == ERROR
    assert gyro.message.startswith(f"fmi3{function}: u_x is real")


def test_counts_that_differ_are_refused(gyro: Instance) -> None:
    values = (ct.c_double * 2)(1e-6, 2e-6)
    assert gyro.set_by_reference("Float64", [gyro.fmu.variables["u_x"].valueReference], values) == ERROR
    assert "2 values for 1 value references" in gyro.message
    assert gyro.get("u_x") == [0.0]


def test_time_is_a_variable(gyro: Instance) -> None:
    assert gyro.set_up(start=0.25) == OK
    assert gyro.get("time") == [0.25]
    assert gyro.call("ExitInitializationMode") == OK
    assert gyro.step(0.25, 1e-5) == OK
    assert gyro.get("time") == [0.25 + 1e-5]
    assert gyro.try_set("time", 0.0) == ERROR
    assert "time is computed" in gyro.message


def test_results_of_a_step(gyro: Instance) -> None:
    gyro.start()
    flags, last = [ct.c_bool(True) for _ in range(3)], ct.c_double(-1.0)
    for step, status in ((1e-5, OK), (-1e-5, ERROR)):
        time = 0.0 if status == OK else 1e-5
        arguments = (ct.c_double(time), ct.c_double(step), 1, *(ct.byref(flag) for flag in flags), ct.byref(last))
        assert gyro.call("DoStep", *arguments) == status
        assert [flag.value for flag in flags] == [False] * 3
        assert last.value == 1e-5
    assert gyro.call("DoStep", ct.c_double(1e-5), ct.c_double(1e-5), 1, None, None, None, None) == ERROR
    assert "NULL" in gyro.message


@pytest.mark.parametrize("event_mode", [True, False])
def test_event_mode_is_refused_and_intermediate_variables_are_not(fmi3: Fmu, event_mode: bool) -> None:
    log: list[tuple[int, str, str]] = []
    callback = fmi3.log_callback(log)
    make = fmi3.function("InstantiateCoSimulation")
    make.restype = ct.c_void_p
    references = (ct.c_uint32 * 1)(0)
    options = (False, False, ct.c_bool(event_mode), ct.c_bool(False), references, ct.c_size_t(1))
    instance = make(b"gyro", fmi3.token.encode(), None, *options, None, callback, None)
    assert (instance is None) == event_mode
    if event_mode:
        assert "eventModeUsed" in log[-1][2]
    else:
        fmi3.function("FreeInstance")(ct.c_void_p(instance))


def test_scheduled_execution_is_refused(fmi3: Fmu) -> None:
    log: list[tuple[int, str, str]] = []
    callback = fmi3.log_callback(log)
    make = fmi3.function("InstantiateScheduledExecution")
    make.restype = ct.c_void_p
    assert make(b"gyro", fmi3.token.encode(), None, False, False, None, callback, None, None, None) is None
    assert "co-simulation only" in log[-1][2]
