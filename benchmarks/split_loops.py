"""The split followed through a temperature ramp, tuned away by the bias, and what the line hides on the way.

The sense axis is a complex amplitude around the drive, Y' = (-Γ + i 2π Δf(t)) Y + n + F, the drive line at zero; a
phase-locked loop holds the drive, so f_x is known. Thermal motion and the answer to the quadrature force F go through
the same resonance: a step of the bias makes the line ring.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from benchmarks.report import Row, row
from benchmarks.split_matching import matching_row
from benchmarks.split_records import THERMAL_RMS, SenseAxis, complex_normal
from calibration.mode_split import (
    BiasTuner,
    Envelope,
    NothingFoundError,
    Question,
    SplitModel,
    SplitTracker,
    estimate,
    frequency_bound,
    line_spectrum,
    split_slope,
    track,
)
from calibration.mode_split.model import spectrum_bound

Complexes = NDArray[np.complex128]

Q: Final = 1885.0
F: Final = 3000.0
DECAY: Final = np.pi * F / Q
HUMP_DB: Final = 20.0
WHITE: Final = SenseAxis(f_x=F, f_y=F, q=Q, hump_db=HUMP_DB).white
"""Floor [V²/Hz], one-sided."""
RATE: Final = 800.0
"""Samples of the slow model a second [Hz]; the fits look at ±100 Hz."""
SPAN: Final = 100.0
BLOCK: Final = 10.0
"""Of an estimate [s]."""

TCK_SPLIT: Final = 30e-6
"""Of the sense stiffness beyond that of the drive [1/K]: 3.6 Hz of split from -20 to 60 °C."""
COLD, HOT, PER_MINUTE = -20.0, 60.0, 1.0
"""The ramp [°C, °C/min]."""
QUADRATURE: Final = np.deg2rad(3.0)
"""Rate that the quadrature force is worth [rad/s]: what a nulling electrode leaves of 300 °/s. At the match y answers
with 2 Ω A Q/ω, 0.03 µm here."""
AMPLITUDE: Final = 3e-6
"""Of the drive [m]."""
GAIN: Final = 1e6
"""Pickoff [V/m]."""
MASS, SOFTENING, GAP, HIGHEST_BIAS = 1.8e-7, 0.02, 1e-5, 40.0
FIRST_SPLIT: Final = -4.0
"""At 10 V and -20 °C [Hz]."""
SETTLING: Final = 60.0
"""Before the loop is judged [s]."""


def temperature_split(minutes: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the ramp adds to the split [Hz]: f/2 · tck_split · ΔT."""
    return 0.5 * F * TCK_SPLIT * np.minimum(PER_MINUTE * minutes, HOT - COLD)


class SlowAxis:
    """The sense amplitude [V], stepped block by block from a settled start."""

    def __init__(self, seed: int, quadrature: float) -> None:
        """Settled, with a force at the drive frequency worth the rate ``quadrature`` [rad/s]."""
        self.rng = np.random.default_rng(seed)
        # y = F/(m 2 ω) / (Γ - i 2π Δf), F = 2 m Ω ω A: a force of Ω A on the amplitude.
        self.force = GAIN * quadrature * AMPLITUDE
        self.state: complex = np.sqrt(2) * THERMAL_RMS * complex(complex_normal(1, self.rng)[0])
        self.settled = False

    def block(self, offset: NDArray[np.float64]) -> Envelope:
        """The samples while the split runs through ``offset`` (count,) [Hz]."""
        count = len(offset)
        pole = np.exp((-DECAY + 2j * np.pi * offset) / RATE)
        if not self.settled:
            self.state += self.force / (DECAY - 2j * np.pi * offset[0])
            self.settled = True
        kick = self.force * (pole - 1) / (-DECAY + 2j * np.pi * offset)
        kick += np.sqrt(-np.expm1(-2 * DECAY / RATE) * 2) * THERMAL_RMS * complex_normal(count, self.rng)
        # In the frame that turns with the offset the pole is constant.
        turn = np.exp(2j * np.pi * np.cumsum(offset) / RATE)
        steady = np.exp(-DECAY / RATE)
        y = turn * lfilter([1.0], [1.0, -steady], kick / turn, zi=[steady * self.state])[0]
        self.state = complex(y[-1])
        noise = np.sqrt(2 * WHITE * RATE) * complex_normal(count, self.rng)
        return Envelope(y + noise, RATE, F, SPAN)


def tracking_rows(seeds: int) -> list[Row]:
    """Error of the track over its posterior bound, through the ramp, blocks of 10 s."""
    # The ramp's kinks at its ends are what dΔf/dt must be free to follow: its step over the ramp's length.
    slope = 0.5 * F * TCK_SPLIT * PER_MINUTE / 60
    wander = slope / np.sqrt(60.0)
    ratios, alone, errors = [], [], []
    for seed in range(seeds):
        count = round((HOT - COLD + 10) / PER_MINUTE * 60 * RATE)
        minutes = np.arange(count) / RATE / 60
        offset = 50.0 + temperature_split(np.maximum(minutes - 5, 0.0))
        part = SlowAxis(seed, np.deg2rad(300.0)).block(offset)
        tracked = list(track(part, Question(q=Q), BLOCK, wander))
        truth = np.array([offset[round(step.t * RATE)] for step in tracked])
        bound = track_bound(len(tracked), wander, frequency_bound(F + 50, Q, BLOCK, 10 ** (HUMP_DB / 10)))
        error = np.array([step.split for step in tracked]) - truth
        ratios.append(np.mean((error / bound)[6:] ** 2))
        errors.append(error[6:])
        found = [(s.block.split - x) for s, x in zip(tracked, truth, strict=True) if s.block is not None]
        alone.append(np.mean(np.square(found)))
    values = {
        "track/bound": float(np.sqrt(np.mean(ratios))),
        "worst run": float(np.sqrt(np.max(ratios))),
        "rms error [Hz]": float(np.sqrt(np.mean(np.concatenate(errors) ** 2))),
        "largest error [Hz]": float(np.abs(np.concatenate(errors)).max()),
        "blocks alone, rms [Hz]": float(np.sqrt(np.mean(alone))),
        "track bound [Hz]": float(bound[-1]),
    }
    what = f"Q {Q:g}, hump {HUMP_DB:g} dB, {COLD:g}..{HOT:g} °C at {PER_MINUTE:g} °C/min, {slope * 60:.3g} Hz/min"
    note = f"{seeds} runs; 300 °/s of quadrature on the axis; Q given"
    return [row(what, "1", values, limit=1.2, judged=("track/bound", "worst run"), note=note)]


def track_bound(count: int, wander: float, block_bound: float) -> NDArray[np.float64]:
    """Posterior bound [Hz] after each of ``count`` blocks whose own bound is ``block_bound`` [Hz]."""
    tracker = SplitTracker(wander)
    bound = []
    for _ in range(count):
        tracker.predict(BLOCK)
        tracker.update(0.0, block_bound, 0.5 * F / Q)
        bound.append(tracker.deviation)
    return np.array(bound)


def matching_rows(seeds: int) -> list[Row]:
    """Split held at zero by the bias through the ramp, one run a seed."""
    runs = [match(seed) for seed in range(seeds)]
    without = float(np.sqrt(np.mean(runs[0][1] ** 2)))
    missed, blocks = sum(run[2] for run in runs), sum(len(run[0]) for run in runs)
    what = f"Δf, slow model, Q {Q:g}, 10 s estimates, {COLD:g}..{HOT:g} °C at {PER_MINUTE:g} °C/min, {seeds} runs"
    note = f"{missed} of {blocks} blocks without an answer; {without:.2f} Hz rms without the loop"
    return [matching_row(what, [run[0] for run in runs], note)]


def match(seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Split over the ramp once settled [Hz], what it would have been without the loop [Hz], blocks without answer."""
    slope = split_slope(SOFTENING, GAP, AMPLITUDE, MASS, F)
    tuner = BiasTuner(slope, 0.5, HIGHEST_BIAS)
    axis = SlowAxis(seed, QUADRATURE)
    bias, first = 10.0, FIRST_SPLIT - slope * 10.0**2
    per_block = round(BLOCK * RATE)
    # The step of the bias has rung off by e^-12 when the block's second part begins.
    settle = 12 / DECAY
    splits, free, missed = [], [], 0
    for index in range(round(60 * (HOT - COLD) / PER_MINUTE / BLOCK)):
        minutes = (index * per_block + np.arange(per_block)) / RATE / 60
        drift = temperature_split(minutes)
        offset = first + slope * bias**2 + drift
        splits.append(float(offset.mean()))
        free.append(FIRST_SPLIT + float(drift.mean()))
        found = _answer(axis.block(offset).part(settle, BLOCK))
        missed += found is None
        bias = tuner.next_bias(bias, found)
    settled = round(SETTLING / BLOCK)
    return np.array(splits[settled:]), np.array(free[settled:]), missed


def _answer(part: Envelope) -> float | None:
    try:
        return estimate(line_spectrum(part, F), Question(q=Q, clean_line=True)).split
    except NothingFoundError:
        return None


def masking_rows() -> list[Row]:
    """Bound of f_y with bins around the line masked, over that without a mask; exact Fisher information, 10 s."""
    return [
        masking_row(widths, skirt)
        for skirt in (0.0, 1e-9)
        for widths in ((0.25, 0.5, 1.0, 2.0) if skirt == 0 else (0.5, 1.0))
    ]


def masking_row(widths: float, skirt: float) -> Row:
    """One mask, half-widths of the hump either side; skirt: of the line, of the floor, not known to the fit."""
    half_width = 0.5 * F / Q
    hump = SenseAxis(f_x=F, f_y=F, q=Q, hump_db=HUMP_DB).hump
    f = F + np.arange(-SPAN, SPAN, 1 / BLOCK)
    kept = np.abs(f - F) >= widths * half_width
    ratios = {}
    for name, away in (
        ("Δf = 0", 0.0),
        ("½ half-width", 0.5),
        ("1 half-width", 1.0),
        ("2 half-widths", 2.0),
        ("10 half-widths", 10.0),
    ):
        model = SplitModel(F + away * half_width, Q, hump, WHITE, 0.1 * WHITE, skirt * WHITE, F, 0.01)
        ideal = SplitModel(F + away * half_width, Q, hump, WHITE, 0.1 * WHITE, 0.0, F, 0.01)
        ratios[name] = spectrum_bound(model, f[kept]) / spectrum_bound(ideal, f)
    line = "clean line" if skirt == 0 else "line with a skirt of unknown size"
    return row(f"masked ±{widths:g} half-widths, {line}", "σ/σ unmasked", ratios)
