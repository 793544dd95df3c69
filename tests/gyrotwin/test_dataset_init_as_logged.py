"""`gyrotwin dataset init` on tables as loggers of slow mechanics write them: angles, several runs, uneven stamps."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
import typer

from discrepancy.data.dataset import load_dataset
from discrepancy.data.import_table import Request, guess_sources
from gyro_model.errors import InputError
from gyrotwin.dataset import dataset_app

RATE = 100.0
T = np.arange(2000) / RATE
SWING = 0.7 * np.exp(-0.05 * T) * np.cos(2 * np.pi * 2.0 * T)


def init(*arguments: str | Path) -> None:
    """The sub-command in this process; raises what it raises."""
    typer.main.get_command(dataset_app).main(["init", *map(str, arguments)], standalone_mode=False)


def swing(folder: Path, table: dict[str, object], *options: str) -> Path:
    """The data set of a free decay in a table of such columns."""
    pl.DataFrame(table).write_csv(folder / "swing.csv")
    init(folder / "swing.csv", "--out", folder / "set", "--map", "u_x=none", "--force", *options)
    return folder / "set"


@pytest.mark.parametrize(
    ("table", "factor"),
    [
        ({"Time/s": T, "Angle/rad": SWING, "AngVel/rad/s": SWING}, 1.0),
        ({"time_ms": 1e3 * T, "theta_deg": SWING}, np.pi / 180),
        ({"ms": 1e3 * T, "swing (deg)": SWING}, np.pi / 180),
        ({"Time [s]": T, "tracked": SWING}, 1.0),
        ({"time": T, "angle [rad]": SWING, "omega [rad/s]": SWING}, 1.0),
    ],
)
def test_an_angle_and_its_time_are_told_by_headings(tmp_path: Path, table: dict[str, object], factor: float) -> None:
    data = load_dataset(swing(tmp_path, table))
    assert not data.fit[0].conditions
    # Six digits of the rate, and a product by a unit's factor rounds twice at most.
    assert data.fit[0].sample_rate == pytest.approx(RATE, rel=1e-6)
    n = len(data.fit[0].v)
    assert data.fit[0].v[:, 0] == pytest.approx(factor * SWING[:n], rel=1e-14)


def test_what_turns_is_said_to_and_a_torque_is_a_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pl.DataFrame({"t": T, "torque [mNm]": SWING, "omega [rad/s]": SWING}).write_csv(tmp_path / "motor.csv")
    init(tmp_path / "motor.csv", "--out", tmp_path / "set")
    said = " ".join(capsys.readouterr().out.split())
    assert "read m as a moment of inertia [kg.m2]" in said
    record = load_dataset(tmp_path / "set").fit[0]
    assert record.senses == "velocity"
    assert record.u[:, 0] == pytest.approx(1e-3 * SWING[:1600], rel=1e-14)


def test_blanks_about_cells_and_headings_are_none_of_them(tmp_path: Path) -> None:
    lines = [f"{t}, {v} " for t, v in zip(T.tolist(), SWING.tolist(), strict=True)]
    (tmp_path / "swing.csv").write_text("\n".join(["time, angle ", *lines]))
    init(tmp_path / "swing.csv", "--out", tmp_path / "set", "--map", "u_x=none", "--map", "v_x=angle")
    data = load_dataset(tmp_path / "set")
    assert data.fit[0].v[:, 0].tolist() == SWING[: len(data.fit[0].v)].tolist()


def test_a_time_that_begins_anew_begins_a_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lengths = (700, 600, 700)
    table = {"t": np.concatenate([T[:n] for n in lengths]), "angle": np.concatenate([SWING[:n] for n in lengths])}
    data = load_dataset(swing(tmp_path, table))
    assert [len(record.t) for record in data.records] == list(lengths)
    assert "3 runs where its time begins anew" in capsys.readouterr().out


def test_a_row_out_of_place_begins_no_run(tmp_path: Path) -> None:
    t = T.copy()
    t[[500, 501]] = t[[501, 500]]
    with pytest.raises(InputError, match=r"time does not increase after 5\.01 s: sort the rows"):
        swing(tmp_path, {"t": t, "angle": SWING})


def test_uneven_stamps_are_put_on_an_even_grid(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    steps = np.random.default_rng(1).gamma(2.0, 1 / (2 * RATE), 4000)
    t = np.cumsum(steps)
    motion = np.exp(-0.02 * t) * np.cos(2 * np.pi * 0.9 * t)
    data = load_dataset(swing(tmp_path, {"t": t, "angle": motion}))
    assert "its stamps are uneven" in capsys.readouterr().out
    [record] = data.fit
    true = np.exp(-0.02 * (record.t + 0)) * np.cos(2 * np.pi * 0.9 * record.t)
    # Between samples a step of 30 ms apart a straight line is off by (ω h)²/8 = 4e-3 at most; a spline by less.
    assert np.abs(record.v[:, 0] - true)[record.valid].max() < 4e-3
    assert record.valid.mean() > 0.99


def test_small_steps_that_add_up_are_put_on_an_even_grid(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # A timer that is 3 % slow for half of the time: no step is off by much, the last stamp by 60 of them.
    steps = np.where(np.arange(4000) < 2000, 1.0, 1.03) / RATE
    t = np.cumsum(steps) - steps[0]
    motion = np.exp(-0.02 * t) * np.cos(2 * np.pi * 0.9 * t)
    data = load_dataset(swing(tmp_path, {"t": t, "angle": motion}))
    assert "its stamps are uneven" in capsys.readouterr().out
    [record] = data.fit
    true = np.exp(-0.02 * record.t) * np.cos(2 * np.pi * 0.9 * record.t)
    # A spline of the fifth degree through 111 samples a period.
    assert np.abs(record.v[:, 0] - true)[record.valid].max() < 1e-6


def test_columns_go_by_their_number_where_headings_differ(tmp_path: Path) -> None:
    for number in (1, 2):
        np.savetxt(tmp_path / f"{number}.csv", np.stack((T, SWING), axis=1), "%.9g", ",",
                   header=f"time {number},angle {number}", comments="")  # fmt: skip
    files = [tmp_path / f"{number}.csv" for number in (1, 2)]
    init(*files, "--out", tmp_path / "set", "--map", "t=1", "--map", "u_x=none", "--map", "v_x=2")
    assert len(load_dataset(tmp_path / "set").records) == 2
    with pytest.raises(InputError, match="--map v_x='3': no such heading"):
        init(files[0], "--out", tmp_path / "other", "--map", "t=1", "--map", "u_x=none", "--map", "v_x=3")


def test_what_is_held_out_of_a_decay_moves(tmp_path: Path) -> None:
    ended = np.where(T < 8, SWING, 0.0)
    data = load_dataset(swing(tmp_path, {"t": T, "angle": ended}))
    [held] = data.held_out
    assert np.abs(held.v[: round(1.5 * RATE)]).max() > 0.3
    assert sum(len(record.t) for record in data.records) == len(T)


@pytest.mark.parametrize(("unit", "factor"), [("µm", 1e-6), ("cm", 1e-2), ("cm/s", 1e-2), ("mm/s2", 1e-3)])
def test_places_are_called_after_their_axes(unit: str, factor: float) -> None:
    request = Request(files=(), out=Path())
    found = guess_sources(["t [s]", "Fx [N]", "Fy [N]", f"x [{unit}]", f"y [{unit}]"], request)
    assert [found[name].heading for name in ("v_x", "v_y")] == [f"x [{unit}]", f"y [{unit}]"]
    assert found["v_x"].factor == pytest.approx(factor)
    # Without a unit of a motion x may be anything.
    assert "v_y" not in guess_sources(["t", "u_x", "u_y", "x", "y"], request)
