"""Defects of a record: the contract of every file, each against a closed form, and blemishes put in and taken out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, freqs, lfilter, sosfilt

from discrepancy.criteria import Criteria
from discrepancy.data.record import Floats, Record, make_record
from discrepancy.defects import force_noise
from discrepancy.fit.defect import (
    Blemish,
    Defect,
    Distortion,
    Disturbance,
    Found,
    Left,
    Timing,
    blemishes,
    defects,
    distortions,
    disturbances,
)
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.noise import BOLTZMANN
from discrepancy.fit.noise import Level as NoiseLevel
from discrepancy.fit.simulate import Simulator
from discrepancy.fit.whitening import Setting, whitener
from gyro_model.model import load_model

RATE, N, F = 2e5, 16_000, 3000.0
T = np.arange(N) / RATE
W = 2 * np.pi * F
SINE = np.column_stack((np.sin(W * T), np.cos(W * T)))
NOISE = 2e-5
every = pytest.mark.parametrize("defect", defects(), ids=lambda d: d.id)


@every
def test_contract(defect: Defect) -> None:
    model = {q.name for q in load_model().quantities}
    assert isinstance(defect, Distortion | Blemish | Disturbance)
    assert not {q.name for q in defect.parameters} & model
    assert defect.sizes and all(q.start == 0 for q in defect.sizes)
    assert all(q.role in ("size", "shape") for q in defect.parameters)
    assert any(year in defect.source for year in map(str, range(1900, 2027)))


@pytest.mark.parametrize("own", [d for d in distortions() if d.voltage], ids=lambda own: own.id)
def test_columns_go_through_a_distortion_of_the_voltage_alone_and_together(own: Distortion) -> None:
    assert own.voltage is not None
    p = {q.name: 0.01 * q.high if q in own.sizes else q.start for q in own.parameters}
    v = np.random.default_rng(1).standard_normal((500, own.axes, 3))
    apart = np.stack([own.voltage(v[..., i], Timing(40, 1 / RATE), p) for i in range(3)], axis=-1)
    assert np.abs(apart - v).max() > 1e-3
    # Rounding, of a signal of one.
    np.testing.assert_allclose(own.voltage(v, Timing(40, 1 / RATE), p), apart, atol=1e-12)
    np.testing.assert_allclose(own.voltage(v.sum(axis=-1), Timing(40, 1 / RATE), p), apart.sum(axis=-1), atol=1e-12)


def test_ids_are_distinct_from_effects() -> None:
    ids = [d.id for d in defects()]
    assert len(set(ids)) == len(ids)
    assert not set(ids) & {e.id for e in load_model().effects}
    assert len(distortions()) + len(blemishes()) + len(disturbances()) == len(ids)


def distortion(name: str) -> Distortion:
    return next(d for d in distortions() if d.id == name)


def answer(found: Floats, wanted: Floats) -> float:
    """The largest error over what the distortion changes, edges aside."""
    inner = slice(200, -200)
    return float(np.abs(found - wanted)[inner].max() / np.abs(wanted - SINE)[inner].max())


@pytest.mark.parametrize("skew", [2e-5, -1e-4])
def test_clock_skew_reads_later(skew: float) -> None:
    own = distortion("clock_skew")
    assert own.voltage is not None and own.beyond is not None
    p, timing = {"clock_skew": skew}, Timing(0, 1 / RATE)
    t = np.arange(N + own.beyond(N, timing, p)) / RATE
    v = np.column_stack((np.sin(W * t), np.cos(W * t)))
    late = T * (1 + skew)
    wanted = np.column_stack((np.sin(W * late), np.cos(W * late)))
    # A cubic spline errs by (w T)^4/384 = 2e-7 of the sine, which changes by up to w s t = 0.03.
    assert answer(own.voltage(v, timing, p)[:N], wanted) < 1e-4


def test_channel_delay_moves_the_second_channel() -> None:
    own = distortion("channel_delay")
    assert own.voltage is not None
    found = own.voltage(SINE, Timing(0, 1 / RATE), {"channel_delay": 3e-6})
    assert np.array_equal(found[:, 0], SINE[:, 0])
    inner = slice(200, -200)
    # A cubic spline errs by (w T)^4/384 = 2e-7 of the sine.
    assert np.abs(found[inner, 1] - np.cos(W * (T - 3e-6))[inner]).max() < 1e-6


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("tau", [1e-9, 1.6e-7, 1.8e-7, 1e-6, 6e-6])
def test_voltage_filter_is_butterworth(tau: float, order: int) -> None:
    own = distortion("voltage_filter")
    assert own.voltage is not None
    gain = freqs(*butter(order, 1 / tau, analog=True), [W])[1][0]
    wanted = np.abs(gain) * np.column_stack((np.sin(W * T + np.angle(gain)), np.cos(W * T + np.angle(gain))))
    # Where it settles within a step a series in derivatives serves, else lines in steps of a half: (w T/2)^2/12 = 2e-4.
    found = own.voltage(SINE, Timing(0, 1 / RATE), {"voltage_filter": tau, "voltage_filter_order": order})
    assert answer(found, wanted) < 2e-4


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("tau", [1e-9, 1.6e-7, 1.8e-7, 1e-6, 6e-6])
def test_force_filter_holds_the_mean_of_butterworth(tau: float, order: int) -> None:
    own = distortion("force_filter")
    assert own.force is not None
    # Steps so short that a held sine is one: images change the ratio by (w h)^2/12 = 1e-5 at most of what is there.
    step = 1 / RATE / 10
    t = np.arange(N) * step
    turning = np.exp(1j * W * t)
    found = own.force(
        np.column_stack((turning.real, turning.imag)), step, {"force_filter": tau, "force_filter_order": order}
    )
    inner = slice(2000, -2000)
    ratio = np.mean((found[inner, 0] + 1j * found[inner, 1]) / turning[inner])
    gain = freqs(*butter(order, 1 / tau, analog=True), [W])[1][0]
    assert abs(ratio - gain) < 0.01 * abs(1 - gain) + 1e-5


@pytest.mark.parametrize("name", ["voltage_filter", "force_filter"])
def test_a_slow_filter_shows_a_small_change(name: str) -> None:
    own = distortion(name)
    p = {name: 100 / RATE, f"{name}_order": 4}

    def passed(signal: Floats) -> Floats:
        made = own.voltage(signal, Timing(0, 1 / RATE), p) if own.voltage else None
        return own.force(signal, 1 / RATE, p) if own.force else np.asarray(made)

    change = 1e-6 * SINE[::-1]
    error = passed(SINE + change) - passed(SINE) - passed(change)
    # The sum is rounded to 1e-10 of the change, which the filter leaves 1e-6 of.
    assert np.abs(error).max() < 1e-3 * np.abs(passed(change)).max()


def test_force_saturation_cuts() -> None:
    own = distortion("force_saturation")
    assert own.force is not None
    found = own.force(SINE, 1 / RATE, {"force_saturation": 2.0})
    assert np.abs(found).max() == 0.5
    assert np.array_equal(found[np.abs(SINE) < 0.5], SINE[np.abs(SINE) < 0.5])


def test_force_scale_scales() -> None:
    own = distortion("force_scale")
    assert own.force is not None and own.gauge
    np.testing.assert_allclose(own.force(SINE, 1 / RATE, {"force_scale": 0.05}), 1.05 * SINE, rtol=1e-15)


def records(changes: Sequence[Floats], smooth: float = 0.0) -> tuple[list[Record], list[Floats]]:
    """Runs, and what a model that is right but for ``smooth`` leaves of them."""
    rng = np.random.default_rng(3)
    found, residuals = [], []
    for number, change in enumerate(changes):
        u = rng.standard_normal((N, 2))
        residual = NOISE * rng.standard_normal((N, 2)) + smooth * SINE**3 + change
        v = SINE + residual
        found.append(make_record(f"run-{number}", T, u, v, sample_rate=RATE))
        residuals.append(residual)
    return found, residuals


def blemish(name: str) -> Blemish:
    return next(b for b in blemishes() if b.id == name)


@pytest.mark.parametrize("name", [b.id for b in blemishes()])
@pytest.mark.parametrize("smooth", [0.0, 1e-3, 0.1])
def test_nothing_is_found_where_nothing_is(name: str, smooth: float) -> None:
    runs, residuals = records([np.zeros((N, 2))] * 3, smooth)
    assert blemish(name).find(Left(runs, residuals), Criteria()) is None


def test_mains_are_found_and_taken_out() -> None:
    lines = [5 * NOISE * np.cos(2 * np.pi * 50.03 * T + phase)[:, None] * np.array([1.0, 0.5]) for phase in (0.3, 1.9)]
    runs, residuals = records(lines)
    found = blemish("mains").find(Left(runs, residuals), Criteria())
    assert found is not None
    level = found.levels["mains"]
    assert level.low < 5 * NOISE < level.high
    for run, residual, line, data in zip(runs, residuals, lines, found.data, strict=True):
        clean = blemish("mains").without(run, data)
        # Two numbers a line from 16,000 samples: what is left of the line is a hundredth of the noise.
        assert np.std(residual - line - (clean.v - SINE)) < 0.05 * NOISE


def test_a_drive_on_the_lines_is_no_mains() -> None:
    runs, residuals = records([5 * NOISE * np.cos(2 * np.pi * 50 * T)[:, None] * np.ones(2)] * 2)
    tones = np.cos(2 * np.pi * 50 * T)[:, None] * np.ones(2)
    driven = [replace(run, u=tones) for run in runs]
    assert blemish("mains").find(Left(driven, residuals), Criteria()) is None


def test_a_line_that_the_drive_has_is_no_mains() -> None:
    # Among other tones, one of which is a hundredth of the power.
    runs, residuals = records([5 * NOISE * np.cos(2 * np.pi * 100 * T)[:, None] * np.ones(2)] * 2)
    assert blemish("mains").find(Left(runs, residuals), Criteria()) is not None
    f = np.array([333.0, 1210.0, 2333.0, 3141.0])
    tones = np.sin(2 * np.pi * f * T[:, None]).sum(axis=1) + 0.2 * np.cos(2 * np.pi * 100 * T)
    driven = [replace(run, u=tones[:, None] * np.ones(2)) for run in runs]
    assert blemish("mains").find(Left(driven, residuals), Criteria()) is None


def test_mains_beside_a_slow_drive_are_found_and_what_follows_the_drive_is_none() -> None:
    # Most of the force's power is about the lines, but it has none of its own there.
    line = 5 * NOISE * np.cos(2 * np.pi * 250 * T)[:, None] * np.ones(2)
    slow = sosfilt(butter(4, 350, fs=RATE, output="sos"), np.random.default_rng(7).standard_normal((N, 2)), axis=0)
    slow /= slow.std()
    for hum, wrong, shown in ((line, 0.5 * NOISE, True), (0 * line, 5 * NOISE, False)):
        runs, residuals = records([hum + wrong * slow] * 2)
        driven = [replace(run, u=slow) for run in runs]
        assert (blemish("mains").find(Left(driven, residuals), Criteria()) is not None) is shown


def test_outliers_are_masked() -> None:
    rng = np.random.default_rng(5)
    places = np.sort(rng.choice(np.arange(10, N - 10, 40), 12, replace=False))
    change = np.zeros((N, 2))
    change[places] = rng.choice([-1, 1], (12, 2)) * 50 * NOISE
    runs, residuals = records([change])
    found = blemish("outliers").find(Left(runs, residuals), Criteria())
    assert found is not None
    assert list(found.data[0]) == places.tolist()
    clean = blemish("outliers").without(runs[0], found.data[0])
    assert np.flatnonzero(~clean.valid).tolist() == places.tolist()


@pytest.mark.parametrize("far", [[(0, 50), (6, 60)], [(0, 90), (1, 200)], [(0, -70), (5, 100), (17, 200)]])
def test_outliers_near_each_other_are_masked(far: list[tuple[int, int]]) -> None:
    change = np.zeros((N, 2))
    for place, deviations in far:
        change[3000 + place, 0] = deviations * NOISE
    runs, residuals = records([change])
    found = blemish("outliers").find(Left(runs, residuals), Criteria())
    assert found is not None
    assert {3000 + place for place, _ in far} <= set(found.data[0])
    # Two that touch make their neighbours seem far.
    assert len(found.data[0]) <= len(far) + 1


def test_a_transient_at_the_start_is_no_outlier() -> None:
    change = np.zeros((N, 2))
    change[:40] = 300 * NOISE * np.exp(-np.arange(40) / 2)[:, None] * [1, -0.5]
    runs, residuals = records([change])
    assert blemish("outliers").find(Left(runs, residuals), Criteria()) is None


def test_noise_that_grows_with_the_motion_has_no_outliers() -> None:
    rng = np.random.default_rng(9)
    # A timer's: 30 times the noise where the motion of a decay is fastest.
    slope = SINE[:, ::-1] * np.exp(-T / T[-1] * 4)[:, None]
    runs, residuals = records([30 * NOISE * slope * rng.standard_normal((N, 1)) for _ in range(3)])
    assert blemish("outliers").find(Left(runs, residuals), Criteria()) is None


@pytest.mark.parametrize("lost", [1, 3, -2])
def test_lost_and_doubled_samples_are_put_back(lost: int) -> None:
    k = 6000
    rows = np.concatenate((np.arange(k), np.arange(k, N) + lost))
    rows = np.clip(rows, 0, N - 1)
    runs, _ = records([np.zeros((N, 2))])
    noise = runs[0].v - SINE
    late = replace(runs[0], v=SINE[rows] + noise)
    found = blemish("missing_samples").find(Left([late], [late.v - SINE]), Criteria())
    assert found is not None
    assert abs(found.data[0][0] - k) <= 3
    assert found.data[0][1] == lost
    clean = blemish("missing_samples").without(late, found.data[0])
    off = np.abs(clean.v - SINE)[clean.valid]
    assert off.max() < 6 * NOISE
    assert clean.valid.sum() > N - 15


def test_what_the_simulator_does_with_a_distortion() -> None:
    model = load_model()
    rng = np.random.default_rng(2)
    f = rng.uniform(500, 5000, 20)
    u = 1e-5 * np.column_stack([np.sin(2 * np.pi * f * T[:4000, None] + p).sum(axis=1) for p in (0.1, 1.3)])
    run = make_record("a", T[:4000], u, np.ones_like(u), sample_rate=RATE)
    p = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
         "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip
    with Simulator(model, jobs=1) as simulator:
        plain = simulator.run(run, p)
        assert np.array_equal(simulator.run(run, {**p, "clock_skew": 0.0, "force_filter": 0.0}), plain)
        # A weak filter of second order is a delay of sqrt(2) tau.
        tau = 1e-7
        filtered = simulator.run(run, {**p, "force_filter": tau}) - plain
        delayed = simulator.run(run, {**p, "actuator_delay": 2**0.5 * tau}) - plain
        assert np.abs(filtered - delayed).max() < 0.03 * np.abs(delayed).max()
        # A piece of a run reads the clock of the whole.
        skewed = simulator.run(run, {**p, "clock_skew": 1e-4})
        assert np.abs(skewed - plain)[-500:].max() > 5 * np.abs(skewed - plain)[:500].max()


P = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
     "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip


def fitted(changes: Sequence[Floats], colour: tuple[float, ...] = ()) -> tuple[Fitted, list[Record]]:
    """A fit that leaves white noise and these changes."""
    runs, residuals = records(changes)
    whiten = whitener(P, 2, 1 / RATE, Setting(colour=colour), N)
    return Fitted(P, (), (), whiten, tuple(residuals), cost=1.0, count=2 * N * len(runs)), runs


def disturbance(name: str) -> Disturbance:
    return next(d for d in disturbances() if d.id == name)


@pytest.mark.parametrize("kind", ["none", "converter", "timer", "smooth"])
def test_jitter_of_time_stamps(kind: str) -> None:
    rng = np.random.default_rng(6)
    slope = W * np.column_stack((np.cos(W * T), -np.sin(W * T))) * (0.2 + (T / T[-1])[:, None])
    late = {"none": 0.0, "converter": 5e-9, "timer": 1e-7, "smooth": 1e-7}[kind]
    delays = [rng.standard_normal((N, 1)) if kind != "smooth" else np.sin(W / 7 * T)[:, None] for _ in range(2)]
    at, runs = fitted([late * slope * delay for delay in delays])
    runs = [replace(r, v=SINE * (0.2 + (T / T[-1])[:, None]) + e) for r, e in zip(runs, at.residuals, strict=True)]
    levels = disturbance("timestamp_jitter").find(at, runs, Criteria())
    assert (levels is not None) == (kind == "timer")
    if levels:
        level = levels["timestamp_jitter"]
        # The interval once more on either side: two deviations leave one in twenty out.
        assert abs(level.value - late) < level.high - level.low


def test_coloured_noise_by_its_rms() -> None:
    rng = np.random.default_rng(8)
    red = [lfilter([1.0], [1.0, -0.8], 1e-3 * rng.standard_normal((N, 2)), axis=0) for _ in range(2)]
    at, runs = fitted(red, (0.8,))
    levels = disturbance("coloured_noise").find(at, runs, Criteria())
    assert levels is not None
    level = levels["coloured_noise"]
    assert abs(level.value - 1e-3 / 0.6) < level.high - level.low
    assert disturbance("coloured_noise").find(fitted(red)[0], runs, Criteria()) is None


def test_mains_of_short_runs_are_found_though_one_is_driven_there() -> None:
    rng = np.random.default_rng(8)
    rate, n = 200_000.0, 16_000
    t = np.arange(n) / rate
    runs, residuals = [], []
    for driven in (False, True, False):
        # Levels that change at random, a millisecond each, have much of their power about the lines.
        u = np.repeat(rng.standard_normal((80, 2)), 200, axis=0) if driven else rng.standard_normal((n, 2))
        phases = rng.uniform(0, 6, 3)
        hum = sum(
            a * np.sin(2 * np.pi * f * t + p)
            for a, f, p in zip((5, 4, 3), (50.02, 100.04, 150.06), phases, strict=True)
        )
        residual = NOISE * (rng.standard_normal((n, 2)) + np.asarray(hum)[:, None])
        runs.append(make_record(f"run-{len(runs)}", t, u, residual, sample_rate=rate))
        residuals.append(residual)
    found = blemish("mains").find(Left(runs, residuals), Criteria())
    assert found is not None
    assert found.levels["mains"].low < 5 * NOISE < found.levels["mains"].high
    for run, lines in zip(runs, found.data, strict=True):
        # Five samples of a thousand parts each: what is left is the noise.
        assert blemish("mains").without(run, lines).v.std() == pytest.approx(NOISE, rel=0.02)
    # A run at whose force nobody has looked, by what the others say.
    phases = rng.uniform(0, 6, 3)
    hum = sum(
        a * np.sin(2 * np.pi * f * t + p) for a, f, p in zip((5, 4, 3), (50.02, 100.04, 150.06), phases, strict=True)
    )
    other = make_record("other", t, runs[1].u, NOISE * (rng.standard_normal((n, 2)) + np.asarray(hum)[:, None]))
    again = blemish("mains").again
    assert again is not None
    assert blemish("mains").without(other, again(found, other, other.v)).v.std() == pytest.approx(NOISE, rel=0.02)


def _short(slow: list[Floats], conditions: list[dict[str, Floats]] | None = None, seed: int = 31) -> list[Record]:
    """Runs of two periods at 50 Hz whose voltage is noise and, on x and a third of it on y, what is ``slow`` (n,)."""
    rng, runs = np.random.default_rng(seed), []
    for number, own in enumerate(slow):
        v = NOISE * (rng.standard_normal((len(own), 2)) + own[:, None] * np.array([1.0, 0.3]))
        runs.append(make_record(f"run-{number}", np.arange(len(own)) / 4e5, rng.standard_normal((len(own), 2)), v,
                                sample_rate=4e5, conditions=conditions[number] if conditions else {}))  # fmt: skip
    return runs


SHORT = np.arange(16_000) / 4e5


@pytest.mark.parametrize("f0", [50.03, 59.9])
def test_mains_of_runs_of_two_periods_are_found_and_taken_out(f0: float) -> None:
    rng = np.random.default_rng(23)

    def hum() -> Floats:
        parts = zip((1, 2, 5), (8.0, 4.0, 3.0), rng.uniform(0, 6, 3), strict=True)
        return np.asarray(sum(a * np.sin(2 * np.pi * n * f0 * SHORT + p) for n, a, p in parts))

    runs = _short([hum() for _ in range(3)])
    found = blemish("mains").find(Left(runs, [run.v for run in runs]), Criteria())
    assert found is not None
    for run, data in zip(runs, found.data, strict=True):
        # Six numbers of 16,000 samples, and what the frequency is off by: a part in a hundred of the noise.
        assert blemish("mains").without(run, data).v.std() == pytest.approx(NOISE, rel=0.02)


@pytest.mark.parametrize("f", [33.0, 55.0, 76.0, 171.0, 335.0])
def test_a_line_of_another_frequency_is_no_mains_of_short_runs(f: float) -> None:
    runs = _short([20 * np.sin(2 * np.pi * f * SHORT + phase) for phase in (0.1, 1.3, 4.0)])
    assert blemish("mains").find(Left(runs, [run.v for run in runs]), Criteria()) is None


def test_what_wanders_or_follows_a_condition_is_no_mains_of_short_runs() -> None:
    rng = np.random.default_rng(29)
    walks = [0.1 * np.cumsum(rng.standard_normal(len(SHORT))) for _ in range(3)]
    drifts = [20 * np.sqrt(SHORT / SHORT[-1])] * 3
    tilts = [np.sin(2 * np.pi * 50 * SHORT + phase) for phase in (0.2, 2.0, 3.1)]
    asked = [_short(walks), _short(drifts), _short([20 * own for own in tilts], [{"a_x": own} for own in tilts])]
    for runs in asked:
        assert blemish("mains").find(Left(runs, [run.v for run in runs]), Criteria()) is None
    hum = _short([20 * own for own in tilts])
    assert blemish("mains").find(Left(hum, [run.v for run in hum]), Criteria()) is not None


def test_short_runs_that_are_driven_on_the_lines_show_no_mains() -> None:
    lines = [sum(np.sin(2 * np.pi * 50 * n * SHORT + n * phase) for n in range(1, 8)) for phase in (0.3, 1.0, 2.2)]
    runs = [replace(run, u=own[:, None] * np.ones(2)) for run, own in zip(_short(lines), lines, strict=True)]
    assert blemish("mains").find(Left(runs, [run.v for run in runs]), Criteria()) is None


def _vibrating(seed: int = 0, samples: int = 6000) -> Record:
    """A mode at a sixtieth of the sample rate under a noise of many tones, 1e-4 of it as noise on the voltage."""
    rng = np.random.default_rng(seed)
    k = np.arange(samples)
    f, phase = rng.uniform(0.005, 0.03, 40), rng.uniform(0, 2 * np.pi, 40)
    u = np.sin(2 * np.pi * f * k[:, None] + phase).sum(axis=1)
    a = 2 * 0.999 * np.cos(2 * np.pi / 60), -(0.999**2)
    v = lfilter([0, 1.0], [1, -a[0], -a[1]], u)
    v = v / np.std(v) + 1e-4 * rng.standard_normal(samples)
    return make_record("run", k / RATE, u[:, None], v[:, None], sample_rate=RATE)


@pytest.mark.parametrize(
    "lost", [{1500: 1}, {900: 1, 4100: 1}, {2000: 7, 3000: -2, 5000: 1}, {1000: -1, 1100: 1}, {2500: 11}]
)
def test_each_loss_shows_in_the_record_itself(lost: dict[int, int]) -> None:
    whole = _vibrating()
    source = np.arange(len(whole.t) + 100)
    for k, n in sorted(lost.items(), reverse=True):
        # From the last on: places are those of the record as it is.
        source = np.delete(source, np.arange(k, k + n)) if n > 0 else np.insert(source, k, source[k + n : k])
    source = source[source < len(whole.t)][: len(whole.t)]
    v = np.vstack((whole.v[source], np.repeat(whole.v[-1:], len(whole.t) - len(source), axis=0)))
    late = replace(whole, v=v)
    found = blemish("missing_samples").find(Left([late], [np.zeros_like(v)]), Criteria())
    assert found is not None
    assert found.levels["missing_samples"].value == sum(lost.values())
    clean = blemish("missing_samples").without(late, found.data[0])
    inner = clean.valid & (np.arange(len(whole.t)) < len(whole.t) - 100)
    # Where the motion turns a loss shows a sample late; such a sample is off by less than a hundredth of the motion.
    assert np.abs(clean.v - whole.v)[inner].max() < 1e-2
    assert np.mean(np.abs(clean.v - whole.v)[inner] > 0) < 1e-3
    assert clean.valid.mean() > 0.95


def test_a_loss_is_seen_behind_what_bends_the_motion() -> None:
    whole = _vibrating(2)
    v = whole.v + 1e-3 * whole.v**3
    # Knocks of the mass, a little before: not predicted, and no loss.
    v[2990:3030:9] += 3e-3
    late = replace(whole, v=np.vstack((v[:3000], v[3001:], v[-1:])))
    assert blemish("missing_samples").find(Left([late], [np.zeros_like(v)]), Criteria()) is not None


# Behind where a sweep begins anew, which is not predicted either; and where the voltage turns, in so much noise that
# what a loss leaves unpredicted is less than 50 times as strong.
@pytest.mark.parametrize(("place", "noise", "jump"), [(2029, 1e-4, 2.0), (3012, 1e-3, 0.0), (3042, 1e-3, 0.0)])
def test_a_loss_is_seen_beside_a_jump_of_the_force_and_noise(place: int, noise: float, jump: float) -> None:
    k = np.arange(6000)
    u = np.sin(2 * np.pi * np.cumsum(0.005 + 0.025 * np.mod(k / 2000, 1)) + jump * (k // 2000))
    v = lfilter([0, 1.0], [1, -2 * 0.999 * np.cos(2 * np.pi / 60), 0.999**2], u)
    v = v / np.std(v) + noise * np.random.default_rng(0).standard_normal(6000)
    v = np.concatenate((v[:place], v[place + 1 :], v[-1:]))
    late = make_record("run", k / RATE, u[:, None], v[:, None], sample_rate=RATE)
    found = blemish("missing_samples").find(Left([late], [np.zeros((6000, 1))]), Criteria())
    assert found is not None
    assert found.levels["missing_samples"].value == 1


@pytest.mark.parametrize("kind", ["clean", "outliers", "clipped", "bent"])
def test_no_loss_is_seen_where_none_is(kind: str) -> None:
    whole = _vibrating(1)
    v = whole.v.copy()
    if kind == "outliers":
        v[::500] += 0.5
    if kind == "clipped":
        v = np.clip(v, -1.5, 1.5)
    if kind == "bent":
        v = v + 0.05 * v**3
    assert blemish("missing_samples").find(Left([replace(whole, v=v)], [np.zeros_like(v)]), Criteria()) is None


def test_a_model_that_is_late_from_an_instant_on_is_no_loss() -> None:
    whole = _vibrating(1)
    # What a wrong model leaves where the motion leads it by two samples from the middle on; the record is whole.
    model = whole.v.copy()
    model[len(model) // 2 :] = np.roll(whole.v, 2, axis=0)[len(model) // 2 :]
    assert blemish("missing_samples").find(Left([whole], [whole.v - model]), Criteria()) is None


@pytest.mark.parametrize(("other", "seen"), [(0.5, True), (1.5, False)])
def test_a_jump_beside_a_larger_misfit_waits(other: float, seen: bool) -> None:
    runs, _ = records([np.zeros((N, 2))])
    slope = np.gradient(SINE, axis=0)
    # Two samples late in the second half; the best constant delay takes half of that away, so that it has rms 1.
    jump = slope * np.where(T[-1] / 2 > T, -1.0, 1.0)[:, None]
    rest = other * np.sqrt(np.mean(slope**2)) * np.sqrt(2) * np.column_stack([np.sin(2.3 * W * T)] * 2)
    hidden = replace(runs[0], v=SINE + 0.01 * np.random.default_rng(3).standard_normal((N, 2)))
    residual = jump + rest
    found = blemish("missing_samples").find(Left([hidden], [residual]), Criteria())
    assert (found is not None) == seen


@pytest.mark.parametrize(("noise", "shaken", "seen"), [(1e-8, 1.0, True), (1e-8, 10.0, False), (0.0, 1.0, False)])
def test_noise_of_a_measured_force(noise: float, shaken: float, seen: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    at, runs = fitted([np.zeros((N, 2))])
    u = 1e-5 * SINE + noise * np.random.default_rng(4).standard_normal((N, 2))
    # 2 σ²/f_s = 4 k_B T d times the square of the size.
    size = shaken * 1e-8 / np.sqrt(2 * BOLTZMANN * 298.15 * P["dxx"] * RATE)
    monkeypatch.setattr(force_noise, "thermal", lambda *_: NoiseLevel(size, 0.9 * size, 1.1 * size))
    levels = disturbance("force_noise").find(at, [replace(runs[0], u=u)], Criteria())
    assert (levels is not None) == seen
    if levels:
        assert levels["force_noise"].value == pytest.approx(1e-8)


@pytest.mark.parametrize("lost", [3, -4])
def test_samples_lost_in_a_held_out_run_are_found_where_a_period_has_ten(lost: int) -> None:
    """Noise hides them from the run's own prediction, and to first order they are not what they are."""
    t, k = np.arange(4000), 1700
    wave = np.column_stack([np.sin(2 * np.pi * t / 10.3), np.cos(2 * np.pi * t / 9.1)])
    rows = np.clip(np.concatenate((t[:k], t[k:] + lost)), 0, len(t) - 1)
    v = wave[rows] + 0.05 * np.random.default_rng(5).standard_normal(wave.shape)
    late = make_record("a", t / RATE, wave, v, sample_rate=RATE)
    own = blemish("missing_samples")
    assert own.again is not None
    place, number = own.again(Found((), {}), late, v - wave)
    assert number == lost
    assert abs(place - k) <= 3
    assert own.again(Found((), {}), replace(late, v=wave + (v - wave[rows])), v - wave[rows]) == ()


@pytest.mark.parametrize(("share", "hum", "seen"), [(0.01, 0.0, True), (0.05, 0.0, False), (0.01, 5.0, False)])
def test_a_force_that_is_nowhere_quiet_may_hold_a_slight_noise(
    share: float, hum: float, seen: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Below all that its record shows; a hum that is left beside it is no white force."""
    residual = hum * NOISE * np.sqrt(2) * np.sin(2 * np.pi * 0.03 * RATE * T)[:, None] * np.ones((1, 2))
    at, runs = fitted([residual])
    u = 1e-5 * np.random.default_rng(4).standard_normal((N, 2))
    size = share * 1e-5 / np.sqrt(2 * BOLTZMANN * 298.15 * P["dxx"] * RATE)
    monkeypatch.setattr(force_noise, "thermal", lambda *_: NoiseLevel(size, 0.9 * size, 1.1 * size))
    levels = disturbance("force_noise").find(at, [replace(runs[0], u=u)], Criteria())
    assert (levels is not None) == seen
    if levels:
        assert levels["force_noise"].value == pytest.approx(share * 1e-5)
