"""The time that a diagnosis takes, as on a machine that does nothing else.

Counted by processor time, which no load of the machine changes: what one thread did counts in full, what ``threads``
of them did side by side counts by their number. So the same data come to the same end wherever they are diagnosed.
"""

from collections.abc import Callable
from functools import wraps
from math import inf
from threading import Lock
from time import process_time, thread_time
from typing import ParamSpec, TypeVar

Given = ParamSpec("Given")
Result = TypeVar("Result")


class OutOfTime(Exception):
    """The time that the present part of a diagnosis may take is over."""


class Clock:
    """Seconds since it was made; ``until``: when the present part is over."""

    def __init__(self, threads: int = 1) -> None:
        self.threads, self.until = threads, inf
        self._begin, self._side_by_side, self._lock = process_time(), 0.0, Lock()

    @property
    def now(self) -> float:
        """Seconds of work so far."""
        return process_time() - self._begin - self._side_by_side * (1 - 1 / self.threads)

    @property
    def late(self) -> bool:
        """Whether the present part is over."""
        return self.now > self.until

    def check(self) -> None:
        """Raises OutOfTime where the present part is over."""
        if self.late:
            raise OutOfTime

    def shared(self, work: Callable[Given, Result]) -> Callable[Given, Result]:
        """``work`` for a thread beside others."""

        @wraps(work)
        def counted(*args: Given.args, **named: Given.kwargs) -> Result:
            begun = thread_time()
            try:
                return work(*args, **named)
            finally:
                with self._lock:
                    self._side_by_side += thread_time() - begun

        return counted
