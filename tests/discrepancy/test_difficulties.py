"""Defects of a record against a generator that shares no code with them: the same record, to what either is right."""

import numpy as np
import pytest

from benchmarks.blind.difficulties import DIFFICULTIES
from benchmarks.blind.experiment import Plan, draw_device, draw_runs
from benchmarks.blind.noise import clean
from discrepancy.data.record import make_record
from discrepancy.fit.defect import distortions
from discrepancy.fit.simulate import Simulator
from gyro_model.model import load_model

NOMINAL = ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy", "sense_gain_x", "sense_gain_y")
STARTS = ("x_start", "y_start", "x_dot_start", "y_dot_start")


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("name", sorted({d.id for d in distortions()} & set(DIFFICULTIES)))
def test_both_distort_alike(name: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    device = draw_device(rng)
    runs = draw_runs(rng, device, Plan())[:2]
    difficulty = DIFFICULTIES[name](rng, device, [*runs, runs[0]])
    p = {n: getattr(device.true, n) for n in NOMINAL} | {name: difficulty.value}
    if name.endswith("_filter"):
        p[f"{name}_order"] = 2.0
    with Simulator(load_model(), jobs=1) as simulator:
        for run in runs:
            wanted = clean(device.true, run, difficulty)
            record = make_record("run", run.t, run.u, wanted, sample_rate=run.rate)
            start = dict(zip(STARTS, (run.start[i] for i in (0, 1, 2, 3)), strict=True))
            off = np.abs(simulator.run(record, {**p, **start}) - wanted)[20:-20].max()
            # Splines of 16 samples a period at least, and a sensor's noise of 2e-5 V.
            assert off < 1e-5 * np.abs(wanted).max()
