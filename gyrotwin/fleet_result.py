"""What `gyrotwin diagnose --each` finds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from gyrotwin.results import Saved, Writer, write_json

if TYPE_CHECKING:
    import polars as pl

    from discrepancy.tell.fleet import Fleet


@dataclass(frozen=True)
class FleetResult(Saved):
    """The devices of a folder, each diagnosed, and what they say together; see `gyrotwin.diagnose_each`."""

    name: str
    fleet: "Fleet" = field(repr=False)

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """Devices, effects with shares, parameters with mean, spread and slopes, outliers; the content of
        fleet.json."""
        return self.fleet.report()

    @property
    def outliers(self) -> Mapping[str, Sequence[str]]:
        """Devices that do not belong, each with the reasons."""
        return {outlier.device: outlier.reasons for outlier in self.fleet.outliers}

    @cached_property
    def devices(self) -> "pl.DataFrame":
        """One row a device: its verdict, effects, columns, and every parameter with its standard deviation."""
        import polars as pl

        rows = []
        for row in self.fleet.rows:
            own = {n: e for n in self.fleet.spreads if (e := row.estimate(n)) is not None}
            numbers = {n: e.value for n, e in own.items()} | {f"{n}_deviation": e.deviation for n, e in own.items()}
            known = {heading: values[row.name] for heading, values in self.fleet.columns.items()}
            effects = ", ".join(row.effects)
            rows.append({"device": row.name, "verdict": row.verdict, "effects": effects, **known, **numbers,
                         "error": row.error})  # fmt: skip
        return pl.DataFrame(rows, infer_schema_length=None)

    def writers(self) -> Mapping[str, Writer]:
        """fleet.json, report.html."""
        from gyrotwin.fleet_report import render

        return {"fleet.json": write_json(self.summary), "report.html": lambda path: render(self, path)}

    def headline(self) -> Sequence[tuple[str, str]]:
        """Devices, effects with their shares, outliers."""
        found = self.fleet
        shares = [(name, f"{s.count} of {s.of} ({s.low:.0%} to {s.high:.0%})") for name, s in found.shares.items()]
        return [("devices", str(len(found.rows))), *shares,
                ("do not belong", ", ".join(o.device for o in found.outliers) or "none")]  # fmt: skip
