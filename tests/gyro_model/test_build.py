"""The build: what makes it necessary, what it says when it can't, what the libraries hold."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import platformdirs
import pytest
from sympy import (
    Abs,
    Rational,
    Symbol,
    acos,
    asin,
    atan,
    atan2,
    ceiling,
    cos,
    cosh,
    exp,
    floor,
    log,
    sin,
    sinh,
    sqrt,
    sympify,
    tan,
    tanh,
)

from gyro_model import build as building
from gyro_model import compiling
from gyro_model.build import Fmus, build, build_all, default_folder, made_token, model_token, token_of
from gyro_model.c_printing import c_expression
from gyro_model.effect_points import MODEL
from gyro_model.envelope import envelope_model
from gyro_model.errors import InputError
from gyro_model.model import Model
from gyro_model.sensor import SensorModel

# What a library of the FMU may take from the system: memory and text. Of libm only the root, which IEEE 754 fixes.
ALLOWED = {
    *("calloc", "malloc", "realloc", "free", "memcpy", "memset", "memcmp", "memmove", "strlen", "strcmp", "strncmp"),
    *("strcpy", "strcat"),
    *("snprintf", "vsnprintf", "__snprintf_chk", "__vsnprintf_chk", "__memcpy_chk", "__stack_chk_fail"),
    "sqrt",
}

# The sensor reads its start values from a file.
FILES = {"fopen", "fread", "fclose", "ferror", "strcspn"}

NAMES = ("Gyroscope", "GyroscopeEnvelope", "GyroscopeSensor")
PATHS = [*(f"{fmi}/{name}.fmu" for name in NAMES for fmi in Fmus._fields), "fmi3/GyroscopeClocked.fmu"]
FORMS = {"full": MODEL, "envelope": envelope_model(), "sensor": SensorModel()}

posix = pytest.mark.skipif(shutil.which("nm") is None or sys.platform != "linux", reason="needs nm on Linux")
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]


def changed(effect_id: str, **changes: object) -> Model:
    """The packaged model with the first parameter of one effect changed."""
    effect = MODEL.effect(effect_id)
    mended = replace(effect, parameters=(replace(effect.parameters[0], **changes), *effect.parameters[1:]))
    return Model(tuple(mended if e is effect else e for e in MODEL.effects))


@pytest.mark.parametrize("token_of_model", [model_token, made_token])
def test_token_names_the_model(token_of_model: Callable[[Model], str]) -> None:
    token = token_of_model(MODEL)
    assert token == token_of_model(MODEL)
    others = [
        Model(tuple(e for e in MODEL.effects if e.id != "cubic_stiffness")),
        changed("cubic_stiffness", high=1e15),
        changed("cubic_stiffness", description="another text"),
        changed("cubic_stiffness", unit="N/m2"),
    ]
    assert len({token, *map(token_of_model, others)}) == 1 + len(others)


@pytest.mark.parametrize("token_of_model", [model_token, made_token])
def test_token_names_the_handwritten_c(
    token_of_model: Callable[[Model], str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    shutil.copytree(building.handwritten_folder(), tmp_path, dirs_exist_ok=True)
    token = token_of_model(MODEL)
    monkeypatch.setattr(building, "handwritten_folder", lambda: tmp_path)
    assert token_of_model(MODEL) == token
    (tmp_path / "core.c").write_text((tmp_path / "core.c").read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert token_of_model(MODEL) != token


def test_an_fmu_that_fits_is_left_alone(fmus: Fmus, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("built anew")

    monkeypatch.setattr(building, "_build_one", refuse)
    before = [path.stat().st_mtime_ns for path in fmus]
    assert build() == fmus
    assert [path.stat().st_mtime_ns for path in fmus] == before
    with pytest.raises(AssertionError, match="built anew"):
        build(force=True)


def test_what_is_no_fmu_of_this_model_is_built_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built: list[Path] = []
    monkeypatch.setattr(building, "_build_one", lambda model, token, fmi, path, *_: built.append(path))
    wanted = [tmp_path / name / "Gyroscope.fmu" for name in ("fmi2", "fmi3")]
    for path in wanted:
        path.parent.mkdir()
    wanted[0].write_bytes(b"no archive")
    with zipfile.ZipFile(wanted[1], "w") as archive:
        archive.writestr("modelDescription.xml", '<fmiModelDescription instantiationToken="{other}"/>')
    assert token_of(wanted[0]) is None
    assert token_of(wanted[1]) == "{other}"
    build(folder=tmp_path)
    assert built == wanted


def test_all_forms_are_built_side_by_side(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(building, "_build_one", lambda *_: None)
    paths = [path.relative_to(tmp_path).as_posix() for path in build_all(folder=tmp_path)]
    assert paths == PATHS


def test_each_form_has_a_token_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(building.handwritten_folder(), tmp_path / "c")
    full, own, sensor = map(model_token, FORMS.values())
    monkeypatch.setattr(building, "handwritten_folder", lambda: tmp_path / "c")
    changed = tmp_path / "c" / "envelope" / "slow.c"
    changed.write_text(changed.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert model_token(FORMS["full"]) == full != own != model_token(FORMS["envelope"])
    assert model_token(FORMS["sensor"]) == sensor


def test_folder_of_another_model_is_the_cache_by_token() -> None:
    model = changed("cubic_stiffness", high=1e15)
    assert default_folder(MODEL).name == "dist"
    assert default_folder(model).name == model_token(model).strip("{}")


def test_equal_models_give_equal_files(fmus: Fmus, tmp_path: Path) -> None:
    again = build(folder=tmp_path, force=True)
    for first, second in zip(fmus, again, strict=True):
        assert first.read_bytes() == second.read_bytes(), "time or place of the build is in the file"


def test_another_device_is_linked_with_what_is_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    commands: list[list[str]] = []

    def compile_nothing(command: list[str], sources: Path, files: list[str], made: Path, *_: object) -> None:
        commands.append([Path(file).name for file in files])
        made.write_bytes(b"object")

    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda _: str(tmp_path / "cache"))
    monkeypatch.setattr(compiling, "_compile", compile_nothing)
    build(replace(MODEL, starts=(("kxx", 60.0),)), tmp_path / "one")
    assert commands == [["whole.c"], ["whole.o", "model.c"]] * 2
    commands.clear()
    build(replace(MODEL, starts=(("kxx", 61.0),)), tmp_path / "other")
    assert commands == [["whole.o", "model.c"]] * 2
    commands.clear()
    # Other code is none of what is kept.
    building.build_form(SensorModel(), tmp_path / "sensor")
    assert commands[0] == ["whole.c"]


@pytest.fixture
def no_compilers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder as the whole PATH, neither CC nor the package ziglang."""
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ziglang" else find(name))
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    return tmp_path


def test_no_compiler(no_compilers: Path, tmp_path: Path) -> None:
    folder = tmp_path / "dist"
    with pytest.raises(
        InputError, match=r"no C compiler: install gcc or clang, set CC, or `pip install gyrotwin\[zig\]`"
    ):
        build(folder=folder)
    assert not list(folder.rglob("*.*")), "something half-written"


def test_cc_that_is_not_there(no_compilers: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CC", "mycc -m64")
    with pytest.raises(InputError, match="compiler CC='mycc': not found; correct CC or unset it"):
        compiling.find_compiler()


def test_order_of_compilers(no_compilers: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("clang", "gcc", "cc"):
        (no_compilers / name).write_text("")
        os.chmod(no_compilers / name, 0o755)
        assert compiling.find_compiler() == [name]
    monkeypatch.setenv("CC", "gcc -m64")
    assert compiling.find_compiler() == ["gcc", "-m64"]


def test_ziglang_is_the_last_resort(no_compilers: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: object() if name == "ziglang" else find(name))
    assert compiling.find_compiler() == [sys.executable, "-m", "ziglang", "cc"]


def test_failing_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bad = tmp_path / "bad.c"
    bad.write_text("int main(void) { return nothing; }\n")
    with pytest.raises(InputError, match=r"compiler .* failed: .*error") as caught:
        compiling.compile_library(tmp_path, ["bad.c"], tmp_path / "bad.so")
    assert "\n" not in str(caught.value)
    monkeypatch.setenv("CC", "false")
    with pytest.raises(InputError, match="compiler 'false' failed"):
        build(folder=tmp_path / "dist")
    assert not list((tmp_path / "dist").rglob("*.*"))


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("fmi", ["fmi2", "fmi3"])
@pytest.mark.parametrize("form", FORMS)
def test_c_compiles_without_a_warning(
    compiler: str, fmi: str, form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", compiler)
    building.write_sources(FORMS[form], tmp_path)
    files = building.c_files(tmp_path, fmi)
    # -O1 sees the flow of values, which some warnings need, in half the time of -O3.
    strict = ("-Werror", "-Wshadow", "-Wstrict-prototypes", "-Wvla", "-O1")
    compiling.compile_library(tmp_path, files, tmp_path / "strict.so", strict)


def names_of(fmu: Path, folder: Path, *options: str) -> set[str]:
    """Symbols of the library of an FMU as nm lists them, versions of the C library cut off."""
    with zipfile.ZipFile(fmu) as archive:
        [library] = [name for name in archive.namelist() if name.endswith(".so")]
        archive.extract(library, folder)
    listing = subprocess.run(["nm", "-D", *options, str(folder / library)], capture_output=True, text=True, check=True)
    return {line.split()[-1].partition("@")[0] for line in listing.stdout.splitlines()}


@posix
@pytest.mark.parametrize("form", FORMS)
def test_only_fmi_functions_are_exported(form: str, tmp_path: Path) -> None:
    for name, path in build(FORMS[form])._asdict().items():
        exported = names_of(path, tmp_path / name, "--defined-only")
        assert exported
        assert all(symbol.startswith(name) for symbol in exported), exported


@posix
@pytest.mark.parametrize("form", FORMS)
def test_little_is_taken_from_the_system(form: str, tmp_path: Path) -> None:
    for name, path in build(FORMS[form])._asdict().items():
        undefined = {
            s
            for s in names_of(path, tmp_path / name, "--undefined-only")
            if not s.startswith(("_ITM", "__gmon", "__cxa"))
        }
        allowed = ALLOWED | (FILES if form == "sensor" else set())
        assert undefined <= allowed, undefined - allowed


@pytest.mark.parametrize("function", ["erf(x)", "gamma(x)", "besselj(0, x)"])
def test_a_function_without_c_of_its_own_is_refused(function: str) -> None:
    with pytest.raises(InputError, match=f"function '{function.partition('(')[0]}' in .*: use one of Abs, .* tanh"):
        c_expression(sympify(function))


def test_every_function_prints_as_c_of_its_own() -> None:
    x = Symbol("x", real=True)
    functions = (exp, log, sin, cos, tan, asin, acos, atan, sinh, cosh, tanh, floor, ceiling)
    for expr in (*(f(x) for f in functions), x ** Symbol("y", real=True), x ** Rational(1, 3), atan2(x, 2), 2**x):
        text = c_expression(expr)
        assert all(name.startswith("gyro_") for name in re.findall(r"\w+(?=\()", text)), text
    assert c_expression(x / sqrt(x + 1)) == "x/sqrt(x + 1)"
    assert c_expression(Abs(x)) == "gyro_fabs(x)"


def standard_headers(folder: Path) -> Path:
    """The C headers of both standards. FMPy's copy of FMI 2 leaves out the prefix of the functions, which is put back
    as fmi2Functions.h 2.0.4 has it."""
    shutil.copytree(compiling.fmi_headers(), folder)
    header = folder / "fmi2Functions.h"
    own, standard = (
        "#define fmi2FullName(name) name",
        (
            "#define fmi2Paste(a, b) a##b\n#define fmi2PasteB(a, b) fmi2Paste(a, b)\n"
            "#define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)"
        ),
    )
    text = header.read_text(encoding="utf-8")
    assert own in text
    header.write_text(text.replace(own, standard), encoding="utf-8")
    return folder


@posix
@pytest.mark.parametrize("fmi", ["fmi2", "fmi3"])
def test_all_forms_link_into_one_program(fmi: str, tmp_path: Path) -> None:
    common = [
        *compiling.find_compiler(),
        *compiling.FLAGS,
        "-O1",
        "-isystem",
        str(standard_headers(tmp_path / "headers")),
    ]
    objects, calls = [], []
    for model in FORMS.values():
        folder = tmp_path / model.NAME
        folder.mkdir()
        building.write_sources(model, folder)
        shutil.copy(Path(__file__).with_name("static_link.c"), folder)
        own = [f"-D{fmi.upper()}_FUNCTION_PREFIX={model.NAME}_", f"-DSTEPPED=step_{model.NAME}", "-I", str(folder)]
        for file in building.c_files(folder, fmi):
            objects.append(f"{folder / file.replace('/', '_')}.o")
            subprocess.run([*common, *own, "-c", str(folder / file), "-o", objects[-1]], check=True)
        calls.append(f'step_{model.NAME}("{model_token(model)}", values, 8) && values[7] == values[7]')
    declared = "".join(f"int step_{m.NAME}(const char *, double *, unsigned long);\n" for m in FORMS.values())
    main = f"{declared}int main(void)\n{{\n    double values[8];\n    return {' && '.join(calls)} ? 0 : 1;\n}}\n"
    (tmp_path / "main.c").write_text(main, encoding="utf-8")
    program = str(tmp_path / "program")
    subprocess.run([*common, str(tmp_path / "main.c"), *objects, "-o", program], check=True)
    assert subprocess.run([program], check=False).returncode == 0
