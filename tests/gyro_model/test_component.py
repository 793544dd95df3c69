"""The WebAssembly component of an FMU (draft of fmi-ls-wasm): it does to the bit what a library does."""

import ctypes as ct
import random
import shutil
import sys
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.validation import validate_fmu
from lxml import etree

from gyro_model import compiling, sensor_fmu
from gyro_model.build import Fmus, build_form, forms, model_token, platforms_of
from gyro_model.component.binary import arguments, called, parts
from gyro_model.component.interface import CALLBACKS, INNER, KINDS, TYPES
from gyro_model.errors import InputError
from gyro_model.form import Form
from gyro_model.model import load_model
from gyro_model.platforms import COMPONENT, own_platform
from gyrotwin.commands.verify import verify

wasmtime = pytest.importorskip("wasmtime", reason="needs the package wasmtime")
pytest.importorskip("ziglang", reason="needs the package ziglang")

from component_host import INTERFACE, Host, Instance, co_simulation, played  # noqa: E402
from test_platforms import compiled_by, compiled_player, score  # noqa: E402
from test_platforms import played as played_native  # noqa: E402
from wasmtime import component  # noqa: E402

from tests.fmu.fmu_importer import Fmu  # noqa: E402
from tests.fmu.fmu_importer import Instance as Native  # noqa: E402

MODELS: dict[str, Form] = {form.NAME: form for form in forms(load_model())}
FULL = MODELS["Gyroscope"]
VR = {q.name: index for index, q in enumerate(FULL.quantities)}
EXTRA = "extra/org.modelica.fmi-ls-wasm"
TOKENS = {name: model_token(form) for name, form in MODELS.items()}


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of FMUs with a component and a library for this machine."""
    made = tmp_path_factory.mktemp("components")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiling, "FLAGS", (*compiling.FLAGS, "-Werror"))
        for form in MODELS.values():
            build_form(form, made, platforms=[COMPONENT.fmi3, own_platform()])
    return made


def code_of(folder: Path, name: str) -> bytes:
    with zipfile.ZipFile(folder / "fmi3" / f"{name}.fmu") as archive:
        return archive.read(f"binaries/{COMPONENT.fmi3}/{name}.wasm")


@pytest.fixture(scope="session")
def code(folder: Path) -> bytes:
    """The component of the full model."""
    return code_of(folder, FULL.NAME)


@pytest.fixture
def host(code: bytes) -> Host:
    return Host(code)


@pytest.fixture(scope="session")
def native(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    """The same FMU by its library."""
    return Fmu(folder / "fmi3" / f"{FULL.NAME}.fmu", tmp_path_factory.mktemp("native"))


# --- what is in the FMU


@pytest.mark.parametrize("name", MODELS)
def test_an_fmu_announces_its_component(name: str, folder: Path) -> None:
    path = folder / "fmi3" / f"{name}.fmu"
    assert platforms_of(path) == {COMPONENT.fmi3, own_platform()}
    schema = Path(fmpy.__file__).parent / "schema/fmi3/fmi3LayeredStandardManifest.xsd"
    with zipfile.ZipFile(path) as archive:
        for file in ("manifest.xml", "fmi-ls-manifest.xml"):
            root = etree.fromstring(archive.read(f"{EXTRA}/{file}"))
            etree.XMLSchema(etree.parse(schema)).assertValid(root)
            said = {key.partition("}fmi-ls-")[2]: value for key, value in root.attrib.items()}
            assert (said["name"], said["version"]) == ("org.modelica.fmi-ls-wasm", "0.1.0")
    assert validate_fmu(str(path)) == []
    if "fmi2" in MODELS[name].STANDARDS:
        assert COMPONENT.fmi3 not in platforms_of(folder / "fmi2" / f"{name}.fmu")


def test_an_importer_that_knows_no_component_runs_the_fmu(folder: Path) -> None:
    result = fmpy.simulate_fmu(str(folder / "fmi3" / "GyroscopeSensor.fmu"), stop_time=0.01, output_interval=1e-3)
    assert len(result) == 11


def test_the_rest_of_an_fmu_is_as_without_it(folder: Path, tmp_path: Path) -> None:
    name = "GyroscopeSensor"
    build_form(MODELS[name], tmp_path, platforms=[own_platform()])
    assert (tmp_path / f"fmi2/{name}.fmu").read_bytes() == (folder / f"fmi2/{name}.fmu").read_bytes()
    with zipfile.ZipFile(tmp_path / f"fmi3/{name}.fmu") as old, zipfile.ZipFile(folder / f"fmi3/{name}.fmu") as new:
        added = {f"binaries/{COMPONENT.fmi3}/{name}.wasm", f"{EXTRA}/manifest.xml", f"{EXTRA}/fmi-ls-manifest.xml"}
        assert set(new.namelist()) - set(old.namelist()) == added
        assert [one for one in old.namelist() if old.read(one) != new.read(one)] == []


def test_without_zig_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find = compiling.importlib.util.find_spec
    monkeypatch.setattr(compiling.importlib.util, "find_spec", lambda name: None if name == "ziglang" else find(name))
    with pytest.raises(InputError, match=r"platform 'wasm32-wasip2': .* `pip install gyrotwin\[zig\]`"):
        build_form(MODELS["GyroscopeClocked"], tmp_path, platforms=[COMPONENT.fmi3])
    assert not list(tmp_path.rglob("*.fmu"))


def test_an_exported_sensor_has_none(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built = Fmus(*(folder / fmi / "GyroscopeSensor.fmu" for fmi in Fmus._fields))
    monkeypatch.setattr(sensor_fmu, "build", lambda model: built)
    path = sensor_fmu.write_sensor({"angle_random_walk": 1e-3}, tmp_path).fmi3
    assert platforms_of(path) == {own_platform()}
    with zipfile.ZipFile(path) as archive:
        assert not [name for name in archive.namelist() if name.startswith(EXTRA)]


def test_verify_says_that_it_plays_the_library(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole, bare = folder / "fmi3" / "GyroscopeSensor.fmu", tmp_path / "bare.fmu"
    verify(whole)
    assert f"Played: the library for {own_platform()}; not those for wasm32-wasip2." in capsys.readouterr().out
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(bare, "w") as new:
        for name in old.namelist():
            if own_platform() not in name:
                new.writestr(name, old.read(name))
    with pytest.raises(InputError, match=f"no library for {own_platform()}, this machine; there are wasm32-wasip2"):
        verify(bare)


# --- what its type is


def words(type_: Any) -> str:
    """A type of wasmtime's in words of the interface language."""
    match type_:
        case component.ListType():
            return f"list<{words(type_.element)}>"
        case component.OptionType():
            return f"option<{words(type_.payload)}>"
        case component.ResultType():
            return f"result<{words(type_.ok)}, {words(type_.err)}>"
        case component.TupleType():
            return f"tuple<{', '.join(map(words, type_.elements))}>"
        case component.EnumType():
            return f"enum<{', '.join(type_.names)}>"
        case component.RecordType():
            return f"record<{', '.join(f'{name}: {words(field)}' for name, field in type_.fields)}>"
        case component.FuncType():
            given = ", ".join(f"{name}: {words(one)}" for name, one in type_.params)
            return f"({given})" + (f" -> {words(type_.result)}" if type_.result else "")
    return type(type_).__name__.removesuffix("Type").lower()


def plain(text: str, types: dict[str, str]) -> str:
    """The words of a type or function with the words of each type in place of its name."""
    if text.startswith("("):
        given = ", ".join(
            f"{one.partition(': ')[0]}: {plain(one.partition(': ')[2], types)}" for one in arguments(text)
        )
        result = text.rpartition(")")[2].removeprefix(" -> ")
        return f"({given})" + (f" -> {plain(result, types)}" if result else "")
    head, _, inside = text.partition("<")
    if not inside:
        return plain(types[text], types) if text in types else text
    if head in ("own", "borrow"):
        return head
    if head == "enum":
        return text
    named = [one.rpartition(": ") for one in parts(inside[:-1])]
    return f"{head}<{', '.join(name + colon + plain(one, types) for name, colon, one in named)}>"


def exported(instance: Any, engine: Any) -> dict[str, str]:
    return {name: words(item.ty) for name, item in instance.ty.exports(engine).items()}


@pytest.mark.parametrize("name", MODELS)
def test_its_type_is_that_of_the_draft(name: str, folder: Path) -> None:
    host = Host(code_of(folder, name))
    type_ = host.component.type
    kinds = [kind for kind in KINDS if kind.name == "co-simulation" or name == FULL.NAME]
    taken, given = type_.imports(host.engine), type_.exports(host.engine)
    # Nothing of WASI: it asks for no files, no clock, no random numbers.
    assert set(taken) == {INTERFACE.format(one) for one in ("types", *CALLBACKS)}
    assert set(given) == {INTERFACE.format(one) for one in ("common", *(kind.name for kind in kinds))}
    assert exported(taken[INTERFACE.format("types")], host.engine) == {one: plain(one, TYPES) for one in TYPES}
    for interface, signature in CALLBACKS.items():
        functions = exported(taken[INTERFACE.format(interface)], host.engine)
        assert functions[called(signature)] == plain(signature.removeprefix(called(signature)), TYPES)
    for kind in kinds:
        types = TYPES | {kind.record[0]: kind.record[1]}
        resource = f"{kind.name}-instance"
        wanted = {one: plain(one, types) for one in types if one not in INNER} | {resource: "resource"}
        made = f"{kind.make.removeprefix(called(kind.make))} -> option<own<{resource}>>"
        wanted[f"[static]{resource}.{called(kind.make)}"] = plain(made, types)
        for method in kind.methods:
            rest = method.removeprefix(f"{called(method)}(")
            full = f"(self: borrow<{resource}>{'' if rest.startswith(')') else ', '}{rest}"
            wanted[f"[method]{resource}.{called(method)}"] = plain(full, types)
        assert exported(given[INTERFACE.format(kind.name)], host.engine) == wanted


# --- what it does


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


# --- random calls

NUMBERS = (0.0, 1e-6, 2.3e-5, 1e-4, -1e-5, 1e300, float("inf"), float("nan"))


def random_value(kind: str, rng: random.Random, n: int) -> Any:
    """A value of a type in words; value references up to a little more than there are."""
    head, _, inside = kind.partition("<")
    match head:
        case "value-reference":
            return rng.randrange(n + 3) if rng.random() < 0.95 else rng.randrange(1 << 32)
        case "bool":
            return rng.random() < 0.5
        case "f32" | "f64":
            return rng.choice(NUMBERS)
        case "string":
            return rng.choice(("", "logAll", "logEvents", "ä\0ö", "x" * 300))
        case "fmu-state":
            return rng.randbytes(rng.choice((0, 7, 64, 4000)))
        case "option":
            return random_value(inside[:-1], rng, n) if rng.random() < 0.5 else None
        case "list":
            size = rng.choice((0, 1, 1, 2, 5, 40))
            return rng.randbytes(size) if inside == "u8>" else [random_value(inside[:-1], rng, n) for _ in range(size)]
        case "tuple":
            return tuple(random_value(one, rng, n) for one in parts(inside[:-1]))
        case "interval-fraction":
            pair = component.Record()
            pair.counter, pair.resolution = rng.randrange(1 << 64), rng.randrange(1 << 64)
            return pair
    low = -(1 << int(kind[1:]) - 1) if kind.startswith("s") else 0
    return rng.randrange(low, low + (1 << int(kind[1:])))


LIFE = ("enter-initialization-mode", "exit-initialization-mode", "do-step", "set-float64", "get-float64", "reset")
TUNED = {"set-float64": NUMBERS[:3]}


@pytest.mark.parametrize(
    ("name", "kind"),
    [(name, kind) for name in MODELS for kind in KINDS if kind.name == "co-simulation" or name == FULL.NAME],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_random_calls_end_nothing(name: str, kind: Any, seed: int, folder: Path) -> None:
    rng = random.Random(f"{name} {kind.name} {seed}")
    host = Host(code_of(folder, name))
    host.update = lambda time: (rng.random() < 0.1, rng.choice(NUMBERS))
    methods = {called(method): [one.partition(": ")[2] for one in arguments(method)] for method in kind.methods}
    n = len(MODELS[name].quantities)
    living: list[Instance] = []
    statuses: dict[str, int] = {}
    now: dict[int, float] = {}
    for _ in range(2500):
        if len(living) < 2 or rng.random() < 0.01:
            flags = [rng.random() < 0.5 for _ in arguments(kind.make)[3:]][: 4 if kind.name == "co-simulation" else 2]
            more = [[0, 99]] if kind.name == "co-simulation" else []
            token = TOKENS[name] if rng.random() < 0.9 else ""
            one = Instance(host, kind.name, "ä", token, "file:///nowhere/", *flags, *more)
            living += [one] if one.made else []
            continue
        one = rng.choice(living)
        method = rng.choice(LIFE if rng.random() < 0.4 else tuple(methods))
        if method not in methods:
            method = "set-time"
        given = [random_value(kind_, rng, n) for kind_ in methods[method]]
        if method == "do-step" and rng.random() < 0.8:
            given = [now.get(id(one), 0.0), rng.choice((1e-6, 2.3e-5, 1e-4)), True]
        if method == "enter-initialization-mode" and rng.random() < 0.8:
            given = [None, 0.0, None]
        result = one(method, *given)
        if method == "do-step" and not isinstance(result, str):
            now[id(one)] = getattr(result, "last-successful-time")
        if method in ("reset", "enter-initialization-mode") and result == "ok":
            now[id(one)] = 0.0 if method == "reset" else given[1]
        said = result if isinstance(result, str) else "value"
        statuses[said] = statuses.get(said, 0) + 1
        if rng.random() < 0.01:
            living.remove(one)
            one.drop()
    assert set(statuses) <= {"ok", "value", "error", "discard"}
    # It got somewhere, and was stopped there.
    assert min(statuses[said] for said in ("ok", "value", "error")) > 50
