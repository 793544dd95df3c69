"""`pip install .` into an empty environment, used from an empty folder: builds its FMU in the user's cache and runs."""

import os
import subprocess
import sys
import venv
from pathlib import Path

import pytest

pytestmark = pytest.mark.minutes(4)

ROOT = Path(__file__).parents[1]


def test_installed_package_works_from_an_empty_folder(tmp_path: Path) -> None:
    venv.create(tmp_path / "venv", with_pip=True)
    scripts = tmp_path / "venv" / ("Scripts" if sys.platform == "win32" else "bin")
    pip = [str(scripts / "python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", str(ROOT)]
    subprocess.run(pip, check=True, timeout=600)
    empty = tmp_path / "empty"
    empty.mkdir()
    # A cache of its own, so that the FMU is built from the C sources in the wheel.
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache"), "HOME": str(tmp_path)}
    environment.pop("PYTHONPATH", None)
    command = [str(scripts / "gyrotwin"), "run", "constant", "--duration", "0.3", "--out", "out"]
    result = subprocess.run(command, cwd=empty, env=environment, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr
    assert sorted(path.name for path in (empty / "out").iterdir()) == [
        *("design.toml", "report.html", "summary.json", "trace.parquet")
    ]
    built = subprocess.run(
        [str(scripts / "gyrotwin"), "build"], cwd=empty, env=environment, capture_output=True, text=True, timeout=300
    )
    paths = [Path(line) for line in built.stdout.split()]
    assert [path.name for path in paths] == [
        *(f"{name}.fmu" for name in ("Gyroscope", "GyroscopeEnvelope", "GyroscopeSensor") for _ in (2, 3)),
        "GyroscopeClocked.fmu",
    ]
    assert all(path.is_file() and ROOT not in path.parents for path in paths)
