"""Mode matching: the bias voltage tuned until the sense mode is at the drive frequency (docs/theory/matching.md)."""

from calibration.matching.holding import Block, Matched, match
from calibration.matching.known import Known, known_of
from calibration.matching.methods import methods
from calibration.matching.methods.method import Method
from calibration.matching.tuner import Tuner

__all__ = ["Block", "Known", "Matched", "Method", "Tuner", "known_of", "match", "methods"]
