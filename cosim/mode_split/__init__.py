"""The frequency split of the two modes from thermal noise, without disturbing operation (SYSTEM.md section 7)."""

from cosim.mode_split.correlation import Correlation, correlate, correlate_without_line, theoretical_spectrum
from cosim.mode_split.estimate import Analysis, NothingFoundError, Question, Split, estimate, find_split
from cosim.mode_split.model import SplitModel, frequency_bound, kept_information
from cosim.mode_split.record import Envelope, VoltageRecord, envelope, find_line
from cosim.mode_split.spectrum import Spectrum, line_spectrum

__all__ = [
    "Analysis",
    "Correlation",
    "Envelope",
    "NothingFoundError",
    "Question",
    "Spectrum",
    "Split",
    "SplitModel",
    "VoltageRecord",
    "correlate",
    "correlate_without_line",
    "envelope",
    "estimate",
    "find_line",
    "find_split",
    "frequency_bound",
    "kept_information",
    "line_spectrum",
    "theoretical_spectrum",
]
