"""A slow drift, another in each run, is taken out and said; what else is slow stays."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hidden_sets import MODEL, made, names
from hypothesis import given
from hypothesis import strategies as st

from discrepancy.data.record import Drift, Floats, Record, curves, make_record
from discrepancy.data.wander import steadied
from discrepancy.diagnose import diagnose

N, RATE = 6000, 1000.0
RESONANCE, WIDTH = 90.0, 3.0
"""Turns of a run."""
Law = Callable[[Floats], Floats]


def run(number: int, drift: Law, *, lowest: int = 40, stiffness: float = 1.0, bends: float = 0.0) -> Record:
    """Under tones from ``lowest`` to 150 turns of the run, seen by its place, which is periodic."""
    rng = np.random.default_rng(number)
    k = np.arange(N // 2 + 1)
    force = np.where((k >= lowest) & (k <= 150), np.exp(2j * np.pi * rng.uniform(size=len(k))), 0)
    answer = 1 / (stiffness * RESONANCE**2 - k**2 + 1j * WIDTH * k + 1e-9)
    u, x = np.fft.irfft(force), np.fft.irfft(force * answer)
    x *= (1 + 0.5 * number) / x.std()
    v = x + bends * x**2 + drift(np.linspace(0, 1, N)) + 1e-3 * rng.normal(size=N)
    return make_record(f"run-{number}", np.arange(N) / RATE, u, v, sample_rate=RATE)


def wave(number: int, size: float = 0.2) -> Law:
    return lambda s: size * (np.sin(2 * s + 3 * number) + (1 - number) * s + number)


def test_what_another_way_in_each_run_is_slow_is_taken_out_and_said() -> None:
    own, said = steadied([run(i, wave(i)) for i in range(2)])
    plain, _ = steadied([run(i, lambda s: 0 * s) for i in range(2)])
    assert len(said) == 1
    assert "v_x: a slow drift of 0.1" in said[0]
    for i, (record, other) in enumerate(zip(own, plain, strict=True)):
        assert record.drift and other.drift is None
        # Beside what the curves take of forty turns of a motion of 0.5 and 1 V: little but for the ends.
        middle = np.s_[N // 10 : -N // 10]
        assert record.drift.taken[middle, 0] == pytest.approx(wave(i)(np.linspace(0, 1, N))[middle], abs=0.02)
        assert record.v == pytest.approx(record.steady(other.v), abs=1e-4)


@pytest.mark.parametrize(
    "records",
    [
        pytest.param([run(i, lambda s: 0 * s) for i in range(2)], id="no drift"),
        pytest.param([run(i, lambda s: 0.2 + 0.3 * s) for i in range(2)], id="one line of all runs"),
        pytest.param([run(i, wave(i), lowest=1) for i in range(2)], id="a force as slow"),
        pytest.param([run(i, wave(i), stiffness=0.0) for i in range(2)], id="a mass that no spring holds"),
        pytest.param([run(i, lambda s: 0 * s, bends=0.05) for i in range(2)], id="a motion that bends"),
        pytest.param([run(0, lambda s: 0.3 * s)], id="a line of one run"),
        pytest.param([run(0, lambda s: 0 * s), run(1, wave(1))], id="in one run of two"),
    ],
)
def test_what_may_be_another_thing_stays(records: list[Record]) -> None:
    own, said = steadied(records)
    assert not said
    assert all(a is b for a, b in zip(own, records, strict=True))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("force", [np.zeros(500), np.ones(500), np.eye(1, 500)[0]], ids=["none", "constant", "a blow"])
def test_runs_that_no_band_drives_are_as_they_are(force: Floats) -> None:
    t = np.arange(500) / RATE
    for v in (np.ones(500), t, np.sin(300 * t) + t):
        both = [np.column_stack(own) for own in ((force, 0 * force), (v, 0 * v))]
        for u, seen in ((force, v), both):
            assert not steadied([make_record("a", t, u, s * seen, sample_rate=RATE) for s in (1, -1)])[1]


@given(seed=st.integers(0, 2**32 - 1), order=st.integers(1, 11))
def test_beside_a_drift_nothing_slow_counts(seed: int, order: int) -> None:
    rng = np.random.default_rng(seed)
    record = run(0, lambda s: 0 * s)
    valid = rng.uniform(size=N) > 0.1
    record = replace(record, valid=valid, drift=Drift(0 * record.v, order))
    values = rng.normal(size=(N, 1))
    slow = curves(N, order) @ rng.normal(size=(order + 1, 1))
    steady = record.steady(values)
    # Rounding of sums of some thousand numbers.
    assert record.steady(values + slow) == pytest.approx(steady, abs=1e-9)
    assert record.steady(steady) == pytest.approx(steady, abs=1e-9)


def test_an_effect_is_named_beside_a_drift() -> None:
    data = made({"k3_x": 2e9, "k3_y": 2e9}, samples=16_000)
    s = np.linspace(0, 1, len(data.fit[0].t))[:, None]
    drifts = [0.2 * (np.sin(2 * s + 3 * i) + (1 - i) * s) for i in range(3)]
    records = [replace(r, v=r.v + own) for r, own in zip(data.records, drifts, strict=True)]
    own, said = steadied(records)
    assert said
    found = diagnose(replace(data, records=own), MODEL)
    assert (found.verdict, names(found)) == ("missing effects", {"cubic_stiffness"})
    [drift] = [f for f in found.record if f.id == "voltage_drift"]
    assert drift.parameters["voltage_drift"].value == pytest.approx(max(np.std(d) for d in drifts[:2]), rel=0.05)
    for value in found.effects[0].parameters.values():
        assert value.low < 2e9 < value.high
