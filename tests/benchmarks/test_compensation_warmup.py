"""The search for what a function of the temperatures would leave of a warm-up."""

import numpy as np
import pytest

from benchmarks import compensation_warmup
from calibration.compensation.record import Blocks


def test_the_search_finds_a_lag_and_leaves_the_noise(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compensation_warmup, "LAGS", (60.0, 240.0))
    rng, t, noise = np.random.default_rng(1), 10.0 * np.arange(240), 0.05
    board, die = 25 - 15 * np.exp(-t / 300) + np.sin(t / 150), 30 - 18 * np.exp(-t / 500)
    # x' = (board - x)/240 by fine steps.
    late, fine = [board[0]], np.interp(np.arange(2400), t, board)
    for value in fine[1:]:
        late.append(late[-1] + (value - late[-1]) / 240)
    rate = 0.3 * np.array(late)[::10] + 0.01 * die**2 + noise * rng.standard_normal(240)
    inputs = {"structure": die, "circuit": board}
    inputs |= {f"{name}_rate": np.gradient(values, t) for name, values in inputs.items()}
    found = compensation_warmup.widest_search(
        Blocks(t, rate, np.zeros(240), np.full(240, noise), inputs, "counts", "test")
    )
    # A quarter of 240 blocks is judged: their rms scatters by 9 %; a few more for the weights, and 3 of that.
    assert found.least <= found.chosen < 1.35 * noise
    assert found.least > 0.6 * noise
