"""Tests of a datasheet that are done are not done again, and give what they gave."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from calibration.datasheet import measure as module
from calibration.datasheet.figure import Curve, Figure, Outcome
from calibration.datasheet.kept import KeptTests, key_of
from calibration.datasheet.procedure import RATE, Procedure
from gyro_model.device import load_device

FIGURE = Figure("bias", "bias", np.float64(0.1) + 0.2, "°/h", float("inf"), 3, None, note="°")
CURVE = Curve("allan", "Allan", {"tau [s]": np.geomspace(0.1, 7.0, 5), "deviation [°/h]": np.array([1.0, np.nan])})


def bench(seed: int = 1) -> SimpleNamespace:
    return SimpleNamespace(device=load_device("rate-mode"), design=None, seed=seed, plan=(1,))


def test_what_was_kept_is_what_was_given(tmp_path: Path) -> None:
    kept = KeptTests(tmp_path / "new" / "kept", print)
    kept.begin("a")
    kept.keep("bias", Outcome([FIGURE], [CURVE]))
    kept.keep("none", Outcome(reason="no figures"))
    again = KeptTests(tmp_path / "new" / "kept", print)
    again.begin("a")
    found = again.found("bias")
    assert found is not None and again.count == 1 and again.found("none") is None
    assert found.figures == [FIGURE]
    for name, values in CURVE.columns.items():
        np.testing.assert_array_equal(found.curves[0].columns[name], values)


@pytest.mark.parametrize("text", ["", "{", "[]", '{"key": "a", "tests": {"x": 3}}', '{"key": "b", "tests": {}}'])
def test_another_file_is_said_and_not_used(tmp_path: Path, text: str) -> None:
    (tmp_path / "kept").write_text(text)
    said: list[str] = []
    kept = KeptTests(tmp_path / "kept", said.append)
    kept.begin("a")
    assert kept.count == 0
    assert len(said) == 1 and "starts anew" in said[0]


def test_a_key_is_of_one_bench(tmp_path: Path) -> None:
    assert key_of(bench(), "rate-open") == key_of(bench(), "rate-open")
    assert len({key_of(bench(), "rate-open"), key_of(bench(2), "rate-open"), key_of(bench(), "rate-closed")}) == 3


def test_a_datasheet_that_was_interrupted_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []

    def give(name: str, stop: bool) -> Procedure:
        def measured(_: object) -> Outcome:
            if stop:
                raise KeyboardInterrupt
            done.append(name)
            return Outcome([FIGURE])

        return Procedure(name, "12", RATE, measured, 1)

    def tests(stop: bool) -> list[module.Test]:
        chosen = {"first": give("first", False), "second": give("second", stop)}
        monkeypatch.setattr(module, "procedures", lambda mode: chosen)
        return module.measure(lambda advance: bench(), "rate-open", None, KeptTests(tmp_path / "kept", print))

    with pytest.raises(KeyboardInterrupt):
        tests(True)
    found = tests(False)
    assert done == ["first", "second"]
    assert [test.outcome.figures for test in found] == [[FIGURE], [FIGURE]]
