"""The tool under test, seen through its public interface only: a folder in, a report out."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from discrepancy.data.dataset import load_dataset
from discrepancy.diagnose import diagnose
from discrepancy.discover.term_search import TermSearch
from gyro_model.model import load_model


def diagnosis(folder: Path) -> dict[str, Any]:
    """The report of ``gyrotwin diagnose`` on the data set in ``folder``."""
    with TemporaryDirectory() as terms:
        return diagnose(load_dataset(folder), load_model(), jobs=1, further=TermSearch(Path(terms))).report()
