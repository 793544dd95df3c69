"""How blind trials are graded."""

import numpy as np
import pytest

from benchmarks.blind.grade import Grade, grade
from benchmarks.blind.summary import by_probability, wilson


def result_of(
    label: dict[str, object], effects: list[dict[str, object]], verdict: str = "missing effects", **rest: object
) -> Grade:
    full = {"level": "", "floor": 1e-4, "multiple": {"": 10.0}, "parameters": {}, **label}
    answer = {"verdict": verdict, "effects": effects, "doubts": [], "misfit": {"final": 1.1e-4, "refit": 5e-4},
              **rest}  # fmt: skip
    graded = grade({"id": "kind-effect-0", "label": full, "answer": answer, "cpu_s": 1.0})
    assert graded is not None
    return graded


def said(name: str, *either: str, **rest: object) -> dict[str, object]:
    return {"id": name, "either": list(either), "parameters": {}, "probability": 0.9, **rest}


@pytest.mark.parametrize(
    ("truth", "found", "right"),
    [
        (["a"], [said("a")], True),
        (["a"], [said("b", "a")], True),
        (["a"], [said("b")], False),
        (["a"], [said("a"), said("b")], False),
        (["a", "b"], [said("b", "a"), said("c", "b")], True),
        (["a", "b"], [said("b", "a"), said("c")], False),
        (["a", "b"], [said("a", "b")], False),
    ],
)
def test_grade_of_named_effects(truth: list[str], found: list[dict[str, object]], right: bool) -> None:
    assert result_of({"kind": "pair", "effects": truth}, found).right is right


def test_grade_of_intervals_and_misfit() -> None:
    values = {"p": {"value": 1.4, "low": 1.0, "high": 2.0}, "q": {"value": 1.4, "low": 1.0, "high": 2.0},
              "r": {"value": 0.5, "low": None, "high": 1.0}}  # fmt: skip
    label = {"kind": "single", "effects": ["a"], "parameters": {"p": 1.5, "q": 2.5, "r": 0.0}}
    found = result_of(label, [said("a") | {"parameters": values}])
    assert found.covered == {"p": True, "q": False}
    assert found.valued  # 2.5 lies within 1.4 + 2 (2.0 - 1.4)
    assert not result_of(label | {"parameters": {"q": 2.7}}, [said("a") | {"parameters": values}]).valued
    assert found.ratio == pytest.approx(1.1)


@pytest.mark.parametrize(
    ("text", "right", "formula"),
    [
        ("-3.1*x**5", True, True),
        ("-3.1*x**5 + 40*x", True, True),
        ("-discovered_1_x*x**5", True, True),
        ("-2*x**2", True, False),
        ("nonsense(", True, False),
    ],
)
def test_grade_of_discovered_terms(text: str, right: bool, formula: bool) -> None:
    points = np.random.default_rng(0).normal(size=(200, 6)).tolist()
    label = {"kind": "unknown", "effects": [], "parameters": {"c": 3.0}, "force_x": "-c*x**5", "force_y": "0",
             "points": points}  # fmt: skip
    finding = said("discovered_1", force_x=text, force_y="0") | {"parameters": {"discovered_1_x": {"value": 3.1}}}
    found = result_of(label, [finding])
    assert (found.right, found.formula) == (right, formula)
    assert not result_of(label, [said("cubic_stiffness")]).right
    assert not result_of(label, [], "nothing missing").right
    assert result_of(label, [], "unexplained").right


def test_held_out_runs_that_get_worse_without_a_doubt_are_counted() -> None:
    label = {"kind": "single", "effects": ["a"]}
    assert not result_of(label, [said("a")]).worse
    assert result_of(label, [said("a")], misfit={"final": 6e-4, "refit": 5e-4}).worse
    assert not result_of(label, [said("a")], misfit={"final": 6e-4, "refit": 5e-4}, doubts=["of a"]).worse
    assert not result_of(label, [], misfit={"final": 6e-4, "refit": 5e-4}).worse


def test_grade_of_inseparable_effects() -> None:
    before, after = ({"kind": "inseparable", "level": s, "effects": ["a"], "rival": "b"} for s in ("before", "after"))
    assert result_of(before, [said("b", "a")]).right
    assert not result_of(before, [said("a")]).right
    assert result_of(after, [said("a")]).right
    assert not result_of(after, [said("a", "b")]).right


def test_wilson_by_hand() -> None:
    # 0 of 400: z²/(n + z²) = 3.8415/403.8415; 5 of 10 is symmetric about a half.
    assert wilson(0, 400) == (0.0, pytest.approx(0.009512, abs=1e-6))
    assert wilson(400, 400)[1] == 1.0
    assert sum(wilson(5, 10)) == pytest.approx(1)
    assert wilson(0, 0) == (0.0, 1.0)


def test_probabilities_are_held_against_what_is_true() -> None:
    label = {"kind": "single", "effects": ["a"]}
    right, wrong = (result_of(label, [said(name, "b", probability=0.7)]) for name in ("a", "b"))
    assert (right.said, wrong.said) == (((0.7, True),), ((0.7, False),))
    [bin_, error] = by_probability([right, right, right, wrong])
    assert (bin_.values["rate"], bin_.values["mean said"], bin_.values["of"]) == (0.75, pytest.approx(0.7), 4)
    assert error.values["rate"] == pytest.approx(0.05)
