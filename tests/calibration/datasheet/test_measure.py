"""The tests of a datasheet one after the other: one that a device does not stand is a line, not the end."""

from types import SimpleNamespace

import pytest

from calibration.datasheet import measure as module
from calibration.datasheet.figure import Figure, Outcome
from calibration.datasheet.procedure import RATE, Procedure
from gyro_model.errors import InputError


def stands(_: object) -> Outcome:
    return Outcome([Figure("bias", "bias", 1.0, "°/h")])


def fails(_: object) -> Outcome:
    raise InputError("drive loop lost its lock")


def told(monkeypatch: pytest.MonkeyPatch, **measures: object) -> list[module.Test]:
    chosen = {name: Procedure(name, "12", RATE, how, 1) for name, how in measures.items()}  # type: ignore[arg-type]
    monkeypatch.setattr(module, "procedures", lambda mode: chosen)
    return module.measure(lambda advance: SimpleNamespace(), RATE, None)


def test_a_test_that_a_device_does_not_stand_is_not_done_and_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = told(monkeypatch, cycle=fails, bias=stands)
    assert (first.outcome.reason, len(first.outcome.figures)) == ("drive loop lost its lock", 0)
    assert len(second.outcome.figures) == 1


def test_where_none_is_done_the_first_reason_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match="lost its lock"):
        told(monkeypatch, cycle=fails, bias=fails)
