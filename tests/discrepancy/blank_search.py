"""A search of which a test says only what it is about."""

from dataclasses import MISSING, fields
from typing import Any, cast

from discrepancy.data.dataset import Dataset
from discrepancy.name.search import Given, Search


def blank_search(**own: Any) -> Search:
    """A search with these entries, those that have no default of their own None."""
    given = Given(cast("Dataset", None), print)
    blank = {own.name: None for own in fields(Search) if own.default is own.default_factory is MISSING}
    return Search(**{**blank, "given": given, **own})
