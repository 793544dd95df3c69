"""What the functions of the package give: numbers, tables and figures of one result, which can be saved.

Each result has ``summary`` (JSON-ready), ``save(folder)``, which writes the same files as the command, and a short
table for notebooks.
"""

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import polars as pl

from gyrotwin.output import check_writable, publish

if TYPE_CHECKING:
    from cosim.design import Design
    from cosim.rate.master import Result as RawRateResult
    from cosim.rate.run import RateRun
    from cosim.recorder import Result as RawRunResult
    from cosim.run import Run
    from discrepancy.data.dataset import Dataset
    from discrepancy.tell.answer import Diagnosis, Finding
    from discrepancy.tell.experiment import Experiment
    from gyro_model.device import Device
    from gyrotwin.figures import Figure

Writer = Callable[[Path], object]
"""Writes one file."""


class Saved(ABC):
    """A result that can be saved as a folder of files."""

    sometimes: ClassVar[tuple[str, ...]] = ()
    """Patterns of files that an earlier result in the same folder may have left and this one need not have."""

    @property
    @abstractmethod
    def summary(self) -> Mapping[str, Any]:
        """What summary.json holds."""

    @abstractmethod
    def writers(self) -> Mapping[str, Writer]:
        """The files by name, each with the function that writes it."""

    @abstractmethod
    def headline(self) -> Sequence[tuple[str, str]]:
        """The few numbers that matter most, as (name, value with unit)."""

    def save(self, folder: str | Path, *, force: bool = False) -> Path:
        """Write all files of the result into a folder, complete or not at all.

        Parameters
        ----------
        folder : str or Path
            Made where it does not exist.
        force : bool
            Write even where the folder holds files that are not results of this program.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        InputError
            If the folder can't be written, is in use by another run, or holds foreign files.

        """
        path = Path(folder)
        check_writable(path)
        publish(path, dict(self.writers()), self.sometimes, force=force)
        return path

    def _repr_html_(self) -> str:
        rows = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in self.headline())
        return f"<table><caption>{escape(type(self).__name__)}</caption><tbody>{rows}</tbody></table>"

    def __str__(self) -> str:
        return "\n".join(f"{name}: {value}" for name, value in self.headline())


def write_json(content: Mapping[str, Any]) -> Writer:
    """A function that writes ``content`` as strict JSON."""
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    return lambda path: path.write_text(text, encoding="utf-8")


def write_trace(trace: pl.DataFrame) -> Writer:
    """A function that writes ``trace`` as parquet."""
    # Small groups keep the memory of the writer small.
    return lambda path: trace.write_parquet(path, row_group_size=20_000)


@dataclass(frozen=True)
class RunResult(Saved):
    """A finished run of the closed loop; see `gyrotwin.run`."""

    run: "Run" = field(repr=False)
    raw: "RawRunResult" = field(repr=False)

    @property
    def trace(self) -> pl.DataFrame:
        """Time series, one row each 50 µs where nothing else was asked for: angles [rad], rates [rad/s], voltages,
        forces, estimates and true values in SI. Of more than 240,000 rows every n-th; trace.parquet has all."""
        return self.raw.trace

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """Errors of the angle and of the parameters, validity, predicted drift; the content of summary.json."""
        from gyrotwin.tasks.run import summary_of

        return summary_of(self.run, self.raw)

    @property
    def valid(self) -> bool:
        """Whether the angle was valid at the end, by what the loop itself knows."""
        return bool(self.summary["valid"]["now"])

    @property
    def device(self) -> "Device":
        """The plant as it ran, with what the scenario and the caller set."""
        return self.run.device

    @property
    def design(self) -> "Design":
        """All that the loop knew."""
        return self.run.design

    def figures(self) -> "list[Figure]":
        """The figures of the report as data."""
        from gyrotwin.report import run_figures
        from gyrotwin.tasks.run import filters_of

        return run_figures(self.summary, self.trace, self.raw.bounds, filters_of(self.run, self.raw), self.raw.start)

    def writers(self) -> Mapping[str, Writer]:
        """summary.json, trace.parquet, design.toml, report.html."""
        from gyrotwin.report import render
        from gyrotwin.tasks.run import DESIGN_FILE, filters_of

        filters, raw = filters_of(self.run, self.raw), self.raw
        return {
            "summary.json": write_json(self.summary),
            "trace.parquet": raw.rows.write,
            DESIGN_FILE: self.run.design.write,
            "report.html": lambda path: render(self.summary, self.trace, raw.bounds, filters, path, raw.start),
        }

    def headline(self) -> Sequence[tuple[str, str]]:
        """Scenario, validity, angle and rate errors."""
        from gyrotwin.numbers import degrees, milliseconds, significant

        s = self.summary
        return [
            ("scenario", f"{s['scenario']}, seed {s['seed']}, {s['run']['duration']}"),
            ("device, design", f"{s['run']['device']}, {s['run']['design']}"),
            ("converged at", milliseconds(s["converged_at"])),
            ("angle valid at the end", "yes" if s["valid"]["now"] else f"no: {s['valid']['reason']}"),
            ("angle error, rms", degrees(s["angle"]["rms_deg"])),
            ("rate error, rms", f"{significant(s['omega']['rms_error'])} rad/s"),
            ("predicted drift, 1 σ", degrees(s["predicted"]["drift_sigma_now_deg_per_s"], "°/s")),
        ]


@dataclass(frozen=True)
class RateResult(Saved):
    """A finished run of rate mode; see `gyrotwin.rate`."""

    run: "RateRun" = field(repr=False)
    raw: "RawRateResult" = field(repr=False)
    split_block: float | None = field(repr=False, default=None)
    """Length of a block of a split estimate [s], where one was asked for."""
    sometimes: ClassVar[tuple[str, ...]] = ("sense.parquet",)

    @property
    def trace(self) -> pl.DataFrame:
        """The record: time [s], rate [rad/s], temperatures [K], drive and quadrature signals."""
        return self.raw.record

    @property
    def sense(self) -> pl.DataFrame | None:
        """v_y as I and Q around the drive carrier for `gyrotwin.split`, where ``sense_record`` asked for it."""
        return self.raw.sense

    @cached_property
    def summary(self) -> Mapping[str, Any]:
        """Bias, scale factor, quadrature, noise; the content of summary.json."""
        from cosim.rate.metrics import summarise
        from gyrotwin import split_online

        summary = summarise(self.run, self.raw)
        if self.split_block is not None and self.raw.sense is not None:
            steps = split_online.split_blocks(self.run, self.raw.sense, self.split_block)
            summary["split"] = split_online.summarise(steps, self.run, self.split_block)
        return summary

    def writers(self) -> Mapping[str, Writer]:
        """summary.json, trace.parquet, report.html, and sense.parquet where it was asked for."""
        from cosim.rate.metrics import allan_of
        from gyrotwin.rate_report import render

        raw, run = self.raw, self.run
        files: dict[str, Writer] = {
            "summary.json": write_json(self.summary),
            "trace.parquet": write_trace(raw.record),
            "report.html": lambda path: render(self.summary, run, raw.record, allan_of(raw.record, run), path),
        }
        if raw.sense is not None:
            files[self.sometimes[0]] = raw.sense.write_parquet
        return files

    def headline(self) -> Sequence[tuple[str, str]]:
        """Bias, scale factor, quadrature."""
        from gyrotwin.rate_report import rows

        return [(name, f"{value} {unit}") for name, value, _, unit in rows(self.summary)]


@dataclass(frozen=True)
class SplitResult(Saved):
    """A frequency split found in noise; see `gyrotwin.split`."""

    summary_: Mapping[str, Any] = field(repr=False)
    files: Mapping[str, Writer] = field(repr=False)
    shown: Any = field(repr=False)
    """Table for rich."""
    trace: pl.DataFrame | None = field(repr=False, default=None)
    """The split through time [s, Hz], where ``track`` asked for it."""

    @property
    def summary(self) -> Mapping[str, Any]:
        """Frequencies [Hz] with 95 % intervals, Q, bound; the content of summary.json."""
        return self.summary_

    def writers(self) -> Mapping[str, Writer]:
        """summary.json, report.html, and track.csv of a track."""
        return self.files

    def headline(self) -> Sequence[tuple[str, str]]:
        """The split, or its ends, and what to know of it."""
        found = {key: self.summary[key] for key in ("split", "first", "last") if key in self.summary}
        ends = [
            (f"split{'' if key == 'split' else ', ' + key}", f"{v['value']:.4f} Hz ({v['low']:.4f} .. {v['high']:.4f})")
            for key, v in found.items()
        ]
        return [*ends, *(("warning", text) for text in self.summary["warnings"])]


@dataclass(frozen=True)
class CompensationResult(Saved):
    """A fitted temperature compensation; see `gyrotwin.compensate`."""

    summary_: Mapping[str, Any] = field(repr=False)
    files: Mapping[str, Writer] = field(repr=False)

    @property
    def summary(self) -> Mapping[str, Any]:
        """Methods with what they leave on fitted and held-out blocks; the content of summary.json."""
        return self.summary_

    def writers(self) -> Mapping[str, Writer]:
        """compensation.toml, compensation.h, summary.json, report.html."""
        return self.files

    def headline(self) -> Sequence[tuple[str, str]]:
        """The chosen method and by how much it improves scale factor and bias on held-out blocks."""
        chosen = self.summary["methods"][self.summary["method"]]["held_out"]
        better = [
            (text, f"{chosen[key]['factor']:.4g}")
            for key, text in (("scale_factor_ppm_per_c", "scale factor better by"), ("bias_per_c", "bias better by"))
            if chosen[key] is not None
        ]
        return [("method", f"{self.summary['method']}: {self.summary['note']}"), *better]


@dataclass(frozen=True)
class DiagnosisResult(Saved):
    """What a model lacks to explain a data set; see `gyrotwin.diagnose`."""

    dataset: "Dataset" = field(repr=False)
    device: "Device" = field(repr=False)
    """The improved device: nominal values, what was fitted, effects and noise, with 95 % intervals."""
    raw: "Diagnosis" = field(repr=False)
    effect_files: Mapping[str, bytes] = field(repr=False, default_factory=dict)
    """Effect files beside the packaged ones, discovered ones included, by path in the folder of the results."""
    warnings: tuple[str, ...] = ()
    sometimes: ClassVar[tuple[str, ...]] = ("effects/discovered_*.py", "next-*.csv")

    @cached_property
    def report(self) -> Mapping[str, Any]:
        """The content of report.json."""
        return self.raw.report()

    @property
    def effects(self) -> "tuple[Finding, ...]":
        """The missing effects, largest first."""
        return self.raw.effects

    @property
    def summary(self) -> Mapping[str, Any]:
        """The content of report.json."""
        return self.report

    @property
    def experiments(self) -> "Mapping[str, Experiment]":
        """By effect, the run that would tell it from its rivals; ``table`` is what a generator plays."""
        return self.raw.experiments

    @property
    def verdict(self) -> str:
        """One of: missing effects, nothing missing, partly explained, unexplained."""
        return str(self.report["verdict"])

    @property
    def misfit(self) -> Mapping[str, Any]:
        """Rms of the residual on held-out runs [V]: nominal, refit, final, and the noise floor."""
        misfit: Mapping[str, Any] = self.report["misfit"]
        return misfit

    @cached_property
    def design(self) -> "Design":
        """The improved device as all that a loop may know: ``gyrotwin.run(..., design=found.design)``."""
        from gyrotwin.api import load_design

        return load_design(self.device, self.device)

    def writers(self) -> Mapping[str, Writer]:
        """report.json, report.html, device.toml, fmi2.fmu, fmi3.fmu, effects that were discovered, and next-EFFECT.csv
        of each experiment that is proposed."""
        from gyrotwin.tasks.diagnose import writers_of

        return writers_of(self)

    def headline(self) -> Sequence[tuple[str, str]]:
        """Verdict, effects with their parameters, misfit."""
        from gyrotwin.numbers import significant, uncertain

        named = [
            (effect.id, ", ".join(f"{n} = {uncertain(v.value, v.low, v.high)} {v.unit}" for n, v in
                                  effect.parameters.items()))
            for effect in self.effects
        ]  # fmt: skip
        levels = ("nominal", "refit", "final", "noise_floor")
        return [
            ("verdict", self.verdict),
            *named,
            ("misfit", ", ".join(f"{key.replace('_', ' ')} {significant(self.misfit[key])}" for key in levels)),
        ]
