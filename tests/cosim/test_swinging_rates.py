"""The flag under rates that are no steps: what is valid does not drift beyond what is said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from runs import run_of, simulated

from cosim.master import simulate
from cosim.recorder import Result
from cosim.scenarios import Sine

WINDOW = 0.1
"""[s]"""
HEAD = 'format = 1\nname = "rate"\ndescription = "a rate"\nangle_unit = "C"\n'
RNG = np.random.default_rng(5)
KNEES = np.concatenate(([0.0], np.sort(RNG.uniform(0.0, 0.5, 30)), [0.5]))
SLOPES = RNG.uniform(-20.0, 20.0, 32)
"""A rate in slopes of some 3000 rad/s2, knees 16 ms apart."""


def run_under(folder: Path, rate: str, duration: float, **options) -> Result:
    """The run of a device whose rate is the course ``rate``."""
    path = folder / "rate.toml"
    path.write_text(f"{HEAD}duration = {duration}\n[omega_z]\n{rate}\n")
    return simulated(str(path), **options)[1]


def windows(result: Result) -> list[tuple[float, float]]:
    """Drift of the angle and its predicted deviation [deg/s] in each window that is valid throughout."""
    t, valid = result.trace["t"].to_numpy(), result.trace["converged"].to_numpy()
    error = np.rad2deg((result.trace["angle_C"] - result.trace["angle_true"]).to_numpy())
    sigma = np.rad2deg(result.trace["drift_sigma"].to_numpy())
    found = []
    for begin in np.arange(0.0, t[-1] - WINDOW, 0.1 * WINDOW):
        inside = (t >= begin) & (t < begin + WINDOW)
        if valid[inside].all():
            found.append((float(np.polyfit(t[inside], error[inside], 1)[0]), float(sigma[inside].mean())))
    return found


@pytest.mark.parametrize("seed", [5147, 5175, 5176])
def test_the_start_of_a_fast_device_finds_its_electronics(seed) -> None:
    # 8.9 kHz: sixteen samples are 0.7 of a period. Begun with so many, these starts came to rest at 54 V/N and no lag.
    found = simulated("rest", device="tuning_fork_as_built", design="lab", seed=seed, duration=0.1)[1]
    # It has 4 V/N, known to some V/N by then; the design means 0 +- 10.
    assert abs(found.trace["est_feedthrough"][-1] - 4.0) < 10.0


@pytest.mark.parametrize(("amplitude", "frequency"), [(1.0, 7.0), (3.0, 2.0)])
def test_a_sine_of_the_rate_does_not_pass_for_damping(amplitude, frequency, tmp_path, residual) -> None:
    rate = f'kind = "sine"\namplitude = {amplitude}\nfrequency = {frequency}'
    found = windows(run_under(tmp_path, rate, 0.8, design="lab", seed=2))
    assert len(found) > 15
    # It drifted by 1.4 and 2.1 deg/s, 20 and 37 of its predicted deviations, 2.8 and 4.2 of what a flag may hide. Of
    # the seeds 0 to 29 one goes over that, by a twelfth.
    residual("drift over what a flag may hide", max(abs(d) / max(0.5, 4 * sigma) for d, sigma in found), 1.0)


def test_a_filter_that_goes_astray_looks_again(tmp_path, residual) -> None:
    # 3.6e-3 of a gain is what the start leaves. Blocks after it went 0.0155 off while they claimed 5e-4, and dampings
    # seemed to move: the angle drifted by 0.6 to 0.7 deg/s, 0.06 deg/s being told.
    run = run_of("rest", device="reference", design="lab", seed=100231, duration=0.6)
    rate = Sine(1.3447519049050746, 0.6454084913731706, 126.11456682201087)
    found = simulate(replace(run, scenario=replace(run.scenario, courses={"omega_z": (rate,)})))
    gain = found.trace["est_actuator_gain_mismatch"].to_numpy()[-1]
    # Another start leaves 1e-3 to 2e-3 of it.
    residual("gain mismatch", abs(gain), 0.006)
    assert all(abs(drift) < max(0.5, 4 * sigma) for drift, sigma in windows(found))


def test_knees_of_the_rate_are_no_steps(tmp_path, residual) -> None:
    rate = f'kind = "ramps"\ntimes = {KNEES.tolist()}\nvalues = {SLOPES.tolist()}'
    found = windows(run_under(tmp_path, rate, 0.6, seed=6))
    assert len(found) > 5
    # Knees taken for steps shift the angle by a degree each, 10 deg/s over a window. Left are kicks by the tones where
    # two knees nearly meet and the rate lags by 1 rad/s for some samples.
    residual("drift [deg/s]", max(abs(d) for d, _ in found), 2.0)


def test_a_fast_rate_leaves_no_offset(tmp_path) -> None:
    # The angle's zero is one sample. Read with velocities as the package sees them, it was 0.11 deg off at 100 rad/s.
    square = 'kind = "square"\namplitude = 3.0\nfrequency = 20.0\nuntil = 0.15'
    ramp = 'kind = "ramps"\nfrom = 0.15\ntimes = [0.15, 0.25]\nvalues = [0.0, 100.0]'
    path = tmp_path / "rate.toml"
    path.write_text(f"{HEAD}duration = 0.35\n[[omega_z]]\n{square}\n[[omega_z]]\n{ramp}\n")
    _, result = simulated(str(path), "x_start=1e-6", design="plain", seed=2)
    last = result.trace.tail(200)
    error = (last["angle_C"] - last["angle_true"]).to_numpy()
    # Of the seed 0.6 of what is told is left.
    assert abs(error.mean()) < 3.0 * last["angle_sigma"].to_numpy().mean()
    # The ripple at twice the oscillation was 0.14 deg rms; 0.004 of it is left, by noise and constants.
    assert np.rad2deg(error.std()) < 0.01
