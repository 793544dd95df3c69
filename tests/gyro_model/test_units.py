"""Units as text: what they mean, and what is refused."""

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gyro_model.effect_points import MODEL
from gyro_model.errors import InputError
from gyro_model.units import UNITS, Dimension, dimension, rate_unit, text_of

# A bare 1 stands alone or above a line; within a product its digit would be an exponent.
names = st.sampled_from(sorted(set(UNITS) - {"1"}))
powers = st.integers(-4, 4).filter(bool)
factors = st.tuples(names, powers)


def text(pairs: list[tuple[str, int]]) -> str:
    return ".".join(f"{name}{power if power != 1 else ''}" for name, power in pairs)


@pytest.mark.parametrize(
    ("unit", "kg", "m", "s", "a", "k"),
    [
        ("1", 0, 0, 0, 0, 0),
        ("N", 1, 1, -2, 0, 0),
        ("N/m", 1, 0, -2, 0, 0),
        ("N.s/m3", 1, -2, -1, 0, 0),
        ("V", 1, 2, -3, -1, 0),
        ("J/K", 1, 2, -2, 0, -1),
        ("N/(m.V2)", -1, -4, 4, 2, 0),
        ("V/Hz0.5", 1, 2, Fraction(-5, 2), -1, 0),
        ("1/s", 0, 0, -1, 0, 0),
    ],
)
def test_dimensions_by_hand(unit: str, kg: int, m: int, s: int, a: int, k: int) -> None:
    assert dimension(unit) == Dimension(*(Fraction(value) for value in (kg, m, s, a, k)))


@pytest.mark.parametrize("unit", ["m", "m/s", "K", "V", "N/m", "m/s2"])
def test_unit_of_a_rate(unit: str) -> None:
    assert dimension(rate_unit(unit)) == dimension(unit) * dimension("1/s")


@given(st.lists(factors, min_size=1, max_size=4), st.lists(factors, min_size=1, max_size=4))
def test_products_and_quotients(above: list[tuple[str, int]], below: list[tuple[str, int]]) -> None:
    product = dimension(text(above)) * dimension(text(below))
    assert dimension(f"{text(above)}.{text(below)}") == product
    quotient = dimension(f"{text(above)}/({text(below)})")
    assert quotient * dimension(text(below)) == dimension(text(above))


@given(names, powers, powers)
def test_powers_add_up(name: str, first: int, second: int) -> None:
    assert dimension(f"{name}{first}.{name}{second}") == dimension(name) ** Fraction(first + second)


@given(st.lists(factors, min_size=1, max_size=5), st.randoms())
def test_order_does_not_matter(pairs: list[tuple[str, int]], random) -> None:
    shuffled = pairs.copy()
    random.shuffle(shuffled)
    assert dimension(text(shuffled)) == dimension(text(pairs))


@pytest.mark.parametrize("unit", ["", "/s", "N/", "Nm", "N m", "m/s/s", "m^2", "kgs", "2", "N..m", "V/√Hz", "Ω"])
def test_what_is_no_unit_is_refused(unit: str) -> None:
    with pytest.raises(InputError, match="factor"):
        dimension(unit)


def test_a_near_unit_is_suggested() -> None:
    with pytest.raises(InputError, match=r"unit 'N/radd': factor 'radd' is unknown; did you mean 'rad'\?"):
        dimension("N/radd")


@pytest.mark.parametrize("quantity", MODEL.quantities, ids=lambda q: q.name)
def test_every_quantity_has_a_unit(quantity) -> None:
    assert dimension(text_of(dimension(quantity.unit))) == dimension(quantity.unit)


@pytest.mark.parametrize("unit", ["1", "N", "N/m3", "N.s/m", "kg/m3", "V/m", "m/s2", "rad/s", "1/K", "N.m2", "V.s0.5"])
def test_a_dimension_as_text_is_read_back(unit: str) -> None:
    assert text_of(dimension(unit)) == unit
