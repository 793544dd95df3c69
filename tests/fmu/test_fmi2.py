"""What is particular to FMI 2.0."""

import ctypes as ct
from collections.abc import Iterator

import fmpy
import pytest
from fmpy.validation import validate_fmu
from fmu_importer import DISCARD, ERROR, NOISY, OK, OUTPUTS, Fmu, Instance, declared_functions


@pytest.fixture
def fmi2(fmus: dict[int, Fmu]) -> Fmu:
    return fmus[2]


@pytest.fixture
def gyro(fmi2: Fmu) -> Iterator[Instance]:
    with Instance(fmi2) as instance:
        yield instance


def test_every_function_of_the_standard_is_exported_unprefixed(fmi2: Fmu) -> None:
    names = declared_functions(2)
    assert len(names) == 44  # counted in the header: guards against a pattern that finds fewer
    assert [name for name in names if not hasattr(fmi2.library, name)] == []
    assert not any(hasattr(fmi2.library, name) for name in ("gyro_new", "fmi_step")), "inner functions stay hidden"


def test_version_and_platform(fmi2: Fmu) -> None:
    for name in ("GetVersion", "GetTypesPlatform"):
        fmi2.function(name).restype = ct.c_char_p
    assert fmi2.function("GetVersion")() == b"2.0"
    assert fmi2.function("GetTypesPlatform")() == b"default"


def test_fmpy_finds_no_fault(fmi2: Fmu) -> None:
    assert validate_fmu(str(fmi2.path)) == []


def test_fmpy_simulates(fmi2: Fmu) -> None:
    times = {"stop_time": 1e-3, "output_interval": 5e-6}
    result = fmpy.simulate_fmu(str(fmi2.path), **times, start_values={"x_start": 1e-6}, output=["v_x"])
    assert len(result) == 201
    # Free decay from 1e-6 m at 1e6 V/m: starts at 1 V and cannot exceed it.
    assert result["v_x"][0] == 1.0 and 0.5 < abs(result["v_x"]).max() <= 1.0


LACKING = [
    "SetRealInputDerivatives",
    "GetRealOutputDerivatives",
    "CancelStep",
    "GetIntegerStatus",
    "GetStringStatus",
]


@pytest.mark.parametrize("name", LACKING)
def test_what_the_fmu_lacks_is_an_error_with_a_message(gyro: Instance, name: str) -> None:
    gyro.start()
    assert gyro.call(name, *[None] * 6) == ERROR
    assert gyro.message.startswith(f"fmi2{name}: ")
    assert gyro.step(0.0, 1e-5) == OK


def test_set_time_belongs_to_model_exchange(gyro: Instance) -> None:
    gyro.start()
    assert gyro.call("SetTime", ct.c_double(0.0)) == ERROR
    assert "allowed in event mode or continuous-time mode" in gyro.message


def test_status_of_the_latest_step(gyro: Instance) -> None:
    done, terminated, time = ct.c_int(-1), ct.c_int(-1), ct.c_double(-1)
    assert gyro.call("GetStatus", 0, ct.byref(done)) == ERROR
    gyro.start()
    for step, status in ((1e-5, OK), (-1.0, ERROR)):
        gyro.step(0.0 if status == OK else 1e-5, step)
        assert gyro.call("GetStatus", 0, ct.byref(done)) == OK and done.value == status
        assert gyro.call("GetRealStatus", 2, ct.byref(time)) == OK
        # 10 000 000 ticks of 1 ps, as a quotient.
        assert time.value == 1e-5
        assert gyro.call("GetBooleanStatus", 3, ct.byref(terminated)) == OK and terminated.value == 0
    assert gyro.call("GetStatus", 1, ct.byref(done)) == ERROR


def test_step_limit_discards_the_rest_of_a_step(fmi2: Fmu) -> None:
    status, time = ct.c_int(-1), ct.c_double(-1)
    with Instance(fmi2) as gyro, Instance(fmi2) as plain:
        for instance in (gyro, plain):
            instance.start(**NOISY, step_limit=100 if instance is gyro else 0)
        assert gyro.step(0.0, 1e6) == DISCARD, "which would take a day"
        assert gyro.call("GetStatus", 0, ct.byref(status)) == OK and status.value == DISCARD
        assert gyro.call("GetRealStatus", 2, ct.byref(time)) == OK and time.value == 100 * 5e-6
        assert plain.step(0.0, 5e-4) == OK
        assert gyro.get(*OUTPUTS) == plain.get(*OUTPUTS)
        # A step of just as many internal ones is a whole one; off the grid a part of one does not count.
        assert gyro.step(5e-4, 5e-4) == OK
        assert gyro.step(1e-3, 5.03e-4) == DISCARD
        assert gyro.step(1.5e-3, 3e-6) == OK
        assert plain.step(5e-4, 1.003e-3) == OK
        assert gyro.get(*OUTPUTS) == plain.get(*OUTPUTS)


def test_set_up_is_optional_and_starts_at_zero(gyro: Instance) -> None:
    assert gyro.call("EnterInitializationMode") == OK
    assert gyro.call("ExitInitializationMode") == OK
    assert gyro.step(0.0, 1e-5) == OK


def test_percent_sign_reaches_the_printf_of_the_importer_doubled(gyro: Instance) -> None:
    names = (ct.c_char_p * 1)(b"100%n")
    assert gyro.call("SetDebugLogging", 1, ct.c_size_t(1), names) == ERROR
    assert "100%%n" in gyro.message


def test_missing_log_function_is_tolerated(fmi2: Fmu) -> None:
    make = fmi2.function("Instantiate")
    make.restype = ct.c_void_p
    address = ct.c_void_p(make(b"gyro", 1, fmi2.token.encode(), b"", None, 0, 1))
    assert address.value is not None
    assert fmi2.function("Terminate")(address) == ERROR
    fmi2.function("FreeInstance")(address)
