"""Degrees of freedom of an Allan variance beside those of an independent program."""

import pytest

from calibration.analysis.allan_freedom import degrees_of_freedom


@pytest.mark.parametrize("exponent", [0, -1, -2])
@pytest.mark.parametrize(
    ("averaged", "rows"), [(1, 400), (7, 1000), (30, 1000), (200, 3000), (200, 500), (3000, 27_001)]
)
def test_freedom_is_that_of_an_independent_program(exponent: int, averaged: int, rows: int) -> None:
    allantools = pytest.importorskip("allantools", reason="Greenhall and Riley's algorithm written by others")
    theirs = allantools.edf_greenhall(exponent, 2, averaged, rows, overlapping=True)
    # Both add the same terms; the differences cancel to 1e-9 of the largest in double precision.
    assert degrees_of_freedom(exponent, averaged, rows) == pytest.approx(theirs, rel=1e-6)


@pytest.mark.parametrize(("exponent", "averaged", "rows"), [(1, 3, 100), (0, 0, 100), (0, 60, 100)])
def test_what_no_record_holds_is_refused(exponent: int, averaged: int, rows: int) -> None:
    with pytest.raises(ValueError, match=r"give|hold no"):
        degrees_of_freedom(exponent, averaged, rows)
