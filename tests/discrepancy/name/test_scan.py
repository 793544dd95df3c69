"""The scan of candidates: batches, and the maxima of a grid."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from discrepancy.data.dataset import load_dataset
from discrepancy.fit import quotients
from discrepancy.fit.continuation import settled
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import scan
from discrepancy.name.columns import Candidate, Library
from discrepancy.name.scan import Scored, batched, next_peaks, scanned
from discrepancy.name.score import NOTHING
from discrepancy.trial_runs import write_trial
from gyro_model.device import load_device
from gyro_model.model import load_model


@given(st.lists(st.integers(1, 9)), st.integers(1, 20))
def test_batches_keep_the_order_and_hold_what_they_may(columns: list[int], most: int) -> None:
    batches = batched(range(len(columns)), columns, most)
    assert [item for batch in batches for item in batch] == list(range(len(columns)))
    for batch, following in zip(batches, [*batches[1:], ()], strict=False):
        held = sum(columns[i] for i in batch)
        assert held <= most or len(batch) == 1
        assert not following or held + columns[following[0]] > most


def test_a_scan_in_batches_scores_as_one_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_trial(load_device("reference"), {"angular_gain": 0.8}, tmp_path / "set", runs=3, samples=3000)
    dataset = load_dataset(tmp_path / "set")
    # A few columns would be simulated, which differs by 1e-6 of a column.
    monkeypatch.setattr(quotients, "FEWEST", 1)
    with Simulator(load_model()) as simulator:
        fitter = Fitter(simulator, dataset.fit)
        _, at = settled(fitter, fitter.begin(dataset.nominal))
        # The first linearisation sets the steps of its difference quotients anew.
        at = fitter.with_grams(at)
        fitter.forget()
        found = Library(fitter).candidates(fitter, at, ())
        one = scanned(fitter, at, (), found)
        monkeypatch.setattr(scan, "HELD", 1)
        fitter.forget()
        several = scanned(fitter, at, (), found)
    assert len(one.batches) == 1 < len(several.batches)
    for (_, whole), (_, part) in zip(one.scores(), several.scores(), strict=True):
        # Sums of products in another order.
        assert part.gain == pytest.approx(whole.gain, rel=1e-6)


def test_the_next_peak_is_the_second_highest_of_the_grid() -> None:
    mode = load_model().effect("parasitic_mode")

    def point(frequency: float, gain: float, trials: int = 6) -> Scored:
        candidate = Candidate(mode, (), {"parasitic_frequency": frequency}, trials=trials)
        return candidate, replace(NOTHING, statistic=gain)

    grid = [point(*p) for p in ((1e3, 1.0), (2e3, 7.0), (3e3, 4.0), (4e3, 5.0), (5e3, 8.0), (6e3, 9.0))]
    sharper = point(5.9e3, 10.0, trials=12)
    peaks = next_peaks(sharper[0], [*grid, sharper])
    assert [c.shapes["parasitic_frequency"] for c, _ in peaks] == [2e3]
