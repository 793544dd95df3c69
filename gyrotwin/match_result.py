"""What `gyrotwin.match` gives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import degrees, isfinite
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from gyrotwin.results import Saved, Writer, write_json, write_trace

if TYPE_CHECKING:
    from calibration.matching import Asking, Matched


@dataclass(frozen=True)
class MatchResult(Saved):
    """A finished run of rate mode with its bias tuned; see `gyrotwin.match`."""

    asking: "Asking" = field(repr=False)
    raw: "Matched" = field(repr=False)

    @property
    def trace(self) -> pl.DataFrame:
        """The record of rate mode, with v_bias [V], split_true, and split_estimate, split_deviation: what the tuner
        held of the last block [Hz]."""
        t = self.raw.record["t"].to_numpy()
        ends = np.array([block.t for block in self.raw.blocks])
        last = np.searchsorted(ends, t * (1 + 1e-12), side="right") - 1
        columns = {
            f"split_{name}": np.where(last >= 0, np.array([getattr(b, key) for b in self.raw.blocks])[last], np.nan)
            for name, key in (("estimate", "split"), ("deviation", "deviation"))
        }
        return self.raw.record.with_columns(**{name: pl.Series(values) for name, values in columns.items()})

    @property
    def blocks(self) -> pl.DataFrame:
        """One row a block: t [s] of its end, length of its measurement [s], v_bias [V], its own split, deviation and
        bound, null where there is none, and what the tuner held after it [Hz]."""
        rows = [
            (b.t, b.length, b.v_bias, *(b.answer or (None, None, None)), b.split, b.deviation) for b in self.raw.blocks
        ]
        names = ("t", "length", "v_bias", "split", "deviation", "bound", "tuner_split", "tuner_deviation")
        return pl.DataFrame(rows, schema=dict.fromkeys(names, pl.Float64), orient="row")

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """The content of match.json: Hz, V, s."""
        from calibration.matching import measures
        from calibration.matching.measures import MATCHED
        from cosim.rate.allan import noise_limits
        from cosim.rate.metrics import PER_ROOT_HOUR

        run, known = self.asking.run, self.asking.known
        found = measures(run, self.raw)
        bias = self.raw.record["v_bias"]
        plan = self.asking.method.start(known, self.asking.asked).plan()
        structure = self.raw.record["temperature_structure"]
        limit = noise_limits(run.nominal, float(structure[0]), 1 / run.sample_rate).total
        return {
            "device": run.device.name,
            "design": run.known.name,
            "method": self.asking.method.name,
            "source": self.asking.method.source,
            "plant": "envelope" if run.envelope else "full",
            "seed": run.seed,
            "duration": run.rows * run.interval,
            "rate_course": run.rate.text,
            "temperature_course": run.temperature.text,
            "temperature_structure_k": {"min": structure.min(), "max": structure.max()},
            "started_at": self.raw.started_at,
            "split": {
                "matched_at": _number(found.matched_at),
                "within_hz": MATCHED,
                "since": found.since,
                "rms_hz": found.rms,
                "largest_hz": found.largest,
            },
            "bias_v": {"first": known.first_bias, "last": bias[-1], "min": bias.min(), "max": bias.max()},
            "block": {
                "count": len(self.raw.blocks),
                "missed": found.missed,
                "measurement_s": plan.measure,
                "settling_s": plan.before,
                "error_over_deviation": _number(found.ratio),
                "error_over_bound": _number(found.over_bound),
            },
            "dither": None if not plan.force else {"frequency_hz": plan.tone, "force_n": 2 * plan.force},
            "rate_noise": {
                "angle_random_walk_deg_rth": _number(PER_ROOT_HOUR * found.walk),
                "angle_random_walk_error_deg_rth": _number(PER_ROOT_HOUR * found.walk_error),
                "limit_deg_rth": PER_ROOT_HOUR * limit,
            },
            "bias_deg_s": degrees(float(self.raw.record["rate"].to_numpy().mean())),
        }

    def writers(self) -> Mapping[str, Writer]:
        """match.json, trace.parquet, report.html."""
        from gyrotwin.match_report import render

        return {
            "match.json": write_json(self.summary),
            "trace.parquet": write_trace(self.trace),
            "report.html": lambda path: render(self.summary, self.trace, self.blocks, path),
        }

    def headline(self) -> Sequence[tuple[str, str]]:
        """When the modes matched, and how well they were held."""
        from gyrotwin.match_report import rows

        return [(name, f"{value} {unit}".strip()) for name, value, unit in rows(self.summary)]


def _number(value: float) -> float | None:
    return value if isfinite(value) else None
