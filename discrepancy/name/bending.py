"""Forces that bend the response of a mass far from a linear one: in its model before anything is fitted, since a linear
fit ends at another mass, from where no column shows them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, Final

from sympy import sympify

from discrepancy.data.linear_fit import fit, joined_form
from discrepancy.data.linear_start import Bent, bent_response
from discrepancy.fit.continuation import grown
from discrepancy.fit.defect import Defect
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import damped
from discrepancy.name.accepted import Taken
from discrepancy.name.columns import Candidate
from gyro_model import symbols
from gyro_model.anatomy import Effect, Force

if TYPE_CHECKING:
    from discrepancy.name.search import Search

FAR: Final = 0.2
"""Share of the force that a linear model leaves unexplained, from which its fit may end at another mass: at 0.12 one
was found, at 0.28 none."""
STRAIGHTER: Final = 0.25
"""Share of that which forces of third order may leave, to be what bends the response."""
PLAINLY: Final = 0.25
"""Times the residual of the linear fit that theirs leaves at most, to be taken before anything else is scored."""

MONOMIALS: Final = tuple((x**3, x**2 * v) for x, v in ((symbols.x, symbols.x_dot), (symbols.y, symbols.y_dot)))
"""Of each axis, in the order of ``Bent.cubic``."""


def bending(search: "Search") -> Taken | None:
    """The model with those effects that are forces of third order in the motion of one axis, where a weak form says
    that they bend the response and a fit with them leaves plainly less; None where not."""
    records, whole = search.dataset.fit, search.whole
    if not any(r.u.any() for r in records):
        return None
    form, told = joined_form(records, search.nominal), bent_response(records, search.nominal)
    if form is None or told is None:
        return None
    linear = fit(form, search.nominal)
    upright = all(told.linear[name] > 0 for name in ("m", "kxx", "kyy") if name in told.linear)
    if linear.unexplained < FAR or told.left > STRAIGHTER * linear.unexplained or not upright:
        return None
    known = search.library.candidates(whole, search.at, search.present, lambda e: bool(_sizes(e, told)))
    plain = whole.fit(replace(search.at, whiten=whole.plain(search.at.parameters)))
    ends = [
        _fitted(search, own, told, plain) for count in range(1, len(known) + 1) for own in combinations(known, count)
    ]
    best = min(ends, key=lambda end: end.price(search.criteria), default=None)
    return best if best and whole.off(best.at) <= PLAINLY * whole.off(plain) else None


def _fitted(search: "Search", taken: Sequence[Candidate], told: Bent, plain: Fitted) -> Taken:
    """The fit that begins with the forces of ``told``."""
    values, free = {**search.at.parameters, **damped(told.linear, search.nominal)}, [*search.at.free]
    for own in taken:
        sizes = _sizes(own.effect, told)
        values |= {p.quantity.name: sizes[p.quantity.name] for p in own.probes}
        free += own.free(search.whole.period)
    begun = replace(search.at, parameters=values, free=tuple(free), whiten=plain.whiten)
    return Taken(search.whole.fit(grown(search.whole, begun)), taken, plain)


def _sizes(effect: Effect | Defect, told: Bent) -> dict[str, float]:
    """Sizes of an effect that is such a force and nothing else, by name; none of another."""
    if not isinstance(effect, Force) or effect.states or effect.nominal:
        return {}
    found: dict[str, float] = {}
    for term, monomials, cubic in zip(effect.force, MONOMIALS, told.cubic, strict=False):
        for q in effect.sizes:
            slope = sympify(term).diff(q.symbol)
            found.update((q.name, c) for monomial, c in zip(monomials, cubic, strict=True) if slope + monomial == 0)
    # Of the axes that are measured: one that has another size is not known by these.
    acting = set().union(*(sympify(term).free_symbols for term in effect.force[: len(told.cubic)]))
    known = {q.name for q in effect.sizes if q.symbol in acting} == found.keys()
    return found if known else {}
