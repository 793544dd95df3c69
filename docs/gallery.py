"""Makes the pages of the gallery: a hook of MkDocs that runs the notebooks in docs/gallery.

A notebook is a Python file in the percent format of Jupytext. Each runs in an interpreter of its own; what a cell
prints, its last value and its figures stand below it. An error ends the build.
"""

import ast
import contextlib
import html
import io
import pprint
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

FOLDER: Final = Path(__file__).parent / "gallery"
DPI: Final = 110
"""Of a figure: eight inches make 880 pixels, the width of a page's column."""
LONGEST: Final = 600
"""Seconds that a notebook may take on a loaded machine."""


class Cell(NamedTuple):
    """A part of a notebook: text in Markdown, or code."""

    markdown: bool
    text: str


def cells(source: str) -> list[Cell]:
    """The cells of a notebook."""
    found = []
    for part in re.split(r"^# %%", source, flags=re.M)[1:]:
        head, _, body = part.partition("\n")
        if "[markdown]" in head:
            found.append(Cell(True, re.sub(r"^# ?", "", body.strip(), flags=re.M)))
        elif body.strip():
            found.append(Cell(False, body.strip()))
    return found


def page_of(source: Path, pictures: Path) -> str:
    """Runs a notebook in this interpreter; gives its page and writes its figures to ``pictures``."""
    import matplotlib

    matplotlib.use("agg")
    names: dict[str, Any] = {"__name__": "__main__"}
    parts: list[str] = []
    for number, cell in enumerate(cells(source.read_text(encoding="utf-8"))):
        if cell.markdown:
            parts.append(cell.text)
            continue
        parts.append(f"```python\n{cell.text}\n```")
        parts += _outputs(cell.text, names, f"{source.stem}-{number}", pictures)
    link = f"[The notebook]({source.name}){{ download }} is a Python file that Jupytext opens."
    return "\n\n".join([*parts, link]) + "\n"


def _outputs(code: str, names: dict[str, Any], name: str, pictures: Path) -> Iterator[str]:
    """Runs a cell; gives what it prints, its last value, its figures."""
    import matplotlib.pyplot as plt

    tree = ast.parse(code)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(tree, name, "exec"), names)
        value = eval(compile(ast.Expression(last.value), name, "eval"), names) if isinstance(last, ast.Expr) else None
    if printed.getvalue().strip():
        yield _block(printed.getvalue().rstrip())
    if hasattr(value, "_repr_html_"):
        yield f'<div class="output">{value._repr_html_()}</div>'
    elif value is not None:
        yield _block(pprint.pformat(value, width=100))
    for number in plt.get_fignums():
        plt.figure(number).savefig(pictures / f"{name}-{number}.png", dpi=DPI, bbox_inches="tight")
        yield f"![Figure of the cell above]({name}-{number}.png)"
    plt.close("all")


def _block(text: str) -> str:
    return f'<pre class="output"><code>{html.escape(text)}</code></pre>'


def on_files(files: Any, config: Any) -> Any:
    """Adds a page and its figures for each notebook (MkDocs calls this)."""
    from mkdocs.structure.files import File

    for source in sorted(FOLDER.glob("*.py")):
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, __file__, str(source), folder]
            done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)
            if done.returncode != 0:
                raise SystemExit(f"{source}: {done.stderr.strip().splitlines()[-1]}")
            for path in sorted(Path(folder).iterdir()):
                files.append(File.generated(config, f"gallery/{path.name}", content=path.read_bytes()))
    return files


if __name__ == "__main__":
    notebook, out = Path(sys.argv[1]), Path(sys.argv[2])
    (out / f"{notebook.stem}.md").write_text(page_of(notebook, out), encoding="utf-8")
