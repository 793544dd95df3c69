"""The gallery: its notebooks are Jupytext's, stand in the site, and run as the site runs them."""

import importlib.util
import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOKS = sorted((DOCS / "gallery").glob("*.py"))

spec = importlib.util.spec_from_file_location("gallery", DOCS / "gallery.py")
assert spec is not None and spec.loader is not None
gallery = importlib.util.module_from_spec(spec)
spec.loader.exec_module(gallery)


def test_each_stands_in_the_site_once() -> None:
    shown = re.findall(r"gallery/(\w+)\.md", (DOCS.parent / "mkdocs.yml").read_text(encoding="utf-8"))
    assert sorted(shown) == [path.stem for path in NOTEBOOKS]
    assert len(NOTEBOOKS) >= 8


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_each_begins_with_its_title_and_draws(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.startswith("# %% [markdown]\n# # ")
    compile(text, path.name, "exec")
    code = [cell.text for cell in gallery.cells(text) if not cell.markdown]
    assert any("plt.subplots" in cell for cell in code)


def test_a_page_has_code_output_and_figures(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="figures need the extra docs")
    source = tmp_path / "small.py"
    source.write_text(
        "# %% [markdown]\n# # Small\n#\n# Words.\n# %%\nimport matplotlib.pyplot as plt\nprint('a < b')\nx = 2\n"
        "# %%\nplt.figure(); _ = plt.plot([1, x])\n# %%\n[x, x]\n"
    )
    page = gallery.page_of(source, tmp_path)
    assert "# Small\n\nWords." in page
    assert "a &lt; b" in page
    assert "<code>[2, 2]</code>" in page
    assert [path.name for path in tmp_path.glob("*.png")] == ["small-2-1.png"]
    assert "![Figure of the cell above](small-2-1.png)" in page


def test_an_error_ends_the_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib", reason="figures need the extra docs")
    pytest.importorskip("mkdocs", reason="needs the extra docs")
    (tmp_path / "bad.py").write_text("# %%\n1 / 0\n")
    monkeypatch.setattr(gallery, "FOLDER", tmp_path)
    with pytest.raises(SystemExit, match=r"bad\.py: ZeroDivisionError"):
        gallery.on_files([], None)
