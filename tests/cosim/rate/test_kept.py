"""A run that was interrupted goes on and gives the same, bit for bit; a file that does not fit is told and not used."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.rate import kept
from cosim.rate.courses import Course, constant, constant_temperature, rate_step, temperature_ramp
from cosim.rate.kept import Keeper
from cosim.rate.master import Result, simulate
from cosim.rate.run import RateRun
from gyro_model.device import load_device

DEVICE = load_device("rate-mode")
FULL = RateRun(DEVICE, constant(0.3, "turns"), constant_temperature(25.0), True, 0.5, seed=3)
ENVELOPE = RateRun(
    DEVICE,
    rate_step(0.3, 8.0),
    temperature_ramp(290.0, 300.0, 60.0),
    False,
    10.0,
    seed=3,
    output_rate=10.0,
    envelope=True,
    sense_rate=250.0,
)

CHECKSUM = "the checksum does not fit: the saved state was damaged, or is of another version of the model"
"""What the FMU says of a state with a wrong bit."""


class Stopped(BaseException):
    """Ctrl-C."""


def interrupted(run: RateRun, path: Path, monkeypatch: pytest.MonkeyPatch) -> float:
    """Simulates half of ``run``; gives the seconds that ``path`` then keeps."""

    def stop(reached: float, duration: float) -> None:
        if reached > 0.5 * duration:
            raise Stopped

    with monkeypatch.context() as patch:
        patch.setattr(kept, "EVERY", 0.0)
        patch.setattr(kept, "SHARE", np.inf)
        keeper = Keeper(path, pytest.fail)
        with pytest.raises(Stopped):
            simulate(run, stop, keeper)
    return keeper.seconds


def same(one: Result, other: Result) -> bool:
    """Whether two runs gave the same bits."""
    if (one.sense is None) != (other.sense is None) or one[1:3] != other[1:3]:
        return False
    sensed = one.sense is None or other.sense is None or one.sense.equals(other.sense)
    return sensed and one.record.equals(other.record)


@pytest.mark.parametrize("run", [FULL, ENVELOPE], ids=["full", "envelope"])
def test_an_interrupted_run_goes_on_bit_for_bit(run: RateRun, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "out" / "kept"
    seconds = interrupted(run, path, monkeypatch)
    assert 0.5 * run.duration < seconds < run.duration
    said: list[str] = []
    reached: list[float] = []
    keeper = Keeper(path, said.append)
    assert same(simulate(run, lambda t, _: reached.append(t), keeper), simulate(run))
    assert said == [f"going on from {path} at t = {seconds:g} s"]
    assert reached[0] > seconds == keeper.seconds
    assert [file.name for file in path.parent.iterdir()] == ["kept"]


def changed(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    """What writes a file with another array ``name``."""

    def write(path: Path) -> None:
        with np.load(path) as file:
            arrays = dict(file)
        arrays[name] = change(arrays[name])
        with path.open("wb") as file:
            np.savez(file, **arrays)

    return write


def flipped(array: np.ndarray) -> np.ndarray:
    """One bit in the middle is another."""
    array = array.copy()
    array[len(array) // 2] ^= 1
    return array


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda path: path.write_bytes(b""), "can't be read"),
        (lambda path: path.write_bytes(path.read_bytes()[:-300]), "can't be read"),
        (lambda path: path.write_bytes(path.read_bytes().replace(b"NUMPY", b"NUMPX")), "can't be read"),
        (changed("rows", lambda a: a.astype(object)), "can't be read"),  # a pickle is not looked at
        (changed("rows", lambda a: a[:, :-1]), "damaged"),
        (changed("rows", lambda a: a[:-1]), "damaged"),
        (changed("loop", lambda a: np.zeros(1)), "damaged"),
        (
            changed("fmu", flipped),
            CHECKSUM,
        ),
        (changed("held", lambda a: a + 1e-12), "another course until there"),
        (changed("key", lambda a: np.array("0" * 64)), "of another run or version"),
    ],
)
def test_a_file_that_does_not_fit_is_told(
    spoil: Callable[[Path], None], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "kept"
    interrupted(FULL, path, monkeypatch)
    spoil(path)
    said: list[str] = []
    keeper = Keeper(path, said.append)
    assert same(simulate(FULL, keeper=keeper), simulate(FULL))
    assert said == [f"{path}: {says}; the run starts anew"]
    assert keeper.seconds == 0


def faster_from(start: float) -> Course:
    """The rate of FULL, and from ``start`` on [s] a bit more."""
    return constant(0.3, "turns")._replace(values=lambda t: np.where(t < start, 0.3, 0.3 + 1e-12))


def test_what_comes_later_may_be_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "kept"
    interrupted(FULL, path, monkeypatch)
    keeper, other = Keeper(path, lambda _: None), replace(FULL, rate=faster_from(0.4))
    assert same(simulate(other, keeper=keeper), simulate(other))
    assert keeper.seconds > 0


@pytest.mark.parametrize(
    ("other", "says"),
    [
        (replace(FULL, seed=4), "of another run or version"),
        (replace(FULL, closed=False), "of another run or version"),
        (replace(FULL, device=DEVICE.with_parameters({"sense_noise": 0.0})), "of another run or version"),
        (replace(FULL, design=DEVICE.with_parameters({"kyy": 1.001 * DEVICE.parameters["kyy"]})), "of another run"),
        (replace(FULL, rate=faster_from(0.2)), "another course until there"),
    ],
)
def test_another_run_starts_anew(other: RateRun, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "kept"
    interrupted(FULL, path, monkeypatch)
    said: list[str] = []
    assert same(simulate(other, keeper=Keeper(path, said.append)), simulate(other))
    [line] = said
    assert says in line


def test_short_runs_write_nothing_and_a_full_disk_ends_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    simulate(FULL, keeper=Keeper(tmp_path / "out" / "kept", said.append))
    assert not (tmp_path / "out").exists()
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(kept, "EVERY", 0.0)
    keeper = Keeper(tmp_path / "file" / "kept", said.append)
    assert same(simulate(FULL, keeper=keeper), simulate(FULL))
    assert keeper.seconds == 0
    assert "an interrupted run would start anew" in said[0]
