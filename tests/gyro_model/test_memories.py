"""What effects remember against models that share nothing with them: play operators, a lag and a walk in numpy, the
motion by the matrix exponential; and what theory says of each."""

from collections.abc import Callable
from math import asin, exp, pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from gyro_runner import Floats, RestingRunner, Runner
from philox_oracle import normals
from scipy.linalg import expm

from gyro_model.build import build
from gyro_model.contract import check_effect
from gyro_model.device import Device
from gyro_model.effects.thermal_hysteresis import EFFECT as HYSTERESIS
from gyro_model.errors import InputError
from gyro_model.evaluate import evaluate
from gyro_model.generate_envelope import envelope as generate_envelope
from gyro_model.generate_envelope import refused_effects
from gyro_model.model import load_model
from gyro_model.reference import sensitivities
from gyro_model.remembered import normal_numbers, remembered

MODEL = load_model()
Residual = Callable[[str, float, float], None]
PERIOD = 5e-6
DEVICE = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7}
START = {"x_start": 1e-6, "y_start": -0.7e-6}
STATES = ("x", "x_dot", "y", "y_dot")

# A step of the oracle rounds its exponential to 1e-15 of the motion, and errors of 400 steps add up.
ROUNDING = 1e-12


def played(course: Floats, width: float, before: float) -> Floats:
    """The play operator of half width ``width`` along ``course``, from ``before``."""
    out = np.empty(len(course))
    for k, value in enumerate(course):
        if value - before > width:
            before = value - width
        elif before - value > width:
            before = value + width
        out[k] = before
    return out


def free_motion(devices: list[dict[str, float]], parts: int = 1) -> dict[str, Floats]:
    """States at samples, ``devices[k]`` being the plant in the k-th of ``parts`` equal parts of each period."""
    state = np.array([START["x_start"], 0.0, START["y_start"], 0.0])
    rows = [state]
    for p in devices:
        m = p["m"]
        rate = np.array(
            [
                [0.0, 1.0, 0.0, 0.0],
                [-p["kxx"] / m, -p["dxx"] / m, -p["kxy"] / m, -p["dxy"] / m],
                [0.0, 0.0, 0.0, 1.0],
                [-p["kxy"] / m, -p["dxy"] / m, -p["kyy"] / m, -p["dyy"] / m],
            ]
        )
        state = expm(rate * PERIOD / parts) @ state
        rows.append(state)
    return dict(zip(STATES, np.array(rows)[::parts].T, strict=True))


def compare(got: dict[str, Floats], wanted: dict[str, Floats], limit: float, residual: Residual) -> None:
    for name, values in wanted.items():
        residual(name, np.max(np.abs(got[name] - values)) / np.max(np.abs(values)), limit)


# --- play -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [1e-7, 2e-6, 1e-4])
def test_play_is_a_command_that_was_played_before(plant: Runner, width: float) -> None:
    rng = np.random.default_rng(31)
    t = np.arange(600) * PERIOD
    u = {name: np.cumsum(rng.normal(0.0, 1e-6, len(t))) for name in ("u_x", "u_y")}
    before = {name: played(values, width, 0.0) for name, values in u.items()}
    with_play = plant.run({**START, "play": width}, t, u)
    without = plant.run(START, t, before)
    for name, values in with_play.items():
        assert np.array_equal(values, without[name]), name
    assert any(np.any(np.diff(values) == 0.0) for values in before.values())


def test_play_of_a_sine_has_its_describing_function(plant: Runner, residual: Residual) -> None:
    # J.-J. E. Slotine, W. Li, Applied Nonlinear Control, 1991, section 5.3, backlash: real and imaginary part.
    amplitude, width, frequency = 1e-6, 3e-7, 400.0
    ratio = width / amplitude
    real = 0.5 + (asin(1 - 2 * ratio) + 2 * (1 - 2 * ratio) * sqrt(ratio * (1 - ratio))) / pi
    wanted = complex(real, -4 * ratio * (1 - ratio) / pi)
    # A stiff device that follows its force at once: resonances at 30 kHz and above, Q of a half.
    stiff = {"kxx": 6395.5, "kyy": 9592.0, "kxy": 0.0, "dxx": 0.0679, "dyy": 0.083, "dxy": 0.0}
    t = np.arange(2000) * PERIOD
    u = {"u_x": amplitude * np.sin(2 * pi * frequency * t)}
    carrier = np.exp(-2j * pi * frequency * t[1500:])
    whole, with_play = (plant.run({**stiff, **own}, t, u)["x"][1500:] for own in ({}, {"play": width}))
    ratio_of_first = np.sum(with_play * carrier) / np.sum(whole * carrier)
    # 500 samples a period: the turning points lie up to half a sample from those of the sine.
    residual("describing function", abs(ratio_of_first - wanted), 2e-4)


def test_play_wider_than_the_command_lets_nothing_through(plant: Runner) -> None:
    t = np.arange(200) * PERIOD
    u = {"u_x": 1e-6 * np.sin(2 * pi * 3000 * t), "u_y": np.full(len(t), -1e-6)}
    out = plant.run({**START, "play": 1.0000001e-6}, t, u)
    rest = plant.run(START, t)
    assert all(np.array_equal(out[name], rest[name]) for name in rest)


def test_play_and_delay_come_in_that_order(plant: Runner, residual: Residual) -> None:
    rng = np.random.default_rng(32)
    t = np.arange(300) * PERIOD
    u = np.cumsum(rng.normal(0.0, 1e-6, len(t)))
    # The delayed force before the start is the first one, which has gone through the play.
    late = {**START, "actuator_delay": 7.3e-6}
    got = plant.run({**late, "play": 1e-6, "actuator_a2": 1e4}, t, {"u_x": u})
    wanted = plant.run({**late, "actuator_a2": 1e4}, t, {"u_x": played(u, 1e-6, 0.0)})
    # A delayed force that the play swallows cuts a step all the same: its parts round apart.
    compare(got, wanted, 1e-13, residual)


# --- thermal_hysteresis ---------------------------------------------------------------------------------------------

WIDTHS = {"thermal_hysteresis_width_1": 1.5, "thermal_hysteresis_width_2": 4.0, "thermal_hysteresis_width_3": 11.0}
CYCLE = np.concatenate(
    [np.linspace(300, 340, 90), np.linspace(340, 285, 120), np.linspace(285, 310, 60), np.linspace(310, 304, 40)]
)


def shares(course: Floats) -> Floats:
    """Mean of (T - p)/w along ``course``, in [-1, 1]."""
    return np.mean([(course - played(course, w, course[0])) / w for w in WIDTHS.values()], axis=0)


def hysteretic(course: Floats, size: float) -> list[dict[str, float]]:
    split = DEVICE["kyy"] - DEVICE["kxx"]
    return [
        DEVICE
        | {"kyy": DEVICE["kyy"] + size * s * split}
        | {name: DEVICE[name] * (1 + size * s) for name in ("dxx", "dyy", "dxy")}
        for s in shares(course)
    ]


def test_thermal_hysteresis_follows_play_operators(plant: Runner, residual: Residual) -> None:
    t = np.arange(len(CYCLE)) * PERIOD
    own = {**DEVICE, **START, **WIDTHS, "thermal_hysteresis": 0.3}
    got = plant.run(own, t, {"temperature": CYCLE}, STATES)
    compare(got, free_motion(hysteretic(CYCLE, 0.3)[:-1]), ROUNDING, residual)


def test_thermal_hysteresis_knows_the_way_and_not_the_speed() -> None:
    up, down = np.linspace(250, 350, 400), np.linspace(350, 250, 400)
    way = np.concatenate([up, down])
    course = shares(way)
    # Far along either way all operators are at their ends.
    assert course[399] == pytest.approx(1.0, abs=1e-12) and course[-1] == pytest.approx(-1.0, abs=1e-12)
    # Half way at the same temperature, the two ways differ by the whole loop.
    assert course[200] - course[599] == pytest.approx(2.0, abs=1e-12)
    assert np.array_equal(shares(np.repeat(way, 3))[::3], course)
    # A small loop inside a large one closes: the operators wipe out what it did.
    inside = np.concatenate([up[:300], up[300:280:-1], up[280:301]])
    assert shares(inside)[-1] == pytest.approx(shares(up[:301])[-1], abs=1e-12)


def test_thermal_hysteresis_at_its_ends_changes_split_and_damping_by_its_size() -> None:
    at = {**DEVICE, "thermal_hysteresis": 0.04, "temperature_structure": 400.0}
    at |= {name: 0.0 for name in (s.name for s in HYSTERESIS.symbols) if name not in at}
    for sign in (1.0, -1.0):
        ends = {f"thermal_play_{i}": 400.0 - sign * w for i, w in enumerate(WIDTHS.values(), 1)}
        terms = evaluate(HYSTERESIS, at | WIDTHS | ends)
        assert terms["kyy"] - DEVICE["kxx"] == pytest.approx((95.92 - 63.955) * (1 + sign * 0.04), rel=1e-12)
        assert terms["dyy"] == pytest.approx(1.8e-6 * (1 + sign * 0.04), rel=1e-14)


# --- stress_relaxation ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("time", [1e-3, 0.2])
def test_stress_relaxation_is_a_lag_of_the_ambient_temperature(plant: Runner, time: float, residual: Residual) -> None:
    n, step_at, size, parts = 300, 37, 2e-5, 16
    course = np.where(np.arange(n) < step_at, 300.0, 340.0)
    slow, middles, part = 300.0 - 298.15, [], PERIOD / parts
    for warm in np.repeat(course[:-1], parts) - 298.15:
        middles.append(warm + (slow - warm) * exp(-0.5 * part / time))
        slow = warm + (slow - warm) * exp(-part / time)
    devices = [DEVICE | {k: DEVICE[k] * (1 + size * s) for k in ("kxx", "kyy", "kxy")} for s in middles]
    own = {**DEVICE, **START, "relaxation": size, "relaxation_time": time}
    got = plant.run(own, np.arange(n) * PERIOD, {"temperature": course}, STATES)
    # The oracle holds the middle of each part: off by (part/time)²/24 of a change of 8e-4 over 40 rad, and by
    # (ω part)²/12 of 8e-4 part/time in each, which turn with the motion: as a hundred of the 5000 parts. Against 80
    # bits the exponentials of the oracle add up to 1.8e-12 on one processor, 4e-16 each.
    middle = (part / time) ** 2 / 24 * 40 + (2.4e4 * part) ** 2 / 12 * part / time * 100
    limit = ROUNDING + 4e-16 * len(devices) + 8e-4 * middle
    compare(got, free_motion(devices, parts), limit, residual)


def test_stress_relaxation_of_an_hour_does_not_round_away(plant: Runner) -> None:
    # 2500 s in steps of 5 us: 2e-9 of the way each. After 20 ms 8e-6 of 40 K have come; a sum that rounds to 300 K
    # would be off by 7e-7 of that a step.
    n = 4000
    course = np.concatenate([[298.15], np.full(n - 1, 338.15)])
    own = {**DEVICE, **START, "relaxation": 1e-2, "relaxation_time": 2500.0}
    got = plant.run(own, np.arange(n) * PERIOD, {"temperature": course}, ("x",))["x"]
    devices = [
        DEVICE
        | {
            k: DEVICE[k] * (1 - 1e-2 * 40 * np.expm1(-(max(i - 0.5, 0.0) * PERIOD) / 2500.0))
            for k in ("kxx", "kyy", "kxy")
        }
        for i in range(n - 1)
    ]
    wanted, without = free_motion(devices)["x"], free_motion([DEVICE] * (n - 1))["x"]
    effect = np.max(np.abs(wanted - without))
    assert np.max(np.abs(got - wanted)) < 1e-5 * effect


# --- turn_on_offset, bias_walk --------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [0, 1, 20240601])
def test_turn_on_offset_is_one_normal_number_of_the_seed(plant: Runner, seed: int, residual: Residual) -> None:
    t = np.arange(300) * PERIOD
    number = normals(seed, "turn_on_offset", np.array([0]))[0, 0]
    got = plant.run({**DEVICE, **START, "turn_on": 0.05, "seed": seed}, t, outputs=STATES)
    device = DEVICE | {"dxy": DEVICE["dxy"] + 0.05 * number * sqrt(DEVICE["dxx"] * DEVICE["dyy"])}
    compare(got, free_motion([device] * 299), ROUNDING, residual)


def test_turn_on_offsets_of_many_seeds_are_normal() -> None:
    numbers = np.array([normals(seed, "turn_on_offset", np.array([0]))[0, 0] for seed in range(4000)])
    # Standard errors of mean and deviation of 4000: 0.016 and 0.011; four of them.
    assert abs(np.mean(numbers)) < 0.064 and abs(np.std(numbers) - 1.0) < 0.045


@pytest.mark.parametrize("seed", [4, 77])
def test_bias_walk_adds_normal_numbers(plant: Runner, seed: int, residual: Residual) -> None:
    n = 400
    steps = normals(seed, "bias_walk", np.arange(n))[:, 0] * sqrt(PERIOD)
    steps[0] = 0.0
    walked = np.cumsum(steps)
    root = sqrt(DEVICE["dxx"] * DEVICE["dyy"])
    devices = [DEVICE | {"dxy": DEVICE["dxy"] + 5.0 * w * root} for w in walked[:-1]]
    got = plant.run({**DEVICE, **START, "bias_walk": 5.0, "seed": seed}, np.arange(n) * PERIOD, outputs=STATES)
    compare(got, free_motion(devices), ROUNDING, residual)


def test_walk_of_another_seed_or_size_is_another(plant: Runner) -> None:
    t = np.arange(200) * PERIOD
    outs = [
        plant.run({**START, "bias_walk": size, "seed": seed}, t)["y"] for size, seed in ((1.0, 1), (1.0, 2), (2.0, 1))
    ]
    assert not np.array_equal(outs[0], outs[1]) and not np.array_equal(outs[0], outs[2])


# --- the envelope form ----------------------------------------------------------------------------------------------

RATE_DEVICE = {"m": 2e-8, "kxx": 19.74, "kyy": 20.14, "kxy": 0.0, "dxx": 1.257e-7, "dyy": 1.058e-6, "dxy": 0.0}
AMPLITUDE = {"x_start_i": 4e-6}


def held(parameters: dict[str, float], n: int) -> dict[str, Floats]:
    """Inputs that hold 4 um at the resonance of x."""
    w = sqrt(parameters["kxx"] / parameters["m"])
    return {
        "carrier_frequency": np.full(n, w / (2 * pi)),
        "u_x_q": np.full(n, parameters["dxx"] * w * 4e-6),
    }


def test_envelope_refuses_play_by_name(envelope: RestingRunner) -> None:
    assert [e.id for e in refused_effects(MODEL) if e.memories] == ["play"]
    assert 'refused = "play";' in generate_envelope(MODEL)
    envelope._started(
        {"thermal_hysteresis": 0.1, "relaxation": 1e-5, "turn_on": 0.1, "bias_walk": 0.1}, {}
    ).freeInstance()
    with pytest.raises(FMICallException):
        envelope._started({"play": 1e-7}, {})


def test_envelope_has_the_turn_on_offset_of_the_full_form(envelope: RestingRunner, residual: Residual) -> None:
    t = np.arange(400) * 1e-3
    number = normals(11, "turn_on_offset", np.array([0]))[0, 0]
    shift = 0.02 * number * sqrt(RATE_DEVICE["dxx"] * RATE_DEVICE["dyy"])
    inputs = held(RATE_DEVICE, len(t))
    outputs = ("y_i", "y_q")
    got = envelope.run({**RATE_DEVICE, **AMPLITUDE, "turn_on": 0.02, "seed": 11}, t, inputs, outputs)
    wanted = envelope.run({**RATE_DEVICE, **AMPLITUDE, "dxy": shift}, t, inputs, outputs)
    compare(got, wanted, 1e-13, residual)


def test_envelope_walks_as_its_own_numbers_say(envelope: RestingRunner) -> None:
    # Both modes damped to settle within 2 ms, so that y follows the walk of dxy, quasi-statically.
    n, step, seed = 4000, 1e-3, 8
    fast = RATE_DEVICE | {"dyy": 4e-5, "dxx": 4e-5}
    t = np.arange(n) * step
    inputs = held(fast, n)
    walk = np.cumsum(np.append(0.0, normals(seed, "bias_walk", np.arange(1, n))[:, 0])) * sqrt(step)
    got = envelope.run({**fast, **AMPLITUDE, "bias_walk": 1e-3, "seed": seed}, t, inputs, ("y_i", "y_q"))
    unit = envelope.run({**fast, **AMPLITUDE, "dxy": 1e-3 * 4e-5}, t, inputs, ("y_i", "y_q"))
    y, one = got["y_i"] + 1j * got["y_q"], unit["y_i"][-1] + 1j * unit["y_q"][-1]
    # y nears the walk at d/2m = 1000/s, and turns by what it is detuned.
    w_x, w_y = (sqrt(fast[k] / fast["m"]) for k in ("kxx", "kyy"))
    decay = np.exp((-0.5 * fast["dyy"] / fast["m"] + 1j * (w_y - w_x)) * step)
    wanted = np.zeros(n, complex)
    for k in range(n - 1):
        wanted[k + 1] = walk[k] + (wanted[k] - walk[k]) * decay
    # The frequencies of the damped mode to second order of 1/Q = 0.06.
    assert np.max(np.abs(y / one - wanted)) < 0.01 * np.ptp(walk)


def test_envelope_and_full_form_agree_on_hysteresis_and_relaxation(
    envelope: RestingRunner, plant: Runner, residual: Residual
) -> None:
    n = 241
    t = np.arange(n) * 1e-3
    course = 298.15 + np.concatenate([np.linspace(0, 30, 121), np.linspace(30, 5, 120)])
    own = {**RATE_DEVICE, "thermal_hysteresis": 0.2, "relaxation": 2e-5, "relaxation_time": 0.05}
    slow = envelope.run(
        {**own, "dxy": 2e-8, **AMPLITUDE}, t, held(RATE_DEVICE, n) | {"temperature": course}, ("y_i", "y_q")
    )
    w, fine = sqrt(RATE_DEVICE["kxx"] / RATE_DEVICE["m"]), 200
    tt = np.arange((n - 1) * fine + 1) * PERIOD
    force = np.real(1j * RATE_DEVICE["dxx"] * w * 4e-6 * np.exp(1j * w * (tt + 0.5 * PERIOD)))
    force /= np.sinc(w * PERIOD / (2 * pi))
    full = plant.run(
        {**own, "dxy": 2e-8, "x_start": 4e-6},
        tt,
        {"u_x": force, "temperature": np.append(np.repeat(course[:-1], fine), course[-1])},
        ("y",),
    )["y"]
    amplitude = slow["y_i"] + 1j * slow["y_q"]
    wanted = np.real(amplitude * np.exp(1j * w * t))
    # The full form starts with a part that turns against the carrier, 5e-3 of y, which decays in 38 ms.
    late = t > 0.16
    residual("y", np.max(np.abs(full[::fine] - wanted)[late]) / np.max(np.abs(amplitude)), 2e-4)


# --- the same without the FMU, as true values ---------------------------------------------------------------------


def test_remembered_courses_are_those_of_the_oracles() -> None:
    t = np.arange(len(CYCLE)) * PERIOD
    values = {"seed": 9, "sample_period": PERIOD, "temperature_structure": CYCLE, **WIDTHS}
    course = remembered(HYSTERESIS, t, values)
    for (name, got), width in zip(course.items(), WIDTHS.values(), strict=True):
        assert np.array_equal(got, played(CYCLE, width, CYCLE[0])), name
    walk = remembered(MODEL.effect("bias_walk"), t, values)["bias_walked"]
    numbers = normals(9, "bias_walk", np.arange(len(t)))[:, 0]
    numbers[0] = 0.0
    assert walk == pytest.approx(np.cumsum(numbers) * sqrt(PERIOD), rel=1e-12, abs=1e-15)
    [drawn] = remembered(MODEL.effect("turn_on_offset"), t, values).values()
    assert np.all(drawn == normals(9, "turn_on_offset", np.array([0]))[0, 0])
    warm = {**values, "t_ref": 298.15, "relaxation_time": 3e-4, "temperature": np.where(t < 2e-4, 300.0, 320.0)}
    [slow] = remembered(MODEL.effect("stress_relaxation"), t, warm).values()
    assert slow == pytest.approx(1.85 + 20 * -np.expm1(-np.maximum(t - 2e-4, 0.0) / 3e-4), abs=1e-12)


def test_normal_numbers_are_those_of_the_fmu() -> None:
    assert np.array_equal(normal_numbers("sense_noise", 123, 1000), normals(123, "sense_noise", np.arange(1000)))


def test_sensitivities_leave_out_what_remembers() -> None:
    with pytest.raises(InputError, match="play not covered"):
        sensitivities(Device("d", {"play": 1e-7}), ("kxx",), np.arange(3) * PERIOD, {})


GAIN_WALK = '''"""The gain of the y pickoff walks at random (a test, 2026)."""

from sympy import Symbol, sqrt

from gyro_model.anatomy import Law, Limit, Memory
from gyro_model.quantities import size
from gyro_model.symbols import normal_x, sense_gain_y, since

WALK = size("gain_walk", "1/s0.5", "random walk of the y gain")
walked = Symbol("gain_walked", real=True)

EFFECT = Law(
    id="gain_walk",
    parameters=(WALK,),
    memories=(Memory(walked, "s0.5", "Wiener process", sample=walked + sqrt(since) * normal_x),),
    changes={sense_gain_y: sense_gain_y * (1 + WALK.symbol * walked)},
    noise=True,
    signature="the scale of v_y strays",
    host_experiment="long record",
    limits=(
        Limit(
            why="2/√s at 0.25 √s: half as much again; a quarter of a second on, 1 √s is added",
            at={"gain_walk": 2.0, "gain_walked": 0.25, "sense_gain_y": 1e6, "since": 0.25, "normal_x": 2.0},
            gives={"sense_gain_y": 1.5e6, "start_gain_walked": 0.0, "sample_gain_walked": 1.25},
        ),
    ),
)
'''


def test_an_amplifier_of_ones_own_drifts_by_the_same_part(tmp_path: Path) -> None:
    (tmp_path / "effects").mkdir()
    (tmp_path / "effects" / "gain_walk.py").write_text(GAIN_WALK, encoding="utf-8")
    model = load_model(tmp_path / "effects")
    check_effect(model.effect("gain_walk"), model)
    plant = Runner(build(model).fmi3, tmp_path / "fmu")
    t = np.arange(200) * PERIOD
    out = plant.run({**START, "gain_walk": 3.0, "seed": 2}, t)
    steps = normals(2, "gain_walk", np.arange(len(t)))[:, 0] * sqrt(PERIOD)
    steps[0] = 0.0
    # A sample has the gain that is drawn with it.
    assert out["v_y"] == pytest.approx(1e6 * (1 + 3.0 * np.cumsum(steps)) * out["y"], rel=1e-12)
    assert np.array_equal(out["v_x"], plant.run(START, t)["v_x"])
