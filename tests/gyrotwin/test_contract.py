"""A user's own parts under the checks that the packaged ones pass."""

from pathlib import Path

import pytest

from gyro_model.errors import InputError
from gyro_model.model import EFFECTS_FOLDER
from gyrotwin import contract

GOOD = (EFFECTS_FOLDER / "cubic_stiffness.py").read_text()


def own(folder: Path, text: str, name: str = "own_stiffness") -> Path:
    """The packaged cubic stiffness under another name, with other parameters."""
    text = text.replace("cubic_stiffness", name).replace("k3_x", "own_x").replace("k3_y", "own_y")
    path = folder / f"{name}.py"
    path.write_text(text)
    return path


def test_an_effect_file_of_one_s_own_passes(tmp_path: Path) -> None:
    assert contract.check(own(tmp_path, GOOD)) == [f"effect own_stiffness: {len(contract.CHECKS)} checks passed"]
    assert len(contract.check(tmp_path)) == 1


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"N/m3"', '"N/m"', "dimension"),
        ("x**3", "x**2", "limit case|dimension"),
        ("x**4", "x**6", "energy|dimension"),
    ],
)
def test_a_wrong_dimension_limit_case_or_energy_is_refused(tmp_path: Path, old: str, new: str, said: str) -> None:
    assert old in GOOD
    with pytest.raises(InputError, match=said):
        contract.check(own(tmp_path, GOOD.replace(old, new)))


def test_a_scenario_and_what_is_none(tmp_path: Path) -> None:
    path = tmp_path / "still.toml"
    path.write_text('format = 1\nname = "still"\n')
    with pytest.raises(InputError, match="description"):
        contract.check(path)
    with pytest.raises(InputError, match="no such file"):
        contract.check(tmp_path / "nothing.py")


def test_an_observer_of_one_s_own_is_run(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text("OBSERVER = 3\n")
    with pytest.raises(InputError, match="OBSERVER is no"):
        contract.check(path)
