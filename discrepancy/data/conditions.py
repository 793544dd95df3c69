"""Operating conditions of the blocks of a run, and the split of one that goes with a disagreement, in words."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata
from scipy.stats import t as student

from discrepancy.data.record import CONDITIONS, Floats, Record

BINS: Final = 8
"""Bins of equal count over a condition; a split lies between two."""

NAMES: Final = {"amplitude": ("amplitude", "m"), "drive": ("drive level", "N"), "omega_z": ("rate", "rad/s"),
                "temperature": ("temperature", "K"), "a_x": ("acceleration a_x", "m/s²"),
                "a_y": ("acceleration a_y", "m/s²"), "v_bias": ("bias", "V")}  # fmt: skip
"""Word and unit of each condition."""
ABSOLUTE: Final = ("omega_z", "a_x", "a_y")
"""Taken by magnitude: what they do to a spectrum grows on both sides of zero."""
PREFIXES: Final = {1e-9: "n", 1e-6: "µ", 1e-3: "m", 1.0: ""}


def operating_conditions(
    record: Record, parameters: Mapping[str, float], parts: Sequence[NDArray[np.int_]]
) -> dict[str, Floats]:
    """Of each block (indices in ``parts``): amplitude of the motion [m] and of the drive [N], as of a sine of the same
    rms, and the mean of each measured input [SI]; each (blocks,)."""
    gains = np.array([parameters["sense_gain_x"], parameters.get("sense_gain_y", 1.0)])[: record.axes]
    q = (record.v - record.v.mean(axis=0)) / gains
    found = {
        "amplitude": np.array([np.sqrt(2 * np.mean(np.sum(q[part] ** 2, axis=1))) for part in parts]),
        "drive": np.array([np.sqrt(2 * np.mean(np.sum(record.u[part] ** 2, axis=1))) for part in parts]),
    }
    for name in CONDITIONS:
        if name in record.conditions:
            values = record.conditions[name]
            values = np.abs(values) if name in ABSOLUTE else values
            found[name] = np.array([np.mean(values[part]) for part in parts])
    return found


@dataclass(frozen=True)
class Split:
    """Where a condition lies beyond ``threshold`` [SI]: above it, or below."""

    name: str
    threshold: float
    above: bool

    def holds(self, conditions: Mapping[str, Floats]) -> NDArray[np.bool_]:
        """For each block (blocks,) whether it meets the condition."""
        values = conditions[self.name]
        return np.asarray(values >= self.threshold if self.above else values <= self.threshold)

    def __str__(self) -> str:
        word, unit = NAMES[self.name]
        scale = 1.0
        if unit in ("m", "N", "V"):
            scale = max((s for s in PREFIXES if s <= abs(self.threshold) * (1 + 1e-9)), default=1e-9)
        number = f"{self.threshold / scale:.3g} {PREFIXES[scale]}{unit}"
        return f"{word} {'above' if self.above else 'below'} {number}"


def association(values: Floats, power: Floats, begins: NDArray[np.int_]) -> tuple[float, float]:
    """Spearman's rank correlation of ``values`` and ``power``, each (blocks,), and its chance without any association.

    begins: first block of each run. What the bins of ``values`` leave of the power may be correlated from block to
    block; n blocks then count as n (1 - r)/(1 + r), r their correlation at lag 1.
    """
    usable = power > 0
    if usable.sum() < BINS or np.ptp(values[usable]) <= 1e-6 * np.abs(values).max():
        return 0.0, 1.0
    x, y = rankdata(values[usable]), rankdata(power[usable])
    bins = np.searchsorted(np.quantile(x, np.arange(1, BINS) / BINS), x)
    left = y - np.array([y[bins == b].mean() if (bins == b).any() else 0.0 for b in range(BINS)])[bins]
    follows = np.ones(len(values), dtype=bool)
    follows[begins] = False
    pairs = follows[usable][1:]
    r = float(np.sum((left[1:] * left[:-1])[pairs]) / max(np.sum(left**2), 1e-300))
    count = len(x) * min(1.0, (1 - r) / (1 + r))
    rank = float(np.corrcoef(x, y)[0, 1])
    if count < 4 or not np.isfinite(rank):
        return 0.0, 1.0
    statistic = rank * np.sqrt((count - 2) / max(1 - rank**2, 1e-12))
    return rank, float(2 * student.sf(abs(statistic), count - 2))


def split(name: str, values: Floats, power: Floats, *, rising: bool) -> Split:
    """The split of ``values`` (blocks,) between two bins that separates the logarithm of ``power`` (blocks,) best."""
    usable = power > 0
    x, y = values[usable], np.log(power[usable])
    inner = np.unique(np.quantile(x, np.arange(1, BINS) / BINS))
    best, widest = float(np.median(x)), -np.inf
    for edge in inner:
        high = x >= edge
        if high.all() or not high.any():
            continue
        # Between-group sum of squares, the largest of which splits two levels best.
        apart = high.mean() * (1 - high.mean()) * (y[high].mean() - y[~high].mean()) ** 2
        if apart > widest:
            best, widest = float(edge), apart
    return Split(name, best, rising)
