"""Noise, delay, clipping and rounding of the FMU against numpy oracles of their own."""

from collections.abc import Callable

import numpy as np
import pytest
from gyro_runner import Floats, Runner
from philox_oracle import normals, philox
from scipy.constants import Boltzmann
from scipy.linalg import sqrtm

Residual = Callable[[str, float, float], None]

PERIOD = 5e-6
N = 4000
T = np.arange(N) * PERIOD
MOVING = {"x_start": 1e-6, "y_start": -0.7e-6}


def forces(n: int, seed: int = 8) -> dict[str, Floats]:
    """White forces of 30 µN on both axes."""
    u = np.random.default_rng(seed).normal(0.0, 3e-5, (2, n))
    return {"u_x": u[0], "u_y": u[1]}


def test_oracle_itself_on_published_vectors() -> None:
    # Known answers of the Random123 distribution (kat_vectors, philox 4x32 10).
    zero = philox(np.zeros((1, 4), np.uint64), (0, 0))[0]
    assert [f"{int(word):08x}" for word in zero] == ["6627e8d5", "e169c58d", "bc57ac4c", "9b00dbd8"]
    ones = philox(np.full((1, 4), 0xFFFFFFFF, np.uint64), (0xFFFFFFFF, 0xFFFFFFFF))[0]
    assert [f"{int(word):08x}" for word in ones] == ["408f276d", "41c83b0e", "a20bc7c6", "6d5451fd"]


@pytest.mark.parametrize("seed", [0, 1, 2**31 - 1])
def test_sense_noise_is_philox(plant: Runner, residual: Residual, seed: int) -> None:
    # At rest with one volt of noise the output is the normal number itself.
    v = plant.run({"sense_noise": 1.0, "seed": seed}, T, outputs=("v_x", "v_y"))
    wanted = normals(seed, "sense_noise", np.arange(N))
    # Two implementations of the inverse normal distribution, each good to a few units in the last place.
    residual("normal numbers", np.max(np.abs(np.stack([v["v_x"], v["v_y"]], 1) - wanted) / (1 + np.abs(wanted))), 2e-15)


def test_a_normal_number_belongs_to_its_sample(plant: Runner) -> None:
    # However the communication steps fall: noise of the voltage and of the force, equal to the last bit.
    own = {"sense_noise": 1.0, "thermal_force": 1.0}
    each, tenth = plant.run(own, T[:101]), plant.run(own, T[:101:10])
    for name, values in tenth.items():
        assert np.array_equal(each[name][::10], values), name


def test_sense_noise_is_white_and_of_the_stated_size(plant: Runner, residual: Residual) -> None:
    n, sigma = 100_000, 2e-5
    v = plant.run({"sense_noise": sigma, "seed": 11}, np.arange(n) * PERIOD, outputs=("v_x", "v_y"))
    x, y = v["v_x"] / sigma, v["v_y"] / sigma
    # Five standard errors each: 1/√n of a mean or correlation, 1/√(2n) of a standard deviation.
    five = 5 / np.sqrt(n)
    residual("mean", max(abs(x.mean()), abs(y.mean())), five)
    residual("standard deviation", max(abs(x.std() - 1), abs(y.std() - 1)), five / np.sqrt(2))
    residual("correlation of axes", abs(np.mean(x * y)), five)
    residual(
        "correlation of samples", max(abs(np.mean(z[lag:] * z[:-lag])) for z in (x, y) for lag in range(1, 20)), five
    )


def test_thermal_force_has_the_covariance_of_the_damping_matrix(plant: Runner, residual: Residual) -> None:
    # One sample period from rest with a very heavy mass: velocity = force·time/m, for each draw.
    d = {"dxx": 3e-6, "dyy": 1e-6, "dxy": -1.2e-6}
    matrix = np.array([[d["dxx"], d["dxy"]], [d["dxy"], d["dyy"]]])
    heavy = {"m": 1.0, "thermal_force": 1.0, "seed": 5, **d}
    t, temperature = np.arange(400) * PERIOD, 350.0
    out = plant.run(heavy, t, {"temperature": np.full(400, temperature)}, ("x_dot", "y_dot"))
    velocity = np.stack([out["x_dot"], out["y_dot"]], 1)
    root = sqrtm(2 * Boltzmann * temperature * matrix / PERIOD)
    wanted = (normals(5, "thermal_force", np.arange(399)) @ root.T) * PERIOD
    scale = np.sqrt(np.mean(wanted**2))
    # The springs add k x Δ/m a period: 100 N/m · (√400 draws · 2 ms) · 5 µs / 1 kg = 2e-5 of a draw.
    residual("impulses", np.max(np.abs(np.diff(velocity, axis=0) - wanted)) / scale, 5e-5)


@pytest.mark.parametrize("delay", [1e-6, 3e-6, 3.4e-6, 17.25e-6, 0.3e-6, 1e-3])
def test_delay_is_the_force_of_that_time_ago(plant: Runner, residual: Residual, delay: float) -> None:
    # On a grid of 50 ns the delayed force can be handed to an FMU without a delay.
    n, fine = 3000, 20
    inputs = forces(n)
    delayed = plant.run({"actuator_delay": delay, **MOVING}, np.arange(n) * 1e-6, inputs)
    k = np.maximum(np.arange(n * fine) - round(delay / 5e-8), 0) // fine
    late = {name: u[k] for name, u in inputs.items()}
    wanted = plant.run({**MOVING, "internal_step": 5e-8}, np.arange(n * fine) * 5e-8, late)
    # 60 000 steps round 1e-16 each, as a random walk 3e-14; four times that.
    for name in ("x", "y", "x_dot", "y_dot"):
        residual(name, np.max(np.abs(delayed[name] - wanted[name][::fine])) / np.max(np.abs(wanted[name])), 1e-13)


def test_delay_of_a_long_step_equals_that_of_short_ones(plant: Runner) -> None:
    u = np.repeat(forces(300)["u_x"], 10)
    short = plant.run({"actuator_delay": 23.7e-6}, np.arange(3000) * 1e-6, {"u_x": u})
    long = plant.run({"actuator_delay": 23.7e-6}, np.arange(300) * 1e-5, {"u_x": u[::10]})
    assert np.array_equal(short["x"][::10], long["x"])


def test_clipping(plant: Runner) -> None:
    free, clipped = (
        plant.run({**MOVING, "sense_noise": 1e-3, **own}, T, forces(N)) for own in ({}, {"adc_limit": 0.6})
    )
    # A choice between numbers, no arithmetic: equal to the last bit. The motion does not feel it.
    for name in ("v_x", "v_y"):
        assert np.array_equal(clipped[name], np.clip(free[name], -0.6, 0.6))
        assert np.ptp(free[name]) > 1.2, "the test would clip nothing"
    assert np.array_equal(clipped["x"], free["x"])


@pytest.mark.parametrize("lsb", [2.0**-12, 1e-3, 0.3])
def test_rounding(plant: Runner, lsb: float) -> None:
    free, rounded = (plant.run({**MOVING, **own}, T, forces(N)) for own in ({}, {"adc_lsb": lsb}))
    # Division, rounding to even and product, in this order: equal to the last bit.
    for name in ("v_x", "v_y"):
        assert np.array_equal(rounded[name], np.rint(free[name] / lsb) * lsb)


def test_order_of_the_converter(plant: Runner) -> None:
    # Noise, then clip, then round (docs/theory/effects.md, eq. 1): the largest output is the rounded limit.
    own = {"sense_noise": 0.01, "adc_limit": 0.55, "adc_lsb": 0.1}
    v = plant.run({**MOVING, **own}, T, outputs=("v_x",))["v_x"]
    before = plant.run({**MOVING, "sense_noise": 0.01}, T, outputs=("v_x",))["v_x"]
    assert np.array_equal(v, np.rint(np.clip(before, -0.55, 0.55) / 0.1) * 0.1)


def test_outputs_latch_at_the_sample_instant(plant: Runner) -> None:
    # Steps of 1 µs: the voltage moves with every fifth, the motion with each.
    out = plant.run(MOVING, np.arange(51) * 1e-6)
    assert np.all(np.diff(out["x"]) != 0)
    held = out["v_x"][:50].reshape(10, 5)
    assert np.all(held == held[:, :1])
    # One product: equal to the last bit.
    assert np.array_equal(held[:, 0], 1e6 * out["x"][:50:5])
