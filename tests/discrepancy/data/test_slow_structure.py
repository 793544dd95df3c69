"""A structure of one hertz on a table: channels of two clocks, a sensor that counts the other way, gaps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, cont2discrete, lfilter, sosfilt

from discrepancy.data.dataset import load_dataset
from discrepancy.data.late import synchronised
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Record, make_record

RATE, SAMPLES = 200.0, 12_000
MASS, STIFFNESS, DAMPING = 1.0, 57.8, 0.456
NOMINAL = {"m": MASS, "kxx": STIFFNESS, "dxx": DAMPING, "sense_gain_x": 1.0}
LATER = 5
"""Samples by which the voltage's clock is behind: 25 ms."""


def shaken(seed: int, later: int = 0, sign: float = 1.0) -> Record:
    """A run under a force held between samples, with a voltage that is late and noisy."""
    rng = np.random.default_rng(seed)
    u = sosfilt(butter(2, [0.3, 12], "band", fs=RATE, output="sos"), rng.standard_normal(SAMPLES + later))
    rates = np.array([[0.0, 1.0], [-STIFFNESS / MASS, -DAMPING / MASS]]), np.array([[0.0], [1 / MASS]])
    a, b, *_ = cont2discrete((*rates, np.eye(2)[:1], np.zeros((1, 1))), 1 / RATE)
    polynomial = np.poly(a)
    numerator = [0.0, b[0, 0], b[1, 0] * a[0, 1] - b[0, 0] * a[1, 1]]
    x = lfilter(numerator, polynomial, u)
    v = sign * (x[:SAMPLES] + 1e-3 * x.std() * rng.standard_normal(SAMPLES))
    t = np.arange(SAMPLES) / RATE
    return make_record(f"{seed}.csv", t, u[later:, None], v[:, None], sample_rate=RATE)


def test_a_voltage_by_another_clock_is_taken_as_early_as_it_was() -> None:
    runs = [shaken(1, LATER), replace(shaken(2, LATER), role="held-out")]
    found, said = synchronised(runs, NOMINAL, most=1e-3)
    assert len(said) == 1 and "s after what u makes" in said[0]
    for record, given in zip(found, runs, strict=True):
        # The minimum of what is left is flat: a tenth of a sample.
        assert record.v[:-LATER] == pytest.approx(given.v[LATER:], abs=0.01 * given.v.std())
        assert record.valid[: SAMPLES - LATER - 1].all() and not record.valid[SAMPLES - LATER :].any()


@pytest.mark.parametrize(("later", "most"), [(0, 1e-3), (LATER, 0.03), (LATER, 1.0)])
def test_what_a_device_may_be_late_by_stays(later: int, most: float) -> None:
    runs = (shaken(1, later), shaken(2, later))
    assert synchronised(runs, NOMINAL, most) == (runs, ())


def test_short_gaps_cost_no_model() -> None:
    runs, rng = [], np.random.default_rng(5)
    for seed in (1, 2):
        record = shaken(seed)
        valid, v = record.valid.copy(), record.v.copy()
        for begin in range(150, SAMPLES - 20, 400):
            end = begin + int(rng.integers(1, 9))
            valid[begin:end] = False
            v[begin:end, 0] = np.interp(np.arange(begin, end), [begin - 1, end], v[[begin - 1, end], 0])
        runs.append(replace(record, v=v, valid=valid))
    found = linear_start(runs, (1.0,))
    assert found is not None
    # In each window of eight periods there are five gaps.
    assert (found["m"], found["kxx"]) == pytest.approx((MASS, STIFFNESS), rel=0.01)
    assert found["dxx"] == pytest.approx(DAMPING, rel=0.05)


def test_a_unit_does_not_say_which_way_a_record_counts(tmp_path: Path) -> None:
    text = "format = 1\n[nominal]\nsense_gain_x = 1.0\n"
    for seed in (1, 2):
        record = shaken(seed, sign=-1.0)
        columns = np.column_stack((record.t, record.u[:, 0], record.v[:, 0]))
        np.savetxt(tmp_path / record.name, columns, delimiter=",", header="t,u_x,v_x", comments="")
        text += f'[[run]]\nfile = "{record.name}"\nsample_rate = {RATE}\n'
    (tmp_path / "dataset.toml").write_text(text, encoding="utf-8")
    data = load_dataset(tmp_path)
    assert data.nominal["sense_gain_x"] == -1.0
    assert data.nominal["m"] == pytest.approx(MASS, rel=0.01)
    assert any("the other way round" in note for note in data.notes)
