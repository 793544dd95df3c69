"""Columns beside a delay and a lag by the variation of the motion, against quotients of simulations and the exact
solution of a linear device."""

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
import pytest
from scipy.linalg import expm

from discrepancy.data.record import Floats, Record, make_record
from discrepancy.fit.lagged import STENCIL, lagged
from discrepancy.fit.quotients import Point, Quotients
from discrepancy.fit.simulate import Simulator
from gyro_model.device import load_device
from gyro_model.model import load_model

MODEL = load_model()
SAMPLES, PERIOD = 3000, 5e-6
DEVICE = load_device("reference").all_parameters | {"sense_noise": 0.0, "x_start": 2e-7, "y_start": -1e-7}
LATE: Final = {
    "a part of a step": {"actuator_delay": 1.3e-6},
    "whole steps": {"actuator_delay": 10e-6},
    "steps and a part": {"actuator_delay": 17.9e-6},
    "a lag": {"amplifier_time_constant": 2e-6},
    "a long lag": {"amplifier_time_constant": 40e-6},
    "both": {"actuator_delay": 7.1e-6, "amplifier_time_constant": 3e-6},
}
BASES: Final[dict[str, dict[str, float]]] = {
    "linear": {},
    "cubic": {"k3_x": 2e9},
    "a mode": {
        "parasitic_coupling": 5.0, "parasitic_frequency": 4100.0, "parasitic_q": 300.0, "parasitic_joint": 1.0,
        "parasitic_start": 1e-9,
    },
    "a law": {"tck": -6e-5, "actuator_a2": 2e3},
    "friction": {"friction_x": 1e-6, "friction_speed": 1e-3},
    "feedthrough": {"feedthrough": 8.0, "actuator_gain_mismatch": 0.02},
}  # fmt: skip
NAMES: Final = {
    "m": 1e-6 * DEVICE["m"], "kxx": 1e-6 * DEVICE["kxx"], "dxy": 1e-6 * DEVICE["dxx"], "x_start": 1e-12,
    "k3_y": 1e5, "actuator_gain_mismatch": 1e-6, "actuator_misalignment": 1e-6, "pickoff_misalignment": 1e-6,
    "offset_x": 1e-8, "parasitic_frequency": 1e-3, "friction_x": 1e-12,
}  # fmt: skip
"""What each is moved by, from where it stands in a base."""


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(MODEL, jobs=1) as made:
        yield made


def record(hold: str = "zero", senses: str = "position") -> Record:
    t = np.arange(SAMPLES) * PERIOD
    u = 2e-5 * np.sin(2 * np.pi * t[:, None] * [3100.0, 3350.0] + [0.0, 1.0])
    conditions = {"omega_z": 3.0 * np.sin(2 * np.pi * 200 * t), "temperature": 300.0 + 20.0 * t / t[-1]}
    return make_record("run", t, u, u, conditions=conditions, sample_rate=1 / PERIOD, hold=hold, senses=senses)


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("late", LATE)
@pytest.mark.parametrize("beside", BASES)
def test_columns_are_as_by_simulation(simulator: Simulator, beside: str, late: str, hold: str) -> None:
    run, base = record(hold), {**DEVICE, **BASES[beside], **LATE[late]}
    followed = simulator.follow(run, base)
    assert followed is not None
    # In whole steps, as it is followed: where the force runs between samples, that is 1e-3 of a column beside friction.
    v = simulator.run(run, base, parts=False)
    seen = lagged(followed.motion.found(0)[:, : run.axes], PERIOD, followed.time_constant)
    assert np.abs(seen - v).max() < 1e-4 * np.abs(v).max()
    present = [n for n in NAMES if n in BASES[beside] or n not in ("parasitic_frequency", "friction_x")]
    jobs = [(run, {**base, name: base.get(name, 0.0) + NAMES[name]}) for name in present]
    for name, job, varied in zip(present, jobs, simulator.vary(followed, jobs), strict=True):
        quotient = simulator.run(*job, parts=False) - v
        assert varied is not None
        # At 60 samples a period: fourth order leaves 1e-5, a friction that turns round within a step of it 1e-3.
        limit = 2e-3 if beside == "friction" else 2e-4
        assert np.linalg.norm(varied - quotient) < limit * np.linalg.norm(quotient), name


def exact(device: Mapping[str, float], run: Record, delay: float, time_constant: float) -> tuple[Floats, Floats]:
    """The voltage of x, which nothing couples with y, and its derivative by kxx: states x, x_dot, their derivatives
    and, behind the lag, both voltages, by matrix exponentials between the instants at which the force changes."""
    m, k, d, gain = (device[name] for name in ("m", "kxx", "dxx", "sense_gain_x"))
    a = np.zeros((7, 7))
    a[0, 1] = a[2, 3] = 1.0
    a[1, :2] = a[3, 2:4] = -k / m, -d / m
    a[1, 6], a[3, 0] = 1 / m, -1 / m
    if time_constant:
        a[4, [0, 4]] = a[5, [2, 5]] = np.array([gain, -1.0]) / time_constant
    steps = int(delay / PERIOD)
    part = delay - steps * PERIOD
    passages = [expm(a * length) for length in (part, PERIOD - part)]
    state, out = np.zeros(7), []
    state[0] = device["x_start"]
    state[4] = gain * state[0]
    for number in range(len(run.t)):
        out.append(np.array(state[4:6] if time_constant else gain * state[[0, 2]]))
        for passage, sample in zip(passages, (number - steps - 1, number - steps), strict=True):
            state[6] = run.u[max(sample, 0), 0]
            state = passage @ state
    found = np.array(out)
    return found[:, 0], found[:, 1]


@pytest.mark.parametrize("late", LATE)
def test_they_are_those_of_the_exact_solution(simulator: Simulator, late: str) -> None:
    base = {**DEVICE, **LATE[late], "kxy": 0.0, "dxy": 0.0}
    run = record()
    still = make_record("run", run.t, run.u, run.u, sample_rate=1 / PERIOD)
    v, slope = exact(base, still, base["actuator_delay"], base["amplifier_time_constant"])
    assert np.abs(simulator.run(still, base)[:, 0] - v).max() < 1e-9 * np.abs(v).max()
    followed = simulator.follow(still, base)
    assert followed is not None
    step = 1e-6 * base["kxx"]
    [varied] = simulator.vary(followed, [(still, {**base, "kxx": base["kxx"] + step})])
    assert varied is not None
    # Fourth order at 60 samples a period, and the polynomial between samples of what lags.
    assert np.abs(varied[:, 0] / step - slope).max() < 2e-6 * np.abs(slope).max()


def test_a_force_that_comes_at_a_sample(simulator: Simulator) -> None:
    # Periods of no whole number of picoseconds: the plant's clock has the force a picosecond earlier at some samples.
    t = np.arange(2000) / 473_888
    u = 2e-5 * np.sin(2 * np.pi * 3100 * t)[:, None]
    run = make_record("run", t, u, u, sample_rate=473_888, hold="first")
    base = {**DEVICE, "feedthrough": 8.0, "actuator_delay": 1 / 473_888}
    followed = simulator.follow(run, base)
    assert followed is not None
    job = run, {**base, "kxx": base["kxx"] * (1 + 1e-7)}
    [varied] = simulator.vary(followed, [job])
    quotient = simulator.run(*job, parts=False) - simulator.run(run, base, parts=False)
    assert varied is not None and np.linalg.norm(varied - quotient) < 1e-4 * np.linalg.norm(quotient)


def test_what_is_late_by_another_time_is_no_variation(simulator: Simulator) -> None:
    run, base = record(), {**DEVICE, "actuator_delay": 2e-6, "amplifier_time_constant": 1e-6}
    followed = simulator.follow(run, base)
    assert followed is not None
    others = [{"actuator_delay": 2.1e-6}, {"actuator_delay": 0.0}, {"amplifier_time_constant": 1.1e-6}]
    assert simulator.vary(followed, [(run, {**base, **own}) for own in others]) == [None, None, None]


def test_a_speed_does_not_go_through_the_lag(simulator: Simulator) -> None:
    run, base = record(senses="velocity"), {**DEVICE, **LATE["both"]}
    followed = simulator.follow(run, base)
    assert followed is not None
    job = run, {**base, "kxx": base["kxx"] * (1 + 1e-7)}
    [varied] = simulator.vary(followed, [job])
    quotient = simulator.run(*job) - simulator.run(run, base)
    assert varied is not None and np.linalg.norm(varied - quotient) < 1e-4 * np.linalg.norm(quotient)


@pytest.mark.parametrize("hold", ["zero", "first", "band-limited"])
@pytest.mark.parametrize("late", ["a part of a step", "whole steps", "steps and a part", "both"])
def test_an_acceleration_is_that_under_the_force_that_acts(simulator: Simulator, late: str, hold: str) -> None:
    base = {**DEVICE, **LATE[late], "kxy": 0.0, "dxy": 0.0}
    delay = base["actuator_delay"]
    # So fast that all three go in the same steps.
    t, w = np.arange(SAMPLES) * PERIOD, 2 * np.pi * 4500
    u = 2e-5 * np.cos(w * t)[:, None]
    made = {senses: make_record("run", t, u, u, sample_rate=1 / PERIOD, hold=hold, senses=senses)
            for senses in ("position", "velocity", "acceleration")}  # fmt: skip
    x, v, a = (
        simulator.run(own, {**base, "amplifier_time_constant": 0.0})[:, 0] * own.reference**own.order
        for own in made.values()
    )
    x, v, a = (own / base["sense_gain_x"] for own in (x, v, a))
    # Of a force that comes at a sample that which acted before.
    sent = {
        "zero": u[np.maximum(np.ceil(np.arange(SAMPLES) - delay / PERIOD - 1e-9).astype(int) - 1, 0), 0],
        "first": np.interp(t - delay, t, u[:, 0]),
        "band-limited": np.where(t > delay, 2e-5 * np.cos(w * (t - delay)), u[0, 0]),
    }[hold]
    force = sent - base["dxx"] * v - base["kxx"] * x
    error = (a - force / base["m"])[100:]
    # A force between samples comes by a Fourier series of a record that does not close.
    assert np.abs(error).max() < (1e-3 if hold == "band-limited" else 1e-9) * np.abs(a).max()


@pytest.mark.parametrize("hold", ["zero", "first", "band-limited"])
@pytest.mark.parametrize("beside", ["linear", "a mode", "friction"])
def test_columns_of_accelerations(simulator: Simulator, beside: str, hold: str) -> None:
    run, base = record(hold, "acceleration"), {**DEVICE, **BASES[beside], **LATE["both"]}
    followed = simulator.follow(run, base)
    assert followed is not None
    v = simulator.run(run, base, parts=False)
    jobs = [(run, {**base, name: base[name] + NAMES[name]}) for name in ("m", "kxx", "dxy", "x_start")]
    for job, varied in zip(jobs, simulator.vary(followed, jobs), strict=True):
        quotient = simulator.run(*job, parts=False) - v
        assert varied is not None
        # A friction that turns round within a step of 60 a period: as of speeds and voltages.
        limit = 1e-3 if beside == "friction" else 2e-4
        assert np.linalg.norm(varied - quotient) < limit * np.linalg.norm(quotient)


def test_a_lag_that_the_temperature_moves_is_not_followed(simulator: Simulator) -> None:
    base = {**DEVICE, "amplifier_time_constant": 1e-6, "tcp": 1e-9}
    assert simulator.follow(record(), base) is None


def test_a_base_that_is_late_is_served(simulator: Simulator) -> None:
    run, base = record("first"), {**DEVICE, **LATE["both"], "k3_x": 2e9}
    own = [{name: (1 + 1e-7) * base[name]} for name in ("kxx", "kyy", "dxx", "dyy", "m")]
    point = Point(run, base, simulator.run(run, base))
    with Simulator(MODEL, jobs=1) as fresh:
        quotients = Quotients(fresh, float(point.v.std()))
        simulated = quotients.columns(point, own)
        quotients.compare([point], own)
        assert list(fresh.seen.bases.values()) == [True]
        varied = quotients.columns(point, own)
    for one, other in zip(varied, simulated, strict=True):
        assert not np.array_equal(one, other)
        assert np.linalg.norm(one - other) < 2e-4 * np.linalg.norm(other)


@pytest.mark.parametrize("time_constant", [1e-9, 1e-6, 1e-5, 1e-3])
def test_a_tone_behind_the_lag(time_constant: float) -> None:
    t, w = np.arange(400) * PERIOD, 2 * np.pi * 3000
    tone = np.column_stack((np.sin(w * t), np.cos(w * t)))
    response = 1 / (1 + 1j * w * time_constant)
    settled = np.column_stack(((response * np.exp(1j * w * t)).imag, (response * np.exp(1j * w * t)).real))
    # It begins where the tone does.
    expected = settled + (tone[0] - settled[0]) * np.exp(-t / time_constant)[:, None]
    # Of a polynomial through six samples of 67 a period, 4e-9, and four times that at the ends.
    assert np.abs(lagged(tone, PERIOD, time_constant) - expected).max() < 5e-8


def test_a_constant_stays_and_a_short_voltage_is_left() -> None:
    constant = np.full((50, 2), 0.3)
    assert np.abs(lagged(constant, PERIOD, 3e-6) - 0.3).max() < 1e-15
    short = np.arange(2.0 * (STENCIL - 1)).reshape(-1, 2)
    assert np.array_equal(lagged(short, PERIOD, 3e-6), short)
