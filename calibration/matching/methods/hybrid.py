"""Hybrid: passive until a hump is found, then active: the dither and the closed loop begin near the match."""

from typing import Final

from calibration.matching.known import Known, Sensed
from calibration.matching.methods import active, passive
from calibration.matching.methods.method import Answer, Asked, Estimator, Method, Plan


class Hybrid:
    """The estimator."""

    def __init__(self, known: Known, asked: Asked) -> None:
        self._passive = passive.Hump(known, asked._replace(block=None))
        self._active = active.Sidebands(known, asked)
        self._found = False

    def plan(self) -> Plan:
        """A passive block until one has shown the hump."""
        return self._active.plan() if self._found else self._passive.plan()

    def measure(self, sensed: Sensed, expected: tuple[float, float]) -> Answer | None:
        """As the method whose turn it is."""
        if self._found:
            return self._active.measure(sensed, expected)
        answer = self._passive.measure(sensed, expected)
        self._found = answer is not None
        return answer


def _start(known: Known, asked: Asked) -> Estimator:
    return Hybrid(known, asked)


METHOD: Final = Method("hybrid", "passive start in the open loop, active hold in the closed one", True, _start)
