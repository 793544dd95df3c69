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
        ('"N/m3"', '"N/m"', r"it is in N\.m2, N is due; it would be with own_x in N/m3 instead of N/m$"),
        ("* x**3", "* (x**3 * (x + 1) - x**4)", "adds up parts in unlike units; N is due"),
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


OWN_OBSERVER = """
import numpy as np
from numba import njit
from cosim.observers.record import INIT_SIGNATURE, STEP_SIGNATURE, Observer

@njit
def count(memory, place):
    memory[place] += 1.0

@njit(INIT_SIGNATURE)
def init(memory, settings, start, start_deviation, sensor, period):
    memory[:12] = start[:12]

@njit(STEP_SIGNATURE)
def step(memory, settings, u_x, u_y, v_x, v_y, estimate, deviation):
    count(memory, 12)
    estimate[:12] = memory[:12]
    deviation[:12] = 1.0
    if memory[12] == 1000.0:
        LATE

OBSERVER = Observer("mine", 13, {"gain": 0.3}, init, step)
"""
OWN_CONTROLLER = """
from numba import njit
from cosim.controllers.record import INIT_SIGNATURE, STEP_SIGNATURE, Controller

@njit(INIT_SIGNATURE)
def init(memory, settings, period):
    memory[0] = 0.0

@njit(STEP_SIGNATURE)
def step(memory, settings, t, estimate, deviation, output):
    output[0] = 1e-6
    output[8] = 3.5e8
    if t > 0.005:
        LATE

CONTROLLER = Controller("mine", 1, {}, init, step)
"""
LATE = [
    (OWN_OBSERVER, "raise ValueError('boo')", "observer mine: ValueError: boo"),
    (OWN_OBSERVER, "estimate[0] = np.nan", "est_x is nan at sample 999 of"),
    (OWN_OBSERVER, "count(memory, 17)", r"step uses memory\[17\], but memory has size 13; .* of 18 or more"),
    (OWN_OBSERVER, "estimate[0] = settings[3]", r"step uses settings\[3\], but settings has size 1 \(gain\)"),
    (OWN_CONTROLLER, "raise ValueError('boo')", "controller mine: ValueError: boo"),
    (OWN_CONTROLLER, "memory[1] = t", r"step uses memory\[1\], but memory has size 1"),
    (OWN_CONTROLLER, "output[9] = t", r"step uses output\[9\], but output has size 9"),
]


@pytest.mark.parametrize(("text", "late", "said"), LATE, ids=[late for _, late, _ in LATE])
def test_what_an_own_part_does_late_is_one_line(tmp_path: Path, text: str, late: str, said: str) -> None:
    path = tmp_path / "mine.py"
    path.write_text(text.replace("LATE", late))
    with pytest.raises(InputError, match=said) as refused:
        contract.check(path)
    assert "\n" not in str(refused.value)


def test_a_late_exception_ends_a_run_with_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.py"
    path.write_text(OWN_OBSERVER.replace("LATE", "raise ValueError('boo')"))
    with pytest.raises(SystemExit) as ended:
        main(["run", "constant", "--observer", str(path), "--out", str(tmp_path / "out")])
    assert ended.value.code == 2
    said = capfd.readouterr().err
    assert "ignored" not in said
    assert said.endswith("gyrotwin: observer mine: ValueError: boo\n")


def test_a_good_part_passes(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(OWN_OBSERVER.replace("LATE", "pass"))
    assert contract.check(path) == ["observer mine: built, compiled and run for 20 ms"]


def test_a_step_that_is_not_compiled_or_not_defined(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(OWN_OBSERVER.replace("LATE", "pass").replace("@njit(STEP_SIGNATURE)", ""))
    with pytest.raises(InputError, match=r"step is not compiled; write @njit\(STEP_SIGNATURE\) above it"):
        contract.check(path)
    path.write_text(OWN_OBSERVER.replace("LATE", "pass").replace("OBSERVER =", "OTHER ="))
    with pytest.raises(InputError, match=rf"{re.escape(str(path))}: defines no EFFECT, OBSERVER or CONTROLLER"):
        contract.check(path)
    path.write_text(OWN_OBSERVER.replace("LATE", "unknown()"))
    with pytest.raises(InputError, match="name 'unknown' is not defined") as refused:
        contract.check(path)
    assert "\n" not in str(refused.value)


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
