"""What settings can be: told before anything runs, with the setting, its value and the remedy."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, isfinite, nan
from pathlib import Path

import pytest
from runs import run_of, simulated

from cosim.controllers.foucault import CONTROLLER
from cosim.core.settings import FILTER, FOUCAULT
from cosim.design import load_design
from cosim.monitor import MONITOR
from cosim.observers import lyapunov
from cosim.observers.ekf import OBSERVER
from cosim.observers.record import Observer
from cosim.setting import Setting, Table, complete, defaults
from gyro_model.device import load_device
from gyro_model.errors import InputError

TABLES: dict[str, Table] = {
    "ekf": FILTER,
    "foucault": FOUCAULT,
    "monitor": MONITOR,
    "lyapunov": lyapunov.SETTINGS,
}
NAMES = [(owner, name) for owner, table in TABLES.items() for name in table]


def outside(setting: Setting) -> list[float]:
    """Values just beyond what a setting can be, and those that are no numbers."""
    if setting.switch:
        return [-1.0, 0.5, 2.0, nan, inf]
    beyond = [setting.low - abs(setting.low or 1.0) * 1e-6, setting.high + abs(setting.high) * 1e-6]
    return [value for value in beyond if isfinite(value)] + [nan, inf, -inf]


@pytest.mark.parametrize(("owner", "name"), NAMES)
def test_a_setting_is_refused_beyond_its_ends_and_not_at_them(owner: str, name: str) -> None:
    table = TABLES[owner]
    for value in outside(table[name]):
        with pytest.raises(InputError, match=f"^{owner}: setting {name} = .*: give .") as refused:
            complete(owner, table, {name: value})
        assert f"{value:g}" in str(refused.value)
        assert table[name].shown in str(refused.value)
    for end in (table[name].low, table[name].high, table[name].default):
        if isfinite(end):
            assert complete(owner, table, {name: end}) == defaults(table) | {name: end}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ("controller.tone_x=1e5", "tone_x = 100000.* give less than 100000 Hz"),
        ("controller.tone2_x=3e5 controller.tone2_amplitude=1e-5", "tone2_x = 300000"),
        ("controller.tone_amplitude=-1e-5", "tone_amplitude = -1e-05: give 0 to 1 N"),
        ("controller.amplitude=0", "amplitude = 0: give"),
        ("controller.tone2_x_ratio=1.02 controller.tone2_amplitude=1e-5", "tone2_x_ratio = 1.02.*give 0.92 or less"),
        ("controller.carousel_rate=1e5", "carousel_rate"),
        ("controller.carousel_rate=1000", "carousel_rate = 1000 rad/s is too fast .* give a size of 228 rad/s or less"),
        ("controller.quadrature_rate=-50", "quadrature_rate = -50"),
        ("controller.k=-64", "setting k = -64"),
        ("controller.k=nan", "setting k = nan"),
        ("observer.slope_walk_min=2e5", "slope_walk_min = 200000 is above slope_walk_max"),
        ("observer.surprise_memory=0", "surprise_memory = 0: give 1 to"),
        ("monitor.patience=-1", "monitor: setting patience = -1: give 0.005 to 1000 s"),
        ("sense_gain_x=0", "sense_gain_x = 0 V/m"),
    ],
)
def test_a_run_that_cannot_work_is_refused(change: str, expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        run_of("constant", *change.split())


def test_tones_that_follow_the_loop_are_held_against_the_sample_rate() -> None:
    lab = {"device": "whole_angle_as_built", "design": "lab"}
    assert run_of("constant", "controller.tone_x_ratio=5", **lab, sample_rate=400e3)
    with pytest.raises(InputError, match=r"tone_x_ratio = 9: samples at 20000 Hz .* give less than"):
        run_of("constant", "controller.tone_x_ratio=9", **lab, sample_rate=20e3)


def test_a_setting_of_an_observer_of_ones_own_says_what_it_can_be() -> None:
    own = Observer("mine", 1, {"gain": Setting(0.3, 0.0, 1.0), "free": 2.0}, print, print)
    assert own.settings_array(gain=1.0).tolist() == [1.0, 2.0]
    with pytest.raises(InputError, match=r"mine: setting gain = 1.5: give 0 to 1"):
        own.settings_array(gain=1.5)
    with pytest.raises(InputError, match="setting free = nan: give a finite number"):
        own.settings_array(free=nan)


@pytest.mark.parametrize("settings_array", [OBSERVER.settings_array, CONTROLLER.settings_array])
def test_defaults_are_settings_that_can_be(settings_array: Callable[..., object]) -> None:
    assert settings_array() is not None


def test_what_a_design_sets_of_the_monitor_is_checked() -> None:
    run = run_of("constant")
    for monitor, expected in (({"patience": -1.0}, "patience = -1"), ({"patienc": 1.0}, "no setting 'patienc'")):
        with pytest.raises(InputError, match=expected):
            replace(run, design=replace(run.design, monitor=monitor))


@pytest.mark.parametrize("pair", ["[0.0, 5.0]", "[2.0, 2.0005]", "[-1.0, -0.9999]"])
def test_an_interval_that_a_parameter_cannot_have_is_refused(tmp_path: Path, pair: str) -> None:
    file = tmp_path / "design.toml"
    file.write_text(f'format = 1\nname = "odd"\n[intervals]\nactuator_delay = {pair}\n')
    with pytest.raises(InputError, match=r"interval actuator_delay = .* s: it can be 0 to 0.001 s at all"):
        load_design(str(file), load_device("reference"), 1)


def test_an_interval_about_a_value_near_an_end_is_none_too_wide(tmp_path: Path) -> None:
    file = tmp_path / "design.toml"
    text = 'format = 1\nname = "near"\n[parameters]\nactuator_delay = 9e-4\n[intervals]\nactuator_delay = [0.0, 1e-3]\n'
    file.write_text(text)
    made = load_design(str(file), load_device("reference"), 1)
    made.write(file)
    # From 4e-4 to 1.4e-3 s as written; the bounds are rounded to what a float holds.
    again = load_design(str(file), load_device("reference"), 1).deviations["actuator_delay"]
    assert again == pytest.approx(made.deviations["actuator_delay"], rel=1e-12)


def test_a_stiffness_that_the_user_sets_is_the_frequency_of_the_loop() -> None:
    run, plain = run_of("constant", "controller.k=16"), run_of("constant")
    assert run.oscillation_hz == pytest.approx(plain.oscillation_hz * (16 / plain.stiffness) ** 0.5, rel=1e-12)
    assert run.controller_settings()["first_frequency"] == run.oscillation_hz


# What is not cancelled turns the pattern, by thousands of deg/s in these runs, and no sample tells that it should not.
@pytest.mark.parametrize(
    "change", ["controller.force_limit=0.1", "controller.tone_amplitude=3.2e-3", "x_start=1e-8", "controller.k=6.4"]
)
def test_a_force_that_meets_its_limit_makes_no_valid_angle(change: str) -> None:
    _, result = simulated("constant", change, duration=0.1)
    assert result.converged_at is None
    assert result.validity.reason.startswith("the force meets its limit, what it lacks may turn the pattern by")


def test_a_tone_at_the_patterns_own_frequency_makes_no_valid_angle() -> None:
    _, result = simulated("constant", "controller.tone_x=2900", duration=0.1)
    assert result.converged_at is None
    assert result.validity.reason.startswith("a tone of 2900 Hz is too near the pattern's own frequency, 3000 Hz")


# The force lags delay and lag, which move together while they are told apart: it turned the pattern by 4 deg/s, with
# the flag up and 0.11 deg/s told.
def test_gains_older_than_the_constants_make_no_valid_angle() -> None:
    lab = {"device": "reference_as_built", "design": "lab", "seed": 2, "duration": 0.2}
    _, result = simulated("constant", "controller.update_period=1e-3", **lab)
    # Up for 10 ms until the first constants that came too late.
    assert not result.validity.now
    assert result.validity.share < 0.1
    said = result.validity.reason
    assert said.startswith("the force lags what the observer knows and turns the pattern by")
    # 3 to 5 deg/s were measured while the flag did not look, seeds 1 to 3; it tells of the worst angle, 22 deg/s.
    assert float(said.partition("pattern by ")[2].partition(" ")[0]) > 3.0


def test_an_update_period_of_half_a_block_works() -> None:
    lab = {"device": "reference_as_built", "design": "lab", "seed": 1, "duration": 0.2}
    _, result = simulated("constant", "controller.update_period=5e-4", **lab)
    assert result.validity.now
