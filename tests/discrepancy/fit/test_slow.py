"""Slow motion beside resonators: by frequency responses of two masses, and fits of what nothing holds."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.structures import Structure, motion
from discrepancy.data.record import Record, Senses, make_record
from discrepancy.fit.fitted import Free
from discrepancy.fit.refit import SETTLED, Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.fit.slow import adrift, as_slow, moved_along, taken
from gyro_model.model import load_model

MODEL = load_model()
MOTOR, LOAD, SPRING, DAMPERS = 1.0, 0.7, 3000.0, (1.5, 0.4, 0.6)
"""kg, kg, N/m; to ground of each, and between [N s/m]."""
RATE, SAMPLES, NOISE = 500.0, 4000, 3e-3


def device(motor: float = MOTOR, load: float = LOAD, spring: float = SPRING) -> dict[str, float]:
    """A motor and its load on a spring, held by nothing, as a mass and a resonator, by hand: q is the load's place,
    scaled by the root of the masses' ratio and turned round."""
    w, (ground, other, along) = np.sqrt(spring / load), DAMPERS
    between = along / (along + other)
    return {
        "m": motor, "kxx": spring, "dxx": ground + along - along * between, "sense_gain_x": 1.0,
        "parasitic_coupling": spring * float(np.sqrt(motor / load)), "parasitic_frequency": float(w) / (2 * np.pi),
        "parasitic_q": load * float(w) / (along + other), "parasitic_joint": between,
    }  # fmt: skip


def structure() -> Structure:
    ground, other, along = DAMPERS
    damping = np.array([[ground + along, -along], [-along, other + along]])
    return Structure(np.diag([MOTOR, LOAD]), damping, SPRING * np.array([[1.0, -1.0], [-1.0, 1.0]]), 0, 0)


def record(senses: Senses, noise: float = NOISE) -> Record:
    t, rng, f = np.arange(SAMPLES) / RATE, np.random.default_rng(4), np.arange(2, 100) * 0.25
    u = np.cos(2 * np.pi * np.outer(t, f) + rng.uniform(0, 2 * np.pi, len(f))).sum(axis=1)
    v = motion(structure(), u, 1 / RATE, "first")[:, ("position", "velocity", "acceleration").index(senses)]
    v = v + noise * v.std() * rng.standard_normal(len(v))
    return make_record("run", t, u[:, None], v[:, None], sample_rate=RATE, hold="first", senses=senses)


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(MODEL, jobs=1) as made:
        yield made


def test_what_is_taken_is_the_response_at_low_frequencies() -> None:
    p = device()
    own = taken(p, MODEL)
    # Of two masses that nothing holds, all that is left is what moves both.
    assert p["kxx"] - own["kxx"] == pytest.approx(0.0, abs=1e-9 * SPRING)
    assert p["dxx"] - own["dxx"] == pytest.approx(DAMPERS[0] + DAMPERS[1], rel=1e-9)
    # The response of the load from its own matrices, at a thousandth of its frequency: beside 1e-6 of it.
    s = 1j * 1e-3 * 2 * np.pi * p["parasitic_frequency"]
    m, d, k = structure()[:3]
    stiff = m * s**2 + d * s + k
    force = stiff[0, 0] - stiff[0, 1] * stiff[1, 0] / stiff[1, 1]
    mass = (force.real - (p["kxx"] - own["kxx"])) / (s**2).real
    assert p["m"] - own["m"] == pytest.approx(mass, rel=1e-5)


def test_a_long_step_leaves_slow_motion_straight() -> None:
    before, after = device(), device(motor=1.02, load=0.65, spring=3300.0)
    free = ("kxx", "dxx")
    # To both a spring of nothing is left: so it is for any step that is straight between them.
    bent = as_slow(before, {name: 0.5 * (before[name] + after[name]) for name in before}, free, MODEL)
    straight = {name: before[name] + 1e-6 * (after[name] - before[name]) for name in before}
    slope = {name: (straight[name] - taken(straight, MODEL)[name] - before[name] + taken(before, MODEL)[name]) / 1e-6
             for name in free}  # fmt: skip
    for name in free:
        now = bent[name] - taken(bent, MODEL)[name]
        then = before[name] - taken(before, MODEL)[name]
        # A slope from a millionth of a step.
        assert now - then == pytest.approx(0.5 * slope[name], abs=1e-8 * before[name])
    # What a straight step itself leaves is no spring of that size.
    halfway = {name: 0.5 * (before[name] + after[name]) for name in before}
    assert abs(halfway["kxx"] - taken(halfway, MODEL)["kxx"]) > 1e-3 * SPRING


def test_what_is_not_free_stays() -> None:
    before, after = device(), device(motor=1.02, load=0.65, spring=3300.0)
    assert as_slow(before, after, (), MODEL) == after


def test_a_mass_is_adrift_where_no_spring_shows() -> None:
    p = device()
    duration = SAMPLES / RATE
    assert adrift(p, 1, MODEL, duration) == ("x_start",)
    # A period of the run: (2 pi/8 s)^2 times both masses, 1.05 N/m.
    assert adrift({**p, "kxx": p["kxx"] + 1.05}, 1, MODEL, duration) == ()


def test_a_mass_that_nothing_holds_goes_the_same_way_from_anywhere(simulator: Simulator) -> None:
    run, p = record("velocity", noise=0.0), device()
    away = {"x_start": 0.5, "x_dot_start": 0.01, "parasitic_start": -0.4, "parasitic_dot_start": 0.0}
    near = moved_along(away, "x_start", p, MODEL)
    assert near["x_start"] == 0.0
    one, other = simulator.run(run, {**p, **away}), simulator.run(run, {**p, **near})
    # Rounding of the place, 1e-16 of 0.5 m beside 1e-3 m, by the spring.
    np.testing.assert_allclose(one, other, atol=1e-9 * float(np.abs(one).max()))


def test_a_place_that_no_sensor_sees_does_not_run_away(simulator: Simulator) -> None:
    """Beside a spring that is nearly none: from twelve starts three fits ended at the noise where it did."""
    run, rng, ended = record("acceleration"), np.random.default_rng(1), 0
    for _ in range(12):
        begun = device(1 + rng.uniform(-0.025, 0.025), 0.7 + rng.uniform(-0.03, 0.03), 3000 + rng.uniform(-120, 120))
        begun["sense_gain_x"] = run.reference**run.order
        free = tuple(Free(name, 1e-6 * value, 0.0) for name, value in begun.items() if name != "sense_gain_x")
        fitter, place = Fitter(simulator, [run]), rng.choice([0.0, 0.03, 0.003])
        starts = ({"x_start": place, "x_dot_start": 0.0, "y_start": 0.0, "y_dot_start": 0.0},)
        found = fitter.fit(fitter.evaluated(replace(fitter.begin(begun), parameters=begun, free=free, starts=starts)))
        ended += found.left < SETTLED and np.std(found.residuals[0]) < 1.04 * NOISE * np.std(run.v)
    # Ten do on the machine that this was chosen on; which do depends on the last digits of sums.
    assert ended >= 8


@pytest.mark.parametrize("senses", ["position", "velocity", "acceleration"])
def test_a_fit_goes_along_the_valley_of_what_nothing_holds(simulator: Simulator, senses: Senses) -> None:
    run, true = record(senses), device()
    gain = {"sense_gain_x": run.reference**run.order}
    begun = device(motor=1.02, load=0.69, spring=3060.0) | gain
    steps = {name: 1e-6 * value for name, value in begun.items() if name != "sense_gain_x"}
    fitter = Fitter(simulator, [run])
    free = tuple(Free(name, step, 0.0) for name, step in steps.items())
    starts = ({"x_start": 0.03, "x_dot_start": 0.0, "y_start": 0.0, "y_dot_start": 0.0},)
    at = replace(fitter.begin(begun), parameters=begun, free=free, starts=starts)
    found = fitter.fit(fitter.evaluated(at))
    assert found.left < SETTLED
    # Nothing but noise, of 4000 samples within three deviations.
    assert np.std(found.residuals[0]) / np.std(run.v) == pytest.approx(NOISE, rel=3 / np.sqrt(2 * SAMPLES))
    for name, deviation in fitter.deviations(found).items():
        assert abs(found.parameters[name] - true[name]) < 4 * deviation, name
