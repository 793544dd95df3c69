"""The commands that stand in README and docs, page by page in the order of the page."""

import shlex
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))


def commands(page: Path) -> list[str]:
    """Those of a page that stand on a line of their own, in code, comments left out, each once."""
    found: dict[str, None] = {}
    fenced = False
    for line in page.read_text(encoding="utf-8").splitlines():
        fenced ^= line.startswith("```")
        text = line.strip().removeprefix("$ ").removeprefix(".venv/bin/")
        if (fenced or line.startswith("    ")) and text.startswith("gyrotwin "):
            found[" ".join(shlex.split(text, comments=True))] = None
    return list(found)
