"""What diagnoses of one kind report."""

from benchmarks.named import report_of
from benchmarks.structures import Outcome


def test_shares_are_of_all_and_of_each_kind() -> None:
    outcomes = [
        Outcome("one, smooth", [], "missing effects: cubic_stiffness", True, {"over noise": 1.0}),
        Outcome("other, rubs with 1 N", [], "unexplained: ", False, {"over noise": 8.0}),
    ]
    rows = report_of("bowed", "Some", outcomes, ("smooth", "rubs"), "a note").tables[0].rows
    assert [row.values["share"] for row in rows] == [0.5, 1.0, 0.0]
