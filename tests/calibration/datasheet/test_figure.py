"""Figures, procedures and their scan."""

import json

import numpy as np
import pytest

from calibration.datasheet.figure import EXPECTATIONS, Curve, Figure, mean, spread
from calibration.datasheet.procedure import FOLDER, MODES, procedures
from gyro_model.errors import InputError


@pytest.mark.parametrize(
    ("value", "error", "expected", "how", "holds"),
    [
        (1.0, 0.1, 1.31, "equals", True),
        (1.0, 0.1, 1.32, "equals", False),
        (1.0, None, 1.009, "equals", True),
        (1.0, None, 1.02, "equals", False),
        (1.0, None, 0.5, "at least", True),
        (1.0, None, 2.0, "at least", False),
        (1.0, None, 0.5, "at most", False),
        (1.0, 0.2, 0.5, "at most", True),
        (None, None, 1.0, "equals", None),
        (1.0, None, None, "equals", None),
    ],
)
def test_a_value_holds_within_three_errors_and_one_percent(
    value: float | None, error: float | None, expected: float | None, how: str, holds: bool | None
) -> None:
    assert Figure("a", "a", value, "1", error, 1, expected, "", how).holds is holds


def test_json_is_strict() -> None:
    figure = Figure("a", "a", float("nan"), "1", np.float64(1.0), 1, np.float64(2.0))
    assert json.loads(json.dumps(figure.as_json(), allow_nan=False))["value"] is None
    curve = Curve("a", "a", {"x [s]": np.array([0.0, np.inf])}).as_json()
    assert json.loads(json.dumps(curve, allow_nan=False))["columns"]["x [s]"] == [0.0, None]


def test_mean_and_spread_by_hand() -> None:
    assert mean([1.0, 3.0]) == (2.0, pytest.approx(1.0))  # sqrt(2)/sqrt(2)
    assert mean([1.0]) == (1.0, None)
    assert spread([1.0, 2.0, 3.0]) == (pytest.approx(1.0), pytest.approx(0.5))


def test_every_file_is_a_procedure_of_some_mode() -> None:
    files = {path.stem for path in FOLDER.glob("[a-z]*.py")}
    assert set().union(*(procedures(mode) for mode in MODES)) == files
    for mode in MODES:
        found = procedures(mode)
        assert [p.order for p in found.values()] == sorted(p.order for p in found.values())
        # The clauses of IEEE Std 1431-2004, part II, run from 12.1 to 12.19.
        assert all(p.order[0] == 12 and 1 <= p.order[1] <= 19 for p in found.values())
        assert all(p.title and p.share > 0 for p in found.values())


def test_an_unknown_mode_names_the_nearest() -> None:
    with pytest.raises(InputError, match="rate-open"):
        procedures("rate-opn")


def test_every_way_to_expect_is_known() -> None:
    assert all(Figure("a", "a", 1.0, "1", None, 1, 1.0, "", how).holds for how in EXPECTATIONS)
