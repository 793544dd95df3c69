"""Numbers as they are written."""

import pytest

from gyrotwin.numbers import in_unit, significant, with_error


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(1449.0, 3, "1450"), (98765.0, 2, "99000"), (123456.0, 3, "1.23e+05"), (-0.0, 3, "0"), (2e10, 3, "2e+10"),
     (1.234e-7, 3, "1.23e-07"), (0.5, 3, "0.5"), (None, 3, "–")],
)  # fmt: skip
def test_significant_digits(value: float | None, digits: int, text: str) -> None:
    assert significant(value, digits) == text


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [(1.234567, 0.0012, "1.2346 ± 0.0012"), (-4.7e-5, 5.5e-4, "-0.00005 ± 0.00055"), (0.0, 0.72, "0.0 ± 0.72"),
     (3.0, 70.0, "3 ± 70"), (-3e-7, 5e-6, "-0.0000003 ± 5e-06"), (1.0, None, "1")],
)  # fmt: skip
def test_no_number_is_finer_than_its_error(value: float, error: float | None, text: str) -> None:
    assert with_error(value, error) == text


def test_a_number_without_dimension_stands_alone() -> None:
    assert in_unit("2", "1") == "2"
    assert in_unit("7.1e+02", "N.s/m3") == "7.1e+02 N·s/m³"
