"""The page of a diagnosis: one self-contained HTML file that works without a network."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from discrepancy.data.dataset import Dataset
from discrepancy.fit.defect import effect_of, quantity_of
from discrepancy.tell.answer import Diagnosis
from discrepancy.tell.assemble import forces
from gyro_model.errors import InputError
from gyro_model.model import Model
from gyrotwin import diagnosis_figures as figures
from gyrotwin.diagnosis_console import verdict
from gyrotwin.figures import Figure
from gyrotwin.numbers import significant, uncertain
from gyrotwin.report import as_json, template, write_whole


def render(
    name: str,
    data: Dataset,
    model: Model,
    report: Mapping[str, Any],
    found: Diagnosis,
    warnings: Sequence[str],
    out: Path,
) -> None:
    """Writes the page of the diagnosis of data set ``name`` to ``out``; report: contents of report.json."""
    drawn = _figures(data, report, found)
    gap, floor = report["misfit"]["final"], report["misfit"]["noise_floor"]
    page = template("diagnosis.html.j2").render(
        name=name,
        report=report,
        sentence=verdict(report),
        facts=_facts(data, model),
        over_floor=gap / floor if gap and floor else None,
        warnings=warnings,
        about={e["id"]: _about(model, e["id"]) for e in report["effects"]},
        rivals={e["id"]: _rivals(model, e["either"], data.axes) for e in report["effects"]},
        formulas={e["id"]: _formulas(model, e, data.axes) for e in report["effects"]},
        parameters=_parameters(data, model, found),
        detectable=_detectable(model, report["detectable"]),
        figures=drawn,
        data=as_json({figure.id: figure.data() for figure in drawn}),
        uncertain=uncertain,
    )
    write_whole(page, out)


def _figures(data: Dataset, report: Mapping[str, Any], found: Diagnosis) -> list[Figure]:
    noise = report["noise"].get("sense_noise", {}).get("value")
    lsb = report["noise"].get("adc_lsb", {}).get("value") or 0.0
    level = (noise**2 + lsb**2 / 12) ** 0.5 if noise is not None else None
    drawn = [
        figures.misfit_figure(found, report["misfit"]["noise_floor"]),
        figures.map_figure(data, found, level),
    ]
    if any(step.scores for step in found.steps):
        drawn.append(figures.score_figure(found.steps))
    curves = figures.backbone_figure(found)
    return [*drawn, figures.spectrum_figure(data, found, level), *([curves] if curves else [])]


def _facts(data: Dataset, model: Model) -> dict[str, str]:
    rates = sorted({record.sample_rate for record in data.records})
    return {
        "axes": str(data.axes),
        "fitted": ", ".join(record.name for record in data.fit),
        "held out": ", ".join(record.name for record in data.held_out),
        "samples": f"{sum(len(record.t) for record in data.records):,}",
        "sample rate": ", ".join(f"{rate / 1e3:g} kHz" if rate >= 1e3 else f"{rate:g} Hz" for rate in rates),
        "effects searched": str(sum(not (e.nominal or e.noise) for e in model.effects)),
    }


def _about(model: Model, effect_id: str) -> str:
    """What an effect is, in the words of its file."""
    try:
        doc = model.effect(effect_id).doc.strip()
    except InputError:
        return ""
    return doc.splitlines()[0].rstrip(".") if doc else ""


def _rivals(model: Model, ids: Sequence[str], axes: int) -> dict[str, str]:
    """Of effects and defects that another can't be told from, by id: their forces, "" where they are none."""
    shown = {i: forces(effect_of(model, i)) for i in ids}
    return {i: ", ".join(_formulas(model, {"id": i, **own}, axes)) if own else "" for i, own in shown.items()}


def _formulas(model: Model, effect: Mapping[str, Any], axes: int) -> list[str]:
    """The terms of an effect: its forces, or what its file changes."""
    forces = {f"F_{axis}": effect.get(f"force_{axis}") for axis in "xy"}
    terms = {key: str(text) for key, text in forces.items() if text and str(text) != "0"}
    if not terms:
        try:
            own = model.effect(effect["id"])
        except InputError:
            return []
        terms = {key: str(text) for key, text in own.terms().items()} if hasattr(own, "terms") else {}
    return [
        f"{key} = {text}".replace("**", "^").replace("*", "·")
        for key, text in terms.items()
        if axes == 2 or not key.endswith("_y")
    ]


def _parameters(data: Dataset, model: Model, found: Diagnosis) -> list[dict[str, Any]]:
    """Every fitted parameter, and those held as known, with its value at each stage."""
    first, refit, last = (found.stages[k].parameters for k in (0, min(1, len(found.stages) - 1), -1))
    rows = []
    for name, value in last.items():
        own = found.device.get(name)
        text = uncertain(own.value, own.low, own.high) if own else f"{significant(value, 5)} (held)"
        quantity = quantity_of(model, name)
        sized = quantity.role in ("size", "shape") and name not in data.nominal
        rows.append({"name": name, "unit": quantity.unit, "nominal": first.get(name),
                     "refit": None if sized and name not in refit else refit.get(name), "text": text})  # fmt: skip
    return rows


def _detectable(model: Model, sizes: Mapping[str, Mapping[str, float | None]]) -> list[dict[str, Any]]:
    rows = []
    for effect, own in sorted(sizes.items()):
        for name, size in own.items():
            rows.append({"effect": effect, "parameter": name, "size": size, "unit": quantity_of(model, name).unit})
    return rows


__all__ = ["render"]
