"""Makes hand_motion.csv: 6 s of a hand turning an object, 100 readings a second.

Reaching movements of the arm follow a minimum-jerk course (Flash and Hogan 1985): a turn by the
angle a in the time d has the rate (30 a/d) s^2 (1 - s)^2, s in 0..1, at most 1.875 a/d. The
profile is a row of such turns, two of them overlapping, plus a physiological tremor of 8 to 12 Hz
with seeded phases. `python -m cosim.profiles.hand_motion` writes the file anew.
"""

from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

PATH: Final = Path(__file__).with_suffix(".csv")
DURATION: Final = 6.0
RATE_HZ: Final = 100
SEED: Final = 7

TURNS: Final = (
    (0.30, 0.80, 60.0),
    (1.25, 0.60, -48.0),
    (1.95, 0.90, -70.0),
    (2.60, 0.70, 25.0),
    (3.45, 0.75, 58.0),
    (4.45, 1.10, -85.0),
)
"""Start [s], time taken [s] and angle [deg] of each turn."""

TREMOR: Final = ((8.3, 1.2), (9.7, 2.0), (11.4, 0.9))
"""Frequency [Hz] and amplitude [deg/s] of each component."""


def rate(t: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rate [deg/s] at `t` [s], shape (n,)."""
    total = np.zeros_like(t)
    for start, time_taken, angle in TURNS:
        s = np.clip((t - start) / time_taken, 0.0, 1.0)
        total += 30 * angle / time_taken * s**2 * (1 - s) ** 2
    phases = np.random.default_rng(SEED).uniform(0, 2 * np.pi, len(TREMOR))
    for (frequency, amplitude), phase in zip(TREMOR, phases, strict=True):
        total += amplitude * np.sin(2 * np.pi * frequency * t + phase)
    return total


def text() -> str:
    """Return the content of the file: a header line, then time [s] and rate [deg/s]."""
    # Two digits of a time at 100 Hz are exact; four of the rate are far below the tremor.
    t = np.arange(round(DURATION * RATE_HZ) + 1) / RATE_HZ
    rows = (f"{time:.2f},{value:.4f}" for time, value in zip(t, rate(t), strict=True))
    return "\n".join(("t,omega_z", *rows)) + "\n"


if __name__ == "__main__":
    PATH.write_text(text(), encoding="utf-8", newline="\n")
