"""What is particular to FMI 3.0, and that both standards give the same numbers."""

import ctypes as ct
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import fmpy
import pytest
from fmpy.validation import validate_fmu
from fmu_importer import DISCARD, ERROR, NOISY, OK, OUTPUTS, Fmu, Instance, declared_functions


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
    "EvaluateDiscreteStates",
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
    "GetOutputDerivatives",
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
    assert "clock" in gyro.message


@pytest.mark.parametrize(
    "kind", ["Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64", "Boolean", "String"]
)
def test_types_without_variables(gyro: Instance, kind: str) -> None:
    for function in (f"Get{kind}", f"Set{kind}"):
        references, room = (ct.c_uint32 * 1)(0), ct.create_string_buffer(16)
        assert gyro.call(function, references, ct.c_size_t(1), room, ct.c_size_t(1)) == ERROR
        assert gyro.message.startswith(f"fmi3{function}: u_x is real")
        assert gyro.call(function, None, ct.c_size_t(0), None, ct.c_size_t(0)) == OK


@pytest.mark.parametrize("function", ["GetBinary", "SetBinary", "GetClock"])
def test_binaries_and_clocks(gyro: Instance, function: str) -> None:
    references, room = (ct.c_uint32 * 1)(0), ct.create_string_buffer(16)
    assert gyro.call(function, references, ct.c_size_t(1), room, room, ct.c_size_t(1)) == ERROR
    assert gyro.message.startswith(f"fmi3{function}: u_x is real")


def test_clocks_are_not_set(gyro: Instance) -> None:
    references, room = (ct.c_uint32 * 1)(0), ct.create_string_buffer(16)
    assert gyro.call("SetClock", references, ct.c_size_t(1), room) == ERROR
    assert "none that an importer sets" in gyro.message
    assert gyro.call("SetClock", None, ct.c_size_t(0), None) == OK


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


def test_intermediate_variables_are_taken(fmi3: Fmu) -> None:
    log: list[tuple[int, str, str]] = []
    make = fmi3.function("InstantiateCoSimulation")
    make.restype = ct.c_void_p
    references = (ct.c_uint32 * 1)(0)
    options = (False, False, ct.c_bool(False), ct.c_bool(False), references, ct.c_size_t(1))
    instance = make(b"gyro", fmi3.token.encode(), None, *options, None, fmi3.log_callback(log), None)
    assert instance is not None
    fmi3.function("FreeInstance")(ct.c_void_p(instance))


def test_scheduled_execution_is_refused(fmi3: Fmu) -> None:
    log: list[tuple[int, str, str]] = []
    callback = fmi3.log_callback(log)
    make = fmi3.function("InstantiateScheduledExecution")
    make.restype = ct.c_void_p
    assert make(b"gyro", fmi3.token.encode(), None, False, False, None, callback, None, None, None) is None
    assert "no model partitions" in log[-1][2]


_UPDATE = ct.CFUNCTYPE(
    None,
    *(ct.c_void_p, ct.c_double, ct.c_bool, ct.c_bool, ct.c_bool, ct.c_bool),
    *(ct.POINTER(ct.c_bool), ct.POINTER(ct.c_double)),
)
_Update = Callable[[float, bool], float | None]
"""(time, whether the step may end early) -> when it shall end [s], None: at its own end."""


@contextmanager
def watched(fmi3: Fmu, update: _Update, *, early: bool, **values: float) -> Iterator[Instance]:
    """A started instance of which ``update`` sees every intermediate point."""

    def called(
        _: int, time: float, may_set: bool, may_get: bool, finished: bool, may_end: bool, *answer: object
    ) -> None:
        assert (may_set, may_get, finished) == (False, True, True)
        end = update(time, may_end)
        answer[0][0], answer[1][0] = end is not None, end or 0.0  # type: ignore[index]

    gyro = Instance(fmi3)
    own, callback = gyro.address, _UPDATE(called)
    make = fmi3.function("InstantiateCoSimulation")
    make.restype = ct.c_void_p
    options = (False, False, False, ct.c_bool(early), None, ct.c_size_t(0))
    gyro.address = ct.c_void_p(make(b"gyro", fmi3.token.encode(), None, *options, None, gyro._callback, callback))
    try:
        gyro.start(**values)
        yield gyro
    finally:
        gyro.__exit__()
        gyro.address = own
        gyro.__exit__()


def result_of_step(gyro: Instance, time: float, step: float) -> tuple[int, bool, float]:
    """Status, earlyReturn and lastSuccessfulTime [s] of a step."""
    events, terminate, early, last = ct.c_bool(), ct.c_bool(), ct.c_bool(), ct.c_double()
    results = (ct.byref(result) for result in (events, terminate, early, last))
    status = gyro.call("DoStep", ct.c_double(time), ct.c_double(step), 1, *results)
    assert not events.value and not terminate.value
    return status, early.value, last.value


def test_intermediate_points_are_those_of_the_grid_with_their_outputs(fmi3: Fmu) -> None:
    seen: list[list[float]] = []

    def update(time: float, may_end: bool) -> None:
        assert not may_end
        assert gyro.get("time") == [time]
        seen.append(gyro.get("time", *OUTPUTS))

    with watched(fmi3, update, early=False, **NOISY) as gyro, Instance(fmi3) as plain:
        plain.start(**NOISY)
        assert gyro.step(0.0, 5.2e-5) == OK
        for k, row in enumerate(seen):
            assert plain.step(k * 5e-6, 5e-6) == OK
            assert plain.get("time", *OUTPUTS) == row
        assert len(seen) == 10
        assert plain.step(5e-5, 2e-6) == OK
        assert plain.get(*OUTPUTS) == gyro.get(*OUTPUTS)


@pytest.mark.parametrize("wanted, given", [(0.0, 2e-5), (2.3e-5, 2.3e-5), (9e-5, 9e-5), (1.0, 1e-4)])
def test_a_step_ends_early_where_it_is_asked_to(fmi3: Fmu, wanted: float, given: float) -> None:
    def update(time: float, may_end: bool) -> float | None:
        assert may_end
        return wanted if time > 1.8e-5 else None

    with watched(fmi3, update, early=True, **NOISY) as gyro, Instance(fmi3) as plain:
        plain.start(**NOISY)
        assert result_of_step(gyro, 0.0, 1e-4) == (OK, given < 1e-4, given)
        assert gyro.get("time") == [given]
        assert plain.step(0.0, given) == OK
        assert plain.get(*OUTPUTS) == gyro.get(*OUTPUTS)
        wanted = 1.0
        assert gyro.step(given, 1e-4) == OK and plain.step(given, 1e-4) == OK
        assert plain.get(*OUTPUTS) == gyro.get(*OUTPUTS)


def test_an_end_that_was_not_allowed_is_not_given(fmi3: Fmu) -> None:
    with watched(fmi3, lambda time, may_end: time, early=False, x_start=1e-6) as gyro:
        assert result_of_step(gyro, 0.0, 1e-4) == (OK, False, 1e-4)


def test_within_a_step_an_importer_may_only_look(fmi3: Fmu) -> None:
    refused = []

    def update(time: float, may_end: bool) -> None:
        calls = [gyro.try_set("u_x", 1.0), gyro.try_set("m", 1.0), gyro.step(time, 1e-5), gyro.call("Reset")]
        calls += [
            gyro.call("Terminate"),
            gyro.call("GetFMUState", ct.byref(ct.c_void_p())),
            gyro.call("SetFMUState", None),
        ]
        fmi3.function("FreeInstance")(gyro.address)
        refused.append(set(calls))
        assert gyro.set_by_reference("Float64", [], (ct.c_double * 0)()) == OK, "nothing is set, and nothing is lost"
        assert gyro.try_get("m")[0] == OK

    with watched(fmi3, update, early=True, x_start=1e-6) as gyro:
        assert gyro.step(0.0, 1e-5) == OK
        assert refused == [{ERROR}]
        assert any("in state intermediate update" in message for _, _, message in gyro.log)
        assert gyro.step(1e-5, 5e-6) == OK, "the instance lives on"


@pytest.mark.parametrize("early", [True, False])
def test_step_limit_ends_a_step_early(fmi3: Fmu, early: bool) -> None:
    with watched(fmi3, lambda time, may_end: None, early=early, x_start=1e-6, step_limit=10) as gyro:
        assert result_of_step(gyro, 0.0, 1e6) == (OK if early else DISCARD, early, 5e-5)
        assert result_of_step(gyro, 5e-5, 5e-5) == (OK, False, 1e-4)
