"""ARCHITECTURE.md stays true: what it names is there."""

import re
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "ARCHITECTURE.md").read_text()
TOPS = re.findall(r"^\| `(\w+/)` \|", TEXT, re.M)
NAMED = sorted(set(re.findall(r"`([\w./*]+(?:/|\.py|\.c|\.h))`", TEXT)))


@pytest.mark.parametrize("name", NAMED)
def test_every_room_and_file_that_it_names_is_there(name: str) -> None:
    # Where a part of one's own goes.
    name = name.removesuffix("ID.py")
    assert any(ROOT.glob(name)) or any(any((ROOT / top).glob(f"**/{name}")) for top in TOPS)


def test_no_two_test_files_share_a_name() -> None:
    # Their folders are no packages, so pytest imports them by name: of two that share one it runs neither whole.
    names = Counter(path.name for path in (ROOT / "tests").rglob("test_*.py"))
    assert [name for name, times in names.items() if times > 1] == []
