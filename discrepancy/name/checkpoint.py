"""The state of a search on disk, so that an interrupted one resumes where it was and gives the same answer.

The file is data: every entry is checked against ``checkpoint_schema.py`` before anything is made of it, and terms that
were found are formulas in a grammar of their own (``formula.py``). Its key is the hash of data, model, options and
code, so that it resumes on any machine and with nothing else.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from math import isclose
from pathlib import Path
from typing import Any, Final

import numpy as np

from discrepancy.data.dataset import Dataset
from discrepancy.fit.continuation import cut
from discrepancy.fit.defect import effect_of, quantity_of
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.variation import Seen
from discrepancy.fit.whitening import Setting
from discrepancy.name.accepted import Dropped
from discrepancy.name.checkpoint_schema import checked, term_from, term_state
from discrepancy.name.columns import Candidate, Probe
from discrepancy.name.score import Score, Step
from discrepancy.terms.effect_file import Term, joined
from gyro_model.build import model_token
from gyro_model.digest import digest_of
from gyro_model.errors import InputError
from gyro_model.model import Model
from gyro_model.whole_file import whole_file

FORMAT: Final = 6
LARGEST: Final = 50_000_000
"""Bytes of a file that is read: ten times that of a search of 100 runs with six effects."""

REPEATS: Final = 1e-6
"""Relative difference of a sum of squares worked out again: on another machine's mathematical library the simulation
differs by rounding."""


def digest(dataset: Dataset, model: Model, settings: Mapping[str, Any]) -> str:
    """Names a search: data, nominal values, model, settings and the code that searches."""
    code = hashlib.sha256((model_token(model) + _code()).encode())
    code.update(
        json.dumps([dict(sorted(dataset.nominal.items())), dataset.unknown, dict(settings)], sort_keys=True).encode()
    )
    for record in dataset.records:
        code.update(f"{record.name} {record.role} {record.hold} {record.senses} {record.sample_rate}".encode())
        for name, values in sorted({"t": record.t, **record.channels}.items()):
            # Little endian, whatever the machine.
            code.update(name.encode() + values.astype("<f8").tobytes())
    return code.hexdigest()


@cache
def _code() -> str:
    """Digest of the searching package's files."""
    return digest_of(Path(__file__).parents[1])


def save(path: Path, key: str, state: Mapping[str, Any]) -> None:
    """Writes ``state`` (plain Python) under the search's ``key``; an older file is replaced whole."""
    with whole_file(path) as file:
        file.write(json.dumps({"format": FORMAT, "key": key, "state": state}).encode())


def load(path: Path | None, key: str, dataset: Dataset, model: Model) -> dict[str, Any] | None:
    """The state kept for the search ``key``, every entry checked, ``terms`` as ``Term``; None where there is none, or
    that of another search, which then starts anew. Raises InputError for a file that no search has written."""
    if path is None or not path.is_file():
        return None
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(f"it has {path.stat().st_size} bytes, over {LARGEST}")
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"it is no JSON ({type(error).__name__})") from None
    if not isinstance(content, dict) or (content.get("format"), content.get("key")) != (FORMAT, key):
        return None
    state = content.get("state")
    if not isinstance(state, dict) or not isinstance(state.get("terms"), list):
        raise InputError("state: give a table with a list of terms")
    terms = terms_from(state["terms"], dataset.axes)
    checked(state, joined(model, [term.effect for own in terms for term in own]), dataset)
    return {**state, "terms": terms}


def fit_state(whole: Fitter, fitter: Fitter, at: Fitted) -> dict[str, Any]:
    """What ``fit_from`` needs to make ``at`` again, bit by bit."""
    return {
        "pieces": len(fitter.records) // len(whole.records),
        "parameters": dict(at.parameters),
        "starts": [dict(start) for start in at.starts],
        "free": [asdict(free) for free in at.free],
        "setting": asdict(at.whiten.setting),
        "square": _square(at),
    }


def fit_from(whole: Fitter, state: Mapping[str, Any]) -> tuple[Fitter, Fitted]:
    """The fitter and the fit of ``fit_state``, linearised. Raises InputError where it does not leave what the state
    says."""
    fitter, at = _evaluated(whole, state)
    if not isclose(_square(at), state["square"], rel_tol=REPEATS):
        raise InputError(f"its fit leaves {_square(at):.6g} V², not {state['square']:.6g} as it says")
    return fitter, fitter.with_grams(at)


def on_other_data(whole: Fitter, state: Mapping[str, Any]) -> dict[str, Any]:
    """The ``fit_state`` of the same fit, held, to the runs of ``whole``, from which more was taken out."""
    return {**state, "square": _square(_evaluated(whole, state)[1])}


def _evaluated(whole: Fitter, state: Mapping[str, Any]) -> tuple[Fitter, Fitted]:
    fitter = cut(whole, state["pieces"])
    # A resumed search has nothing kept, and the one that goes on is to find the same.
    fitter.forget()
    parameters = state["parameters"]
    setting = Setting(**{**state["setting"], "colour": tuple(state["setting"]["colour"])})
    whiten = fitter.whitener(parameters, setting)
    free = tuple(Free(**entry) for entry in state["free"])
    return fitter, fitter.evaluated(Fitted(parameters, tuple(state["starts"]), free, whiten, ()))


def columns_state(columns: Seen) -> dict[str, Any]:
    """What ``columns_into`` needs: of kinds of columns, and of what they stand beside, which the variation serves."""
    return {
        "kinds": [[list(map(list, kind)), int(alike)] for kind, alike in columns.kinds.items()],
        "bases": [[sorted(base), int(alike)] for base, alike in columns.bases.items()],
    }


def columns_into(columns: Seen, state: Mapping[str, Any]) -> None:
    """Has ``columns`` know what ``state`` says, and no more."""
    columns.kinds.clear()
    columns.bases.clear()
    columns.kinds.update({tuple((n, v) for n, v in kind): bool(alike) for kind, alike in state["kinds"]})
    columns.bases.update({frozenset(base): bool(alike) for base, alike in state["bases"]})


def _square(at: Fitted) -> float:
    """Sum of squares of the residuals [V²]."""
    with np.errstate(over="ignore"):
        return float(sum(np.sum(residual**2) for residual in at.residuals))


def terms_state(terms: Sequence[Sequence[Term]]) -> list[list[dict[str, Any]]]:
    """What ``terms_from`` needs: of each further search, its terms as formulas."""
    return [[term_state(term) for term in own] for own in terms]


def terms_from(state: Sequence[Any], axes: int) -> list[tuple[Term, ...]]:
    """The terms of ``terms_state``. Raises InputError for a formula that the library of terms does not have."""
    found = []
    for own in state:
        if not isinstance(own, list):
            raise InputError("terms: give a list of lists")
        found.append(tuple(term_from(entry, axes) for entry in own))
    return found


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
    probes = tuple(Probe(quantity_of(model, name), step, power) for name, step, power in state["probes"])
    partner = candidate_from(model, state["partner"]) if state["partner"] else None
    searched = tuple(model.parameter(name) for name in state["searched"])
    return Candidate(effect_of(model, state["effect"]), probes, state["shapes"], searched, state["trials"], partner)


def dropped_state(dropped: Dropped) -> list[Any]:
    """What ``dropped_from`` needs."""
    return [candidate_state(dropped.candidate), {n: list(size) for n, size in dropped.sizes.items()}, dropped.share]


def dropped_from(model: Model, state: list[Any]) -> Dropped:
    """What was taken out, of ``dropped_state``."""
    candidate, sizes, share = state
    return Dropped(candidate_from(model, candidate), {n: (v, d) for n, (v, d) in sizes.items()}, share)


def step_state(step: Step) -> list[Any]:
    """What ``step_from`` needs."""
    scores = {name: asdict(score) for name, score in step.scores.items()}
    for score in scores.values():
        del score["moves"]
    return [scores, step.accepted]


def step_from(state: list[Any]) -> Step:
    """The step of ``step_state``."""
    return Step({name: Score(**score) for name, score in state[0].items()}, state[1])


def probes_state(kept: Mapping[tuple[str, str], tuple[Probe, float]]) -> list[list[Any]]:
    """What ``probes_from`` needs."""
    return [[*key, probe.step, probe.power, target] for key, (probe, target) in kept.items()]


def probes_from(model: Model, state: list[list[Any]]) -> dict[tuple[str, str], tuple[Probe, float]]:
    """The probes of ``probes_state``."""
    return {(name, beside): (Probe(quantity_of(model, name), step, power), target)
            for name, beside, step, power, target in state}  # fmt: skip
