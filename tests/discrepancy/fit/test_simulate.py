"""The simulation of records: how the force runs between samples, against exact responses of the linear oscillator."""

from collections.abc import Iterator

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import butter, lsim

from benchmarks.rubbing import Rubbing, motion
from benchmarks.structures import Structure
from discrepancy.clock import Clock, OutOfTime
from discrepancy.data.record import Record, make_record
from discrepancy.fit.bench import Bench
from discrepancy.fit.quotients import Point, Quotients
from discrepancy.fit.simulate import Simulator
from gyro_model.model import load_model

OSCILLATOR = {"m": 5e-6, "kxx": 1.0, "dxx": 2.5e-4, "sense_gain_x": 1.0}
"""71 Hz, Q = 9."""
PERIOD = 1 / 610.35
"""Nine samples in a period of the mode."""
SETTLED = 400
"""Samples after which the start has decayed to exp(-25 x 0.66) = 1e-7."""


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(load_model(), jobs=1) as made:
        yield made


def record(hold: str, frequency: float) -> Record:
    t = np.arange(2000) * PERIOD
    u = 0.02 * np.sin(2 * np.pi * frequency * t)
    return make_record("run", t, u, u, sample_rate=1 / PERIOD, hold=hold)


def exact(run: Record, interp: bool) -> np.ndarray:
    """The oscillator from rest under a force that is held (or linear) between samples, by matrix exponentials."""
    p = OSCILLATOR
    return np.asarray(lsim(([1], [p["m"], p["dxx"], p["kxx"]]), run.u[:, 0], run.t, interp=interp)[1])


@pytest.mark.parametrize("frequency", [40.0, 70.0, 200.0])
def test_force_held_over_a_long_period(simulator: Simulator, frequency: float) -> None:
    run = record("zero", frequency)
    v = simulator.run(run, OSCILLATOR)[:, 0]
    # A linear motion is exact over a step of any length; time is in whole picoseconds, 3e-10 of a step.
    static = np.abs(run.u).max() / OSCILLATOR["kxx"]
    assert np.abs(v - exact(run, False)).max() < 1e-9 * max(static, np.abs(v).max())


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("slower", [1e2, 1e4])
def test_a_slow_device_moves_as_a_fast_one(simulator: Simulator, slower: float, hold: str) -> None:
    """Where all times are as much longer, with a spring that bends, a film that damps and dry friction."""
    own = OSCILLATOR | {
        "k3_x": 5e2, "d2_x": 1e-2, "friction_x": 1e-3, "friction_speed": 0.05,
        "hysteresis_x": 2e-3, "hysteresis_length": 0.02,
    }  # fmt: skip
    fast = record(hold, 70.0)
    slow = make_record("run", fast.t * slower, fast.u, fast.u, sample_rate=1 / (PERIOD * slower), hold=hold)
    times = {"m": slower**2, "dxx": slower, "d2_x": slower, "friction_speed": 1 / slower}
    v = simulator.run(fast, own)
    other = simulator.run(slow, {name: value * times.get(name, 1.0) for name, value in own.items()})
    # Time is in whole picoseconds: 3e-10 of a sample period.
    assert np.abs(other - v).max() < 1e-9 * np.abs(v).max()


@pytest.mark.parametrize(("frequency", "relative"), [(40.0, 1e-4), (70.0, 1e-4), (200.0, 2e-2)])
def test_force_linear_between_samples(simulator: Simulator, frequency: float, relative: float) -> None:
    run = record("first", frequency)
    v = simulator.run(run, OSCILLATOR)[SETTLED:, 0]
    # What is left is of fourth order: (pi f h)^4 = 3e-5 at the mode, 1e-2 at 200 Hz, for steps h of a third; a plain
    # hold of the middle would be off by (pi f h)^2/3 = 5e-3 at the mode.
    assert np.abs(v - exact(run, True)[SETTLED:]).max() < relative * np.abs(v).max()


@pytest.mark.parametrize(("frequency", "relative"), [(40.0, 2e-5), (70.0, 1e-5), (200.0, 2e-3)])
def test_force_band_limited(simulator: Simulator, frequency: float, relative: float) -> None:
    run, w = record("band-limited", frequency), 2 * np.pi * frequency
    # The ends of a record do not say how the force ran beyond them.
    inside = slice(SETTLED, -SETTLED)
    v = simulator.run(run, OSCILLATOR)[inside, 0]
    p = OSCILLATOR
    response = 1 / (p["kxx"] - p["m"] * w**2 + 1j * w * p["dxx"])
    true = 0.02 * np.imag(response * np.exp(1j * w * run.t[inside]))
    # Only images at 3/T - f are left, f/(3/T - f) as strong, and weaker in the motion by (f0/(3/T - f))^2 over the
    # response at f: 2e-5 at 40 Hz, 6e-5/Q at the mode, 2e-3 at 200 Hz.
    assert np.abs(v - true).max() < relative * np.abs(true).max()


FAST = {"m": 1e-7, "kxx": 100.0, "dxx": 2e-6, "sense_gain_x": 1.0}
"""5 kHz, Q = 1600."""


def stepped(u: np.ndarray, period: float, delay: float, lag: float) -> np.ndarray:
    """``FAST`` from rest under a held force that switches ``delay`` after each sample, seen through a ``lag``, by
    matrix exponentials of (x, x', lagged x)."""
    p, seen = FAST, 1 / lag if lag else 0.0
    rate = np.array([[0, 1, 0], [-p["kxx"] / p["m"], -p["dxx"] / p["m"], 0], [seen, 0, -seen]])
    whole = np.block([[rate, np.array([[0], [1 / p["m"]], [0]])], [np.zeros((1, 4))]])
    before, after = expm(whole * delay), expm(whole * (period - delay))
    state, past, x = np.zeros(3), u[0], np.zeros(len(u))
    for k, force in enumerate(u):
        x[k] = state[2 if lag else 0]
        state = (after @ np.append((before @ np.append(state, past))[:3], force))[:3]
        past = force
    return x


@pytest.mark.parametrize(
    ("name", "size"), [("actuator_delay", 1e-8), ("actuator_delay", 1.3e-6), ("amplifier_time_constant", 1e-7)]
)
def test_delay_and_lag_of_a_part_of_a_step(simulator: Simulator, name: str, size: float) -> None:
    period, t = 5e-6, np.arange(3000) * 5e-6
    u = 1e-6 * np.sin(2 * np.pi * np.outer(t, [3.1e3, 4.9e3, 5.2e3, 6.4e3]) + np.arange(4)).sum(axis=1)
    run = make_record("run", t, u, u, sample_rate=1 / period)
    plain, late = (simulator.run(run, p)[:, 0] for p in (FAST, FAST | {name: size}))
    delay, lag = (size, 0.0) if name == "actuator_delay" else (0.0, size)
    true = stepped(u, period, delay, lag) - stepped(u, period, 0.0, 0.0)
    # (w h)^2/12 = 2e-4 at 6.4 kHz for steps h of a quarter, some times that beside the mode; a plain mean: w h/2 = 0.1.
    assert np.std(late - plain - true) < 8e-4 * np.std(true)


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("tau", [2e-7, 1e-6, 6e-6])
def test_a_held_force_bends_what_the_filter_of_the_voltage_sees(simulator: Simulator, tau: float, order: int) -> None:
    period, t, p = 5e-6, np.arange(3000) * 5e-6, FAST
    # White: two thirds of it above the mode, where held steps and a curve through the samples differ.
    u = 1e-6 * np.random.default_rng(order).standard_normal(len(t))
    run = make_record("run", t, u, u, sample_rate=1 / period)
    own = {"voltage_filter": tau, "voltage_filter_order": float(order)}
    plain, filtered = (simulator.run(run, values)[:, 0] for values in (FAST, FAST | own))
    numerator, denominator = butter(order, 1 / tau, analog=True)
    device = [p["m"], p["dxx"], p["kxx"]]
    whole = (numerator * p["sense_gain_x"], np.polymul(denominator, device))
    true = lsim(whole, u, t, interp=False)[1] - lsim(([p["sense_gain_x"]], device), u, t, interp=False)[1]
    inner = slice(50, None)
    # Steps of a quarter sample; within one, where a filter is quicker than that, the bend is not followed.
    allowed = 2e-3 if tau < period / 4 / 2.5 else 2e-4
    assert np.std((filtered - plain - true)[inner]) < allowed * np.std(true[inner])


STIFF = {**OSCILLATOR, "stop_stiffness": 1e6, "stop_gap": 1e-9}
"""In touch it swings at 70 kHz: a run of twenty thousand samples takes half a minute."""


@pytest.fixture
def resting() -> Record:
    t = np.arange(20000) * PERIOD
    return make_record("run", t, 1e-3 * np.sin(t), t, sample_rate=1 / PERIOD)


def test_a_run_too_stiff_to_follow_is_given_up(resting: Record) -> None:
    with Simulator(load_model(), jobs=1) as own:
        assert np.isnan(own.run(resting, STIFF)[-1])
        # A stop as stiff as the suspension.
        assert np.isfinite(own.run(resting, {**STIFF, "stop_stiffness": 1.0})).all()


def test_a_mass_that_friction_holds_is_followed_however_steep_that_is(resting: Record) -> None:
    with Simulator(load_model(), jobs=1) as own:
        held = own.run(resting, {**OSCILLATOR, "friction_x": 0.1, "friction_speed": 1e-9})
    # It creeps at v atanh(u/f), u = 1 mN sin t.
    t = resting.t
    assert np.abs(held[:, 0] - 1e-9 * 1e-2 * (1 - np.cos(t))).max() < 1e-3 * 1e-11


class Ends(Clock):
    """A clock that is asked three times before the time is over."""

    asked = 0

    def check(self) -> None:
        self.asked += 1
        if self.asked > 3:
            raise OutOfTime


def test_a_run_ends_with_the_time(resting: Record) -> None:
    # Asked before the run, and every PIECE samples of it.
    with Simulator(load_model(), 1, Ends()) as own, pytest.raises(OutOfTime):
        own.run(resting, OSCILLATOR)


def test_a_part_of_a_part_lies_where_it_is_in_the_run(simulator: Simulator, resting: Record) -> None:
    inner = simulator.part(simulator.part(resting, 200, 600), 100, 250)
    assert simulator.place_of(inner)[1] == 300
    np.testing.assert_array_equal(inner.t, resting.t[300:450])


def test_what_changes_the_voltage_alone_is_no_other_run(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[int] = []
    begin = Bench.begin
    monkeypatch.setattr(Bench, "begin", lambda *of: begun.append(1) or begin(*of))
    run, filtered = record("zero", 40.0), [OSCILLATOR | {"voltage_filter": tau} for tau in (1e-4, 2e-4)]
    with Simulator(load_model(), jobs=1) as own, Simulator(load_model(), jobs=1) as fresh:
        first, second = (own.run(run, p) for p in filtered)
        assert len(begun) == 1
        np.testing.assert_array_equal(second, fresh.run(run, filtered[1]))
        # What is given out is not what is kept.
        plain = own.run(run, OSCILLATOR)
        plain[:] = 0.0
        np.testing.assert_array_equal(own.run(run, OSCILLATOR), fresh.run(run, OSCILLATOR))
        assert np.std(first - second) > 1e-3 * np.std(second)
        # Another device is another run.
        assert not np.array_equal(own.run(run, OSCILLATOR | {"kxx": 1.01}), own.run(run, OSCILLATOR))


RUBBING = {"m": 1.0, "kxx": (2 * np.pi * 5) ** 2, "dxx": 2.0, "friction_x": 0.2, "friction_speed": 1e-6}


def rubbed() -> tuple[Record, dict[str, float]]:
    """A mass that rubs, under a force that runs on, as an accelerometer sees it."""
    own = Rubbing(Structure(np.eye(1), 2.0 * np.eye(1), RUBBING["kxx"] * np.eye(1), 0, 0), 0.2, 0.0, 1.0)
    t, rng, f = np.arange(4000) / 600.0, np.random.default_rng(1), np.arange(1, 60) * 0.5
    u = np.cos(2 * np.pi * np.outer(t, f) + rng.uniform(0, 2 * np.pi, len(f))).sum(axis=1)
    u /= u.std()
    true = motion(own, u, 1 / 600.0, "first")[:, 2]
    run = make_record("run", t, u, true, sample_rate=600.0, hold="first", senses="acceleration")
    return run, RUBBING | {"sense_gain_x": run.reference**2}


def test_jumps_of_a_friction_that_accelerometers_see_are_where_they_are(simulator: Simulator) -> None:
    run, device = rubbed()
    plain, late = (simulator.run(run, {**device, "actuator_delay": delay}) for delay in (0.0, 1e-12))
    # Two samples beside a jump: 1.5e-3. In three steps of a held force a sample it is 7.6e-3.
    assert np.std(plain - run.v) < 2e-3 * np.std(run.v)
    assert np.std(simulator.run(run, device, parts=False) - run.v) > 4e-3 * np.std(run.v)
    # No delay may seem to bring what shorter steps do; one of 1e-12 s moves a jump by 1e-6 of them.
    assert np.std(plain - late) < 1e-5 * np.std(run.v)


def test_columns_are_differences_of_runs_in_the_same_steps(simulator: Simulator) -> None:
    run, device = rubbed()
    linear = {**device, "friction_x": 0.0}
    own = Quotients(simulator, float(np.std(run.v)))
    for base, name, step in ((linear, "actuator_delay", 1e-9), (linear, "friction_x", 1e-7), (device, "kxx", 1e-4)):
        begun = base.get(name, 0.0)
        point = Point(run, base, simulator.run(run, base))
        [column] = own.columns(point, [{name: begun + step}])
        # Away from where the parameter begins to act all runs go in steps of one kind by themselves.
        first, second = (simulator.run(run, {**base, name: begun + k * step}) for k in (1, 2))
        error = np.sort(np.abs(column - (second - first)).ravel())
        # But for samples beside a jump; a staircase would leave 1e-3 of the motion, a thousand times all of a column.
        assert error[:-20].max() < 0.02 * np.abs(second - first).max(), name
