"""GyroscopeVaried: what a diagnosis runs is Gyroscope, and its library exports some functions more."""

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from gyro_runner import Runner

from gyro_model import build as building
from gyro_model import compiling
from gyro_model.experiments import verify
from gyro_model.varied import varied_model


@pytest.fixture(scope="module")
def fmu() -> Path:
    return building.build_form(varied_model())["fmi3"]


def test_it_meets_the_traces_of_the_full_model(fmu: Path) -> None:
    residuals = verify(fmu)
    assert residuals
    assert all(r.met for r in residuals)


@pytest.mark.skipif(sys.platform != "linux", reason="lists the dynamic symbols of ELF")
def test_it_exports_its_functions_beside_those_of_fmi(fmu: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        [library] = [name for name in archive.namelist() if name.endswith(".so")]
        archive.extract(library, tmp_path)
    command = ["nm", "-D", "--defined-only", str(tmp_path / library)]
    listing = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    exported = {line.split()[-1] for line in listing.splitlines()}
    own = {"gyro_measure", "gyro_follow", "gyro_linearise", "gyro_depart", "gyro_vary", "gyro_acceleration"}
    assert {name for name in exported if not name.startswith("fmi3")} == own


def test_one_that_serves_briefly_is_compiled_otherwise_and_gives_the_same_bits(fmu: Path, tmp_path: Path) -> None:
    brief = varied_model(brief=True)
    assert brief.compiler_flags != varied_model().compiler_flags
    assert building.model_token(brief) == building.model_token(varied_model())
    own = building.build_form(brief, tmp_path / "fmu")["fmi3"]
    bent = {"friction_x": 2e-5, "friction_speed": 1e-6, "k3_x": 1e10, "stop_stiffness": 1e4, "stop_gap": 2e-7,
            "hysteresis_y": 1e-5, "thermal_force": 1.0, "sense_noise": 2e-11}  # fmt: skip
    t = np.arange(2001) * 5e-6
    u = {"u_x": 3e-5 * np.sin(2 * np.pi * 3e3 * t), "u_y": 2e-5 * np.cos(2 * np.pi * 3e3 * t)}
    found = [Runner(path, tmp_path / name).run(bent, t, u) for path, name in ((own, "own"), (fmu, "other"))]
    assert np.ptp(found[0]["x"]) > 2e-7
    for name, values in found[0].items():
        np.testing.assert_array_equal(values, found[1][name])


def test_its_c_compiles_without_a_warning(tmp_path: Path) -> None:
    building.write_sources(varied_model(), tmp_path)
    strict = ("-Werror", "-Wshadow", "-Wstrict-prototypes", "-Wvla", "-O1")
    compiling.compile_library(tmp_path, building.c_files(tmp_path, "fmi3"), tmp_path / "strict.so", strict)
