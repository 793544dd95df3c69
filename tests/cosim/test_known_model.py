"""The device as the loop knows it, written as C, against the reference simulation; and what can't be known."""

import ctypes
from dataclasses import replace

import numpy as np
import pytest
from plant import MEASURED, PERIOD, device_with, told

from cosim.core.library import HEALTH_NAMES, library, pointer
from cosim.core.settings import FILTER
from cosim.known_model import KnownModel, can_be_estimated, uses_command
from cosim.layout import PARAMETER_NAMES
from cosim.observers.ekf import OBSERVER
from cosim.running import Part, filter_health, known_values, observe, prior
from cosim.setting import defaults
from gyro_model.errors import InputError
from gyro_model.model import load_model
from gyro_model.reference import simulate
from gyro_model.symbols import u_x, u_y, y

COUNT = 64
"""Samples of a prediction, one period of x alone."""
NOISE = 1e-6
"""What the filter is told [V]: the floor, a millionth of the signal. Its innovations are measured in this."""

CHAIN = {
    "actuator_delay": 3.3e-6,
    "amplifier_time_constant": 1.7e-6,
    "feedthrough": 8.0,
    "actuator_gain_mismatch": 0.04,
    "pickoff_gain_mismatch": -0.03,
    "actuator_misalignment": 0.015,
    "pickoff_misalignment": -0.02,
    "offset_x": 0.01,
    "offset_y": -0.007,
    "offset_drift": 0.4,
    "pickoff_inverse_gap": 5e4,
    "pickoff_mismatch": 0.05,
    "k3_x": 2e10,
    "k3_y": 1e10,
}
"""The electronic chain and the spring's cubic part at the sizes that the design lab allows."""

DEVICES = {
    "textbook": {},
    "chain": CHAIN,
    "long delay": {**CHAIN, "actuator_delay": 17.3e-6, "amplifier_time_constant": 30e-6},
    "short lag": {**CHAIN, "actuator_delay": 5e-6, "amplifier_time_constant": 2e-9},
    "springs": {
        **{"k2_x": 1e6, "k2_y": -2e6, "d2_x": 5e6, "d2_y": 2e6, "softening": 0.1, "electrode_gap": 1e-5},
        **{"actuator_a2": 30.0, "actuator_a3": 1e5, "angular_gain": 0.8},
    },
    "package": {
        **{"frame_rotation": 1.0, "acceleration_gain_x": -1.0, "acceleration_gain_y": -1.0, "tck": -6e-5},
        **{"tck_split": -1e-5, "tcd": 2.5e-3, "tcg": -2e-4, "parasitic_coupling": 0.5, "parasitic_frequency": 3300.0},
        **{"amplifier_time_constant": 1e-6, "tcp": 3e-9},
    },
    "driven mode": {"parasitic_coupling": 0.5, "parasitic_frequency": 3300.0, "parasitic_drive": 1.5},
}


def innovation(lib, part):
    """Rms innovation [V] of all samples: while a start grows, its mean is taken anew at each doubling."""
    return NOISE * np.sqrt(filter_health(lib, part)["chi2"])


def told_exactly(design):
    """A filter that takes the design for certain, so that it only predicts, ready for the first sample."""
    lib = library(design.known_model)
    memory = lib.memory("filter")
    settings = OBSERVER.settings_array(start=COUNT, surprise=1e300, omega_walk_min=0.0, omega_walk_max=0.0)
    p, root = prior(design, lib)
    z = np.zeros(lib.moving_size)
    z[lib.sizes["NS"]] = RATE
    certain, lowest = np.full_like(z, 1e-30), np.full_like(p, -1e300)
    arrays = (settings, known_values(design, lib, PERIOD), z, certain, p, root * 1e-12, lowest)
    lib.call.core_filter_start(pointer(memory), *map(pointer, arrays), ctypes.c_double(PERIOD))
    return lib, Part(lib.address("core_filter_step").value or 0, memory)


RATE = 5.0
FORCE = 40e-6
INPUTS = np.array([320.0, 30.0, -20.0, 12.0, 320.0, 320.0])
"""Temperature, a_x, a_y, v_bias; temperatures of structure and circuit, which follow at once here."""


def commands():
    """A force that changes with every sample, near the modes and away from them [N]."""
    t = np.arange(COUNT) * PERIOD
    u = FORCE * np.stack((np.sin(2 * np.pi * 2700 * t), np.cos(2 * np.pi * 450 * t)), axis=1)
    # Before the first sample there was no force, in the loop; the reference takes the first command for it.
    u[0] = 0.0
    return u


@pytest.mark.parametrize("name", DEVICES)
def test_prediction_is_that_of_the_reference_simulation(name, residual):
    device = device_with(sense_noise=0.0, **DEVICES[name])
    t, u = np.arange(COUNT) * PERIOD, commands()
    held = dict(zip(("temperature", "a_x", "a_y", "v_bias"), INPUTS[:4], strict=True))
    inputs = {key: np.full(COUNT, value) for key, value in held.items()} | {"omega_z": np.full(COUNT, RATE)}
    truth = simulate(device, t, {**inputs, "u_x": u[:, 0], "u_y": u[:, 1]})
    estimated = {key: 1e-9 for key in CHAIN if key in DEVICES[name]}
    lib, part = told_exactly(told(device, estimated))
    size = len(lib.estimate_names)
    estimate, deviation = np.zeros(size), np.zeros(size)
    off = np.zeros((COUNT, 4))
    for k in range(COUNT):
        v = np.array([truth["v_x"][k], truth["v_y"][k]])
        observe(part, u[max(k - 1, 0)], v, INPUTS, estimate, deviation)
        off[k] = estimate[:4] - [truth[state][k] for state in ("x", "x_dot", "y", "y_dot")]
    scale = np.array([1e-6, 0.019, 1e-6, 0.019])
    # The linear part is exact; the exponential's last terms and 64 products of it round by 1e-16 each. What bends is
    # integrated by Simpson's rule, its own effect on itself to first order: (share of the bend)^2 (omega T)^2 a sample,
    # for omega T = 0.1 and a share of 3e-4 (cubic) 1e-9, of 2e-2 (quadratic) 4e-6; it turns round with the motion.
    limit = {"textbook": 1e-12, "springs": 1e-5}.get(name, 1e-7)
    residual(f"{name}: states", np.abs(off / scale).max(), limit)
    # The voltage through the lag is interpolated by a polynomial of fifth degree: (omega T)^6/6! = 1e-9 of 1 V.
    residual(f"{name}: voltage [V rms]", innovation(lib, part), limit)


def test_a_wrong_parameter_is_seen_by_the_comparison():
    """The comparison above would see each parameter of the chain, wrong by a hundredth of its size."""
    device = device_with(sense_noise=0.0, **CHAIN)
    t, u = np.arange(COUNT) * PERIOD, commands()
    truth = simulate(device, t, {"omega_z": np.full(COUNT, RATE), "u_x": u[:, 0], "u_y": u[:, 1]})
    for wrong in CHAIN:
        near = device_with(sense_noise=0.0, **{**CHAIN, wrong: 1.01 * CHAIN[wrong]})
        lib, part = told_exactly(told(near, dict.fromkeys(CHAIN, 1e-9)))
        estimate, deviation = np.zeros(len(lib.estimate_names)), np.zeros(len(lib.estimate_names))
        for k in range(COUNT):
            v = np.array([truth["v_x"][k], truth["v_y"][k]])
            observe(part, u[max(k - 1, 0)], v, MEASURED, estimate, deviation)
        # At least twice the limit above; or so far off that the filter finds no device and begins anew.
        lost = filter_health(lib, part)["restarted_at"] >= 0
        assert lost or innovation(lib, part) > 2e-7, wrong


@pytest.mark.parametrize(
    ("acting", "estimated", "expected"),
    [
        (("cubic_stiffness",), ("k3_z",), "did you mean 'k3_"),
        ((), ("k3_x",), "no acting effect has it"),
        (("angular_gain",), ("angular_gain",), "without an interval"),
        (("damping_step",), ("damping_step_time",), "without an interval"),
        (("sense_noise",), ("sense_noise",), "without an interval"),
        (("thermal_lag",), ("structure_lag",), "without an interval"),
        (("adc_clipping",), ("adc_limit",), "without an interval"),
        (("dry_friction",), ("friction_x",), "without an interval"),
        (("contact_stop",), ("stop_stiffness",), "without an interval"),
        (("hysteresis",), (), "leave it out of the design"),
        (("parasitic_mode",), ("parasitic_drive",), "without an interval"),
        (("play",), (), "effect play: .* leave it out of the design"),
        (("thermal_hysteresis",), (), "effect thermal_hysteresis: .* leave it out of the design"),
        (("stress_relaxation",), (), "effect stress_relaxation: .* leave it out of the design"),
        (("comb_fringe",), (), "leave it out of the design"),
    ],
)
def test_what_can_not_be_estimated_is_refused(acting, estimated, expected):
    with pytest.raises(InputError, match=expected):
        KnownModel(load_model(), acting, estimated)


def test_of_a_mode_on_which_the_command_acts_all_but_its_share_can_be_estimated():
    model = load_model()
    mode = model.effect("parasitic_mode")
    names = [q.name for q in mode.parameters if q not in mode.starts]
    assert {n for n in names if not can_be_estimated(model, n)} == {"parasitic_drive"}
    assert not uses_command(model.effect("parasitic_mode"))
    assert not can_be_estimated(model, "comb_fringe")
    assert uses_command(model.effect("comb_fringe"))


@pytest.mark.parametrize(("force", "refused"), [(u_x, False), (u_x**2, True), (u_x * u_y, True), (u_x * y, True)])
def test_a_force_of_the_command_must_be_linear_in_it(force, refused):
    effect = replace(load_model().effect("comb_fringe"), force=(force, 0))
    assert uses_command(effect) is refused


def test_fingerprint_tells_structures_apart_and_values_not():
    model = load_model()
    first = KnownModel(model, ("cubic_stiffness",), ("k3_x",))
    prints = {
        known.fingerprint()
        for known in (
            first,
            KnownModel(model, ("cubic_stiffness",), ()),
            KnownModel(model, ("cubic_stiffness",), ("k3_y",)),
            KnownModel(model, ("cubic_stiffness", "actuator_delay"), ("k3_x",)),
        )
    }
    assert len(prints) == 4
    assert KnownModel(model, ("cubic_stiffness",), ("k3_x",)).fingerprint() == first.fingerprint()


def test_what_shows_by_its_square_is_flat_at_its_lowest_value():
    # A gap's voltage goes by 1/g squared, of pairs that differ by 1/g times that difference, which may be none.
    acting = ("amplifier_bandwidth", "cubic_stiffness", "pickoff_mismatch", "pickoff_nonlinearity")
    estimated = ("amplifier_time_constant", "k3_x", "pickoff_inverse_gap", "pickoff_mismatch")
    header = KnownModel(load_model(), acting, estimated).header()
    assert "flat[NP] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0};" in header


def test_settings_stand_in_the_order_of_the_c():
    # The structure is written from the same table: its names, in order, are the array's.
    assert list(defaults(FILTER).values()) == OBSERVER.settings_array().tolist()
    assert OBSERVER.settings_array(settle=3.0)[list(FILTER).index("settle")] == 3.0


def test_values_come_back_from_the_coordinates_of_the_filter():
    design = told(device_with(**CHAIN), dict.fromkeys(CHAIN, 1e-3))
    lib, part = told_exactly(design)
    count = lib.sizes["NP"]
    p, root, health = np.zeros(count), np.zeros((count, count)), np.zeros(len(HEALTH_NAMES))
    lib.call.core_filter_found(pointer(part.memory), pointer(p), pointer(root), pointer(health))
    values = np.concatenate((p[:6] / p[-1], p[6:-1], 1 / p[-1:]))
    expected = [design.values[name] for name in PARAMETER_NAMES[:6]] + [design.values[n] for n in CHAIN]
    # Two roundings.
    np.testing.assert_allclose(values, [*expected, design.values["m"]], rtol=4e-16)
