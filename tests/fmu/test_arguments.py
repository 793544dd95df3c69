"""What a caller gets wrong in C: addresses that are NULL, in every state of every FMU; counts that do not fit."""

import ctypes as ct
from collections.abc import Iterator

import pytest
from fmu_importer import DISCARD, ERROR, OK, Exchange, Fmu, Instance, declared_functions, update

# They make or end an instance, have none, or take a floating-point number first.
APART = {"GetVersion", "GetTypesPlatform", "FreeInstance", "DoStep", "SetupExperiment", "SetTime"}
APART |= {"EnterInitializationMode", "ExitInitializationMode", "Terminate", "Reset"}


def instances(fmu: Fmu) -> Iterator[tuple[str, Instance]]:
    """An instance in each state that its interfaces have, anew each time it is asked for."""
    for state in ("instantiated", "initialization", "step", "terminated"):
        with Instance(fmu) as one:
            if state != "instantiated":
                assert one.set_up() == OK
            if state in ("step", "terminated"):
                assert one.call("ExitInitializationMode") == OK
            if state == "terminated":
                assert one.call("Terminate") == OK
            yield state, one
    if fmu.description.modelExchange is not None:
        for state in ("event", "continuous"):
            with Exchange(fmu) as one:
                one.start()
                if state == "continuous":
                    update(one)
                    assert one.call("EnterContinuousTimeMode") == OK
                yield state, one
    if fmu.version == 3 and fmu.description.coSimulation.hasEventMode:
        with Instance(fmu, events=True, early=True) as one:
            one.start()
            yield "event of a co-simulation", one


def asked(version: int) -> list[str]:
    names = (name[4:] for name in declared_functions(version))
    return [name for name in names if name not in APART and not name.startswith("Instantiate")]


def test_nothing_but_null_is_refused_or_harmless(any_fmu: Fmu) -> None:
    for name in asked(any_fmu.version):
        for state, one in instances(any_fmu):
            status = one.call(name, *[None] * 12)
            assert status in (OK, DISCARD, ERROR), (name, state)
            assert status != ERROR or one.message.startswith(f"fmi{any_fmu.version}{name}: "), (name, state)
            assert one.call("Reset") == OK


def test_a_count_without_an_array_is_refused(any_fmu: Fmu) -> None:
    # Address, count, address, count: what all functions over arrays take, FMI 2 with fewer counts.
    for name in asked(any_fmu.version):
        counted = name.startswith(("Set", "Get", "Ser", "Des", "DeS")) and "Status" not in name
        if not counted or name in ("SetFMUstate", "SetFMUState", "GetFMUstate", "GetFMUState"):
            continue
        for state, one in instances(any_fmu):
            if name.startswith("GetNumber"):
                assert one.call(name, None) in (OK, ERROR)
                continue
            assert one.call(name, None, 1, None, 1, None, 1, None, 1) == ERROR, (name, state)
            assert one.message, (name, state)


def test_steps_with_nowhere_to_put_results_are_refused(any_fmu: Fmu) -> None:
    with Instance(any_fmu) as one:
        one.start()
        if any_fmu.version == 3:
            for missing in range(4):
                results = [ct.byref(r) for r in one._step_results]
                results[missing] = None
                assert one.call("DoStep", ct.c_double(0.0), ct.c_double(1e-6), 1, *results) == ERROR
                assert "NULL" in one.message
        assert one.step(0.0, 1e-6) == OK


def test_events_with_nowhere_to_put_results(fmu: Fmu) -> None:
    with Exchange(fmu) as gyro:
        gyro.start()
        if fmu.version == 3:
            for missing in range(6):
                results = [*map(ct.byref, [ct.c_bool() for _ in range(5)]), ct.byref(ct.c_double())]
                results[missing] = None
                assert gyro.call("UpdateDiscreteStates", *results) == ERROR
                assert "NULL" in gyro.message
        gyro.update()
        assert gyro.call("EnterContinuousTimeMode") == OK
        flags = [(ct.c_bool if fmu.version == 3 else ct.c_int)(True) for _ in range(2)]
        for given in ((None, None), (ct.byref(flags[0]), None), tuple(map(ct.byref, flags))):
            assert gyro.call("CompletedIntegratorStep", 1, *given) == OK
        assert not any(flag.value for flag in flags)
        if fmu.version == 3:
            for name, wanted in (("ContinuousStates", len(gyro.states)), ("EventIndicators", 0)):
                count = ct.c_size_t(99)
                assert gyro.call(f"GetNumberOf{name}", ct.byref(count)) == OK
                assert count.value == wanted


def test_status_of_a_step_by_kind(fmus: dict[int, Fmu]) -> None:
    with Instance(fmus[2]) as gyro:
        gyro.start()
        assert gyro.step(0.0, 1e-5) == OK
        place = ct.c_double()
        for name, good in (("GetStatus", 0), ("GetRealStatus", 2), ("GetBooleanStatus", 3)):
            for kind in range(4):
                assert gyro.call(name, kind, ct.byref(place)) == (OK if kind == good else ERROR), (name, kind)
            assert gyro.call(name, good, None) == ERROR
        for name in ("GetIntegerStatus", "GetStringStatus"):
            assert gyro.call(name, 0, ct.byref(place)) == ERROR


def test_instances_without_a_token_or_a_name(any_fmu: Fmu) -> None:
    log: list[tuple[int, str, str]] = []
    callback = any_fmu.log_callback(log)
    if any_fmu.version == 3:
        make = any_fmu.function("InstantiateCoSimulation")
        make.restype = ct.c_void_p
        rest = (False, False, ct.c_bool(False), ct.c_bool(False), None, ct.c_size_t(0), None)
        assert make(b"gyro", None, None, *rest, callback, None) is None
        assert "NULL" in log[-1][2]
        address = make(None, any_fmu.token.encode(), None, *rest, None, None)
        assert address is not None
        # Nobody listens: a refusal says nothing, and is one.
        assert any_fmu.function("Terminate")(ct.c_void_p(address)) == ERROR
        any_fmu.function("FreeInstance")(ct.c_void_p(address))
    else:
        make = any_fmu.function("Instantiate")
        make.restype = ct.c_void_p
        assert make(b"gyro", 1, any_fmu.token.encode(), None, None, 0, 0) is not None


def test_categories_that_are_null_or_unknown(any_fmu: Fmu) -> None:
    with Instance(any_fmu) as one:
        assert one.call("SetDebugLogging", 1, ct.c_size_t(1), None) == ERROR
        assert one.call("SetDebugLogging", 1, ct.c_size_t(1), (ct.c_char_p * 1)(None)) == ERROR
        assert "NULL" in one.message


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"kxx": 1.0, "kyy": 1.0, "kxy": 2.0}, "not positive definite"),
        ({"kxx": 0.0}, "kxx"),
        ({"dxx": 1e-7, "dyy": 1e-7, "dxy": 1e-6}, "feeds energy"),
    ],
)
def test_parameters_that_are_no_device(gyro: Instance, values: dict[str, float], said: str) -> None:
    gyro.set(**values)
    assert gyro.set_up() == OK
    assert gyro.call("ExitInitializationMode") == ERROR
    assert said in gyro.message


def test_model_exchange_refuses_what_is_no_state_or_time(fmu: Fmu) -> None:
    with Exchange(fmu) as gyro:
        gyro.start()
        gyro.update()
        assert gyro.call("EnterContinuousTimeMode") == OK
        n = len(gyro.states)
        good = gyro.array("GetContinuousStates")
        wrong = (ct.c_double * n)(*good[:-1], float("nan"))
        assert gyro.call("SetContinuousStates", wrong, ct.c_size_t(n)) == ERROR
        assert "finite" in gyro.message
        assert gyro.call("SetContinuousStates", wrong, ct.c_size_t(n - 1)) == ERROR
        assert gyro.array("GetContinuousStates") == good
        for time in (float("nan"), float("inf"), -1.0):
            assert gyro.call("SetTime", ct.c_double(time)) == ERROR
        indicators = (ct.c_double * 1)()
        assert gyro.call("GetEventIndicators", indicators, ct.c_size_t(1)) == ERROR
        assert gyro.call("GetEventIndicators", indicators, ct.c_size_t(0)) == OK
        nominals = gyro.array("GetNominalsOfContinuousStates")
        assert all(value > 0.0 for value in nominals)
        # Beyond the next sample but one.
        assert gyro.call("SetTime", ct.c_double(1.0)) == OK
        assert gyro.call("EnterEventMode") == ERROR
        assert "beyond the sample" in gyro.message
