"""Mode matching: the bias voltage tuned until the sense mode is at the drive frequency (docs/theory/matching.md)."""

from calibration.matching.asking import Asking, ask
from calibration.matching.holding import Block, Matched, match
from calibration.matching.known import Known, Sensed, designed_bias, known_of
from calibration.matching.measures import Measures, measures
from calibration.matching.methods import methods
from calibration.matching.methods.method import Answer, Asked, Method, Plan
from calibration.matching.sidebands import find_pole
from calibration.matching.tuner import Tuner

__all__ = [
    "Answer",
    "Asked",
    "Asking",
    "Block",
    "Known",
    "Matched",
    "Measures",
    "Method",
    "Plan",
    "Sensed",
    "Tuner",
    "ask",
    "designed_bias",
    "find_pole",
    "known_of",
    "match",
    "measures",
    "methods",
]
