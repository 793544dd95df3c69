"""What `gyrotwin datasheet` gives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from gyrotwin.numbers import significant
from gyrotwin.results import Saved, Writer, write_json

if TYPE_CHECKING:
    from calibration.datasheet.figure import Figure
    from calibration.datasheet.measure import Test

HEADLINE = ("angle_random_walk", "bias_instability", "bias_repeatability", "scale_factor_nonlinearity", "bandwidth")
"""Figures that matter most, where the mode has them."""
FILE = "datasheet.json"


@dataclass(frozen=True)
class DatasheetResult(Saved):
    """A datasheet; see `gyrotwin.datasheet`."""

    head: Mapping[str, Any]
    tests: "Sequence[Test]" = field(repr=False)

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """Device, mode, tests with their figures and curves; the content of datasheet.json."""
        tests = [
            {
                "id": test.id,
                "title": test.procedure.title,
                "clause": test.procedure.clause,
                "not_done": test.outcome.reason,
                "figures": [figure.as_json() for figure in test.outcome.figures],
            }
            for test in self.tests
        ]
        curves = {curve.id: curve.as_json() for test in self.tests for curve in test.outcome.curves}
        return {**self.head, "tests": tests, "curves": curves}

    @property
    def figures(self) -> "dict[str, Figure]":
        """All figures by id."""
        return {figure.id: figure for test in self.tests for figure in test.outcome.figures}

    def writers(self) -> Mapping[str, Writer]:
        """datasheet.json, report.html."""
        from gyrotwin.datasheet_report import render

        return {FILE: write_json(self.summary), "report.html": lambda path: render(self, path)}

    def headline(self) -> Sequence[tuple[str, str]]:
        """Angle random walk, bias instability, bandwidth and their like."""
        found = self.figures
        return [
            (found[key].name, f"{significant(found[key].value)} {found[key].unit}") for key in HEADLINE if key in found
        ]
