"""Temperature cycles of a made-up gyroscope whose bias remembers: written without the package that is tested."""

from typing import NamedTuple

import numpy as np

from calibration.compensation.record import Blocks, TemperatureTest, make_blocks

STEP = 1.0
NOISE = 2e-5


RAMPS = ((55.0, 1.0), (-15.0, 1.0), (55.0, 3.0), (-15.0, 3.0))
"""Two speeds: at one alone a play and a lag look alike."""


def course(legs: tuple[tuple[float, float], ...] = RAMPS) -> np.ndarray:
    """Chamber [°C] from -15 by (to, at [°C/min]), each held for 10 min; a row a second."""
    parts, now = [np.full(600, -15.0)], -15.0
    for to, at in legs:
        parts += [np.linspace(now, to, int(abs(to - now) / at * 60)), np.full(600, to)]
        now = to
    return np.concatenate(parts)


class Cycle(NamedTuple):
    """A test, and what of its bias no function of the temperatures' history tells: walk, turn-on, noise [rad/s]."""

    test: TemperatureTest
    untold: np.ndarray


def record(chamber: np.ndarray, seed: int, **sizes: float) -> TemperatureTest:
    """The test of ``cycle``."""
    return cycle(chamber, seed, **sizes).test


def cycle(
    chamber: np.ndarray, seed: int, *, play: float = 0.0, slow: float = 0.0, walk: float = 0.0, turn_on: float = 0.0
) -> Cycle:
    """A test at rest. Bias [rad/s]: a curve of the structure's temperature, and a play of 5 °C, a lag of 2500 s of the
    chamber, a random walk [/√s] and an offset [rad/s], each by its size."""
    rng = np.random.default_rng(seed)
    structure, board = chamber.copy(), chamber.copy()
    stress, stuck = chamber.copy(), chamber.copy()
    for k in range(1, len(chamber)):
        structure[k] = structure[k - 1] + (chamber[k] - structure[k - 1]) * STEP / 240
        board[k] = board[k - 1] + (chamber[k] - board[k - 1]) * STEP / 120
        stress[k] = stress[k - 1] + (chamber[k] - stress[k - 1]) * STEP / 2500
        stuck[k] = min(max(stuck[k - 1], structure[k] - 5), structure[k] + 5)
    u = (structure - 20) / 40
    bias = 1e-2 * (u - 0.6 * u**2 + 0.4 * np.sin(3 * u)) + play * (stuck - structure) + slow * (stress - structure)
    untold = walk * np.sqrt(STEP) * np.cumsum(rng.standard_normal(len(chamber))) + turn_on
    sensors = {
        "structure": structure + 2e-3 * rng.standard_normal(len(chamber)),
        "circuit": board + 2e-2 * rng.standard_normal(len(chamber)),
    }
    t = STEP * np.arange(1.0, len(chamber) + 1)
    untold = untold + NOISE * rng.standard_normal(len(t))
    return Cycle(TemperatureTest(t, bias + untold, 0 * t, sensors, name=f"cycle {seed}"), untold)


def blocks(chamber: np.ndarray, seed: int, **sizes: float) -> Blocks:
    """The test of ``cycle`` as blocks of 10 s."""
    return make_blocks(record(chamber, seed, **sizes), 10.0, 0.0)
