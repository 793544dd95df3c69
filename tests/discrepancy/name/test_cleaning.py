"""What is taken out of a record is followed by a fit to its end."""

from dataclasses import replace
from typing import Any

import pytest
from blank_search import blank_search

from discrepancy.name import cleaning
from discrepancy.name.search import Search


@pytest.mark.parametrize(("taken", "fits"), [((), 0), ((True,), 1), ((True, True), 1)])
def test_a_record_that_was_cleaned_is_fitted_to_a_minimum(
    monkeypatch: pytest.MonkeyPatch, taken: tuple[bool, ...], fits: int
) -> None:
    # A null with two lost samples was "unexplained": the fit after them had ended 2,000 variances short of a minimum.
    looks, fitted = iter((*taken, False, False)), []

    def cleaned(search: Search, blemish: Any) -> Search:
        return replace(search, blemishes=(*search.blemishes, blemish)) if next(looks) else search

    def refitted(search: Search, at: object) -> Search:
        fitted.append(at)
        return search

    monkeypatch.setattr(cleaning, "blemishes", lambda: ["missing_samples"])
    monkeypatch.setattr(cleaning, "_cleaned", cleaned)
    monkeypatch.setattr(Search, "fitted", refitted)
    cleaning.clean(blank_search(fitter="whole", whole="whole", at="present"))
    assert fitted == ["present"] * fits
