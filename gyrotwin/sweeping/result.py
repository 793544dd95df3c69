"""What a sweep gives: its rows, the yield against the plan's limits, which parameter costs most, the worst points."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from gyrotwin.sweeping import rows
from gyrotwin.sweeping.plan import Plan
from gyrotwin.sweeping.sensitivity import Index, indices


@dataclass(frozen=True)
class SweepResult:
    """A finished sweep in ``folder``; digest: names the plan with the text of its task, as both were worked off."""

    plan: Plan
    folder: Path = field(repr=False)
    digest: str = field(repr=False)

    @cached_property
    def rows(self) -> pl.DataFrame:
        """One row a point, in their order: point, seed, parameters, outputs, error."""
        return rows.read(self.folder)

    @cached_property
    def times(self) -> pl.DataFrame:
        """Seconds of each point."""
        return rows.read(self.folder, rows.TIMES)

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs that are numbers."""
        known = {"point", "seed", "error", *self.plan.parameters}
        numbers = (name for name, kind in self.rows.schema.items() if name not in known and kind.is_numeric())
        return [name for name in numbers if self.rows[name].null_count() < len(self.rows)]

    @property
    def failed(self) -> pl.DataFrame:
        """Rows of the points that failed."""
        return self.rows.filter(pl.col("error").is_not_null())

    def within(self) -> pl.Series:
        """Of each row, whether it is without an error and within all limits."""
        good = self.rows["error"].is_null()
        for name, (low, high) in self.plan.limits.items():
            if name not in self.rows.columns:
                return pl.Series([False] * len(self.rows))
            good = good & self.rows[name].is_between(low, high).fill_null(False)
        return good

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """Points, failures, yield with its 95 % interval (Wilson), quantiles of the outputs, sensitivities."""
        good, count = int(self.within().sum()), len(self.rows)
        low, high = _wilson(good, count)
        quantiles = (0.05, 0.5, 0.95)
        return {
            "task": self.plan.task,
            "plan": self.digest,
            "points": count,
            "failed": len(self.failed),
            "yield": {"value": good / max(count, 1), "low": low, "high": high},
            "outputs": {n: {str(q): self.rows[n].quantile(q, "linear") for q in quantiles} for n in self.outputs},
            "sensitivity": {n: [i._asdict() for i in found] for n, found in self.sensitivity.items()},
            "processor_seconds": float(self.times["seconds"].sum()) if len(self.times) else 0.0,
        }

    @cached_property
    def sensitivity(self) -> Mapping[str, list[Index]]:
        """Indices of each output where the plan samples for them: method saltelli or morris, one seed, no failure."""
        plan = self.plan
        alone = len(plan.random) == len(plan.parameters) and len(plan.seeds) == 1
        if plan.method not in ("saltelli", "morris") or not alone or len(self.failed):
            return {}
        unit = plan.unit_sample()
        if len(unit) != len(self.rows):
            return {}
        seed = int(plan.sampling.get("seed", 1))
        columns = {n: self.rows[n].cast(pl.Float64).to_numpy() for n in self.outputs if self.rows[n].null_count() == 0}
        return {n: indices(plan.method, plan.random, unit, values, seed)
                for n, values in columns.items() if np.ptp(values) > 0}  # fmt: skip

    def worst(self, count: int = 5) -> pl.DataFrame:
        """Failed rows first, then those farthest beyond a limit or nearest to one; without limits those with the
        largest first output."""
        table = self.rows
        far = pl.Series([float("-inf")] * len(table))
        for name, (low, high) in self.plan.limits.items():
            if name in table.columns:
                values, width = table[name], _width(low, high)
                beyond = pl.select(pl.max_horizontal(low - values, values - high) / width).to_series()
                far = pl.select(pl.max_horizontal(far, beyond.fill_null(float("inf")))).to_series()
        if not self.plan.limits and self.outputs:
            far = table[self.outputs[0]].cast(pl.Float64).fill_null(float("inf"))
        far = pl.select(pl.when(table["error"].is_not_null()).then(float("inf")).otherwise(far)).to_series()
        return table.with_columns(far.alias("_far")).sort("_far", descending=True).drop("_far").head(count)

    def _repr_html_(self) -> str:
        s = self.summary
        return f"<p>{s['points']} points, {s['failed']} failed, yield {s['yield']['value']:.1%}</p>"


def _width(low: float, high: float) -> float:
    """Of an interval; of one that is open at one end, the size of the other."""
    ends = [end for end in (low, high) if isfinite(end)]
    return max(high - low if len(ends) == 2 else abs(ends[0]) if ends else 1.0, 1e-300)


def _wilson(good: int, count: int) -> tuple[float, float]:
    """95 % interval of a share."""
    if count == 0:
        return 0.0, 1.0
    z = 1.959963984540054
    middle = (good + z * z / 2) / (count + z * z)
    reach = z / (count + z * z) * (good * (count - good) / count + z * z / 4) ** 0.5
    return max(middle - reach, 0.0), min(middle + reach, 1.0)
