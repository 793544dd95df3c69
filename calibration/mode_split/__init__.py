"""The frequency split of the two modes from thermal noise, without disturbing operation (docs/theory/split.md)."""

from calibration.mode_split.correlation import Correlation, correlate, correlate_without_line, theoretical_spectrum
from calibration.mode_split.estimate import (
    Analysis,
    NothingFoundError,
    Question,
    Split,
    correlations,
    estimate,
    find_split,
)
from calibration.mode_split.follow import Track, follow_split
from calibration.mode_split.model import SplitModel, frequency_bound, kept_information
from calibration.mode_split.record import Envelope, VoltageRecord, envelope, find_line
from calibration.mode_split.spectrum import Spectrum, line_spectrum
from calibration.mode_split.tracking import (
    BiasTuner,
    SplitTracker,
    Tracked,
    expected_drift,
    expected_wander,
    split_slope,
    track,
)

__all__ = [
    "Analysis",
    "BiasTuner",
    "Correlation",
    "Envelope",
    "NothingFoundError",
    "Question",
    "Spectrum",
    "Split",
    "SplitModel",
    "SplitTracker",
    "Track",
    "Tracked",
    "VoltageRecord",
    "correlate",
    "correlate_without_line",
    "correlations",
    "envelope",
    "estimate",
    "expected_drift",
    "expected_wander",
    "find_line",
    "find_split",
    "follow_split",
    "frequency_bound",
    "kept_information",
    "line_spectrum",
    "split_slope",
    "theoretical_spectrum",
    "track",
]
