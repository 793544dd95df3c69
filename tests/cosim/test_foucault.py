"""The controller on a plant of its own: isotropy, forced response, energy, quadrature, delay, actuators."""

import ctypes
from functools import cache

import numpy as np
import pytest
from plant import MEASURED, PERIOD, REFERENCE, TONES, K, begin, device_with, sampled, told
from runs import drift, simulated

from cosim.controllers.foucault import CONTROLLER
from cosim.core.library import CONTROL_NAMES
from cosim.layout import OMEGA_Z, PARAMETER_NAMES, M, X, Y
from gyro_model.device import write_device

FORCED = CONTROL_NAMES.index("forced_x")
OMEGA_SQUARED = CONTROL_NAMES.index("omega_squared")
TURNED = CONTROL_NAMES.index("turned")
SILENT = {"tone_amplitude": 0.0}


def truth(omega_z=0.0):
    estimate = np.zeros(12)
    estimate[OMEGA_Z] = omega_z
    estimate[5:] = REFERENCE
    return estimate


def run(n, state, omega_z=0.0, change=None, effects=None, plant=None, **changes):
    """Close the loop with the truth as estimate; return states (n, 4), outputs (n, 12).

    effects: what plant and design have besides; plant: f(history of commands) -> force that acts on the mass in each
    part of the period, as (duration, force) pairs.
    """
    loop = begin(told(device_with(**(effects or {}))), **changes)
    phi, gamma = sampled(REFERENCE, omega_z)
    states, outputs = np.zeros((n, 4)), np.zeros((n, len(CONTROL_NAMES)))
    estimate, deviation = truth(omega_z), np.zeros(12)
    moved = cache(lambda duration: sampled(REFERENCE, omega_z, duration))
    state = np.array(state, dtype=float)
    for k in range(n):
        states[k] = state
        estimate[:4] = state
        if change is not None:
            change(k, estimate, deviation)
        u = loop.control(k, estimate, deviation)
        outputs[k] = loop.output
        if plant is None:
            state = phi @ state + gamma @ u
        else:
            for duration, force in plant(outputs[: k + 1, :2]):
                part, push = moved(duration)
                state = part @ state + push @ force
    return states, outputs


def loop_matrix(omega_z=0.0, rate=200e3, **changes):
    """The sampled loop in closed form: its matrix (4, 4), from the controller's answer to unit states."""
    n, columns = 4, np.zeros((4, 4))
    phi, gamma = sampled(REFERENCE, omega_z, 1 / rate)
    for i in range(n):
        loop = begin_at(rate, **changes)
        estimate = truth(omega_z)
        estimate[i] = SIZES[i]
        u = step(loop, estimate)
        columns[:, i] = phi[:, i] + gamma @ u / SIZES[i]
    return columns


SIZES = np.array([1e-9, 1e-5, 1e-9, 1e-5])
"""Small states: below them no limit of the force is met."""


def begin_at(rate, **changes):
    from cosim.core.library import library, pointer
    from cosim.running import known_values

    design = told(device_with())
    lib = library(design.known_model)
    memory = lib.memory("foucault")
    settings = CONTROLLER.settings_array(
        k=K, amplitude=1e-6, first_frequency=3000.0, quadrature_loop=0.0, **(SILENT | changes)
    )
    values = known_values(design, lib, 1 / rate)
    lib.call.core_foucault_start(pointer(memory), pointer(settings), pointer(values), ctypes.c_double(1 / rate))
    return lib, memory


def step(loop, estimate):
    from plant import MEASURED

    from cosim.running import Part, control

    lib, memory = loop
    output = np.zeros(len(CONTROL_NAMES))
    control(Part(lib.address("core_foucault_step").value, memory), 0.0, estimate, np.zeros(12), MEASURED, output)
    return output[:2]


@pytest.mark.parametrize("rate", [50e3, 100e3, 200e3])
@pytest.mark.parametrize("omega_z", [0.0, 20.0])
def test_sampled_loop_is_an_isotropic_lossless_foucault_pendulum(rate, omega_z):
    values = np.linalg.eigvals(loop_matrix(omega_z, rate))
    turns = np.log(values[values.imag > 0]) * rate
    omega = np.sqrt(K / REFERENCE[6])
    expected = np.array([omega - omega_z, omega + omega_z])
    # Exact to rounding over T for omega_z = 0. The Coriolis force itself raises both by
    # omega_z^2 / (2 omega), 0.011 rad/s, and the gains treat omega_z to first order.
    tolerance = 1e-5 if omega_z == 0.0 else 0.02
    np.testing.assert_allclose(np.sort(turns.imag), expected, rtol=0, atol=tolerance)
    np.testing.assert_allclose(turns.real, 0.0, atol=tolerance)


def test_plain_hold_grows_as_the_source_leaves_it():
    values = np.linalg.eigvals(loop_matrix(rate=100e3, hold_compensation=0.0))
    # The stiffness that is cancelled acts T/2 late and feeds energy: +62 /s at 100 kHz.
    assert np.log(np.abs(values)).max() * 1e5 == pytest.approx(62.0, abs=0.5)


def test_forced_response_is_a_motion_of_the_loop():
    _, outputs = run(1, np.zeros(4))
    states, outputs = run(4000, outputs[0, FORCED : FORCED + 4], quadrature_loop=0.0)
    scale = np.abs(states).max(axis=0)
    # Exact but for rounding, which the lossless loop lets grow like the number of samples.
    assert (np.abs(states - outputs[:, FORCED : FORCED + 4]) / scale).max() < 1e-9


def test_change_of_rate_does_not_change_the_forced_response():
    _, outputs = run(1, np.zeros(4), omega_z=20.0)
    states, outputs = run(4000, outputs[0, FORCED : FORCED + 4], omega_z=20.0, quadrature_loop=0.0)
    # The Coriolis force is cancelled at t_k, not at mid-hold: 500 Hz * T / 2 * 2 pi = 0.8 % of a
    # part 2 omega_z omega_t / omega^2 = 4e-4 of the response.
    difference = np.abs(states - outputs[:, FORCED : FORCED + 4])[:, ::2].max()
    assert difference < 1e-4 * np.abs(states[:, ::2]).max()


def angle(states):
    """Angle of the pattern [deg] and ratio of the minor to the major axis, for states (4,)."""
    omega_squared = K / REFERENCE[6]
    x, x_dot, y, y_dot = states
    cross = 2 * (omega_squared * x * y + x_dot * y_dot)
    along = omega_squared * (x * x - y * y) + x_dot**2 - y_dot**2
    total = omega_squared * (x * x + y * y) + x_dot**2 + y_dot**2
    straight = np.hypot(cross, along) / total
    return np.degrees(0.5 * np.arctan2(cross, along)), np.sqrt(max(1 - straight, 0) / (1 + straight))


def test_energy_loop_restores_the_amplitude_without_turning():
    begun = np.radians(30.0)
    start = 0.5e-6 * np.array([np.cos(begun), 0.0, np.sin(begun), 0.0])
    states, outputs = run(8000, start, energy_loop=1.0, energy_rate=200.0, **SILENT)
    last = states[-200:]
    amplitude = np.sqrt((last[:, 0] ** 2 + last[:, 2] ** 2).max())
    # Eight time constants of the logistic approach from a quarter of the energy.
    assert amplitude == pytest.approx(1e-6, rel=5e-3)
    # Isotropic damping turns nothing; 0.02 deg is the ripple of the sampled mode at 6 kHz.
    assert abs(angle(last[-1])[0] - 30.0) < 0.05
    assert outputs[-1, OMEGA_SQUARED] == K / REFERENCE[6]


def test_quadrature_loop_straightens_the_orbit_without_turning_it():
    omega = np.sqrt(K / REFERENCE[6])
    start = np.array([1e-6, 0.0, 0.0, 0.3e-6 * omega])
    states, _ = run(12_000, start, quadrature_rate=100.0, **SILENT)
    free, _ = run(12_000, start, quadrature_loop=0.0, **SILENT)
    # 60 ms of 100 /s: e^-6 of 0.3, and a tenth of it for the smoothing and the ellipse's own speed-up.
    assert angle(free[-1])[1] == pytest.approx(0.3, abs=0.01)
    assert angle(states[-1])[1] < 0.3 * np.exp(-6) * 1.5
    # The force lies across the position at mid-hold: what it turns is (omega T/2)^2 = 2e-3 of the 17 deg that it bends.
    assert abs(angle(states[-1])[0]) < 0.1


def straightened(states, outputs, drop=0.5):
    """Rate at which the pattern turns beyond what the controller says [rad/s]; the beginning, where the orbit becomes
    that of a turning frame, left out."""
    turned = np.unwrap(np.deg2rad([angle(state)[0] for state in states]), period=np.pi) - outputs[:, TURNED]
    kept = slice(int(drop * len(turned)), None)
    return np.polyfit(np.arange(len(turned))[kept] * PERIOD, turned[kept], 1)[0]


def test_carousel_turns_the_pattern_and_says_by_how_much(residual):
    states, outputs = run(8000, [1e-6, 0, 0, 0], carousel_rate=20.0, **SILENT)
    turned = np.degrees(outputs[-1, TURNED])
    # 40 ms of 20 rad/s, 45.8 deg, the way a rate of turn would turn it; counted at each sample, one of them to come.
    assert turned == pytest.approx(-np.degrees(20.0 * 8000 * PERIOD), rel=1e-9)
    # 0.1 deg of ripple at 6 kHz.
    assert angle(states[-1])[0] == pytest.approx(turned, abs=0.2)
    # The gains hold to first order in the rate, (rate/omega)^2 = 1e-6, and over 20 ms the ripple leaves 2e-4 rad/s in a
    # slope. A force of the velocity at the sample, half a hold late, was short by 0.042 rad/s.
    residual("turning that is not told [rad/s]", abs(straightened(states, outputs)), 1e-3)


def test_carousel_without_compensation_of_the_hold_still_turns():
    states, _ = run(4000, [1e-6, 0, 0, 0], carousel_rate=20.0, hold_compensation=0.0, **SILENT)
    # 22.9 deg in 20 ms; the hold that is left in takes (omega T)^2/6 of it and bends the rest.
    assert angle(states[-1])[0] == pytest.approx(-22.9, abs=1.5)


REVERSAL = {"reversal_period": 0.01, "reversal_rate": 400.0}


def test_reversal_exchanges_the_modes_and_comes_back():
    states, outputs = run(8000, [1e-6, 0, 0, 0], **REVERSAL, **SILENT)
    ends = np.degrees(outputs[[1999, 3999, 5999, 7999], TURNED])
    # The other way round from the third on, so that errors of the turn and what twice the pattern's angle does cancel.
    np.testing.assert_allclose(ends, [-90.0, 0.0, 90.0, 0.0], atol=1e-9)
    # It rests for 10 ms less the 3.9 ms that a right angle takes at 400 rad/s.
    assert outputs[1213, TURNED] == 0.0 > outputs[1216, TURNED]
    found = [angle(state)[0] for state in states[[1990, 3990, 5990, 7990]]]
    # Just before the end of a turn, 1.1 deg short of it; 2 deg: the ellipse that 400 rad/s make, 2 Omega/omega.
    assert abs(found[0]) == pytest.approx(90.0, abs=3.5)
    assert found[1] == pytest.approx(0.0, abs=3.5)
    assert abs(found[2]) == pytest.approx(90.0, abs=3.5)
    assert found[3] == pytest.approx(0.0, abs=3.5)


def test_reversal_that_takes_longer_than_its_period_is_refused():
    from gyro_model.errors import InputError

    with pytest.raises(InputError, match=r"give 0\.0785 s or more, or a higher rate"):
        CONTROLLER.settings_array(reversal_period=0.05)
    with pytest.raises(InputError, match="reversal_period = -1"):
        CONTROLLER.settings_array(reversal_period=-1.0)
    CONTROLLER.settings_array(reversal_period=0.08)


DELAY = 7.3e-6
"""Between one period and two: the command before the last acts 2.3 us into the period."""


def late(commands):
    """The forces of a period whose command comes DELAY late."""
    k = len(commands) - 1
    before = commands[k - 2] if k > 1 else np.zeros(2)
    after = commands[k - 1] if k > 0 else np.zeros(2)
    return [(DELAY - PERIOD, before), (2 * PERIOD - DELAY, after)]


def test_a_known_delay_is_predicted_ahead():
    straight = {"quadrature_loop": 0.0, **SILENT}
    states, _ = run(4000, [1e-6, 0, 0, 0], effects={"actuator_delay": DELAY}, plant=late, **straight)
    energy = states[:, 1] ** 2 + states[:, 3] ** 2 + K / REFERENCE[6] * (states[:, 0] ** 2 + states[:, 2] ** 2)
    # Where the delay is not known, 7.3 us turn the stiffness across, 13 N/m, into damping and the pattern grows as
    # kxy delay/(2 m): 260 /s, 180-fold in 20 ms. Known, the forces under way are exact; the state they begin with is
    # too.
    assert energy[-1] / energy[0] == pytest.approx(1.0, abs=0.02)
    assert abs(angle(states[-1])[0]) < 0.5
    unknown, _ = run(4000, [1e-6, 0, 0, 0], plant=late, **straight)
    assert np.abs(angle(unknown[-1])[0]) > 1.0 or np.ptp(unknown[-400:, 0]) > 4e-6


def test_forced_response_between_two_forces_is_a_motion_of_the_loop():
    alone = {"tone_amplitude": 0.0, "tone2_amplitude": 30e-6, "quadrature_loop": 0.0}
    states, outputs = run(2000, np.zeros(4), effects={"actuator_delay": DELAY}, plant=late, **alone)
    forced = outputs[:, FORCED : FORCED + 4]
    # What is left is the free motion that the first commands have begun: a sine of the loop, and nothing at the tones.
    # Taken as sines, the velocities would err by (omega T)^2/8, 1.8e-3 of them at 3900 Hz.
    phase = np.sqrt(outputs[-1, OMEGA_SQUARED]) * PERIOD * np.arange(len(states))
    sines = np.stack((np.cos(phase), np.sin(phase)), axis=1)[100:]
    free = (states - forced)[100:]
    left = free - sines @ np.linalg.lstsq(sines, free, rcond=None)[0]
    assert (np.abs(left).max(axis=0) / np.abs(forced).max(axis=0)).max() < 1e-5


def test_known_actuators_are_inverted():
    effects = {
        **{"actuator_misalignment": 0.02, "actuator_gain_mismatch": -0.04},
        **{"actuator_a2": 100.0, "actuator_a3": 1e6},
    }

    def actuate(commands):
        u = commands[-1]
        curved = u + 100.0 * u**2 + 1e6 * u**3
        gained = curved * [1.0, 0.96]
        return [(PERIOD, gained + 0.02 * gained[::-1])]

    ideal, _ = run(400, [1e-6, 0, 0.5e-6, 0])
    states, _ = run(400, [1e-6, 0, 0.5e-6, 0], effects=effects, plant=actuate)
    # Three Newton steps on a curve of 1 %: 1e-2 to the eighth. Rounding grows with the samples.
    assert np.abs(states - ideal)[:, [X, Y]].max() < 1e-6 * 1e-9


def test_nothing_is_cancelled_until_stiffness_and_mass_are_known():
    def unsure(k, estimate, deviation):
        deviation[5] = K * (0.03 if k < 100 else 0.01)

    _, outputs = run(300, [1e-6, 0, 0, 0], change=unsure)
    t = np.arange(100) * PERIOD
    tones = 32e-6 * np.sin(2 * np.pi * np.outer(t, (TONES["tone_x"], TONES["tone_y"])))
    # Rounding of a product and a sine.
    np.testing.assert_allclose(outputs[:100, :2], tones, rtol=1e-12, atol=1e-18)
    # The cancelled stiffness of 1 um across is far above the tones' first part.
    assert np.abs(outputs[150:, 1]).max() > 10e-6


def test_a_constant_is_followed_at_once_though_inputs_change_at_every_sample():
    loop = begin(told(device_with()), update_period=2e-4)
    estimate, deviation, inputs = truth(), np.zeros(12), MEASURED.copy()
    used = []
    for k in range(200):
        inputs[0] += 1e-3
        # No multiple of the 40 samples at which inputs are followed.
        estimate[M] = REFERENCE[6] * (1.001 if k >= 157 else 1.0)
        loop.control(k, estimate, deviation, inputs)
        used.append(loop.output[OMEGA_SQUARED])
    np.testing.assert_allclose(used[:157], K / REFERENCE[6], rtol=1e-12)
    np.testing.assert_allclose(used[157:], K / REFERENCE[6] / 1.001, rtol=1e-12)


def test_found_stiffness_is_taken_once_and_scales_the_tones():
    tones = {"tone_amplitude": 32e-6, "tone_x": 450.0, "tone_y": 500.0}
    found = 0.8 * (REFERENCE[0] + REFERENCE[1]) / 2
    loop = begin(told(device_with()), found_stiffness=0.8, **tones)
    told_so = begin(told(device_with()), **{**tones, "k": found, "tone_amplitude": 32e-6 * found / K})
    estimate, deviation = truth(), np.zeros(12)
    for k in range(3000):
        loop.control(k, estimate, deviation)
        told_so.control(k, estimate, deviation)
        # Another estimate is no reason for another frequency.
        estimate[5] = REFERENCE[0] * (1.01 if k >= 1000 else 1.0)
    assert loop.output[OMEGA_SQUARED] == pytest.approx(found / REFERENCE[6], rel=1e-12)
    np.testing.assert_allclose(loop.output, told_so.output, rtol=1e-9, atol=1e-15)


def test_an_estimate_that_is_no_number_leaves_the_device_alone():
    def lose(k, estimate, deviation):
        if 50 <= k < 60:
            estimate[0] = np.nan

    _, outputs = run(200, [1e-6, 0, 0, 0], change=lose)
    assert np.isfinite(outputs).all()
    assert np.abs(outputs[100:, 1]).max() > 10e-6


def test_force_is_bounded_while_estimates_are_wrong():
    def wrong(k, estimate, deviation):
        estimate[:4] *= 100.0

    _, outputs = run(10, [1e-6, 0, 0, 0], change=wrong)
    limit = CONTROLLER.settings["force_limit"].default * K * 1e-6
    # Beside the feedback there are the two tones of 32 uN.
    assert np.hypot(outputs[:, 0], outputs[:, 1]).max() < limit + 2 * 32e-6


def test_unknown_setting_is_refused():
    with pytest.raises(ValueError, match="no setting 'stiffness'"):
        CONTROLLER.settings_array(stiffness=1.0)


def test_a_delay_does_not_change_the_scale_of_the_angle():
    delay = 4.9e-6

    def late(commands):
        before = commands[-2] if len(commands) > 1 else np.zeros(2)
        return [(delay, before), (PERIOD - delay, commands[-1])]

    omega_z, straight = 20.0, {"quadrature_loop": 0.0, **SILENT}
    states, _ = run(8000, [1e-6, 0, 0, 0], omega_z, effects={"actuator_delay": delay}, plant=late, **straight)
    turned = np.unwrap([angle(state)[0] for state in states], period=180.0)
    slope = np.polyfit(np.arange(8000) * PERIOD, turned, 1)[0]
    # Where only the velocities are turned on the way, 0.1 (omega delay)^2 of the angle is missing: 0.2 %.
    assert slope == pytest.approx(-np.degrees(omega_z), rel=1e-4)


def test_hard_springs_of_a_split_device_do_not_turn_the_pattern(tmp_path, residual):
    # 25 samples a period, a delay beyond one of them, springs that are 3e-4 harder at 1 um. Predicted in halves,
    # what bends the motion turned the pattern by 0.031 deg/s.
    device = device_with(kxy=6.0, k3_x=2e10, k3_y=1e10, actuator_delay=15e-6, sense_noise=2e-8)
    write_device(device, tmp_path / "device.toml")
    told = {"k3_x": 2e10, "k3_y": 1e10, "actuator_delay": 15e-6}
    seven = {name: device.parameters[name] for name in PARAMETER_NAMES}
    lines = ["format = 1", 'name = "told"', "[parameters]", *(f"{n} = {v!r}" for n, v in (seven | told).items())]
    lines += ["[intervals]", *(f"{n} = [{v * (1 - 1e-5)!r}, {v * (1 + 1e-5)!r}]" for n, v in seven.items())]
    (tmp_path / "design.toml").write_text("\n".join([*lines, "[controller]", "tone2_deflection = 0.4e-6"]) + "\n")
    files = {"device": str(tmp_path / "device.toml"), "design": str(tmp_path / "design.toml")}
    _, result = simulated("rest", sample_rate=75e3, duration=0.5, **files)
    assert result.validity.now
    residual("drift [deg/s]", abs(drift(result, 0.2)), 0.02)  # of the order (omega T)^3 the hold leaves 0.014
