"""A diagnosis as tables in the terminal."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Final

from rich.console import Group, RenderableType
from rich.text import Text

from discrepancy.tell.answer import Diagnosis
from gyrotwin.numbers import in_unit, significant, uncertain
from gyrotwin.terminal_table import Table

PARTLY: Final = "partly explained"
MOST_RUNS: Final = 4
"""Held-out runs that get a column of their own."""
LEAST: Final = 1e-3
"""Share of power that is told as a number."""


def results(report: Mapping[str, Any], found: Diagnosis) -> RenderableType:
    """What report.json holds, as tables for rich, with the stages of the held-out runs."""
    parts: list[RenderableType] = [Text(verdict(report), style="bold")]
    if report["effects"]:
        parts.append(_effects(report["effects"]))
    parts += [Text(f"the record: {_defect(defect)}") for defect in report["record"]]
    parts += [Text("Misfit on held-out runs, rms(v - v_sim)/rms(v)", style="italic"), _misfit(report, found)]
    parts += [
        Text(f"next, next-{e['id']}.csv: {e['next_experiment']}") for e in report["effects"] if e.get("next_experiment")
    ]
    parts += [Text(f"doubt: {doubt}", style="yellow") for doubt in found.doubts]
    return Group(*parts)


def verdict(report: Mapping[str, Any]) -> str:
    """The verdict as a sentence."""
    gap, floor = report["misfit"]["final"], report["misfit"]["noise_floor"]
    ratio = f", {gap / floor:.3g} times the noise floor" if gap and floor else ""
    ids = [e["id"] for e in report["effects"]]
    if ids:
        listed = ids[0] if len(ids) == 1 else f"{', '.join(ids[:-1])} and {ids[-1]}"
        before = significant(report["misfit"]["refit"])
        them = "it" if len(ids) == 1 else "them"
        # A model that leaves all bounds has no misfit.
        final, refit = (inf if left is None else left for left in (gap, report["misfit"]["refit"]))
        goes = "falls" if final <= refit else "rises"
        share = f"{report['left']:.1%}" if report["left"] >= LEAST else f"Less than {LEAST:.1%}"
        rest = f" {share} of the residual's power is left." if report["verdict"] == PARTLY else ""
        part = "In part, the" if report["verdict"] == PARTLY else "The"
        return (
            f"{part} model lacks {listed}: with {them} the misfit on held-out runs {goes} from {before} to "
            f"{significant(gap)}{ratio}.{rest}"
        )
    if report["verdict"] == "unexplained":
        return f"Unexplained: a misfit of {significant(gap)}{ratio} stays on held-out runs, and no effect explains it."
    return f"Nothing is missing that this data would show: the refitted model misses held-out runs by " \
        f"{significant(gap)}{ratio}."  # fmt: skip


def _defect(defect: Mapping[str, Any]) -> str:
    values = ", ".join(f"{name} = {in_unit(_value(p), p['unit'])}" for name, p in defect["parameters"].items())
    instead = f" (or {', '.join(defect['either'])})" if defect["either"] else ""
    return f"{defect['id']}{instead}, {values}, taken into account"


def _effects(effects: Sequence[Mapping[str, Any]]) -> Table:
    table = Table(title="Missing effects (± 95 %)", title_justify="left")
    for heading in ("effect", "parameter", "value", "unit", "or instead", "probability"):
        right = heading in ("value", "probability")
        table.add_column(heading, justify="right" if right else "left", overflow="fold")
    for effect in effects:
        shown = effect["id"], ", ".join(effect["either"]) or "–", f"{effect['probability']:.2f}"
        for name, p in effect["parameters"].items():
            table.add_row(shown[0], name, _value(p), p["unit"], *shown[1:])
            shown = "", "", ""
    return table


def _value(p: Mapping[str, Any]) -> str:
    if p["low"] is not None and p["low"] == p["high"]:
        return f"{significant(p['value'], 5)} (held)"
    bounded = p["low"] is not None and p["high"] is not None
    return uncertain(p["value"], p["low"], p["high"]) if bounded else significant(p["value"], 5)


def _misfit(report: Mapping[str, Any], found: Diagnosis) -> Table:
    table = Table()
    runs = list(report["misfit"]["runs"])
    table.add_column("model")
    for heading in ("all", *(runs if 1 < len(runs) <= MOST_RUNS else ())):
        table.add_column(heading, justify="right", overflow="fold")
    for stage in found.stages:
        values = [stage.misfit[run] for run in ("", *runs)]
        table.add_row(stage_label(stage.name), *(significant(value) for value in values[: len(table.columns) - 1]))
    floors = [report["misfit"]["noise_floor"], *(report["misfit"]["runs"][run]["noise_floor"] for run in runs)]
    table.add_row("noise floor", *(significant(value) for value in floors[: len(table.columns) - 1]), style="dim")
    return table


def stage_label(name: str) -> str:
    """A stage in words."""
    return name if name in ("nominal", "refit") else f"+ {name}"
