"""Limits of a laboratory: one checked record, settable from a file, and what the runs suggest where none is given."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from discrepancy.criteria import load_criteria
from discrepancy.data.record import Record, make_record
from discrepancy.tell.limits import LEVEL, LONGEST, Limits, load_limits, room_of
from gyro_model.errors import InputError

RATE = 100_000.0


def run(level: float = 1.0, **held: float) -> Record:
    t = np.arange(200) / RATE
    u = level * np.stack([np.sin(6e3 * t), 0.5 * np.sin(7e3 * t)], axis=1)
    return make_record(
        "run", t, u, 3 * u, sample_rate=RATE, conditions={n: np.full(200, value) for n, value in held.items()}
    )


def test_what_the_runs_suggest() -> None:
    room = room_of(Limits(), [run(1.0), run(2.0, v_bias=15.0, omega_z=-20.0)])
    u = np.abs(run(2.0).u).max(axis=0)
    assert room.force == pytest.approx(tuple(LEVEL * u), rel=1e-15)
    assert room.voltage == pytest.approx(tuple(LEVEL * 3 * u), rel=1e-15)
    assert (room.rate, room.samples) == (RATE, LONGEST)
    assert room.base == {"v_bias": 15.0, "omega_z": -20.0}
    assert room.ranges["v_bias"] == (0.0, 30.0)
    assert room.ranges["omega_z"] == (-20.0, 20.0)
    assert room.ranges["temperature"] == (298.15, 318.15)
    assert next(iter(room.ranges)) == "v_bias", "a supply is cheaper than an oven"


def test_a_file_sets_them(tmp_path: Path) -> None:
    (tmp_path / "lab.toml").write_text("force_x = 1e-6\nlongest = 0.5\nomega_z = [0, 0]\nv_bias = [5, 12.0]\n")
    room = room_of(load_limits(tmp_path / "lab.toml"), [run()])
    assert room.force[0] == 1e-6
    assert room.samples == 50_000
    assert room.ranges["v_bias"] == (5, 12.0)
    assert "omega_z" not in room.ranges, "a turntable that does not turn is none"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("longes = 1", "did you mean 'longest'"),
        ("force_x = 0", "positive number in N"),
        ("longest = inf", "positive number in s"),
        ("v_bias = 3", "lowest and the highest"),
        ("v_bias = [3, 2]", "lowest and the highest"),
        ("v_bias = [3, nan]", "lowest and the highest"),
        ("temperature = [0, 300]", "a laboratory reaches"),
        ("omega_z = [0, 1e9]", "a laboratory reaches"),
        ("longest = ", "TOML"),
    ],
)
def test_a_wrong_one_is_one_line(tmp_path: Path, text: str, expected: str) -> None:
    (tmp_path / "lab.toml").write_text(text)
    with pytest.raises(InputError, match=expected) as error:
        load_limits(tmp_path / "lab.toml")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("load", [load_limits, load_criteria])
def test_a_file_that_nests_without_end_is_refused(load: Callable[[Path], object], tmp_path: Path) -> None:
    (tmp_path / "deep.toml").write_text("x = " + "[" * 5000)
    with pytest.raises(InputError, match="nested too deeply"):
        load(tmp_path / "deep.toml")
