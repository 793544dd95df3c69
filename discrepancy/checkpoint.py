"""The state of a search on disk, so that an interrupted one resumes where it was and gives the same answer."""

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from discrepancy.answer import Step
from discrepancy.columns import Candidate, Probe
from discrepancy.continuation import cut
from discrepancy.dataset import Dataset
from discrepancy.effect_file import write_text
from discrepancy.fitted import Fitted, Free
from discrepancy.refit import Fitter
from discrepancy.score import Score
from discrepancy.whitening import Setting
from gyro_model.build import model_token
from gyro_model.model import Model

FORMAT: Final = 2


def digest(dataset: Dataset, model: Model, settings: Mapping[str, Any]) -> str:
    """Names a search: data, nominal values, model and settings."""
    code = hashlib.sha256(model_token(model).encode())
    code.update(json.dumps([dict(sorted(dataset.nominal.items())), dict(settings)], sort_keys=True).encode())
    for record in dataset.records:
        code.update(f"{record.name} {record.role} {record.hold} {record.sample_rate}".encode())
        for name, values in sorted({"t": record.t, **record.channels}.items()):
            code.update(name.encode() + values.tobytes())
    return code.hexdigest()


def save(path: Path, key: str, state: Mapping[str, Any]) -> None:
    """Writes ``state`` (plain Python) under the search's ``key``; an older file is replaced whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(path.name + ".part")
    beside.write_text(json.dumps({"format": FORMAT, "key": key, "state": state}), encoding="utf-8")
    os.replace(beside, path)


def load(path: Path | None, key: str) -> dict[str, Any] | None:
    """The state kept for the search ``key``; None where there is none, or that of another search, which then starts
    anew."""
    if path is None:
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    same = isinstance(content, dict) and content.get("format") == FORMAT and content.get("key") == key
    return content["state"] if same else None


def fit_state(whole: Fitter, fitter: Fitter, at: Fitted) -> dict[str, Any]:
    """What ``fit_from`` needs to make ``at`` again, bit by bit."""
    return {
        "pieces": len(fitter.records) // len(whole.records),
        "parameters": dict(at.parameters),
        "starts": [dict(start) for start in at.starts],
        "free": [asdict(free) for free in at.free],
        "setting": asdict(at.whiten.setting),
    }


def fit_from(whole: Fitter, state: Mapping[str, Any]) -> tuple[Fitter, Fitted]:
    """The fitter and the fit of ``fit_state``, linearised."""
    fitter = cut(whole, state["pieces"])
    # A resumed search has nothing kept, and the one that goes on is to find the same.
    fitter.forget()
    parameters = state["parameters"]
    whiten = fitter.whitener(parameters, Setting(**state["setting"]))
    free = tuple(Free(**entry) for entry in state["free"])
    return fitter, fitter.with_grams(fitter.evaluated(Fitted(parameters, tuple(state["starts"]), free, whiten, ())))


def terms_state(terms: Sequence[Sequence[Path]]) -> list[dict[str, str]]:
    """What ``terms_from`` needs: of each further search, its effect files whole, by name."""
    return [{path.name: path.read_text(encoding="utf-8") for path in files} for files in terms]


def terms_from(state: Sequence[Mapping[str, str]], folder: Path) -> list[tuple[Path, ...]]:
    """The effect files of ``terms_state``, written to ``folder``. Raises InputError where that can't be."""
    return [tuple(write_text(folder / name, text) for name, text in files.items()) for files in state]


def candidate_state(candidate: Candidate) -> dict[str, Any]:
    """What ``candidate_from`` needs."""
    return {
        "effect": candidate.effect.id,
        "probes": [[p.quantity.name, p.step, p.power] for p in candidate.probes],
        "shapes": dict(candidate.shapes),
        "searched": [q.name for q in candidate.searched],
        "trials": candidate.trials,
        "partner": candidate_state(candidate.partner) if candidate.partner else None,
    }


def candidate_from(model: Model, state: Mapping[str, Any]) -> Candidate:
    """The candidate of ``candidate_state``."""
    probes = tuple(Probe(model.parameter(name), step, power) for name, step, power in state["probes"])
    partner = candidate_from(model, state["partner"]) if state["partner"] else None
    searched = tuple(model.parameter(name) for name in state["searched"])
    return Candidate(model.effect(state["effect"]), probes, state["shapes"], searched, state["trials"], partner)


def step_state(step: Step) -> list[Any]:
    """What ``step_from`` needs."""
    return [{name: asdict(score) for name, score in step.scores.items()}, step.accepted]


def step_from(state: list[Any]) -> Step:
    """The step of ``step_state``."""
    return Step({name: Score(**score) for name, score in state[0].items()}, state[1])


def probes_state(kept: Mapping[tuple[str, str], tuple[Probe, float]]) -> list[list[Any]]:
    """What ``probes_from`` needs."""
    return [[*key, probe.step, probe.power, target] for key, (probe, target) in kept.items()]


def probes_from(model: Model, state: list[list[Any]]) -> dict[tuple[str, str], tuple[Probe, float]]:
    """The probes of ``probes_state``."""
    return {(name, beside): (Probe(model.parameter(name), step, power), target)
            for name, beside, step, power, target in state}  # fmt: skip
