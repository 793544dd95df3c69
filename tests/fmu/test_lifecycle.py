"""What both standards share: the life cycle, variables, and instances that do not touch one another."""

import ctypes as ct
import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from fmu_importer import ERROR, NOISY, OK, OUTPUTS, Fmu, Instance, declared_functions


def test_token_of_another_model_is_refused(any_fmu: Fmu) -> None:
    log: list[tuple[int, str, str]] = []
    fmu = any_fmu
    assert fmu.instantiate(fmu.log_callback(log), "{00000000-0000-0000-0000-000000000000}") is None
    status, category, message = log[-1]
    assert (status, category) == (ERROR, "logStatusError")
    assert "{00000000-0000-0000-0000-000000000000}" in message and fmu.token in message


def test_call_in_a_wrong_state_names_function_state_and_allowed_states(gyro: Instance) -> None:
    assert gyro.step(0.0, 1e-6) == ERROR
    assert "DoStep: " in gyro.message
    assert "in state instantiated; allowed in step mode" in gyro.message


# What each state refuses; the other calls of the list are allowed there.
REFUSED = {
    "instantiated": {"ExitInitializationMode", "Terminate", "DoStep", "get output"},
    "initialization": {"EnterInitializationMode", "Terminate", "DoStep"},
    "step": {"EnterInitializationMode", "ExitInitializationMode", "set parameter"},
    "terminated": {
        "EnterInitializationMode",
        "ExitInitializationMode",
        "Terminate",
        "DoStep",
        "set parameter",
        "set input",
    },
}


def reach(gyro: Instance, state: str) -> None:
    if state != "instantiated":
        assert gyro.set_up() == OK
    if state in ("step", "terminated"):
        assert gyro.call("ExitInitializationMode") == OK
    if state == "terminated":
        assert gyro.call("Terminate") == OK


@pytest.mark.parametrize("state", REFUSED)
def test_each_state_allows_what_the_standards_allow(any_fmu: Fmu, state: str) -> None:
    names = [v.name for v in any_fmu.description.modelVariables]
    first = next(v.name for v in any_fmu.description.modelVariables if v.causality == "output")
    trials: dict[str, Callable[[Instance], int]] = {
        "EnterInitializationMode": lambda g: g.set_up(),
        "ExitInitializationMode": lambda g: g.call("ExitInitializationMode"),
        "Terminate": lambda g: g.call("Terminate"),
        "DoStep": lambda g: g.step(0.0, 1e-6),
        "Reset": lambda g: g.call("Reset"),
        "set parameter": lambda g: g.try_set("internal_step", 2e-5),
        "set input": lambda g: g.try_set(names[0], 1e-6),
        "get parameter": lambda g: g.try_get("internal_step")[0],
        "get input": lambda g: g.try_get(names[0])[0],
        "get output": lambda g: g.try_get(first)[0],
        "save and restore": lambda g: g.restore(g.save()),
        "SetDebugLogging": lambda g: g.call("SetDebugLogging", 0, ct.c_size_t(0), None),
    }
    refused = set()
    for name, trial in trials.items():
        with Instance(any_fmu) as gyro:
            reach(gyro, state)
            if trial(gyro) == ERROR:
                refused.add(name)
    assert refused == REFUSED[state]


def test_setting_nothing_changes_nothing(any_fmu: Fmu) -> None:
    kind = "Real" if any_fmu.version == 2 else "Float64"
    with Instance(any_fmu) as gyro:
        gyro.start()
        assert gyro.step(0.0, 1e-3) == OK
        assert gyro.call("Terminate") == OK
        saved = gyro.save()
        before = gyro.serialize(saved)
        assert gyro.set_by_reference(kind, [], (ct.c_double * 0)()) == OK
        assert gyro.serialize(gyro.save(saved)) == before
        assert gyro.restore(saved) == OK, gyro.log
        gyro.free_saved(saved)


def test_null_instance_is_an_error(any_fmu: Fmu) -> None:
    # Every function of the standard that takes an instance, with nothing in the other arguments.
    makes = {"GetVersion", "GetTypesPlatform", "Instantiate", "FreeInstance"}
    for full_name in declared_functions(any_fmu.version):
        name = full_name[4:]
        if name not in makes and not name.startswith("Instantiate"):
            assert any_fmu.function(name)(*[None] * 12) == ERROR, name
    any_fmu.function("FreeInstance")(None)


def test_parameters_lock_after_initialization(gyro: Instance) -> None:
    gyro.start()
    assert gyro.try_set("kxx", 70.0) == ERROR
    assert "kxx" in gyro.message and "step mode" in gyro.message
    assert gyro.get("kxx") != [70.0]
    assert gyro.try_set("seed", 3) == ERROR
    assert "seed" in gyro.message
    assert gyro.step(0.0, 1e-5) == OK


def test_outputs_cannot_be_set(gyro: Instance) -> None:
    assert gyro.try_set("v_x", 1.0) == ERROR
    assert "v_x is computed" in gyro.message


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
@pytest.mark.parametrize("name", ["u_x", "m"])
def test_values_that_are_no_numbers_are_refused_by_name(gyro: Instance, name: str, value: float) -> None:
    before = gyro.get(name)
    assert gyro.try_set(name, value) == ERROR
    assert f"{name} is " in gyro.message and "finite" in gyro.message
    assert gyro.get(name) == before


def test_an_input_beyond_its_bounds_is_refused_by_name_while_stepping(gyro: Instance) -> None:
    gyro.start()
    before = gyro.get("temperature")
    assert gyro.try_set("temperature", -5.0) == ERROR
    assert "temperature is -5; give a value from 0" in gyro.message
    assert gyro.get("temperature") == before


def test_refused_set_changes_none_of_its_variables(gyro: Instance) -> None:
    references = [gyro.fmu.variables[name].valueReference for name in ("u_x", "u_y")]
    assert gyro.set_by_reference(gyro.kind("u_x"), references, (ct.c_double * 2)(1e-6, float("nan"))) == ERROR
    assert gyro.get("u_x", "u_y") == [0.0, 0.0]


def test_unknown_reference_and_wrong_type_are_refused(gyro: Instance) -> None:
    real, integer = gyro.kind("u_x"), gyro.kind("seed")
    for reference in (len(gyro.fmu.variables), 2**32 - 1):
        assert gyro.set_by_reference(real, [reference], (ct.c_double * 1)(1.0)) == ERROR
        assert str(reference) in gyro.message
    assert gyro.set_by_reference(real, [gyro.fmu.variables["seed"].valueReference], (ct.c_double * 1)(1.0)) == ERROR
    assert "seed is integer" in gyro.message
    assert gyro.set_by_reference(integer, [gyro.fmu.variables["u_x"].valueReference], (ct.c_int32 * 1)(1)) == ERROR
    assert "u_x is real" in gyro.message


def test_types_without_variables_are_refused_by_name(gyro: Instance) -> None:
    assert gyro.set_by_reference("Boolean", [gyro.fmu.variables["v_x"].valueReference], (ct.c_int32 * 1)(1)) == ERROR
    assert "v_x is real" in gyro.message


def test_null_arrays_are_refused(gyro: Instance) -> None:
    count = () if gyro.fmu.version == 2 else (ct.c_size_t(1),)
    for function in (f"Set{gyro.kind('u_x')}", f"Get{gyro.kind('u_x')}"):
        assert gyro.call(function, None, ct.c_size_t(1), None, *count) == ERROR
        assert "NULL" in gyro.message


def test_seed_reads_back(gyro: Instance) -> None:
    gyro.set(seed=2147483647)
    assert gyro.get("seed") == [2147483647]


def test_outputs_in_initialization_mode_follow_what_is_set(gyro: Instance) -> None:
    gain = gyro.get("sense_gain_x")[0]
    assert gyro.set_up() == OK
    for x in (1e-6, 2e-6):
        gyro.set(x_start=x)
        # One product of two doubles, in the FMU as here: no tolerance.
        assert gyro.get("v_x", "x") == [gain * x, x]
    assert gyro.call("ExitInitializationMode") == OK
    assert gyro.get("v_x") == [gain * 2e-6]


def test_reading_outputs_in_initialization_mode_leaves_no_trace(fmu: Fmu) -> None:
    with Instance(fmu) as plain, Instance(fmu) as curious:
        plain.start(**NOISY)
        assert curious.set_up() == OK
        for name, value in NOISY.items():
            curious.set(**{name: value})
            curious.get(*OUTPUTS)
        assert curious.call("ExitInitializationMode") == OK
        assert curious.run(0, 30) == plain.run(0, 30)


def test_parameter_out_of_bounds_is_named_and_can_be_mended(gyro: Instance) -> None:
    gyro.set(m=-1.0)
    assert gyro.set_up() == OK
    assert gyro.call("ExitInitializationMode") == ERROR
    assert "ExitInitializationMode: m = -1" in gyro.message
    gyro.set(m=1.8e-7)
    assert gyro.call("ExitInitializationMode") == OK


def test_reset_equals_a_fresh_instance(fmu: Fmu) -> None:
    with Instance(fmu) as fresh, Instance(fmu) as used:
        used.start(start=0.5, **NOISY)
        for k in range(40):
            assert used.step(0.5 + k * 1e-5, 1e-5) == OK
        assert used.call("Reset") == OK
        blank, wiped = fresh.save(), used.save()
        assert used.serialize(wiped) == fresh.serialize(blank)
        fresh.free_saved(blank)
        used.free_saved(wiped)
        fresh.start(seed=3, sense_noise=1e-3)
        used.start(seed=3, sense_noise=1e-3)
        assert used.run(0, 50) == fresh.run(0, 50)


def test_64_interleaved_instances_equal_one_alone(fmu: Fmu) -> None:
    def parameters(i: int) -> dict[str, float]:
        return NOISY | {"seed": i % 8, "x_start": 1e-7 * (i % 8)}

    alone = []
    for i in range(8):
        with Instance(fmu) as gyro:
            gyro.start(**parameters(i))
            alone.append(gyro.run(0, 20))
    crowd = [Instance(fmu) for _ in range(64)]
    for i, gyro in enumerate(crowd):
        gyro.start(**parameters(i))
    traces: list[list[list[float]]] = [[] for _ in crowd]
    for k in range(20):
        for trace, gyro in zip(traces, crowd, strict=True):
            trace += gyro.run(k, k + 1)
    for gyro in crowd:
        gyro.__exit__()
    assert traces == [alone[i % 8] for i in range(64)]
    assert alone[0] != alone[1]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_10000_lives_do_not_grow_memory(fmu: Fmu) -> None:
    def resident() -> int:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")

    def live(n: int) -> None:
        for _ in range(n):
            gyro.address = ct.c_void_p(fmu.instantiate(callback, fmu.token))
            gyro.set(actuator_delay=5e-6)
            assert gyro.set_up() == OK
            assert gyro.call("ExitInitializationMode") == OK
            gyro.free_saved(gyro.save())
            fmu.function("FreeInstance")(gyro.address)

    callback = fmu.log_callback([])
    gyro = Instance(fmu)
    own = gyro.address
    live(500)
    before = resident()
    live(10_000)
    grown = resident() - before
    gyro.address = own
    gyro.__exit__()
    # The smallest block of a life (the state, the delay line) has over 100 bytes, so a leak of it would be over 1 MB.
    assert grown < 1_000_000


def test_log_categories(fmu: Fmu) -> None:
    def categories(gyro: Instance) -> list[str]:
        found = [category for _, category, _ in gyro.log]
        gyro.log.clear()
        return found

    def select(gyro: Instance, on: bool, *names: bytes) -> int:
        return gyro.call("SetDebugLogging", int(on), ct.c_size_t(len(names)), (ct.c_char_p * len(names))(*names))

    with Instance(fmu, logging=True) as gyro:
        gyro.call("Reset")
        gyro.call("Terminate")
        assert categories(gyro) == ["logEvents", "logEvents", "logStatusError"]
        assert select(gyro, False) == OK
        gyro.call("Reset")
        gyro.call("Terminate")
        assert categories(gyro) == ["logStatusError"], "errors stay until their own category is switched off"
        assert select(gyro, False, b"logStatusError") == OK
        gyro.call("Terminate")
        assert categories(gyro) == []
        assert select(gyro, True, b"logAll") == OK
        assert select(gyro, True, b"logNothing") == ERROR
        assert "logNothing" in gyro.message
