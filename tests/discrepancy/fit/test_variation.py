"""Columns by the variation of a motion, against quotients of simulations and sensitivities of the reference."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from discrepancy.data.record import Record, make_record
from discrepancy.fit.quotients import FEWEST, Point, Quotients, is_smooth
from discrepancy.fit.simulate import Simulator
from discrepancy.name.columns import nameable
from gyro_model.anatomy import Delay, Effect, Follow, Force, Lag
from gyro_model.device import load_device
from gyro_model.model import load_model
from gyro_model.quantities import Quantity
from gyro_model.reference import sensitivities

MODEL = load_model()
DEVICE = load_device("reference").all_parameters | {
    "x_start": 2e-7, "y_start": -1e-7, "sense_noise": 0.0, "k3_x": 2e8, "angular_gain": 0.9,
}  # fmt: skip
SAMPLES, PERIOD = 3000, 5e-6
SMALL: Final = 1e-6
"""Change of the voltage over the voltage that a size is moved by: its square is then far below what is asked."""
AGREES: Final = 2e-3
"""Of a column: at 60 samples a period a smooth one is right to 1e-5 and a quotient of SMALL is rounded to 1e-7; dry
friction changes its sign within a step or two, which makes 1.3e-3."""


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(MODEL, jobs=1) as made:
        yield made


def record(samples: int = SAMPLES, hold: str = "zero", senses: str = "position", *, axes: int = 2) -> Record:
    """Two tones on each axis, a rate, temperature and bias that change, and acceleration."""
    t = np.arange(samples) * PERIOD
    u = 2e-5 * np.sin(2 * np.pi * t[:, None] * [3100.0, 3350.0] + [0.0, 1.0])[:, :axes]
    conditions = {
        "omega_z": 3.0 * np.sin(2 * np.pi * 200 * t) if axes == 2 else np.zeros(samples),
        "temperature": 300.0 + 20.0 * t / t[-1],
        "v_bias": 5.0 + np.sin(2 * np.pi * 300 * t),
        "a_x": np.full(samples, 9.81),
    }
    return make_record("run", t, u, u, conditions=conditions, sample_rate=1 / PERIOD, hold=hold,
                       senses=senses)  # fmt: skip


def probe(simulator: Simulator, run: Record, base: Mapping[str, float], q: Quantity, shapes: Mapping[str, float]
          ) -> dict[str, float] | None:  # fmt: skip
    """A change of ``q`` that moves the voltage by SMALL; None where none does."""
    v = simulator.run(run, base, parts=False)
    step = 1e-3 * (q.typical if q.typical else 1.0)
    for _ in range(8):
        sign = -1.0 if q.start + step > q.high else 1.0
        changes = {**shapes, q.name: base.get(q.name, q.start) + sign * step}
        change = np.linalg.norm(simulator.run(run, {**base, **changes}, parts=False) - v) / np.linalg.norm(v)
        if not np.isfinite(change) or change > 10 * SMALL:
            step *= 0.1 if not np.isfinite(change) else SMALL / change
        elif change < 0.1 * SMALL:
            step *= 1e3 if change < 1e-12 else SMALL / change
        else:
            return changes
    return None


def both(simulator: Simulator, run: Record, base: Mapping[str, float], changes: Mapping[str, float]
         ) -> tuple[np.ndarray, np.ndarray | None]:  # fmt: skip
    motion = simulator.follow(run, base)
    assert motion is not None
    quotient = simulator.run(run, {**base, **changes}, parts=False) - simulator.run(run, base, parts=False)
    [varied] = simulator.vary(motion, [(run, {**base, **changes})])
    return quotient, varied


def is_carried(effect: Effect) -> bool:
    """Whether an effect carries more than the motion from step to step, or acts between steps."""
    jumps = isinstance(effect, Force) and effect.impulse is not None
    return isinstance(effect, Delay | Lag | Follow) or bool(effect.memories) or jumps


SIZES = [(e, q) for e in nameable(MODEL, limits=False) for q in e.sizes]


SENSORS = [("position", "zero"), ("velocity", "zero"), ("acceleration", "zero"), ("acceleration", "first")]


@pytest.mark.parametrize(("senses", "hold"), SENSORS)
@pytest.mark.parametrize(("effect", "q"), SIZES, ids=[q.name for _, q in SIZES])
def test_every_size_is_as_by_simulation_or_is_not_followed(
    simulator: Simulator, effect: Effect, q: Quantity, senses: str, hold: str
) -> None:
    run = record(SAMPLES, hold, senses)
    shapes = {s.name: s.typical for s in effect.parameters if s.role == "shape" and s.typical}
    if effect.id == "damping_step":
        shapes["damping_step_time"] = 1000 * PERIOD
    changes = probe(simulator, run, DEVICE, q, shapes)
    if changes is None:
        pytest.skip("changes nothing here alone")
    quotient, varied = both(simulator, run, DEVICE, changes)
    if is_carried(effect) or simulator.refines(changes):
        assert varied is None
    elif effect.id == "hysteresis":
        # Its states are far from linear in what drives them, so that it is no variation of anything: a kind to refuse.
        assert varied is not None and np.linalg.norm(varied - quotient) > AGREES * np.linalg.norm(quotient)
    else:
        assert varied is not None
        assert np.linalg.norm(varied - quotient) < AGREES * np.linalg.norm(quotient)


@pytest.mark.parametrize("name", ["m", "kxx", "kyy", "kxy", "dxx", "dxy", "x_start", "y_dot_start", "sense_gain_x"])
def test_every_nominal_parameter_is_as_by_simulation(simulator: Simulator, name: str) -> None:
    run, size = record(), {"kxy": DEVICE["kxx"], "dxy": DEVICE["dxx"], "x_start": 1e-6, "y_dot_start": 0.02}
    changes = {name: DEVICE[name] + 1e-7 * size.get(name, DEVICE[name])}
    quotient, varied = both(simulator, run, DEVICE, changes)
    assert varied is not None
    assert np.linalg.norm(varied - quotient) < 1e-4 * np.linalg.norm(quotient)


BEGUN = {"parasitic_start": -1e-6, "parasitic_dot_start": 0.1}


@pytest.mark.parametrize(("senses", "hold"), SENSORS)
@pytest.mark.parametrize("start", [{}, {"parasitic_start": 3e-6}, BEGUN])
def test_a_mode_that_begins_in_motion_is_as_by_simulation(
    simulator: Simulator, start: Mapping[str, float], senses: str, hold: str
) -> None:
    mode = {"parasitic_coupling": 1e-4, "parasitic_frequency": 4100.0, "parasitic_q": 300.0}
    quotient, varied = both(simulator, record(SAMPLES, hold, senses), DEVICE, {**mode, **start})
    assert varied is not None
    # Fourth order at 49 samples a period of the mode: (w h)^4 = 2.8e-4, of which a tenth is left.
    assert np.linalg.norm(varied - quotient) < 1e-4 * np.linalg.norm(quotient)
    # Nothing is integrated before the first sample.
    assert np.abs(varied[0] - quotient[0]).max() < 1e-6 * np.abs(quotient).max()


MODE: Final = {
    "parasitic_coupling": 5.0, "parasitic_frequency": 4100.0, "parasitic_q": 300.0, "parasitic_joint": 1.0,
    "parasitic_start": 1e-9,
}  # fmt: skip
LOOP: Final = {"hysteresis_x": 1e-6, "hysteresis_length": 3e-7}
BESIDE_MODE: Final = ["m", "kxx", "kyy", "kxy", "dxx", "x_start", "k3_x", "k3_y", *MODE]
NATURAL: Final = {"kxy": DEVICE["kxx"], "x_start": 1e-6, "k3_y": 1e12, "parasitic_start": 1e-6}


def moved(base: Mapping[str, float], name: str) -> dict[str, float]:
    """``name`` by 1e-6 of what is natural for it."""
    return {name: base.get(name, 0.0) + 1e-6 * NATURAL.get(name, base.get(name, 0.0))}


@pytest.mark.parametrize(("senses", "hold"), SENSORS)
@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("name", BESIDE_MODE)
def test_beside_a_mode_every_parameter_is_as_by_simulation(
    simulator: Simulator, name: str, linear: bool, senses: str, hold: str
) -> None:
    base = {**DEVICE, **MODE} | ({"k3_x": 0.0} if linear and name != "k3_x" else {})
    quotient, varied = both(simulator, record(SAMPLES, hold, senses), base, moved(base, name))
    assert varied is not None
    # By the curvature of a quotient of 1e-6, at a mode of Q = 300.
    assert np.linalg.norm(varied - quotient) < 3e-4 * np.linalg.norm(quotient)


@pytest.mark.parametrize("name", ["m", "kxx", "dxx", "x_start", "k3_x", "hysteresis_x", "parasitic_frequency"])
def test_beside_a_hysteresis_too(simulator: Simulator, name: str) -> None:
    base = {**DEVICE, **MODE, **LOOP}
    quotient, varied = both(simulator, record(), base, moved(base, name))
    assert varied is not None
    # A turning point, where it has a corner, lies anywhere in one of 60 steps a period.
    assert np.linalg.norm(varied - quotient) < 5e-3 * np.linalg.norm(quotient)


def test_a_mode_that_is_not_there_any_more_is_no_variation(simulator: Simulator) -> None:
    run, base = record(300), {**DEVICE, **MODE}
    motion = simulator.follow(run, base)
    assert motion is not None
    assert simulator.vary(motion, [(run, {**base, "parasitic_coupling": 0.0})]) == [None]


def test_it_is_the_sensitivity_of_the_reference(simulator: Simulator) -> None:
    """By DOP853 on the variational equation, of which no line is C."""
    names, run = ("kxx", "dxy", "k3_x", "m"), record(300)
    device = load_device("reference").with_parameters({n: v for n, v in DEVICE.items() if n != "sense_noise"})
    inputs = {"u_x": run.u[:, 0], "u_y": run.u[:, 1], **run.conditions}
    exact = sensitivities(device, names, run.t, inputs)
    motion = simulator.follow(run, DEVICE)
    assert motion is not None
    for i, name in enumerate(names):
        step = 1e-6 * abs(DEVICE[name] or DEVICE["dxx"])
        [varied] = simulator.vary(motion, [(run, {**DEVICE, name: DEVICE[name] + step})])
        assert varied is not None
        true = exact[:, [0, 2], i] * [DEVICE["sense_gain_x"], DEVICE["sense_gain_y"]]
        # Fourth order at 60 samples a period: (w h)^4/4320 = 3e-8; the rates' rounding, 1e-16, over a step of 1e-6; the
        # curvature of 1/m.
        assert np.abs(varied / step - true).max() < 1e-5 * np.abs(true).max(), name


@pytest.mark.parametrize("hold", ["first", "band-limited"])
def test_a_force_that_runs_between_samples(simulator: Simulator, hold: str) -> None:
    quotient, varied = both(simulator, record(hold=hold), DEVICE, {"k3_y": 1e5})
    assert varied is not None
    assert np.linalg.norm(varied - quotient) < 1e-4 * np.linalg.norm(quotient)


SWELL = """
'''A force that swells.'''

from sympy import sin

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import shape, size
from gyro_model.symbols import t, x

SWELL = size("swell", "N", "amplitude", nominal=1e-7, display="µN")
RATE = shape("swell_rate", "1/s", 2000.0, "angular frequency", low=1.0, search=None)
force = SWELL.symbol * sin(RATE.symbol * t)
EFFECT = Force(
    id="swell",
    parameters=(SWELL, RATE),
    force=(force, 0),
    energy=Energy(stored=-force * x),
    signature="a line at 318 Hz",
    host_experiment="no drive",
    limits=(
        Limit(
            why="at the start",
            at={"swell": 1e-6, "swell_rate": 2000.0, "t": 0.0},
            gives={"force_x": 0.0, "force_y": 0.0},
        ),
    ),
)
"""


def test_a_force_that_goes_with_time(tmp_path: Path) -> None:
    (tmp_path / "swell.py").write_text(SWELL)
    with Simulator(load_model(tmp_path), jobs=1) as own:
        quotient, varied = both(own, record(), DEVICE, {"swell": 1e-10, "swell_rate": 2000.0})
    assert varied is not None
    assert np.linalg.norm(varied - quotient) < 1e-4 * np.linalg.norm(quotient)


def test_a_speed_and_a_single_axis(simulator: Simulator) -> None:
    run = replace(record(axes=1), senses="velocity", reference=2 * np.pi * 3000)
    quotient, varied = both(simulator, run, DEVICE, {"k3_x": 2.0001e8})
    assert varied is not None and varied.shape == (SAMPLES, 1)
    assert np.linalg.norm(varied - quotient) < 1e-4 * np.linalg.norm(quotient)


DISTORTED = [{"clock_skew": 2e-5}, {"channel_delay": 3e-6}, {"force_scale": 0.05}, {"force_filter": 2e-6},
             {"clock_skew": 1e-4, "force_scale": -0.02}, {"voltage_filter": 2e-6}, {"voltage_filter": 2e-5},
             {"voltage_filter": 3e-6, "actuator_delay": 7e-6, "amplifier_time_constant": 2e-6},
             {"force_filter": 3e-6, "actuator_delay": 7e-6, "amplifier_time_constant": 2e-6}]  # fmt: skip


@pytest.mark.parametrize(("senses", "hold"), SENSORS)
@pytest.mark.parametrize("base", DISTORTED, ids="-".join)
def test_what_a_defect_of_the_record_leaves_of_it(
    simulator: Simulator, base: Mapping[str, float], senses: str, hold: str
) -> None:
    run, own = record(SAMPLES, hold, senses), {**DEVICE, **base}
    if senses == "acceleration" and "voltage_filter" in base:
        # It is the slope of speeds in parts of a step.
        assert simulator.follow(run, own) is None
        return
    late = hold != "zero" or "actuator_delay" in base
    if senses == "acceleration" and late and any(name.startswith("force") for name in base):
        # Its force at a sample is not known.
        assert simulator.follow(run, own) is None
        return
    quotient, varied = both(simulator, run, own, {"k3_x": 2.0001e8})
    assert varied is not None and np.linalg.norm(varied - quotient) < 1e-4 * np.linalg.norm(quotient)


def test_a_defect_that_is_another_is_no_variation(simulator: Simulator) -> None:
    run, base = record(300), {**DEVICE, "clock_skew": 2e-5}
    followed = simulator.follow(run, base)
    assert followed is not None
    assert simulator.vary(followed, [(run, {**base, "clock_skew": 3e-5})]) == [None]


def test_a_motion_that_carries_more_is_not_followed(simulator: Simulator) -> None:
    assert simulator.follow(record(), {**DEVICE, "play": 1e-6}) is None


def probes() -> list[dict[str, float]]:
    near = 1 + 1e-7
    return [{name: near * DEVICE[name]} for name in ("kxx", "kyy", "dxx", "dyy", "m")]


def test_kinds_that_it_does_not_give_are_simulated(simulator: Simulator) -> None:
    parasitic = {"parasitic_coupling": 1e-3, "parasitic_frequency": 5000.0, "parasitic_q": 50.0}
    own = [*probes(), {"hysteresis_x": 1e-12}, {"play": 1e-12}, parasitic]
    run = record()
    point, signal = Point(run, DEVICE, simulator.run(run, DEVICE)), 0.2
    with Simulator(MODEL, jobs=1) as fresh:
        quotients = Quotients(fresh, signal)
        assert len(own) >= FEWEST
        before = quotients.columns(point, own)
        quotients.compare([point], own)
        kinds = {kind[0][0]: good for kind, good in fresh.seen.kinds.items()}
        assert kinds["hysteresis_x"] is kinds["play"] is False
        assert kinds["parasitic_coupling"] is True
        assert list(fresh.seen.bases.values()) == [True]
        after = quotients.columns(point, own)
    assert np.array_equal(before[5:7], after[5:7])
    assert not np.array_equal(before[0], after[0])
    for one, other in zip(before, after, strict=True):
        assert np.linalg.norm(one - other) < AGREES * np.linalg.norm(one)


def test_what_acts_on_the_record_is_another_base(simulator: Simulator) -> None:
    run, filtered = record(), {**DEVICE, "voltage_filter": 2e-6}
    with Simulator(MODEL, jobs=1) as fresh:
        quotients = Quotients(fresh, 0.2)
        for base in (filtered, DEVICE):
            quotients.compare([Point(run, base, simulator.run(run, base))], probes())
        served = {bool("voltage_filter" in base): good for base, good in fresh.seen.bases.items()}
    assert served == {True: True, False: True}


def test_a_large_change_is_simulated_and_no_test_of_a_kind(simulator: Simulator) -> None:
    run, stiffer = record(), {"k3_y": 1e9}
    point = Point(run, DEVICE, simulator.run(run, DEVICE))
    with Simulator(MODEL, jobs=1) as fresh:
        quotients = Quotients(fresh, 0.2)
        quotients.compare([point], [*probes(), stiffer])
        columns = quotients.columns(point, [*probes(), stiffer])
    assert np.array_equal(columns[-1], simulator.run(run, {**DEVICE, **stiffer}) - point.v)


def test_smooth_effects_are_those_without_corner_event_or_memory() -> None:
    smooth = {e.id for e in MODEL.effects if is_smooth(e)}
    assert {"cubic_stiffness", "thermal_stiffness", "pickoff_nonlinearity", "electrostatic_softening"} <= smooth
    assert not smooth & {"dry_friction", "contact_stop", "damping_step", "play", "parasitic_mode", "frame_rotation"}


@pytest.mark.parametrize("speed", [1e-6, 1e-7])
@pytest.mark.parametrize("mode", [{}, {"parasitic_coupling": 3.0, "parasitic_frequency": 5000.0, "parasitic_q": 50.0}])
def test_columns_go_through_rests(simulator: Simulator, speed: float, mode: dict[str, float]) -> None:
    """Of an axis that friction holds for two fifths of the time, and lets go again."""
    run = record(axes=1)
    run = replace(run, u=run.u * np.where(run.t[:, None] % 5e-3 < 2.5e-3, 1.0, 0.3))
    held = DEVICE | mode | {"friction_x": 1.2e-5, "friction_speed": speed, "kxy": 0.0, "dxy": 0.0, "y_start": 0.0}
    steps = np.abs(np.diff(simulator.run(run, held, parts=False), axis=0))
    assert 0.3 < np.mean(steps < 1e-2 * steps.max(axis=0)) < 0.5
    for name in ("m", "kxx", "dxx", "friction_x", "k3_x", *mode):
        quotient, varied = both(simulator, run, held, {name: held[name] * (1 + 1e-7)})
        assert varied is not None
        error = np.abs(varied - quotient).max(axis=1)
        # A sample that a jump of the quotient falls on is off by all of it.
        assert np.sort(error)[: -len(error) // 100].max() < AGREES * np.abs(quotient).max(), name
