"""What is taken out of a record is followed by a fit to its end."""

from types import SimpleNamespace
from typing import Any

import pytest

from discrepancy.name import cleaning


@pytest.mark.parametrize(("taken", "fits"), [((), 0), ((True,), 1), ((True, True), 1)])
def test_a_record_that_was_cleaned_is_fitted_to_a_minimum(
    monkeypatch: pytest.MonkeyPatch, taken: tuple[bool, ...], fits: int
) -> None:
    # A null with two lost samples was "unexplained": the fit after them had ended 2,000 variances short of a minimum.
    looks, fitted = iter((*taken, False, False)), []

    def cleaned(search: Any, blemish: object) -> bool:
        found = next(looks)
        search.found += [blemish] * found
        return found

    monkeypatch.setattr(cleaning, "blemishes", lambda: ["missing_samples"])
    monkeypatch.setattr(cleaning, "_cleaned", cleaned)
    search: Any = SimpleNamespace(fitter="whole", whole="whole", found=[], at="present", go_on=fitted.append)
    cleaning.clean(search)
    assert fitted == ["present"] * fits
