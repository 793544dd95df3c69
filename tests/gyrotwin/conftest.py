"""One diagnosis by the command, looked at from several sides."""

import io
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
from cubic_case import Tables, exit_code, kept, tables, written
from rich.console import Console

from discrepancy import diagnose as naming
from discrepancy.tell.answer import Diagnosis
from gyrotwin.tasks import diagnose


@pytest.fixture(scope="session")
def runs() -> Tables:
    return tables()


@pytest.fixture(scope="session")
def answer(runs: Tables, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """One diagnosis by the command: folder of the data, folder of the answer, the Diagnosis itself."""
    root = tmp_path_factory.mktemp("diagnosis")
    data = written(root / "cubic", runs)
    found: list[Diagnosis] = []
    terminal = io.StringIO()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(naming, "diagnose", kept(naming.diagnose, found))
        patch.setattr(diagnose, "console", Console(file=terminal, width=100))
        assert exit_code("diagnose", str(data), "--out", str(root / "out"), "--jobs", "1", "--max-effects", "2") == 0
    yield SimpleNamespace(data=data, out=root / "out", found=found[0], terminal=terminal.getvalue())
