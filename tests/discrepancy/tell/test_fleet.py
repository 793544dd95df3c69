"""Many devices together: shares, populations, devices that do not belong."""

import json

import numpy as np
import pytest

from discrepancy.tell.fleet import Estimate, Row, fleet

GOOD = 40


def wafer(slope: float = -0.1) -> tuple[list[Row], dict[str, dict[str, float]]]:
    """Rows of devices whose k3 falls along x below what is named, two bad ones and one without data."""
    rng = np.random.default_rng(1)
    rows, columns = [], {"x [mm]": {}, "lot": {}, "x [inch]": {}}
    for k in range(GOOD + 3):
        name = f"die-{k:02d}"
        x = float(k % 8)
        columns["x [mm]"][name], columns["lot"][name], columns["x [inch]"][name] = x, 7.0, x / 25.4
        if k == GOOD + 2:
            rows.append(Row(name, error="table run-01.csv does not exist"))
            continue
        k3 = 1.0 + slope * x + 0.1 * rng.standard_normal() + (5.0 if k == GOOD else 0.0)
        estimate = Estimate(k3 + 0.05 * rng.standard_normal(), 0.05, "N/m3")
        named = k3 > 0.6
        m = Estimate(1e-7 * (1 + 0.01 * rng.standard_normal()), 1e-11, "kg")
        rub = {"friction_x": Estimate(2e-9, 1e-11, "N")} if k == GOOD + 1 else {}
        none = {"friction_x": Estimate(1e-11 * rng.standard_normal(), 1e-11, "N")} if k != GOOD + 1 else {}
        effects = {"cubic_stiffness": ("k3_x",)} if named else {}
        effects |= {"dry_friction": ("friction_x",)} if rub else {}
        values = {"m": m, **rub, **({"k3_x": estimate} if named else {})}
        absent = {**none, **({} if named else {"k3_x": estimate})}
        detectable = {"dry_friction": {"friction_x": 1e-9 if k % 2 else 1e-8}}
        rows.append(Row(name, "missing effects", effects, {"cubic_stiffness": ("play",)} if named and k == 0 else {},
                        ("clock_skew",) if k < 3 else (), values, absent, detectable, 1e-3, 1e-3))  # fmt: skip
    return rows, columns


def test_a_wafer_with_a_gradient_and_bad_dies() -> None:
    rows, columns = wafer()
    found = fleet(rows, columns)
    assert list(found.columns) == ["x [mm]"], "a constant and a multiple of another column say nothing"
    k3 = found.spreads["k3_x"].found
    # Dies at the far end name nothing, and still hold the slope and the spread.
    assert k3.slopes[0].low < -0.1 < k3.slopes[0].high < 0
    assert k3.spread.low < 0.1 < k3.spread.high
    assert len(found.spreads["k3_x"].devices) == GOOD + 2
    assert {o.device for o in found.outliers} == {"die-40", "die-41"}
    reasons = {o.device: " ".join(o.reasons) for o in found.outliers}
    assert "k3_x" in reasons["die-40"]
    assert "names dry_friction, as 1 of 42 do" in reasons["die-41"]
    assert "friction_x = 2e-09 N" in reasons["die-41"]


def test_shares_count_those_that_could_have_shown_it() -> None:
    found = fleet(*wafer())
    friction, cubic = found.shares["dry_friction"], found.shares["cubic_stiffness"]
    assert (friction.count, friction.of, friction.seen) == (1, 42, 21)
    # Wilson's interval of 1 of 42 by hand: (p + z²/2n ± z √(pq/n + z²/4n²))/(1 + z²/n).
    assert friction.low == pytest.approx(0.0042155, rel=1e-4)
    assert friction.high == pytest.approx(0.1232119, rel=1e-4)
    assert cubic.uncertain == 1
    assert found.record == {"clock_skew": 3}


def test_the_report_is_plain_json() -> None:
    report = fleet(*wafer()).report()
    again = json.loads(json.dumps(report, allow_nan=False))
    assert again["devices"]["die-42"] == {"error": "table run-01.csv does not exist"}
    assert again["parameters"]["k3_x"]["devices"]["die-40"]["distance"] > 10
    assert set(again["outliers"]) == {"die-40", "die-41"}


def test_a_fleet_of_three_has_shares_and_no_population() -> None:
    rows, _ = wafer()
    found = fleet(rows[:3])
    assert found.spreads == {}
    assert found.shares["cubic_stiffness"].of == 3


def test_a_fleet_of_failures_says_nothing() -> None:
    found = fleet([Row("a", error="no"), Row("b", error="no")])
    assert (found.shares, found.spreads, found.outliers) == ({}, {}, ())
