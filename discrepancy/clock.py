"""The time that a diagnosis takes, as on a machine that does nothing else.

Counted by processor time, which no load of the machine changes: what one thread did counts in full, what several did
side by side as if each had a core of its own. So the same data come to the same end wherever they are diagnosed.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from threading import Lock, local
from time import process_time, thread_time
from typing import NamedTuple, TypeVar

Given = TypeVar("Given")
Result = TypeVar("Result")


class Spent(NamedTuple):
    """Of some work [s]: how long it takes, how long its parts take one after another, and what of these is not
    counted."""

    passed: float
    worked: float
    spared: float


class OutOfTime(Exception):
    """The time that the present part of a diagnosis may take is over."""


class Clock:
    """Seconds since it was made; ``until``: when the present part is over."""

    def __init__(self, threads: int = 1) -> None:
        self.threads, self.until = threads, inf
        self._begin, self._side_by_side, self._lock = process_time(), 0.0, Lock()
        self._own = local()

    @property
    def now(self) -> float:
        """Seconds of work so far."""
        return process_time() - self._begin - self._side_by_side

    @property
    def late(self) -> bool:
        """Whether the present part is over."""
        return self.now > self.until

    def check(self) -> None:
        """Raises OutOfTime where the present part is over."""
        if self.late:
            raise OutOfTime

    @contextmanager
    def unhurried(self) -> Iterator[None]:
        """Something short, without which all that came before would be in vain, whenever the present part is over."""
        until, self.until = self.until, inf
        try:
            yield
        finally:
            self.until = until

    @contextmanager
    def side_by_side(self) -> Iterator["Batch"]:
        """Parts of some work, which threads do beside each other; a part may do so itself."""
        batch = Batch(self)
        try:
            yield batch
        finally:
            done = batch.done
            self.spare(done.worked - done.passed - done.spared)
            within = self.within
            if within is not None:
                within.append(done._replace(spared=done.worked - done.passed))

    @property
    def within(self) -> list[Spent] | None:
        """What was done side by side within the part that this thread does; None where it does none."""
        return getattr(self._own, "within", None)

    @within.setter
    def within(self, parts: list[Spent] | None) -> None:
        self._own.within = parts

    def spare(self, seconds: float) -> None:
        """Takes back so much of what is counted."""
        with self._lock:
            self._side_by_side += seconds


class Batch:
    """Parts of work that are done side by side."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._parts = clock, list[Spent]()

    @property
    def done(self) -> Spent:
        """By all so far."""
        passed, worked, spared = (list(own) for own in zip(*self._parts, strict=True)) if self._parts else ([], [], [])
        # No longer than by threads that never wait, nor shorter than the longest part.
        return Spent(max(*passed, sum(worked) / self._clock.threads, 0.0), sum(worked), sum(spared))

    def part(self, work: Callable[[Given], Result]) -> Callable[[Given], Result]:
        """``work`` for a thread beside others. While it goes on it is taken for one of as many as there are threads."""

        def counted(given: Given) -> Result:
            clock, begun, within = self._clock, thread_time(), list[Spent]()
            clock.within = within
            try:
                return work(given)
            finally:
                own, clock.within = thread_time() - begun, None
                spared = own * (1 - 1 / clock.threads)
                clock.spare(spared)
                self._parts.append(Spent(*map(sum, zip((own, own, spared), *within, strict=True))))

        return counted
