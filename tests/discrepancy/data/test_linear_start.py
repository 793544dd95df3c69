"""Nominal values from the record's own response: those of the device that made it, for whatever gain is given."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hidden_sets import MODEL, TRUE, made
from scipy.integrate import solve_ivp
from scipy.signal import cont2discrete, lfilter

from discrepancy.data.dataset import Dataset, _believed
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Record, make_record
from gyro_model.errors import InputError

NAMES = ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy")


@pytest.fixture(scope="module")
def runs() -> tuple[Record, ...]:
    return made({}, samples=4000).records


def test_with_the_gain_it_is_the_device(runs: tuple[Record, ...]) -> None:
    found = linear_start(runs[:2], (TRUE["sense_gain_x"], TRUE["sense_gain_y"]))
    assert found is not None
    # 80 periods in noise of 2e-5 of the signal: a start, from which a fit of whole runs stays in step.
    for name in NAMES:
        assert found[name] == pytest.approx(TRUE[name], rel=0.1 if name[0] == "d" else 0.003)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((), "taken as 1 V/m"),
        (("sense_gain_x", "sense_gain_y"), "from the record's own response"),
        (("m",), "of the mass given"),
        (("m", "kxx", "kyy", "dxx", "dyy"), "of the mass given"),
    ],
)
def test_what_is_not_given_comes_from_the_record(given: tuple[str, ...], said: str, runs: tuple[Record, ...]) -> None:
    nominal, [note] = _believed({name: TRUE[name] for name in given}, runs)
    assert said in note
    scale = 1.0 if given else 1e-6
    for name in ("m", "kxx", "kyy"):
        assert nominal[name] == pytest.approx(scale * TRUE[name], rel=0.003)
    assert nominal["sense_gain_x"] == pytest.approx(scale * TRUE["sense_gain_x"], rel=0.003)


def test_other_values_alone_are_not_completed(runs: tuple[Record, ...]) -> None:
    given = {"kxx": TRUE["kxx"], "sense_gain_x": 1e6}
    assert _believed(given, runs) == (given, [])
    with pytest.raises(InputError, match="lacks m"):
        Dataset(Path(), given, runs, model=MODEL)


def test_a_line_of_the_mains_is_no_mode() -> None:
    # A mode at 200 Hz, swept from 180 to 220 Hz; beside its answer the sensor has a fifth of 50 Hz.
    t = np.arange(8000) / 4000
    u, w = np.sin(2 * np.pi * (180 * t + 10 * t**2)), 2 * np.pi * 200
    number, below, _ = cont2discrete(([1.0], [1.0, w / 50, w**2]), t[1])
    v = lfilter(np.squeeze(number), below, u)
    humming = make_record("run", t, u, v + 0.2 * v.std() * np.sin(2 * np.pi * 50 * t), sample_rate=4000)
    found = linear_start([humming], (1.0,))
    assert found is not None
    assert np.sqrt(found["kxx"] / found["m"]) == pytest.approx(w, rel=0.002)


def test_a_device_that_swings_by_itself_has_one() -> None:
    # Duffing and van der Pol, without unit: 100 periods of 20 samples, driven by noise of a tenth of the spring.
    rng, h = np.random.default_rng(3), 2 * np.pi / 20
    u = 0.1 * rng.normal(size=2000)

    def rate(_: float, s: np.ndarray, force: float) -> tuple[float, float]:
        x, v = s
        return v, force + 0.05 * (1 - x**2) * v - x - 0.1 * x**3

    states = [np.array([0.1, 0.0])]
    for force in u[:-1]:
        states.append(solve_ivp(rate, (0, h), states[-1], args=(force,), rtol=1e-8).y[:, -1])
    run = make_record("run", np.arange(2000) * h, u, np.array(states)[:, 0], sample_rate=1 / h)
    found = linear_start([run], (1.0,))
    assert found is not None
    # Windows of 25 periods of a motion that is not small: a start.
    assert found["m"] == pytest.approx(1.0, rel=0.02)
    assert found["kxx"] == pytest.approx(1.0, rel=0.02)
    assert found["dxx"] > 0


def test_without_a_linear_answer_there_is_no_start() -> None:
    rng = np.random.default_rng(1)
    [run] = made({}, samples=4000).records[:1]
    # Noise that the force has no part in.
    object.__setattr__(run, "v", rng.standard_normal(run.v.shape))
    assert linear_start([run], (1.0, 1.0)) is None


def test_an_offset_of_the_sensor_hides_no_response(runs: tuple[Record, ...]) -> None:
    moved = [replace(run, v=run.v + 2.0 * run.v.std(axis=0)) for run in runs[:2]]
    found = linear_start(moved, (TRUE["sense_gain_x"], TRUE["sense_gain_y"]))
    assert found is not None
    for name in ("m", "kxx", "kyy"):
        # As without the offset, above.
        assert found[name] == pytest.approx(TRUE[name], rel=0.003)


def test_a_blow_soon_after_the_begin_of_a_run_is_seen() -> None:
    rate, n, m, f, q = 5000.0, 6000, 0.4, 143.0, 150.0
    w, t = 2 * np.pi * f, np.arange(n) / rate
    blow = np.where((t > 0.02) & (t < 0.022), 60 * np.sin(np.pi * (t - 0.02) / 2e-3) ** 2, 0.0)
    b, a, _ = cont2discrete(([1.0], [m, m * w / q, m * w**2]), 1 / rate, "zoh")
    v = lfilter(np.ravel(b), a, blow)
    v += 1e-3 * v.std() * np.random.default_rng(2).standard_normal(n)
    found = linear_start([make_record("hit", t, blow[:, None], v[:, None], sample_rate=rate)], (1.0,))
    assert found is not None
    # One blow, a thousandth of noise: a start, as above.
    assert found["m"] == pytest.approx(m, rel=0.02)
    assert found["kxx"] == pytest.approx(m * w**2, rel=0.02)


def test_a_masked_sample_beyond_the_first_windows_costs_no_model() -> None:
    """A decay of ten periods: the windows of a second round reach the sample, those of the first do not."""
    t, w, s = np.arange(354) / 50.0, 2 * np.pi * 1.49, 0.3
    v = np.exp(-s * t) * np.cos(w * t)
    valid = np.ones(len(t), np.bool_)
    valid[262::5] = False
    record = make_record("a", t, np.zeros((len(t), 1)), v[:, None], sample_rate=50.0, hold="zero")
    record = replace(record, valid=valid)
    found = linear_start([record], [1.0])
    assert found is not None
    # The bin of the spectrum's peak, 0.14 Hz, is the coarsest of what the first round knows.
    assert np.sqrt(found["kxx"] / found["m"]) == pytest.approx(w, rel=0.02)


def test_a_timer_that_stalls_is_no_other_rate_in_a_part_of_a_run() -> None:
    t = np.arange(120) / 50.0
    t[30:] += 4e-3
    ring = np.cos(9.0 * t)[:, None]
    assert make_record("a", t, np.zeros_like(ring), ring, sample_rate=50.0, hold="zero").sample_rate == 50.0
    # Of a run this long a hundredth is another clock.
    t = np.arange(6000) / 49.5
    with pytest.raises(InputError, match=r"t steps at 49\.5 Hz"):
        make_record("a", t, np.zeros((6000, 1)), np.cos(t)[:, None], sample_rate=50.0, hold="zero")
