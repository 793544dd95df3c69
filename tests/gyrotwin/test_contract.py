"""A user's own parts under the checks that the packaged ones pass."""

import re
from pathlib import Path

import platformdirs
import pytest

from gyro_model.errors import InputError
from gyro_model.model import EFFECTS_FOLDER, load_model
from gyrotwin import contract
from gyrotwin.cli import main

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


def test_what_fails_the_contract_is_not_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda name: str(tmp_path / "cache"))
    good, bad = tmp_path / "good", tmp_path / "bad"
    for folder, text in ((good, GOOD), (bad, GOOD.replace('"N/m3"', '"N/m"'))):
        folder.mkdir()
        own(folder, text)
    with pytest.raises(SystemExit) as ended:
        main(["run", "constant", "--effects", str(bad), "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    assert re.fullmatch(r"gyrotwin: effect own_stiffness: .*dimension.*\n", capsys.readouterr().err)
    assert not (tmp_path / "out").exists()
    # What has passed is kept, what has failed is not; a file that has changed is checked again.
    load_model(good)
    assert len(list((tmp_path / "cache" / "checked").iterdir())) == 1
    monkeypatch.setattr("gyro_model.contract.check_effect", lambda *rest: pytest.fail("checked again"))
    load_model.cache_clear()
    load_model(good)
    own(good, GOOD + "\n")
    load_model.cache_clear()
    with pytest.raises(pytest.fail.Exception, match="again"):
        load_model(good)
    load_model.cache_clear()


def test_a_constant_with_a_dimension_is_none_of_its_terms_faults(tmp_path: Path) -> None:
    """F_x = -k_B T/l^2 own x: the Boltzmann constant has a unit, and its number alone would not fit."""
    (tmp_path / "own_entropic.py").write_text(
        """\"\"\"A spring of entropy, of length own_length.\"\"\"

from sympy import Integer

from gyro_model.anatomy import Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import BOLTZMANN, temperature_structure, x

DENSITY = size("own_density", "1/m2", "one over the square of the length")

EFFECT = Force(
    id="own_entropic",
    parameters=(DENSITY,),
    force=(-BOLTZMANN * temperature_structure * DENSITY.symbol * x, Integer(0)),
    energy=None,
    signature="the resonance of x rises with temperature",
    host_experiment="ring-down at two temperatures",
    limits=(
        Limit(
            why="1e24 of k_B 100 K: 1.380649e3 N/m, at 1 um",
            at={"own_density": 1e24, "temperature_structure": 100.0, "x": 1e-6},
            gives={"force_x": -1.380649e-3, "force_y": 0.0},
        ),
    ),
)
"""
    )
    assert contract.check(tmp_path) == [f"effect own_entropic: {len(contract.CHECKS)} checks passed"]
