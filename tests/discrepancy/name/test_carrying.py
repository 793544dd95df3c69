"""What a heavily damped shaft carries, of which no peak shows; no line of the motion is the FMU's."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.drives_damped import band, drawn
from benchmarks.structures import motion, runs_of
from discrepancy.data.dataset import Dataset
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Senses
from discrepancy.data.weak_modes import all_modes
from discrepancy.diagnose import diagnose
from discrepancy.name.grids import swing
from gyro_model.model import load_model


@pytest.mark.parametrize("senses", ["position", "velocity", "acceleration"])
def test_a_load_is_named_without_a_peak_of_it(senses: Senses) -> None:
    rng = np.random.default_rng(3)
    own, alone = drawn(rng)
    records = runs_of(band(alone), rng, senses, "first", 3e-3, lambda u, step: motion(own, u, step, "first"))
    assert not [mode for modes in all_modes(records[:2]) for mode in modes if mode.seen]
    nominal = linear_start(records[:2], (records[0].reference ** records[0].order,))
    assert nominal is not None
    data = Dataset(Path("here"), nominal, tuple(records), estimated=("m", "kxx", "dxx"), hold_stated=True)
    # Nothing beside it.
    found = diagnose(data, load_model(), jobs=1, max_effects=0)
    assert [effect.id for effect in found.effects] == ["parasitic_mode"]
    told = found.effects[0].parameters["parasitic_frequency"]
    # Twice the 95 % interval: one of 16,000 leaves it by chance.
    assert abs(told.value - alone) < told.high - told.low < 0.05 * alone
    # 8000 samples know the rms of noise to 0.8 %.
    assert found.misfit["final"] < 1.05 * 3e-3


def test_a_mass_that_nothing_holds_swings_where_the_force_drives_it() -> None:
    rng = np.random.default_rng(3)
    own, alone = drawn(rng)
    records = runs_of(band(alone), rng, "position", "first", 3e-3, lambda u, step: motion(own, u, step, "first"))
    assert swing(records, 2 * alone) == 2 * alone
    # To a bin of the spectrum, which a window spreads over two.
    assert swing(records, 1e-6) == pytest.approx(0.5 * 3 * alone, rel=0.02)
