"""Courses: the mean over a hold against numerical integration, sharp edges, limits at jumps, blocks."""

from itertools import pairwise
from math import pi

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from cosim.scenarios.courses import Constant, Course, Part, Pieces, Record, Sine, Square, curve, ramps, steps
from cosim.scenarios.scenario import Scenario
from cosim.scenarios.spans import Spans, snapped
from gyro_model.errors import InputError

PERIODS = st.sampled_from([1e-3, 0.0123, 1 / 48.0, 0.1])
SMALL = st.floats(-10, 10)


def knots(least: int) -> st.SearchStrategy[tuple[np.ndarray, np.ndarray]]:
    """Times from 0 on with steps of 0.01 to 0.5 s, and values."""
    gaps = st.lists(st.floats(0.01, 0.5), min_size=least - 1, max_size=12)

    def points(gap: list[float]) -> st.SearchStrategy[tuple[np.ndarray, np.ndarray]]:
        values = st.lists(SMALL, min_size=len(gap) + 1, max_size=len(gap) + 1)
        return values.map(lambda v: (np.concatenate(([0.0], np.cumsum(gap))), np.array(v)))

    return gaps.flatmap(points)


WAVES = st.tuples(SMALL, st.floats(0.1, 4.0), st.floats(-720, 720))
COURSES = st.one_of(
    SMALL.map(Constant),
    WAVES.map(lambda w: Sine(*w)),
    WAVES.map(lambda w: Square(*w)),
    knots(1).map(lambda p: steps(*p)),
    knots(2).map(lambda p: ramps(*p)),
    knots(4).map(lambda p: curve(*p)),
)


def value(course: Course, t: float) -> float:
    return float(course.limits(np.array([t]))[1][0])


def integral(course: Course, begin: float, end: float) -> float:
    """By quadrature between the edges and knots that lie within."""
    inner = course.course if isinstance(course, Part) else course
    kinks = inner.times if isinstance(inner, Pieces) else course.edges(end + 1.0)
    kinks = np.concatenate((kinks, course.edges(end + 1.0)))
    inside = np.unique(np.clip(kinks[(kinks > begin) & (kinks < end)], begin, end))
    borders = [begin, *inside, end]
    return sum(quad(lambda t: value(course, t), a, b, epsabs=1e-12)[0] for a, b in pairwise(borders))


def span_of(course: Course) -> float:
    """How long a course lasts: a curve ends with its last reading."""
    inner = course.course if isinstance(course, Part) else course
    return float(inner.integral.x[-1]) if hasattr(inner, "integral") else np.inf


@settings(max_examples=150)
@given(COURSES, st.floats(0, 1), st.floats(0.01, 2), PERIODS, st.integers(0, 30))
def test_a_held_value_is_the_mean_of_the_course(
    inner: Course, begin: float, length: float, period: float, first: int
) -> None:
    assume((first + 3) * period <= span_of(inner))
    course = Part(inner, begin, begin + length)
    means = course.mean(Spans.of_samples(first, 3, period))
    for k, mean in enumerate(means):
        by_quadrature = integral(course, (first + k) * period, (first + k + 1) * period) / period
        # quad stops at 1e-12 for each of a dozen pieces, in a hold of 1e-3 s; a curve may overshoot them 1e3 times.
        assert mean == pytest.approx(by_quadrature, abs=1e-7, rel=1e-7)


@given(COURSES, st.floats(0, 0.2), st.integers(0, 40), st.integers(1, 40))
def test_blocks_change_no_bit(inner: Course, begin: float, first: int, count: int) -> None:
    assume(span_of(inner) >= 80 * 1e-3)
    course = Part(inner, begin, begin + 0.05)
    whole = course.mean(Spans.of_samples(0, 80, 1e-3))
    part = course.mean(Spans.of_samples(first, count, 1e-3))
    np.testing.assert_array_equal(part, whole[first : first + count])


@pytest.mark.parametrize("sample_rate", [1e3, 48e3, 2e5, 3e5])
@pytest.mark.parametrize("edge", [0.1, 0.3, 0.7, 1.1])
def test_edges_on_the_grid_stay_sharp(sample_rate: float, edge: float) -> None:
    # k * (1/rate) and the decimal differ by rounding for most of these.
    n, at = round(1.5 * sample_rate), round(edge * sample_rate)
    spans = Spans.of_samples(0, n, 1 / sample_rate)
    expected = np.where(np.arange(n) < at, 2.0, -3.0)
    np.testing.assert_array_equal(steps(np.array([0.0, edge]), np.array([2.0, -3.0])).mean(spans), expected)
    sequence = Part(Constant(2.0), until=edge).mean(spans) + Part(Constant(-3.0), begin=edge).mean(spans)
    np.testing.assert_array_equal(sequence, expected)


def test_waves_by_hand() -> None:
    quarter = Spans(np.array([0.0, 0.25, 0.5, 0.75, 1.0]), np.array([0.125, 0.375, 0.625, 0.875]), 0.25)
    # The mean of a sine over its first quarter is 2/pi; a phase of 90 deg makes it a cosine.
    np.testing.assert_allclose(Sine(1.0, 1.0).mean(quarter), np.array([2, 2, -2, -2]) / pi, rtol=1e-14)
    np.testing.assert_allclose(Sine(1.0, 1.0, 90.0).mean(quarter), np.array([2, -2, -2, 2]) / pi, rtol=1e-14)
    np.testing.assert_array_equal(Square(3.0, 1.0).mean(quarter), [3, 3, -3, -3])
    np.testing.assert_array_equal(Square(3.0, 1.0, 90.0).mean(quarter), [3, -3, -3, 3])
    # An edge at 0.375 s, in the middle of the second hold.
    np.testing.assert_allclose(Square(3.0, 1.0, 45.0).mean(quarter), [3, 0, -3, 0], atol=1e-15)
    np.testing.assert_allclose(Square(3.0, 1.0, 45.0).edges(1.0), [0.375, 0.875])


def test_ramps_by_hand() -> None:
    course = ramps(np.array([0.0, 1.0, 3.0]), np.array([0.0, 2.0, 0.0]))
    means = course.mean(Spans.of_samples(0, 3, 1.5))
    # 0 to 1 s: area 1; 1 to 1.5 s: from 2 to 1.5, area 0.875. Then 1.125 and nothing.
    np.testing.assert_allclose(means, np.array([1.875, 1.125, 0.0]) / 1.5, rtol=1e-15)


def test_a_curve_keeps_the_digits_of_small_changes_on_a_large_level() -> None:
    t = np.linspace(0, 3600, 3601)
    course = curve(t, 300 + 1e-3 * np.sin(2 * pi * t / 600))
    held = course.mean(Spans.of_samples(3599 * 200_000, 1000, 5e-6))
    # A record of 1 mK: without its level the integral of 1e6 K s would round to 2e-10 K s, 5e-5 K in a hold of 5 us.
    assert np.ptp(held) < 1e-7


def test_a_wave_faster_than_the_samples_is_refused() -> None:
    with pytest.raises(InputError, match=r"frequency = 600 Hz: samples each 0.001 s can't follow; give at most 500 Hz"):
        Sine(1.0, 600.0).mean(Spans.of_samples(0, 4, 1e-3))


def test_a_record_is_read_from_its_start_and_must_cover_the_run() -> None:
    inner = ramps(np.array([0.0, 10.0]), np.array([0.0, 10.0]))
    course = Part(Record("record r", 10.0, inner, start=4.0, begin=1.0), begin=1.0)
    np.testing.assert_allclose(course.mean(Spans.of_samples(0, 3, 1.0)), [0.0, 4.5, 5.5])
    course.mean(Spans.of_samples(6, 1, 1.0))
    with pytest.raises(InputError, match="record r is too short: it lasts 10 s and the run needs 11 s of it"):
        course.mean(Spans.of_samples(7, 1, 1.0))
    with pytest.raises(InputError, match="start 10 s lies outside the record r, which lasts 10 s"):
        Record("record r", 10.0, inner, start=10.0)


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: Sine(1.0, 0.0), "frequency = 0.0: give a positive number in Hz"),
        (lambda: Square(np.nan, 1.0), "amplitude = nan: give a finite number"),
        (lambda: Constant(np.inf), "value = inf"),
        (lambda: steps(np.array([0.0, 1.0]), np.array([1.0])), "2 times and 1 values"),
        (lambda: ramps(np.array([0.0, 1.0, 1.0]), np.zeros(3)), "times 1 then 1 s: let them increase"),
        (lambda: curve(np.array([0.0, 1.0]), np.zeros(2)), "2 rows are too few for a curve"),
        (lambda: Part(Constant(1.0), -1.0), "from = -1.0: give a time of 0 s or more"),
        (lambda: Part(Constant(1.0), 1.0, 1.0), "until = 1.0: give a time after 1 s"),
    ],
)
def test_what_can_not_be_is_refused_where_it_is_built(build: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        build()  # type: ignore[operator]


def scenario_of(**courses: tuple[Course, ...]) -> Scenario:
    return Scenario("test", "made here", 10.0, courses)


def test_edges_are_where_the_sum_jumps() -> None:
    # At 1 s one course goes on as the other ends; at 2 s the sum jumps; the sine begins and ends at zero.
    chosen = scenario_of(
        omega_z=(Part(ramps(np.array([0.0, 1.0]), np.array([0.0, 5.0])), 0.0, 1.0), Part(Constant(5.0), 1.0, 2.0)),
        v_bias=(Part(Sine(3.0, 1.0), 4.0, 6.0),),
        a_x=(steps(np.array([0.0, 3.0, 3.5]), np.array([1.0, 1.0, 2.0])),),
    )
    np.testing.assert_allclose(chosen.edges_until(10.0), [2.0, 3.5])
    np.testing.assert_allclose(chosen.edges_until(3.5), [2.0])


def test_opposite_jumps_cancel() -> None:
    up = steps(np.array([0.0, 0.7]), np.array([0.1, 0.4]))
    down = steps(np.array([0.0, 0.7]), np.array([-0.1, -0.4]))
    assert scenario_of(omega_z=(up, down)).edges_until(1.0).size == 0


def test_a_gap_holds_the_start_value() -> None:
    chosen = scenario_of(temperature=(Part(Constant(350.0), 1.0, 2.0), Part(Sine(2.0, 0.25), 1.0, 2.0)))
    held = chosen.inputs(0, 3, 1.0)[:, 1]
    # The mean of 2 sin(pi t/2) from 1 to 2 s is 4/pi.
    np.testing.assert_allclose(held, [298.15, 350 + 4 / pi, 298.15], rtol=1e-14)
    np.testing.assert_allclose(chosen.edges_until(10.0), [1.0, 2.0])


def test_a_temperature_that_can_not_be_meant_is_refused() -> None:
    with pytest.raises(InputError, match=r"temperature reaches 25 K from 0 s on: give 100 to 600 K; is its unit right"):
        scenario_of(temperature=(Constant(25.0),))
    # One after the other, not on top of each other.
    scenario_of(temperature=(Part(Constant(400.0), until=1.0), Part(Constant(400.0), begin=1.0)))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "a/b"}, "name = 'a/b': give one that a folder can have"),
        ({"duration": 0.0}, "duration = 0.0: give a positive time in s"),
        ({"angle_unit": "D"}, "angle_unit = 'D': give A, B, C"),
        ({"courses": {"omega": (Constant(1.0),)}}, "input 'omega' is unknown; did you mean 'omega_z'"),
        ({"parameters": {"x_start": np.nan}}, "parameter x_start = nan"),
    ],
)
def test_a_scenario_checks_itself(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Scenario(**({"name": "n", "description": "d", "duration": 1.0} | changes))  # type: ignore[arg-type]


def test_a_damping_step_is_an_edge_only_where_it_acts() -> None:
    on = {"damping_step_factor": 2.0, "damping_step_time": 0.3}
    np.testing.assert_array_equal(Scenario("n", "d", 1.0, {}, on).edges_until(1.0), [0.3])
    for off in ({"damping_step_time": 0.3}, {"damping_step_factor": 1.0, "damping_step_time": 0.3}):
        assert Scenario("n", "d", 1.0, {}, off).edges_until(1.0).size == 0


@given(st.integers(1, 10**8), st.floats(1e3, 1e7))
def test_snapping_undoes_the_rounding_of_the_grid_and_nothing_else(k: int, rate: float) -> None:
    edge = k / rate
    grid = k * (1 / rate)
    np.testing.assert_array_equal(snapped(np.array([grid]), np.array([edge])), [edge])
    off = edge + 0.01 / rate
    if 0.01 / rate > 2e-12 * edge:
        np.testing.assert_array_equal(snapped(np.array([off]), np.array([edge])), [off])
