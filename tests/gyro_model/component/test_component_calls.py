"""The component does to the bit what a library does."""

import ctypes as ct
import shutil
import sys
from pathlib import Path

import fmpy
import pytest
from component_fmus import FULL, TOKENS, VR, code_of, wasmtime
from component_host import Host, Instance, co_simulation, played
from test_platforms import compiled_by, compiled_player, score
from test_platforms import played as played_native

from tests.fmu.fmu_importer import Fmu
from tests.fmu.fmu_importer import Instance as Native

pytestmark = pytest.mark.minutes(4)


@pytest.mark.skipif(sys.platform != "linux" or shutil.which("cc") is None, reason="plays a library on Linux")
@pytest.mark.parametrize(
    ("form", "name"), [("full", "Gyroscope"), ("envelope", "GyroscopeEnvelope"), ("sensor", "GyroscopeSensor")]
)
def test_it_gives_the_same_bits_as_a_library(form: str, name: str, folder: Path, tmp_path: Path) -> None:
    library = compiled_by("cc")(form, tmp_path / form)
    wanted = played_native([compiled_player(tmp_path, "cc"), str(library)], form)
    assert played(code_of(folder, name), score(form)) == wanted


def started(fmu: Instance, values: dict[str, float] | None = None) -> Instance:
    given = {"x_start": 1e-6, "y_dot_start": 1e-3} | (values or {})
    assert fmu("set-float64", [VR[name] for name in given], list(given.values())) == "ok"
    assert fmu("enter-initialization-mode", 1e-6, 0.0, 1.0) == "ok"
    assert fmu("exit-initialization-mode") == "ok"
    return fmu


def test_the_version_is_that_of_fmi(host: Host) -> None:
    assert host.call("common", "get-version") == "3.0"


def test_a_message_bears_the_name_that_the_importer_gave(host: Host) -> None:
    made = Instance(host, "co-simulation", "Kreisel ä", TOKENS[FULL.NAME], "", False, True, False, False, [])
    assert made.made and made("terminate") == "error"
    [(*_, instantiated), (name, status, category, refused)] = host.log
    assert (name, status, category) == ("Kreisel ä", "error", "logStatusError")
    assert instantiated.startswith("fmi3InstantiateCoSimulation: instantiated") and "instantiated; allowed" in refused


def test_a_message_stays_utf_8_where_the_importer_s_text_is_cut(host: Host) -> None:
    fmu = co_simulation(host, TOKENS[FULL.NAME])
    # The message cuts it after 60 bytes, within a letter.
    assert fmu("set-debug-logging", True, ["logAll", "a" + "ä" * 40]) == "error"
    assert "unknown log category a????" in host.log[-1][3]
    assert fmu("set-debug-logging", True, ["logEvents", "logStatusError"]) == "ok"


def test_another_token_makes_no_instance(host: Host) -> None:
    assert not co_simulation(host, "{0}").made
    assert "the token is {0}" in host.log[-1][3]


def test_a_kind_that_there_is_not_makes_none(folder: Path) -> None:
    host = Host(code_of(folder, "GyroscopeSensor"))
    assert not co_simulation(host, TOKENS["GyroscopeSensor"], events=True).made
    assert "hasEventMode is false" in host.log[-1][3]


REFUSED = {
    "lists of unlike lengths": ("set-float64", [VR["u_x"]], [1.0, 2.0]),
    "an unknown variable": ("get-float64", [99999]),
    "another type": ("get-int32", [VR["u_x"]]),
    "an output": ("set-float64", [VR["x"]], [0.0]),
    "not a number": ("set-float64", [VR["u_x"]], [float("nan")]),
    "text": ("set-string", [VR["u_x"], VR["u_y"]], ["a", ""]),
    "bytes": ("set-binary", [VR["u_x"]], [b"ab", b""]),
    "a clock": ("set-clock", [0], [True]),
    "an interval": ("set-interval-fraction", [0], []),
    "another time": ("do-step", 0.5, 1e-5, True),
    "beyond the stop time": ("do-step", 0.0, 2.0, True),
    "a mode that it is not in": ("update-discrete-states",),
    "a state that is cut": ("set-fmu-state", b"GYRO"),
    "no state": ("set-fmu-state", b""),
    "unlike seeds": ("get-directional-derivative", [VR["x"]], [VR["u_x"]], [1.0, 2.0]),
    "derivatives of inputs": ("set-input-derivatives", [(VR["u_x"], 1)], [0.0]),
    "derivatives of outputs": ("get-output-derivatives", [(VR["x"], 1)]),
    "dependencies": ("get-variable-dependencies", VR["x"]),
    "their number": ("get-number-of-variable-dependencies", VR["x"]),
    "configuration": ("enter-configuration-mode",),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_refused_is_an_error_with_a_message_and_changes_nothing(case: str, host: Host) -> None:
    fmu = started(co_simulation(host, TOKENS[FULL.NAME]))
    before = fmu("get-fmu-state")
    assert fmu(*REFUSED[case]) == "error"
    assert len(host.log) == 1 and host.log[0][1] == "error"
    assert fmu("get-fmu-state") == before


def test_empty_lists_are_fine_where_fmi_says_so(host: Host) -> None:
    fmu = started(co_simulation(host, TOKENS[FULL.NAME]))
    for name, none in {"float64": [], "int32": [], "uint8": b"", "boolean": [], "string": [], "clock": []}.items():
        assert fmu(f"get-{name}", []) == none
        assert fmu(f"set-{name}", [], none) == "ok"


def test_messages_are_those_of_the_library(host: Host, native: Fmu) -> None:
    fmu = started(co_simulation(host, TOKENS[FULL.NAME]))
    with Native(native) as library:
        library.set(x_start=1e-6, y_dot_start=1e-3)
        library.start(stop=1.0)
        vr, value = (ct.c_uint32 * 1)(VR["x"]), (ct.c_double * 2)(0.0, 0.0)
        for n in (1, 2):
            assert native.function("SetFloat64")(library.address, vr, ct.c_size_t(1), value, ct.c_size_t(n)) == 3
            fmu("set-float64", [VR["x"]], [0.0] * n)
        assert [entry[3] for entry in host.log] == [message for *_, message in library.log]


def test_an_intermediate_update_can_end_a_step(host: Host) -> None:
    fmu = started(co_simulation(host, TOKENS[FULL.NAME], early=True))
    host.update = lambda time: (time > 1.2e-5, 2e-5)
    step = fmu("do-step", 0.0, 1e-4, True)
    assert getattr(step, "last-successful-time") == 2e-5 and getattr(step, "early-return")
    assert [seen for seen, *_ in host.seen] == [5e-6, 1e-5, 1.5e-5, 2e-5][: len(host.seen)]
    assert {tuple(flags) for _, *flags in host.seen} == {(False, True, True, True)}


def test_within_an_intermediate_update_variables_are_read_and_no_more(host: Host) -> None:
    fmu = started(co_simulation(host, TOKENS[FULL.NAME], early=True))
    read: list[float] = []

    def look(time: float) -> tuple[bool, float]:
        read.extend(fmu("get-float64", [VR["x"]]))
        assert fmu("set-float64", [VR["u_x"]], [1e-7]) == "error" == fmu("do-step", time, 1e-5, True)
        with pytest.raises(wasmtime.WasmtimeError):
            fmu.drop()
        return False, 0.0

    host.update = look
    step = fmu("do-step", 0.0, 2e-5, True)
    assert getattr(step, "last-successful-time") == 2e-5
    other, steps = started(co_simulation(host, TOKENS[FULL.NAME])), []
    for k in range(3):
        other("do-step", 5e-6 * k, 5e-6, True)
        steps += other("get-float64", [VR["x"]])
    assert read == steps and len(set(read)) == 3


def test_a_host_of_model_exchange_alone_needs_the_other_callback_as_a_trap(code: bytes) -> None:
    with pytest.raises(wasmtime.WasmtimeError, match="intermediate-update-callbacks"):
        Host(code, updates=False)
    host = Host(code, updates=False, traps=True)
    fmu = Instance(host, "model-exchange", "gyro", TOKENS[FULL.NAME], "", False, False)
    assert fmu("enter-initialization-mode", None, 0.0, None) == "ok" == fmu("exit-initialization-mode")


def test_without_early_return_nobody_is_asked(host: Host) -> None:
    fmu = started(co_simulation(host, TOKENS[FULL.NAME]))
    assert getattr(fmu("do-step", 0.0, 1e-4, True), "last-successful-time") == 1e-4
    assert host.seen == []


def test_a_clock_ticks_in_event_mode(folder: Path) -> None:
    name = "GyroscopeClocked"
    host = Host(code_of(folder, name))
    fmu = co_simulation(host, TOKENS[name], events=True, early=True)
    clock = next(
        v.valueReference
        for v in fmpy.read_model_description(str(folder / f"fmi3/{name}.fmu")).modelVariables
        if v.type == "Clock"
    )
    assert fmu("enter-initialization-mode", None, 0.0, None) == "ok" == fmu("exit-initialization-mode")
    ticks, now = [], 0.0
    for _ in range(5):
        ticks.append(fmu("get-clock", [clock]))
        assert not getattr(fmu("update-discrete-states"), "new-discrete-states-needed")
        assert fmu("enter-step-mode") == "ok"
        step = fmu("do-step", now, 3e-6, True)
        now = getattr(step, "last-successful-time")
        assert getattr(step, "event-handling-needed") == (round(now / 1e-6) % 5 == 0)
        assert fmu("enter-event-mode") == "ok"
    # A step of 3 µs, one that ends early at a sample, 5 µs, and so on.
    assert ticks == [[True], [False], [True], [False], [True]]


def test_a_state_goes_to_another_instance(host: Host) -> None:
    fmu, other = (started(co_simulation(host, TOKENS[FULL.NAME]), {"sense_noise": 1e-3}) for _ in "ab")
    fmu("do-step", 0.0, 3.3e-5, True)
    assert other("set-fmu-state", fmu("get-fmu-state")) == "ok"
    found = []
    for one in (fmu, other):
        one("do-step", 3.3e-5, 1e-4, True)
        found.append((one("get-float64", [VR["v_x"], VR["x"]]), one("get-fmu-state")))
    assert found[0] == found[1]


def test_model_exchange_gives_the_library_s_derivatives(host: Host, native: Fmu) -> None:
    fmu = started(Instance(host, "model-exchange", "gyro", TOKENS[FULL.NAME], "", False, False))
    assert getattr(fmu("update-discrete-states"), "next-event-time-defined")
    assert fmu("enter-continuous-time-mode") == "ok"
    n = fmu("get-number-of-continuous-states")
    states = [1e-7 * (k + 1) for k in range(n - 3)] + [298.0] * 3
    nominals = fmu("get-nominals-of-continuous-states")
    assert len(nominals) == n and fmu("get-number-of-event-indicators") == 0 and fmu("get-event-indicators") == []
    assert fmu("set-time", 1e-6) == "ok" == fmu("set-continuous-states", states)
    assert fmu("get-continuous-states") == states
    assert fmu("set-continuous-states", states[1:]) == "error"
    assert not getattr(fmu("completed-integrator-step", True), "enter-event-mode")
    with Native(native, co_simulation=False) as library:
        library.set(x_start=1e-6, y_dot_start=1e-3)
        library.start(stop=1.0)
        flags = [ct.c_bool() for _ in range(5)]
        native.function("UpdateDiscreteStates")(library.address, *map(ct.byref, flags), ct.byref(ct.c_double()))
        native.function("EnterContinuousTimeMode")(library.address)
        native.function("SetTime")(library.address, ct.c_double(1e-6))
        native.function("SetContinuousStates")(library.address, (ct.c_double * n)(*states), ct.c_size_t(n))
        rates = (ct.c_double * n)()
        assert native.function("GetContinuousStateDerivatives")(library.address, rates, ct.c_size_t(n)) == 0
        assert fmu("get-continuous-state-derivatives") == list(rates)
        assert any(rates)


def test_derivatives_along_a_direction_have_the_length_that_fmi_says(host: Host) -> None:
    fmu = started(co_simulation(host, TOKENS[FULL.NAME]))
    outputs, inputs = [VR["x"], VR["y"], VR["x_dot"]], [VR["u_x"], VR["omega_z"]]
    forward = fmu("get-directional-derivative", outputs, inputs, [1.0, 2.0])
    adjoint = fmu("get-adjoint-derivative", outputs, inputs, [1.0, 2.0, 3.0])
    assert (len(forward), len(adjoint)) == (3, 2)
    # v' J u is the same from both sides, to rounding.
    assert sum(s * f for s, f in zip((1.0, 2.0, 3.0), forward, strict=True)) == pytest.approx(
        sum(s * a for s, a in zip((1.0, 2.0), adjoint, strict=True)), rel=1e-12
    )


def test_nothing_that_comes_in_stays(code: bytes) -> None:
    # Each kind of call takes 1 MiB or more in all. There is less, beside stack and tables.
    host = Host(code, memory=2 << 20)
    size = 1 << 15
    for _ in range(64):
        fmu = Instance(
            host, "co-simulation", "x" * size, TOKENS[FULL.NAME], "x" * size, *[False] * 4, [0] * (size // 4)
        )
        assert not co_simulation(host, "x" * size).made
        assert started(fmu)("set-fmu-state", bytes(size)) == "error"
        assert fmu("set-debug-logging", True, ["x" * size]) == "error"
        assert fmu("set-string", [0], ["x" * size]) == "error"
        assert fmu("set-float64", [VR["u_x"]] * (size // 8), [0.0] * (size // 8)) == "ok"
        assert len(fmu("get-float64", [VR["x"]] * (size // 8))) == size // 8
        assert all(len(fmu("get-fmu-state")) > 1000 for _ in range(5))
        fmu.drop()


def test_a_dropped_instance_is_gone(host: Host) -> None:
    fmu = co_simulation(host, TOKENS[FULL.NAME])
    fmu.drop()
    with pytest.raises(wasmtime.WasmtimeError):
        fmu("reset")
