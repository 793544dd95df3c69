"""From terms in equations of motion to names of effect files, as favourably as can be without knowing the answer."""

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Any, Final

from sympy import Expr, Integer, Symbol

from discrepancy.terms.library import SIGNALS, Form, forms, known
from gyro_model import symbols
from gyro_model.model import load_model

Term = tuple[Expr, int]
"""A product of signals without its coefficient, and the axis (0 or 1) that it pushes."""

RATE: Final[Symbol] = symbols.omega_z
LINEAR: Final = (
    *SIGNALS, RATE * symbols.x_dot, RATE * symbols.y_dot, RATE**2 * symbols.x, RATE**2 * symbols.y,
)  # fmt: skip
"""What acts in the linear device in a turning frame, which is no missing effect."""
ONE: Final = Integer(1)


@cache
def products() -> tuple[Expr, ...]:
    """Every product of signals in the diagnosis' own library, and the constant, without coefficients."""
    found = {bare(e): None for form in forms(2) for part in form.parts for e in part if e != 0}
    return (ONE, *found)


def bare(product: Expr) -> Expr:
    """A product without its number."""
    return product.as_coeff_Mul()[1]


@cache
def _names() -> Mapping[Term, tuple[str, ...]]:
    """The effects that state a term."""
    constant = Form("term_0", ((ONE, Integer(0)), (Integer(0), ONE)))
    library = {form.id: form for form in (constant, *forms(2))}
    found: dict[Term, dict[str, None]] = {}
    for id_, (effect, sizes) in known(load_model(), library.values()).items():
        for part, size in zip(library[id_].parts, sizes, strict=True):
            for axis in (0, 1):
                if size is not None and part[axis] != 0:
                    found.setdefault((bare(part[axis]), axis), {})[effect.id] = None
    return {term: tuple(ids) for term, ids in found.items()}


def answer(terms: Mapping[Term, float]) -> dict[str, Any]:
    """The report of a rival, in the form that the trials are graded by.

    terms: accelerations by term, with their coefficients. Terms of effect files become a finding an effect, an
    effect that shares them goes into ``either``; all others together are one discovered force.
    """
    named: dict[tuple[str, ...], None] = {}
    force = [Integer(0), Integer(0)]
    for (product, axis), coefficient in terms.items():
        ids = _names().get((product, axis), ())
        if ids:
            named[ids] = None
        else:
            force[axis] += coefficient * product
    findings = [_finding(ids[0], ids[1:]) for ids in named]
    if any(f != 0 for f in force):
        findings.append(_finding("discovered_1", (), force_x=str(force[0]), force_y=str(force[1])))
    # A regression simulates nothing, so that it cannot tell whether held-out runs get worse.
    return {"verdict": "missing effects" if findings else "nothing missing", "effects": findings,
            "doubts": ["not simulated"]}  # fmt: skip


def _finding(id_: str, either: Iterable[str], **rest: str) -> dict[str, Any]:
    # Neither rival tells an interval or a probability; the grade takes what is not told as such.
    return {"id": id_, "either": list(either), "parameters": {}, "probability": 1.0, **rest}
