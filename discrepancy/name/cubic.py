"""Effects that are forces of third order in the motion of one axis, and their sizes by those of such forces."""

from collections.abc import Sequence
from typing import Final

from sympy import sympify

from discrepancy.fit.defect import Defect
from gyro_model import symbols
from gyro_model.anatomy import Effect, Force

MONOMIALS: Final = tuple((x**3, x**2 * v) for x, v in ((symbols.x, symbols.x_dot), (symbols.y, symbols.y_dot)))
"""Of each axis, in the order of ``Bent.cubic``."""


def cubic_sizes(effect: Effect | Defect, cubic: Sequence[tuple[float, float]]) -> dict[str, float]:
    """Sizes, by name, of an effect that is forces -k3 x³ and -d2 x² x' and nothing else, by those of each axis that is
    measured, (k3, d2) [N/m³, N.s/m³]; none of another."""
    if not isinstance(effect, Force) or effect.states or effect.nominal:
        return {}
    found: dict[str, float] = {}
    for term, monomials, own in zip(effect.force, MONOMIALS, cubic, strict=False):
        for q in effect.sizes:
            slope = sympify(term).diff(q.symbol)
            found.update((q.name, c) for monomial, c in zip(monomials, own, strict=True) if slope + monomial == 0)
    # Of the axes that are measured: one that has another size is not known by these.
    acting = set().union(*(sympify(term).free_symbols for term in effect.force[: len(cubic)]))
    known = {q.name for q in effect.sizes if q.symbol in acting} == found.keys()
    return found if known else {}
