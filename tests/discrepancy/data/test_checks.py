"""Step 1: each rule with data that trips it and data that must not."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from discrepancy.data import checks
from discrepancy.data.clipping import flat_tops
from discrepancy.data.dataset import Dataset, load_dataset
from discrepancy.data.excitation import _free_motion, _start, cramer_rao_bounds, noise_level
from discrepancy.data.record import Floats, Record, make_record
from gyro_model.errors import InputError

EXAMPLES = Path(__file__).parents[4] / "shared" / "examples"
needs_examples = pytest.mark.skipif(not EXAMPLES.is_dir(), reason="the example data sets ../shared/examples are absent")

RATE = 50e3
TRUE = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
        "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip
NOMINAL = TRUE | {"m": 1.75e-7, "kxx": 65.0, "kyy": 94.0, "dxx": 2e-6}
NOISE = 2e-5


def simulated(n: int, u: Floats, omega: float = 0.0, noise: float = NOISE, seed: int = 1) -> Floats:
    """Samples (n, 2) [V] of docs/theory/plant.md, eqs. 1 and 3, from rest, by scipy: none of the code under test."""
    k = np.array([[TRUE["kxx"], TRUE["kxy"]], [TRUE["kxy"], TRUE["kyy"]]])
    d = np.array([[TRUE["dxx"], TRUE["dxy"]], [TRUE["dxy"], TRUE["dyy"]]])
    d = d + 2 * TRUE["m"] * omega * np.array([[0, -1], [1, 0]])
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-k / TRUE["m"], -d / TRUE["m"]]])
    b = np.vstack((np.zeros((2, 2)), np.eye(2) / TRUE["m"]))
    ad, bd, *_ = cont2discrete((a, b, np.eye(4), np.zeros((4, 2))), 1 / RATE)
    state, q = np.zeros(4), np.empty((n, 2))
    for i in range(n):
        q[i] = state[:2]
        state = ad @ state + bd @ u[i]
    return 1e6 * q + noise * np.random.default_rng(seed).standard_normal((n, 2))


def drive(n: int, seed: int = 5) -> Floats:
    """White force of 4 uN rms."""
    return 4e-6 * np.random.default_rng(seed).standard_normal((n, 2))


@pytest.fixture(scope="module")
def runs() -> tuple[Record, ...]:
    """Two runs at 0 and 5 rad/s, the second held out in no test, and a third held out; 0.12 s each."""
    made = []
    for i, omega in enumerate((0.0, 5.0, 0.0)):
        u = drive(6000, seed=i)
        v = simulated(6000, u, omega, seed=10 + i)
        role = "held-out" if i == 2 else "fit"
        made.append(make_record(f"r{i}", np.arange(6000) / RATE, u, v, sample_rate=RATE, role=role,
                                conditions={"omega_z": np.full(6000, omega)}))  # fmt: skip
    return tuple(made)


def data(records: tuple[Record, ...], **nominal: float) -> Dataset:
    return Dataset(Path(), NOMINAL | nominal, records)


Change = Callable[[Floats, Floats, dict[str, Floats]], tuple[Floats, Floats, Mapping[str, Floats]]]


def altered(records: tuple[Record, ...], change: Change) -> Dataset:
    """The runs as they would be with a fault."""
    changed = []
    for record in records:
        u, v, conditions = change(record.u.copy(), record.v.copy(), dict(record.conditions))
        changed.append(replace(record, u=u, v=v, conditions=conditions))
    return data(tuple(changed))


def test_sound_data_gives_no_finding(runs: tuple[Record, ...]) -> None:
    assert checks.check(data(runs)) == []


@needs_examples
@pytest.mark.parametrize("name", ["null", "duffing", "two", "silverbox"])
def test_examples_give_no_finding(name: str) -> None:
    assert checks.check(load_dataset(EXAMPLES / name)) == []


X, Y = np.array([1, 0]), np.array([0, 1])
FAULTS: dict[str, tuple[Change, str]] = {
    "v swapped": (lambda u, v, c: (u, v[:, ::-1].copy(), c), "swapped"),
    "u swapped": (lambda u, v, c: (u[:, ::-1].copy(), v, c), "swapped"),
    "both swapped": (lambda u, v, c: (u[:, ::-1].copy(), v[:, ::-1].copy(), c), "exchanged in u and v"),
    "v_x turned": (lambda u, v, c: (u, v * (Y - X), c), "v_x (or u_x) looks to have the wrong sign"),
    "u_y turned": (lambda u, v, c: (u * (X - Y), v, c), "v_y (or u_y) looks to have the wrong sign"),
    "both turned": (lambda u, v, c: (u, -v, c), "wrong sign and v_y"),
    "v in mV": (lambda u, v, c: (u, 1e3 * v, c), "(v in mV?)"),
    "v_y in mV": (lambda u, v, c: (u, v * (X + 1e3 * Y), c), "v_y looks"),
    "u in uN": (lambda u, v, c: (1e6 * u, v, c), "(u in µN"),
    "v a displacement": (lambda u, v, c: (u, 1e-6 * v, c), "displacement in m"),
    "swapped and turned": (lambda u, v, c: (u, v[:, ::-1] * (Y - X), c), "swapped and v_"),
    "rate in deg/s": (lambda u, v, c: (u, v, {"omega_z": np.rad2deg(c["omega_z"])}), "looks like deg/s"),
    "rate turned": (lambda u, v, c: (u, v, {"omega_z": -c["omega_z"]}), "omega_z looks to have the wrong sign"),
    "degC": (lambda u, v, c: (u, v, {"temperature": 25.0 + 0 * v[:, 0]}), "looks like degC"),
    "dead channel": (lambda u, v, c: (u, v * X + 0.1 * Y, c), "v_y is 0.1 V throughout"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_refused_and_named(runs: tuple[Record, ...], fault: str) -> None:
    change, expected = FAULTS[fault]
    with pytest.raises(InputError) as error:
        checks.check(altered(runs, change))
    assert expected in str(error.value)
    assert "\n" not in str(error.value)


WARNINGS: dict[str, tuple[Change, str]] = {
    # A gain ten times too low is no unit; it is said, not refused.
    "gain": (lambda u, v, c: (u, v / 10, c), "sense_gain"),
    "fast": (lambda u, v, c: (u, v, {"omega_z": 40 + 0 * v[:, 0]}), "deg/s"),
    "gravity in g": (lambda u, v, c: (u, v, {"a_x": 1.0 + 0 * v[:, 0]}), "in g?"),
    "huge acceleration": (lambda u, v, c: (u, v, {"a_y": 2e5 + 0 * v[:, 0]}), "a_y reaches"),
}


@pytest.mark.parametrize("case", WARNINGS)
def test_what_is_only_said(runs: tuple[Record, ...], case: str) -> None:
    change, expected = WARNINGS[case]
    # The first run alone: at rest, so that a false rate contradicts no Coriolis force of it.
    found = checks.check(altered((runs[0], runs[2]), change))
    assert any(expected in finding.message for finding in found)


HARMLESS: dict[str, Change] = {
    "kelvin": lambda u, v, c: (u, v, {"temperature": 233.0 + 0 * v[:, 0]}),
    "slow": lambda u, v, c: (u, v, {"omega_z": 30 + 0 * v[:, 0]}),
    "gravity": lambda u, v, c: (u, v, {"a_x": 9.81 + 0 * v[:, 0]}),
    "strong cubic pickoff": lambda u, v, c: (u, v + 0.3 * v**3 / np.max(v**2), c),
    "offset": lambda u, v, c: (u, v + 2 * v.std(axis=0), c),
    "gain 30 % off": lambda u, v, c: (u, 1.3 * v, c),
    "feedthrough of 30 % of the signal": lambda u, v, c: (u, v + 0.3 * u / u.std() * v.std(), c),
}


@pytest.mark.parametrize("case", HARMLESS)
def test_effects_and_usual_values_pass(runs: tuple[Record, ...], case: str) -> None:
    assert checks.check(altered((runs[0], runs[2]), HARMLESS[case])) == []


def with_time(record: Record, t: Floats) -> Record:
    return replace(record, t=t)


def test_a_hole_is_refused_with_its_place(runs: tuple[Record, ...]) -> None:
    t = runs[0].t.copy()
    t[4000:] += 3 / RATE
    with pytest.raises(InputError, match=r"1 hole, 3 samples in all, the first after t = 0\.07998 s"):
        list(checks.holes(with_time(runs[0], t)))


def test_jitter(runs: tuple[Record, ...]) -> None:
    k, normal = np.arange(6000), np.random.default_rng(2).uniform(-1, 1, 6000)

    def found(size: float) -> list[Any]:
        # A uniform deviate of half width a has a/sqrt(3) rms.
        return list(checks.jitter(with_time(runs[0], (k + np.sqrt(3) * size * normal) / RATE)))

    assert found(0.005) == []
    assert "2%" in found(0.02)[0].message
    with pytest.raises(InputError, match="resample"):
        list(checks.jitter(with_time(runs[0], (k + 0.4 * np.sqrt(2) * np.sin(k / 50)) / RATE)))


def test_resolution(runs: tuple[Record, ...]) -> None:
    assert list(checks.resolution(runs[0], NOMINAL)) == []
    # The same table with its kHz taken for Hz has its modes a thousand times above the sample rate.
    slow = replace(runs[0], t=runs[0].t * 1e3, sample_rate=RATE / 1e3)
    with pytest.raises(InputError, match="t in ms"):
        list(checks.resolution(slow, NOMINAL))
    coarse = replace(runs[0], t=runs[0].t * 4, sample_rate=RATE / 4)
    assert "hold" in next(iter(checks.resolution(coarse, NOMINAL))).message


def test_short_runs_are_said(runs: tuple[Record, ...]) -> None:
    short = replace(
        runs[0], **{name: getattr(runs[0], name)[:1500] for name in ("t", "u", "v", "valid")}, conditions={}
    )
    # 0.03 s of the 2900 Hz mode are 87 periods.
    assert "short" in next(iter(checks.length(short, NOMINAL))).message
    assert list(checks.length(runs[0], NOMINAL)) == []


def test_clipping_is_masked_and_said(runs: tuple[Record, ...]) -> None:
    record = runs[0]
    limit = 0.7 * np.abs(record.v[:, 0]).max()
    v = np.round(np.clip(record.v, -limit, limit) / 1e-4) * 1e-4
    clipped = make_record("c", record.t, record.u, v, sample_rate=RATE)
    # Exactly the samples whose value the limit changed by more than the rounding.
    beyond = (np.abs(record.v) > limit + 1e-4).any(axis=1)
    assert beyond.sum() > 50
    assert not clipped.valid[beyond].any()
    assert clipped.valid[(np.abs(record.v) < limit - 1e-4).all(axis=1)].all()
    assert f"{(~clipped.valid).sum()} samples" in next(iter(checks.clipping(clipped))).message


PHASE = 2 * np.pi * np.arange(4000) / 64


def _moves(way: int, rest: int) -> Floats:
    """A mass moved to the same place and back, three times, without a jerk; so many samples on its way, and at rest."""
    s = np.linspace(0, 1, way)
    there = 10 * s**3 - 15 * s**4 + 6 * s**5
    return np.tile(np.concatenate([there, np.ones(rest), there[::-1], np.zeros(rest)]), 3)


UNCLIPPED = {
    "sine": np.sin(PHASE),
    "sine, 8 bits": np.round(127 * np.sin(1.0001 * PHASE)) / 127,
    "sine, 3 bits": np.round(4 * np.sin(1.0001 * PHASE)) / 4,
    "noise, 3 levels": np.round(0.5 * np.random.default_rng(3).standard_normal(4000)),
    "settled": np.round(1e3 * (1 - np.exp(-np.arange(4000) / 50))),
    "lightly damped, 12 bits": np.round(2047 * np.exp(-np.arange(4000) / 3e3) * np.sin(PHASE)),
    "never positive": -np.abs(np.random.default_rng(4).standard_normal(4000)),
    "brought to rest, three times": np.round(1e4 * _moves(300, 200)) / 1e4,
}


@pytest.mark.parametrize("case", UNCLIPPED)
def test_no_flat_top_where_nothing_is_clipped(case: str) -> None:
    assert not flat_tops(UNCLIPPED[case][:, None]).any()


@pytest.mark.parametrize("samples_a_period", [7.3, 64.7])
def test_flat_tops_at_one_end(samples_a_period: float) -> None:
    v = np.sin(2 * np.pi * np.arange(4000) / samples_a_period)
    tops = flat_tops(np.minimum(v, 0.9)[:, None])[:, 0]
    assert np.array_equal(tops, v >= 0.9)


@pytest.mark.parametrize("limit", [0.3, 0.6, 0.95])
@pytest.mark.parametrize("seed", range(4))
def test_flat_tops_under_noise_and_beside_another_mode(limit: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    v = 0.8 * np.sin(0.6 * PHASE) + 0.2 * np.sin(2.3 * PHASE + seed) + 1e-3 * rng.standard_normal(len(PHASE))
    limit *= v.max()
    tops = flat_tops(np.round(1e4 * np.minimum(v, limit))[:, None])[:, 0]
    assert tops[v > limit].all() and not tops[v < limit - 1e-4].any()


def test_noise_level_is_that_of_the_generator(runs: tuple[Record, ...]) -> None:
    # 3763 Hz is the highest mode; the band from 18.8 to 22.5 kHz has 440 lines, whose median is known to 7 %.
    _, sigma = _start(runs[0], TRUE, _free_motion(runs[0], TRUE))
    assert sigma == pytest.approx(NOISE, rel=0.2)


def test_noise_level_without_a_band_above_the_modes() -> None:
    # The first decile of 3000 lines is known to 6 %; the line itself is above it.
    v = np.sin(PHASE) + 0.01 * np.random.default_rng(7).standard_normal(len(PHASE))
    assert noise_level(v, 1.0, 1 / 64 * 8) == pytest.approx(0.01, rel=0.15)


def test_bounds_agree_with_the_scatter_of_least_squares() -> None:
    """One axis: 200 least-squares fits with scipy's own simulation scatter as the bound says."""
    m, k, d, n = 1e-7, 40.0, 2e-5, 800
    u = 1e-6 * np.random.default_rng(8).standard_normal(n)

    def response(mass: float, stiffness: float, damping: float) -> Floats:
        b, a, _ = cont2discrete(([1.0], [mass, damping, stiffness]), 1 / RATE)
        return 1e6 * np.asarray(lfilter(np.ravel(b), a, u))

    q = response(m, k, d)
    noise = 1e-3 * np.std(q)
    # Central, h so small that the phase at the end (320 rad) moves by 2e-3: m and k are so nearly one parameter (to
    # 1 %) that a derivative 1 % wrong would mislead.
    h = 1e-5
    jacobian = np.empty((n, 3))
    for i in range(3):
        high, low = (response(*np.where(np.arange(3) == i, 1 + sign * h, 1) * (m, k, d)) for sign in (1, -1))
        jacobian[:, i] = (high - low) / (2 * h)
    rng = np.random.default_rng(9)
    fits = [np.linalg.lstsq(jacobian, noise * rng.standard_normal(n), rcond=None)[0] for _ in range(200)]
    scatter = np.std(fits, axis=0)
    record = make_record("one", np.arange(n) / RATE, u, q + noise * rng.standard_normal(n), sample_rate=RATE)
    nominal = {"m": m, "kxx": k, "dxx": d, "sense_gain_x": 1e6}
    bounds = np.array(list(cramer_rao_bounds((record,), nominal).values()))
    # 200 fits know a scatter to 5 %, the noise level another 10 %; the unknown start, which the fits above know, adds
    # to the bound: at most a half with 800 samples of which some 50 tell the start.
    assert np.all(bounds > 0.75 * scatter)
    assert np.all(bounds < 1.5 * scatter)


def test_poor_excitation_names_the_parameter() -> None:
    # y is neither driven nor coupled: nothing moves it.
    u = drive(6000) * X
    v = simulated(6000, u)
    v[:, 1] = 0.1 * NOISE * np.random.default_rng(1).standard_normal(6000)
    t = np.arange(6000) / RATE
    records = tuple(make_record(role, t, u, v, sample_rate=RATE, role=role) for role in ("fit", "held-out"))
    with pytest.raises(InputError, match=r"excitation too poor.*kyy"):
        list(checks.excitation(data(records, kxy=0.0, dxy=0.0)))


def test_weak_excitation_is_said(runs: tuple[Record, ...]) -> None:
    # Noise 3000 times as large brings the bound of damping from 2e-4 over 10 % and leaves it below 50 %.
    noisy = tuple(replace(r, v=r.v + 0.06 * np.random.default_rng(6).standard_normal(r.v.shape)) for r in runs)
    found = list(checks.excitation(data(noisy)))
    assert [finding.check for finding in found] == ["excitation"]


def test_many_runs_are_told_alike_in_one_line() -> None:
    short = [checks.Finding("short", f"run{n}", f"short: {n} periods") for n in range(12)]
    whole = [checks.Finding("assumed", "", text) for text in ("one", "other")]
    assert checks.lines([*whole, *short]) == ["one", "other", "run0: short: 0 periods (and 11 further runs likewise)"]
    assert checks.lines(short[:3]) == [str(finding) for finding in short[:3]]
