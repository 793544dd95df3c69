"""Whether an answer is right: the label against the report, one trial at a time."""

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
import sympy

from benchmarks.blind.difficulties import UNSEEN

DISCOVERED: Final = "discovered_"
ALIKE: Final = 0.95
"""Correlation from which a formula counts as the true one, both without what the nominal terms imitate."""
VALUED: Final = 2.0
"""Of the 95 % interval: four standard errors, which the right value leaves by chance in one of 16,000."""
STATES: Final = ("x", "y", "x_dot", "y_dot", "u_x", "u_y")


class Grade(NamedTuple):
    """kind, level, truth: from the label; named: what was said; right: as the results' row asks; exact: without the
    help of ``either``; covered: by true parameter, whether its interval holds it; ratio: final misfit over the true
    noise floor, None where there is none; multiple: the smallest of the effects, of the detectable size; said: of each
    name of an effect file its probability, and whether it is true; worse: effects were named without a doubt, and the
    misfit of held-out runs is larger with them than of the refitted device without; valued: right, and every true
    parameter within VALUED of its interval."""

    id: str
    kind: str
    level: str
    truth: tuple[str, ...]
    named: tuple[str, ...]
    verdict: str
    right: bool
    exact: bool
    covered: Mapping[str, bool]
    ratio: float | None
    refit_ratio: float | None
    multiple: float
    formula: bool | None
    cpu_s: float
    said: tuple[tuple[float, bool], ...]
    worse: bool
    valued: bool


def grade(result: Mapping[str, Any]) -> Grade | None:
    """The grade of a result; None where the trial could not be made."""
    if "not_made" in result:
        return None
    label, answer = result["label"], result["answer"]
    findings = answer.get("effects", [])
    truth, named = tuple(label["effects"]), tuple(f["id"] for f in findings)
    verdict = "error" if "error" in answer else str(answer["verdict"])
    exact = verdict != "error" and sorted(named) == sorted(truth)
    record = {f["id"] for f in answer.get("record", [])}
    misfit, floor = answer.get("misfit", {}), label["floor"]
    right = _right(label, verdict, findings, record)
    return Grade(
        id=result["id"], kind=label["kind"], level=str(label["level"]), truth=truth, named=named, verdict=verdict,
        right=right, exact=exact, covered=dict(_covered(label, findings)),
        ratio=_over(misfit.get("final"), floor), refit_ratio=_over(misfit.get("refit"), floor),
        multiple=min(label.get("multiple", {"": 0.0}).values()), formula=_formula(label, findings),
        cpu_s=float(result["cpu_s"]),
        said=tuple((float(f["probability"]), f["id"] in truth) for f in findings
                   if not f["id"].startswith(DISCOVERED)),
        worse=bool(findings) and not answer["doubts"] and misfit["final"] > misfit["refit"],
        valued=right and all(dict(_covered(label, findings, VALUED)).values()),
    )  # fmt: skip


def _over(misfit: float | None, floor: float) -> float | None:
    return None if misfit is None else misfit / floor


def _meant(finding: Mapping[str, Any]) -> set[str]:
    return {finding["id"], *finding["either"]}


def _right(label: Mapping[str, Any], verdict: str, findings: list[Mapping[str, Any]], record: set[str]) -> bool:
    if verdict == "error":
        return False
    kind, truth = label["kind"], list(label["effects"])
    if kind == "null":
        return verdict == "nothing missing" and not findings
    if kind == "unknown":
        return verdict != "nothing missing" and all(f["id"].startswith(DISCOVERED) for f in findings)
    if kind == "inseparable":
        both = {*truth, label["rival"]}
        if label["level"] == "before":
            return len(findings) == 1 and both <= _meant(findings[0])
        return len(findings) == 1 and findings[0]["id"] == truth[0] and label["rival"] not in findings[0]["either"]
    if kind == "difficulty" and not {*label["record"]} <= record | UNSEEN:
        return False
    return len(findings) == len(truth) and _matched(truth, findings)


def _matched(truth: list[str], findings: list[Mapping[str, Any]]) -> bool:
    """Whether every true effect has a finding of its own that means it."""
    if not truth:
        return True
    return any(
        truth[0] in _meant(finding) and _matched(truth[1:], findings[:place] + findings[place + 1 :])
        for place, finding in enumerate(findings)
    )


def _covered(
    label: Mapping[str, Any], findings: Iterable[Mapping[str, Any]], wide: float = 1.0
) -> Iterable[tuple[str, bool]]:
    """True parameters of effects that were named by their own name, and whether the interval holds them, made ``wide``
    times as wide about the value."""
    for finding in findings:
        if finding["id"] in label["effects"]:
            for name, said in finding["parameters"].items():
                true = label["parameters"].get(name)
                if true is not None and None not in (said["low"], said["high"]):
                    low, high = (said["value"] + wide * (said[end] - said["value"]) for end in ("low", "high"))
                    yield name, bool(low <= true <= high)


def _formula(label: Mapping[str, Any], findings: list[Mapping[str, Any]]) -> bool | None:
    """Of a term in no file: whether the forces of all findings together are the true one on the motion."""
    if label["kind"] != "unknown":
        return None
    points = np.array(label["points"])
    try:
        said = np.concatenate([sum((_said(f, axis, points) for f in findings), np.zeros(len(points))) for axis in "xy"])
    except (sympy.SympifyError, TypeError, NameError, SyntaxError):
        return False
    size = label["parameters"]["c"]
    true = np.concatenate([_values(label[f"force_{axis}"], points, {"c": size}) for axis in "xy"])
    said, true = _nonlinear(said, points), _nonlinear(true, points)
    length = float(np.linalg.norm(said) * np.linalg.norm(true))
    return bool(length > 0 and said @ true > ALIKE * length)


def _said(finding: Mapping[str, Any], axis: str, points: np.ndarray) -> np.ndarray:
    """The force of a finding on an axis, its parameters at the values that it gives."""
    parameters = {name: entry["value"] for name, entry in finding.get("parameters", {}).items()}
    return _values(finding.get(f"force_{axis}") or "0", points, parameters)


def _values(text: str, points: np.ndarray, parameters: Mapping[str, float]) -> np.ndarray:
    symbols = sympy.symbols(STATES, real=True)
    names = dict(zip(STATES, symbols, strict=True)) | {name: sympy.Float(v) for name, v in parameters.items()}
    function = sympy.lambdify(symbols, sympy.sympify(text, locals=names), "numpy")
    return np.broadcast_to(function(*points.T), len(points)).astype(float)


def _nonlinear(force: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A force (2n,) without its part linear in positions, velocities and drives, each axis for itself."""
    scaled = points / np.abs(points).max(axis=0)
    axes = np.split(force, 2)
    return np.concatenate([f - scaled @ np.linalg.lstsq(scaled, f, rcond=None)[0] for f in axes])
