"""One FMU for every platform: where its libraries are, and that all of them give the same bits, every effect on."""

import functools
import importlib.util
import os
import platform as machine
import re
import shutil
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest

from gyro_model import compiling
from gyro_model.anatomy import Effect, Law
from gyro_model.build import build, build_all, c_files, model_token, platforms_of, write_sources
from gyro_model.compiling import STRICT, compile_library, fmi_headers
from gyro_model.effect_points import MODEL, active_parameters
from gyro_model.envelope import envelope_model
from gyro_model.errors import InputError
from gyro_model.form import Form
from gyro_model.generate_envelope import refused_effects
from gyro_model.model import Model
from gyro_model.platforms import NAMES, PLATFORMS, WASM, chosen_platforms, own_platform, platform_of
from gyro_model.sensor import SensorModel

pytestmark = pytest.mark.minutes(12)

HERE = Path(__file__).parent
FORMS: dict[str, Form] = {"full": MODEL, "envelope": envelope_model(), "sensor": SensorModel()}
STEPS = 300
AARCH64_ROOT = Path("/usr/aarch64-linux-gnu")

linux = pytest.mark.skipif(sys.platform != "linux", reason="plays the libraries of other systems on Linux")
zig = pytest.mark.skipif(not importlib.util.find_spec("ziglang"), reason="needs the package ziglang")


def test_this_machine_has_the_name_that_importers_look_for() -> None:
    assert (platform_of(own_platform()).fmi2, own_platform()) == (fmpy.platform, fmpy.platform_tuple)


def test_names_are_read_and_checked() -> None:
    assert chosen_platforms("all") == NAMES
    assert chosen_platforms("x86_64-windows, wasm32,wasm32") == ("x86_64-windows", "wasm32")
    with pytest.raises(InputError, match=r"platform 'x86_64-window': give `all` or .*; did you mean 'x86_64-windows'"):
        chosen_platforms("x86_64-linux,x86_64-window")


def test_without_zig_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "ziglang" else find(name))
    with pytest.raises(InputError, match=r"platform 'x86_64-windows': .* `pip install gyrotwin\[zig\]`"):
        build(folder=tmp_path, platforms=["x86_64-windows"])
    assert not list(tmp_path.rglob("*.fmu"))


# Scenarios: what switches an effect on, and everything at once.
STARTS = {"x_start": 1e-6, "y_dot_start": 1e-3}


def awake(effect: Effect, model: Model) -> dict[str, float]:
    """Parameters that switch on an effect and, for a law, what it changes, other laws apart."""
    rng = np.random.default_rng(len(effect.id))
    targets = set(effect.changes) if isinstance(effect, Law) else set()
    moved = (e for e in model.effects if e.symbols & targets and not (e.nominal or isinstance(e, Law)))
    return {name: value for e in (*moved, effect) for name, value in active_parameters(e, rng, model).items()}


# Every part of the sensor.
SENSOR = {
    "structure_lag": 0.01, "thermal_hysteresis": 1e-2, "angle_random_walk": 1e-3, "bias_instability": 1e-3,
    "rate_random_walk": 1e-3, "turn_on": 1e-2, "filter_lead_1": 1e-3, "bias_temperature_9": 1e-2, "lsb": 1e-4,
}  # fmt: skip


def scenarios(model: Form) -> dict[str, dict[str, float]]:
    """Parameters by name of what they switch on."""
    if not isinstance(model, Model):
        return {"nothing": {}, "everything": SENSOR}
    refused = refused_effects(model) if model.NAME == FORMS["envelope"].NAME else ()
    alone = {e.id: awake(e, model) for e in model.effects if not e.nominal and e not in refused}
    every = {name: value for parameters in alone.values() for name, value in parameters.items()}
    known = {q.name for q in model.quantities}
    cases = {"nothing": {}, **alone, "everything": every}
    return {name: {p: v for p, v in {**STARTS, **own}.items() if p in known} for name, own in cases.items()}


def bits(value: float) -> str:
    return struct.pack(">d", value).hex()


@functools.cache
def score(form: str) -> str:
    """What play.c and play.mjs read."""
    model = FORMS[form]
    reference = {q.name: index for index, q in enumerate(model.quantities)}
    scales = {"N": 2e-7, "rad/s": 0.7, "K": 2.0, "m/s2": 3.0, "V": 0.4 if form == "sensor" else 1.0}
    inputs = [q for q in model.quantities if q.role == "input" and q.unit in scales]
    outputs = [reference[q.name] for q in model.quantities if q.role == "output" and not q.integer]
    lines = [" ".join(map(str, (model_token(model), len(outputs), *outputs)))]
    for name, parameters in scenarios(model).items():
        words = [name, len(inputs), *(w for q in inputs for w in (reference[q.name], bits(scales[q.unit])))]
        words += [len(inputs), *(w for q in inputs for w in (reference[q.name], bits(model.start(q))))]
        words += [len(parameters), *(w for p, v in parameters.items() for w in (reference[p], bits(v)))]
        words += [reference["seed"], 7, STEPS, bits(0.62 * model.start(model.by_name["internal_step"]))]
        lines.append(" ".join(map(str, words)))
    return "\n".join(lines) + "\n"


def played(command: list[str], form: str) -> dict[str, list[str]]:
    """Steps done, hashes of outputs and of the saved state by scenario."""
    quiet = os.environ | {"WINEDEBUG": "-all"}
    run = subprocess.run(command, input=score(form), capture_output=True, text=True, check=False, env=quiet)
    assert run.returncode == 0, run.stderr[-2000:]
    return {name: hashes for name, *hashes in map(str.split, run.stdout.splitlines())}


def compiled_player(folder: Path, *compiler: str, suffix: str = "") -> str:
    program = folder / f"play{suffix}"
    command = [*compiler, *STRICT, "-O1", "-isystem", str(fmi_headers()), str(HERE / "play.c"), "-o", str(program)]
    result = subprocess.run(command + ([] if suffix else ["-ldl"]), capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return str(program)


def compiled_by(compiler: str, *flags: str) -> Callable[[str, Path], Path]:
    """Makes a library of a form's C with a compiler of this machine."""

    def library(form: str, folder: Path) -> Path:
        (folder / "c").mkdir(parents=True)
        write_sources(FORMS[form], folder / "c")
        made = folder / "library.so"
        before = os.environ.get("CC")
        os.environ["CC"] = compiler
        try:
            compile_library(folder / "c", c_files(folder / "c", "fmi3"), made, flags)
        finally:
            os.environ.pop("CC") if before is None else os.environ.update(CC=before)
        return made

    return library


@pytest.fixture(scope="module")
def wanted(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, list[str]]]:
    """The hashes that the first compiler gives, by form."""
    folder = tmp_path_factory.mktemp("wanted")
    player = compiled_player(folder, "cc")
    return {form: played([player, str(compiled_by("cc")(form, folder / form))], form) for form in FORMS}


@linux
@pytest.mark.parametrize("form", FORMS)
def test_what_is_played_is_worth_comparing(form: str, wanted: dict[str, dict[str, list[str]]]) -> None:
    hashes = wanted[form]
    assert len(hashes) == len(scenarios(FORMS[form]))
    # An effect that acts leaves other outputs than none does. A voltage that is steady is nothing near the carrier.
    silent = [name for name, (_, outputs, _) in hashes.items() if outputs == hashes["nothing"][1] and name != "nothing"]
    assert silent == ([] if form != "envelope" else ["amplifier_drift", "amplifier_offset"])
    assert not [name for name, (steps, *_) in hashes.items() if int(steps) < STEPS]


@linux
@pytest.mark.parametrize("form", FORMS)
# Not -mfma: gcc 12 then fuses vectors (vfmaddsub) whatever -ffp-contract=off says.
@pytest.mark.parametrize("flags", ["-O0", "-O2", "-O3 -mavx"])
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_every_compiler_gives_the_same_bits(
    compiler: str, flags: str, form: str, wanted: dict[str, dict[str, list[str]]], tmp_path: Path
) -> None:
    if shutil.which(compiler) is None or ("avx" in flags and machine.machine() != "x86_64"):
        pytest.skip(f"needs {compiler} on a machine for which it knows {flags}")
    library = compiled_by(compiler, *flags.split())(form, tmp_path / form)
    assert played([compiled_player(tmp_path, "cc"), str(library)], form) == wanted[form]


@pytest.fixture(scope="session")
def everywhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of FMUs with libraries for all platforms."""
    folder = tmp_path_factory.mktemp("everywhere")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiling, "FLAGS", (*compiling.FLAGS, "-Werror"))
        build_all(folder=folder, platforms=NAMES)
    return folder


def extracted(folder: Path, form: str, name: str, to: Path) -> Path:
    platform = PLATFORMS[name]
    member = f"binaries/{platform.fmi3}/{FORMS[form].NAME}{platform.suffix}"
    with zipfile.ZipFile(folder / "fmi3" / f"{FORMS[form].NAME}.fmu") as archive:
        return Path(archive.extract(member, to))


# The first bytes of a library, and where the processor stands in it.
HEADERS = {
    "x86_64-linux": (b"\x7fELF", 18, b"\x3e\x00"),
    "aarch64-linux": (b"\x7fELF", 18, b"\xb7\x00"),
    "x86_64-windows": (b"MZ", None, b"PE\0\0\x64\x86"),
    "x86_64-darwin": (b"\xcf\xfa\xed\xfe", 4, b"\x07\x00\x00\x01"),
    "aarch64-darwin": (b"\xcf\xfa\xed\xfe", 4, b"\x0c\x00\x00\x01"),
}


@zig
@pytest.mark.parametrize("form", FORMS)
def test_every_platform_is_in_one_fmu(form: str, everywhere: Path) -> None:
    for fmi in ("fmi2", "fmi3"):
        path = everywhere / fmi / f"{FORMS[form].NAME}.fmu"
        assert platforms_of(path) == {getattr(platform, fmi) for platform in PLATFORMS.values()} - {""}
        with zipfile.ZipFile(path) as archive:
            for name, (magic, at, processor) in HEADERS.items():
                p = PLATFORMS[name]
                data = archive.read(f"binaries/{getattr(p, fmi)}/{FORMS[form].NAME}{p.suffix}")
                at = at or int.from_bytes(data[60:64], "little")
                assert data.startswith(magic) and data[at : at + len(processor)] == processor, name
                assert f"{fmi}DoStep".encode() in data, "the functions of the standard are exported"
    assert (everywhere / "wasm32" / f"{FORMS[form].NAME}.wasm").read_bytes().startswith(b"\0asm")


@zig
@linux
@pytest.mark.skipif(shutil.which("readelf") is None, reason="needs readelf")
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", ["x86_64-linux", "aarch64-linux"])
def test_linux_needs_no_more_than_an_old_c_library(name: str, form: str, everywhere: Path, tmp_path: Path) -> None:
    library = extracted(everywhere, form, name, tmp_path)
    text = subprocess.run(["readelf", "-dsW", str(library)], capture_output=True, text=True, check=True).stdout
    versions = {tuple(map(int, v.split(".")[:3])) for v in re.findall(r"GLIBC_([\d.]+)", text)}
    assert versions and max(versions) <= (2, 17)
    assert [line.split("[")[1] for line in text.splitlines() if "(NEEDED)" in line] == ["libc.so.6]"]


RUNNERS = {
    "x86_64-linux": [],
    "aarch64-linux": ["qemu-aarch64", "-L", str(AARCH64_ROOT)],
    "x86_64-windows": ["wine"],
}


@zig
@linux
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", RUNNERS)
def test_every_platform_gives_the_same_bits(
    name: str, form: str, everywhere: Path, wanted: dict[str, dict[str, list[str]]], tmp_path: Path
) -> None:
    library = extracted(everywhere, form, name, tmp_path)
    command = RUNNERS[name]
    if command and shutil.which(command[0]) is None:
        pytest.skip(f"needs {command[0]}")
    if name == "aarch64-linux" and not AARCH64_ROOT.is_dir():
        pytest.skip("needs the C library for aarch64, Debian's libc6-arm64-cross")
    if name == "x86_64-linux" and machine.machine() != "x86_64":
        pytest.skip("needs an x86_64 machine")
    cross = [sys.executable, "-m", "ziglang", "cc", "-target", PLATFORMS[name].target]
    player = compiled_player(tmp_path, *cross, suffix=".exe" if name == "x86_64-windows" else "")
    assert played([*command, player, str(library)], form) == wanted[form]


@zig
@linux
@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
@pytest.mark.parametrize("form", FORMS)
def test_wasm_gives_the_same_bits(form: str, everywhere: Path, wanted: dict[str, dict[str, list[str]]]) -> None:
    module = everywhere / WASM.fmi3 / f"{FORMS[form].NAME}{WASM.suffix}"
    assert played(["node", str(HERE / "play.mjs"), str(module)], form) == wanted[form]
