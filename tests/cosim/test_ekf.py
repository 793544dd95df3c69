"""The Kalman filter: its slopes against finite differences, its covariance against its errors, short closed loops.

That the covariance is the inverse of the Fisher information, test_bound.py shows on the same filter.
"""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from plant import GAIN, MEASURED, NOISE, PERIOD, REFERENCE, begin, close_loop, device_with, sampled, told
from runs import simulated
from scipy.stats import chi2

from cosim.core.library import HEALTH_NAMES, library, pointer
from cosim.design import load_design, packaged_designs
from cosim.exchange import exchange
from cosim.fmu import open_plant
from cosim.layout import PARAMETER_NAMES
from cosim.observers.ekf import OBSERVER
from cosim.running import Part, filter_health, known_values, observe, prior
from gyro_model.errors import InputError

CHAIN = {
    **{"actuator_delay": 3.3e-6, "amplifier_time_constant": 1.7e-6, "feedthrough": 8.0, "k3_x": 1e10, "k3_y": 1e10},
    **{"actuator_gain_mismatch": 0.04, "pickoff_gain_mismatch": -0.03, "actuator_misalignment": 0.015},
    **{"pickoff_misalignment": -0.02, "offset_x": 0.01, "offset_drift": 0.4, "pickoff_inverse_gap": 5e4},
    "pickoff_mismatch": 0.05,
}
DRIVEN_MODE = {"parasitic_coupling": 20.0, "parasitic_frequency": 3300.0, "parasitic_drive": 1.5}
"""A mode on which four tenths of the force act."""
COUNT = 100
STEPS = {
    **{"actuator_delay": 1e-10, "amplifier_time_constant": 1e-10, "feedthrough": 1e-2, "k3_x": 1e6, "k3_y": 1e6},
    **{"offset_x": 1e-5, "offset_drift": 1e-3, "pickoff_inverse_gap": 10.0},
    **{"parasitic_coupling": 1e-4, "parasitic_frequency": 1e-2},
}
"""Changes for a difference quotient [SI]; of ratios 1e-5, of k/m, d/m and 1/m 1e-6, 1e-4 and 1e-6 of them."""


def recorded(device):
    """Commands (n, 2) and the samples (n, 2) that the device without noise gives to them."""
    t = np.arange(COUNT) * PERIOD
    u = 40e-6 * np.stack((np.sin(2 * np.pi * 2700 * t), np.sin(2 * np.pi * 450 * t)), axis=1)
    v, flags, outputs = np.zeros((COUNT, 2)), np.zeros(4), np.zeros(6)
    with open_plant({**device.parameters, "internal_step": 1e-6}) as plant:
        v[0] = plant.get(("v_x", "v_y"))
        for k in range(COUNT - 1):
            inputs = np.array([*u[k], 0.0])
            exchange(plant.handle, plant.inputs, inputs, plant.outputs, outputs, flags, k * PERIOD, PERIOD)
            v[k + 1] = outputs[:2]
    return u, v


def filtered(design, p, u, v):
    """State and slopes after all samples at the constants ``p``, of which the filter is sure."""
    lib = library(design.known_model)
    memory = lib.memory("filter")
    settings = OBSERVER.settings_array(surprise=1e300, slope_walk_min=0.0, slope_walk_max=1e3)
    size = lib.moving_size
    z, dz = np.zeros(size), np.full(size, 1.0)
    states = lib.sizes["NS"]
    dz[: states + 1] = [*(1e-6, 0.019) * (states // 2), 10.0]
    _, root = prior(design, lib)
    arrays = (settings, known_values(design, lib, PERIOD), z, dz, p, root * 1e-12, np.full_like(p, -1e300))
    lib.call.core_filter_start(pointer(memory), *map(pointer, arrays), ctypes.c_double(PERIOD))
    part = Part(lib.address("core_filter_step").value or 0, memory)
    estimate, deviation = np.zeros(len(lib.estimate_names)), np.zeros(len(lib.estimate_names))
    for k in range(len(v)):
        observe(part, u[max(k - 1, 0)], v[k], MEASURED, estimate, deviation)
    slopes, own = np.zeros((size, len(p))), np.zeros((size, size))
    lib.call.core_filter_slopes(pointer(memory), pointer(slopes), pointer(own))
    return estimate[:5].copy(), slopes[[0, 1, 2, 3, states]]


# At the truth and without noise the innovations vanish, and with them what the gains owe to the constants, which the
# slopes leave out on purpose.
@pytest.mark.parametrize("effects", [{}, CHAIN, DRIVEN_MODE], ids=["textbook", "chain", "driven mode"])
def test_slopes_are_the_derivatives_of_the_state(effects, residual):
    u, v = recorded(device_with(sense_noise=0.0, **effects))
    estimated = dict.fromkeys((name for name in effects if name != "parasitic_drive"), 1e-9)
    design = told(device_with(sense_noise=2e-5, **effects), estimated)
    lib = library(design.known_model)
    p, _ = prior(design, lib)
    _, slopes = filtered(design, p, u, v)
    names = (*PARAMETER_NAMES[:6], *lib.known.estimated, "m")
    scale = np.array([1e-6, 0.019, 1e-6, 0.019, 1.0])
    for q, name in enumerate(names):
        relative = 1e-3 if name.startswith("d") else 1e-6
        step = STEPS.get(name, relative * abs(p[q]) if name in PARAMETER_NAMES else 1e-5)
        up, down = p.copy(), p.copy()
        up[q] += step
        down[q] -= step
        quotient = (filtered(design, up, u, v)[0] - filtered(design, down, u, v)[0]) / (2 * step)
        size = np.abs(quotient / scale).max()
        assert size > 0, name
        # Both misalignments are off by 0.4 and 1.0 % of their slopes: measured, not derived.
        limit = (2e-2 if name.endswith("misalignment") else 2e-3) if effects else 1e-4
        # Rounding of the state, 1e-14, over the change that the step makes, 1e-9 and more; Simpson's rule for the
        # slopes,
        # (omega T)^4/2880 a sample; the bend at first order and the lag's differences, 1e-3 of what they make.
        residual(name, np.abs((slopes[:, q] - quotient) / scale).max() / size, limit)


def test_slopes_follow_corrections_that_come_late(residual):
    # The filter takes up the device while it moves: its first innovations tell a velocity, by another lag another one.
    # With gains that know nothing of the lag the slopes were 13 % off.
    u, v = recorded(device_with(sense_noise=0.0, **CHAIN))
    design = told(device_with(sense_noise=2e-5, **CHAIN), dict.fromkeys(CHAIN, 1e-9))
    lib = library(design.known_model)
    p, _ = prior(design, lib)
    q = (*PARAMETER_NAMES[:6], *lib.known.estimated).index("amplifier_time_constant")
    taken_up, step = slice(40, 60), np.zeros(len(p))
    step[q] = 1e-10
    _, slopes = filtered(design, p, u[taken_up], v[taken_up])
    up, down = (filtered(design, at, u[taken_up], v[taken_up])[0] for at in (p + step, p - step))
    scale = np.array([1e-6, 0.019, 1e-6, 0.019])
    quotient = (up - down)[:4] / (2 * step[q]) / scale
    residual("by the lag", np.abs(slopes[:4, q] / scale - quotient).max() / np.abs(quotient).max(), 2e-3)


def relative(estimates):
    return estimates[:, 5:12] / REFERENCE - 1.0


@pytest.mark.parametrize("seed", [1, 2])
def test_constant_rate_converges_and_knows_how_well(seed):
    omega_z = np.full(14000, 5.0)
    omega_z[10000:] = -5.0
    design = load_design("plain", device_with(sense_noise=2e-5), seed)
    made = replace(design, controller={"k": 63.955, "tone_amplitude": 32e-6, "tone_x": 450.0, "tone_y": 500.0})
    course = close_loop(begin(made), omega_z, seed)
    assert np.abs(relative(course.estimates)[8000:]).max() < 0.015
    error = np.abs(course.estimates[-1] - np.concatenate([course.states[-1], [-5.0], REFERENCE]))
    # Eight estimates, correlated: 4.5 standard deviations are passed once in some 10,000 runs.
    assert (error[4:12] < 4.5 * course.deviations[-1, 4:12]).all()
    # 0.2 rad/s are asked for from 20 ms after an edge; here 5 ms after.
    assert np.abs(course.estimates[11000:, 4] + 5.0).max() < 0.2


def test_doubled_damping_is_followed():
    n, jump = 18000, 10000
    design = load_design("plain", device_with(sense_noise=2e-5), 1)
    course = close_loop(begin(design), np.full(n, 5.0), 1, scale_damping=(jump, 2.0))
    damping = course.estimates[:, 8:11] / (2.0 * REFERENCE[3:6]) - 1.0
    # 5 % within 0.1 s are asked for; here 20 ms.
    assert np.abs(damping[jump + 4000 :]).max() < 0.05


@pytest.mark.parametrize("seed", [6, 7, 8])
def test_without_a_force_only_ratios_are_learned(seed):
    """k/m becomes known to 1e-7 meanwhile: what rounds there must not pass for knowledge of the mass."""
    design = load_design("plain", device_with(sense_noise=2e-5), seed)
    loop = begin(design)
    _, before = prior(design, loop.lib)
    state, noise = np.array([1e-6, 0.0, 0.0, 0.0]), np.random.default_rng(seed).standard_normal((16500, 2))
    phi, _ = sampled(REFERENCE, 5.0)
    for k in range(16500):
        loop.observe(np.zeros(2), GAIN * state[::2] + NOISE * noise[k])
        state = phi @ state
    count = loop.lib.sizes["NP"]
    p, root, health = np.zeros(count), np.zeros((count, count)), np.zeros(len(HEALTH_NAMES))
    loop.lib.call.core_filter_found(pointer(loop.observer.memory), pointer(p), pointer(root), pointer(health))
    deviation, at_first = np.sqrt(np.sum(root[6] ** 2)), np.sqrt(np.sum(before[6] ** 2))
    # Seven of 30 % each, and six ratios of them known; the dampings not wholly: 0.5 % are left of them.
    assert deviation == pytest.approx(at_first / np.sqrt(7), rel=0.01)


def test_errors_are_as_large_as_the_filter_says():
    squared = []
    for seed in range(12):
        design = load_design("plain", device_with(sense_noise=2e-5), seed)
        loop = begin(design)
        course = close_loop(loop, np.full(20000, 5.0), seed)
        count = loop.lib.sizes["NP"]
        p, root, health = np.zeros(count), np.zeros((count, count)), np.zeros(len(HEALTH_NAMES))
        loop.lib.call.core_filter_found(pointer(loop.observer.memory), pointer(p), pointer(root), pointer(health))
        truth = np.array([*(REFERENCE[:6] / REFERENCE[6]), 1 / REFERENCE[6]])
        squared.append(np.sum(np.linalg.solve(root, p - truth) ** 2))
        assert len(course.estimates) == 20000
    # Twelve independent sums of seven squares: between the 0.1 % bounds of chi-square with 84 degrees of freedom.
    low, high = chi2.ppf([0.001, 0.999], 12 * 7)
    assert low < np.sum(squared) < high


def test_innovations_of_an_ideal_device_are_as_expected():
    loop = begin(load_design("plain", device_with(sense_noise=2e-5), 1))
    close_loop(loop, np.full(20000, 5.0), 1)
    health = filter_health(loop.lib, loop.observer)
    # Means over 5 ms, 2000 numbers: standard deviations of 3.2 % and of 3.2 %; five of them.
    assert health["chi2"] == pytest.approx(1.0, abs=0.16)
    assert abs(health["white_x"]) < 0.16 and abs(health["white_y"]) < 0.16
    assert health["restarted_at"] < 0


def test_a_filter_that_lost_its_numbers_begins_anew_with_clean_means():
    loop = begin(load_design("plain", device_with(sense_noise=2e-5), 1))
    loop.observe(np.zeros(2), np.array([1.0, 0.0]))
    for _ in range(40):
        loop.observe(np.zeros(2), np.array([np.nan, np.nan]))
    for _ in range(40):
        loop.observe(np.zeros(2), np.array([0.5, 0.1]))
    health = filter_health(loop.lib, loop.observer)
    assert health["restarted_at"] > 0
    assert all(np.isfinite(value) for value in health.values()), health
    assert np.isfinite(loop.estimate).all()


def test_lab_finds_what_hides_in_the_chain():
    hidden = {"actuator_delay": 2e-6, "feedthrough": 5.0, "pickoff_gain_mismatch": 0.02, "k3_x": 5e9}
    _, result = simulated("constant", *(f"{k}={v}" for k, v in hidden.items()), design="lab", duration=0.3, seed=2)
    last = result.trace[-1]
    # Delay against lag against feedthrough is weak and turns nothing; the force is late by delay and lag together.
    late = last["est_actuator_delay"][0] + last["est_amplifier_time_constant"][0]
    assert late == pytest.approx(hidden["actuator_delay"], abs=2e-9)
    # Ten times what is left of the priors' width, 2e10 N/m3 and 10 %, by the 0.3 s.
    assert last["est_k3_x"][0] == pytest.approx(hidden["k3_x"], abs=1e9)
    assert last["est_pickoff_gain_mismatch"][0] == pytest.approx(0.02, abs=2e-3)


# Where the mode might ring as far as the mass, these three and seven more of the seeds 401 to 420 ended at a coupling
# of 0.05 and less, and fitted. The last start came to rest at 0.50 where no other size was looked at.
@pytest.mark.parametrize("coupling, seed", [(1.0, 403), (1.0, 407), (1.0, 413), (1.431, 1888)])
def test_a_mode_beside_the_oscillation_is_found(coupling, seed, tmp_path):
    design = tmp_path / "design.toml"
    lab = packaged_designs()["lab"].read_text(encoding="utf-8")
    design.write_text(lab.replace("[intervals]\n", "[intervals]\nparasitic_coupling = [0.0, 2.0]\n", 1))
    _, result = simulated("constant", f"parasitic_coupling={coupling}", design=str(design), duration=0.17, seed=seed)
    # A coupling of the other sign is the same device. By the end it is known to 0.1 or so; of the seeds 401 to 440 the
    # worst was off by 0.44 at 0.12 s.
    assert abs(result.trace["est_parasitic_coupling"][-1]) == pytest.approx(coupling, abs=0.5)


@pytest.mark.parametrize("name", ["forgetting", "blocks"])
def test_unknown_setting_is_refused(name):
    with pytest.raises(ValueError, match=f"no setting '{name}'"):
        OBSERVER.settings_array(**{name: 1.0})


@pytest.mark.parametrize(("name", "value"), [("start", 20000.0), ("start", 0.0), ("settle", -1.0), ("block", 500.0)])
def test_a_setting_beyond_the_memory_is_refused(name, value):
    with pytest.raises(InputError, match=f"setting {name} = "):
        OBSERVER.settings_array(**{name: value})
