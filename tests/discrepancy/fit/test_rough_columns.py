"""Columns beside a delay or a lag, in whole steps and in parts of a step, and columns that grow without bounds."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from discrepancy.data.dataset import load_dataset
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.trial_runs import write_trial
from gyro_model.device import load_device
from gyro_model.model import load_model

PROBES = {"kxx": 1e-3, "dxx": 1e-8, "k3_x": 1e8, "feedthrough": 1.0, "actuator_gain_mismatch": 1e-4}


@pytest.mark.parametrize("held_back", [{"actuator_delay": 1e-6}, {"amplifier_time_constant": 3e-6}], ids=str)
def test_they_agree_with_those_in_parts_of_a_step(
    held_back: Mapping[str, float], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_trial(load_device("reference"), {"k3_x": 1e9, **held_back}, tmp_path / "trial", runs=2, samples=2000)
    dataset = load_dataset(path.parent)
    runs = [replace(run, hold="first") for run in dataset.fit]
    with Simulator(load_model(), 1) as simulator:
        fitter = Fitter(simulator, runs)
        begun = fitter.begin(dataset.nominal)
        at = fitter.evaluated(replace(begun, parameters={**begun.parameters, **held_back}))
        probes = [{name: at.parameters.get(name, 0.0) + step} for name, step in PROBES.items()]
        assert simulator.differs(runs[0], at.parameters, parts=False) and not any(map(simulator.refines, probes))
        rough = fitter.columns(at, 0, probes)
        monkeypatch.setattr(simulator, "refines", lambda names: True)
        fine = fitter.columns(at, 0, probes)
    for name, one, other in zip(PROBES, rough, fine, strict=True):
        # The staircase of the force: 1.4e-4 of a column, and 5e-3 of that of a feedthrough, which passes it on.
        limit = 1e-2 if name == "feedthrough" else 3e-4
        assert np.linalg.norm(one - other) < limit * np.linalg.norm(other), name


@pytest.mark.parametrize("beyond", [np.inf, 1e200])
def test_a_change_under_which_the_device_swings_ever_more_has_no_column(
    beyond: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_trial(load_device("reference"), {}, tmp_path / "trial", runs=2, samples=2000)
    dataset = load_dataset(path.parent)
    fill = Fitter._fill

    def swinging(self, at, run, extra, columns, *, near):  # type: ignore[no-untyped-def]
        fill(self, at, run, extra, columns, near=near)
        columns[-1, 1000:] = beyond

    with Simulator(load_model(), 1) as simulator:
        fitter = Fitter(simulator, dataset.fit)
        begun = fitter.begin(dataset.nominal)
        steady = fitter.with_grams(begun)
        monkeypatch.setattr(Fitter, "_fill", swinging)
        at = fitter.with_grams(begun)
    assert at.grams is not None
    assert steady.grams is not None
    last = at.grams.shape[1] - 2
    assert not at.grams[:, last].any()
    others = [i for i in range(at.grams.shape[1]) if i != last]
    # The scale of a column follows from its own size.
    np.testing.assert_allclose(at.grams[:, others][:, :, others], steady.grams[:, others][:, :, others], rtol=1e-9)
