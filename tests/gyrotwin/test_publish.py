"""Files of a folder are written together."""

from pathlib import Path

import pytest

from gyro_model.errors import InputError
from gyrotwin.output import publish


def writer(text: str):
    return lambda path: path.write_text(text)


def files(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_what_an_earlier_call_wrote_besides_goes(tmp_path: Path) -> None:
    names = ("report.html", "effects/discovered_1.py", "effects/discovered_2.py", "effects/mine.py")
    publish(tmp_path, {name: writer("first") for name in names})
    publish(tmp_path, {name: writer("second") for name in names[:2]}, sometimes=("effects/discovered_*.py",))
    assert files(tmp_path) == ["effects/discovered_1.py", "effects/mine.py", "report.html"]
    assert (tmp_path / "effects/discovered_1.py").read_text() == "second"


def test_a_writer_that_fails_leaves_all_as_it_was(tmp_path: Path) -> None:
    publish(tmp_path, {"summary.json": writer("first"), "sense.parquet": writer("first")})

    def fail(path: Path) -> None:
        path.write_text("half")
        raise OSError("disk full")

    with pytest.raises(InputError, match="disk full; nothing written"):
        publish(tmp_path, {"summary.json": writer("second"), "track.csv": fail}, sometimes=("sense.parquet",))
    assert files(tmp_path) == ["sense.parquet", "summary.json"]
    assert (tmp_path / "summary.json").read_text() == "first"
