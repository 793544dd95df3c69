"""The shortest run that tells rivals apart: forces and conditions chosen by the separation that they bring.

Candidates of the library are held against each other over a short horizon, then over longer ones, until one decides
within it. The best are then improved, one change at a time, for as long as the work allows; each has to decide sooner
than the best so far, so that trials get shorter as the design gets better. What rivals differ by without a refit
bounds the separation from above: most candidates are left by that alone, which two simulations show.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Final

import numpy as np

from discrepancy.data.record import MINIMUM_SAMPLES, Floats, Record
from discrepancy.tell.changes import changed, simpler
from discrepancy.tell.drives import Drive, Player, Steps
from discrepancy.tell.rivals import Rival, ends_of, followed

FIRST: Final = 2 * MINIMUM_SAMPLES
"""Samples of the first horizon."""
GROWTH: Final = 4
"""Of each horizon over the one before."""
LATER, HOPELESS = 3200, 1e4
"""From a horizon of so many samples on, runs that even without a refit all would have to be repeated so often are not
looked at any longer: what rings up to the limits has done so nearly."""
SPEED: Final = 1.5e6
"""Samples simulated a second of work."""
CALL: Final = 500
"""Samples that could be simulated in the time that it takes to begin a run."""
PATIENCE: Final = 2.0
"""Of the seconds of work, after which the clock ends it."""
TOGETHER: Final = 32
"""Drives that are simulated without a look at the work."""
SCREENED, IMPROVED = 0.6, 0.9
"""Shares of the work after which the library has been looked through, and the best of it improved."""
TRIED: Final = 80
"""Candidates that are refitted over a horizon."""
BEST: Final = 4
"""Designs that are improved, in turns."""
CHANGES: Final = 400
"""Changes that are tried at most."""
BURDEN: Final = 0.1
"""Of the time, that a condition which has to be changed must save at least: a turntable is set up for that."""
SIMPLER: Final = 1.1
"""Times as long as a run may take with something less to play."""
MARGIN: Final = 2.0
"""Times the run that decides, that is to be played: the device and its noise are not quite as thought."""
LEAST: Final = 5 * MINIMUM_SAMPLES
"""Samples of a table at least: the initial state takes 50 of them."""
LONGER: Final = 1.2
"""Of a run that did not decide, over the one before."""
OVERTIME: Final = 1.5
"""Of the work, after which a time is told as it is."""
FAINT: Final = 1e-3
"""Of the separation that is asked: what is below counts as that much."""
KEPT: Final = 0.97
"""Of the voltage's limit, at which a drive that went beyond is played again."""


@dataclass(frozen=True)
class Design:
    """A drive, and how soon it decides. samples: until the separation reaches what was asked, in one run or, where that
    takes longer than a run may, in several; horizon: what the drive is laid out for; scale: of the voltage's limit by
    which it is governed."""

    drive: Drive
    samples: float
    horizon: int
    scale: float = 1.0

    @property
    def price(self) -> float:
        """By which designs are compared: what decides before a record is long enough is as good, and a condition to be
        changed counts as time."""
        return max(self.samples, MINIMUM_SAMPLES) * (1 + BURDEN * len(self.drive.steps))


class Designer:
    """Looks for the shortest run. asked: the separation D to be reached; seconds: of work, after which the best so far
    has to do. Work is counted by samples simulated, so that the same rivals give the same design; where these take
    longer, the clock ends it."""

    def __init__(self, rivals: Sequence[Rival], player: Player, asked: float, seconds: float, seed: int = 0) -> None:
        self.rivals, self.player, self.asked = rivals, player, asked
        self.simulator = rivals[0].simulator
        self.clock = self.simulator.clock
        self.begin, self.seconds, self.work = self.clock.now, seconds, 0.0
        self.rng = np.random.default_rng(seed)

    def over(self, share: float = 1.0) -> bool:
        """Whether a share of the work is done."""
        took = (self.clock.now - self.begin) / PATIENCE
        return max(took, self.work / SPEED) > share * self.seconds or self.clock.late

    def _worked(self, runs: int, samples: int) -> None:
        self.work += runs * (samples + CALL)

    def find(self) -> Design | None:
        """The best design; None where not one drive of the library keeps the limits."""
        best = self._improved(self._screened())
        return None if best is None else self._settled(self._simplified(best))

    def table(self, samples: float) -> int:
        """Samples of the run that is to be played where so many decide."""
        return int(np.clip(np.ceil(MARGIN * samples), LEAST, self.player.room.samples))

    def play(self, design: Design, n: int) -> tuple[Record, Floats]:
        """The run of ``n`` samples of a design, and its separation at the moments of ``ends_of``."""
        _, scale = self._least(design.drive, n, design.horizon, design.scale)
        record = self.player.record(design.drive, n, design.horizon, scale)
        try:
            return record, self.separation(record)
        finally:
            self.simulator.forget([record])

    def separation(self, record: Record) -> Floats:
        """D of the first rival from the others at the moments of ``ends_of``, the least, whichever follows; 0 where the
        FMU refuses. What the others are told from each other by is for the run after that."""
        voltages = [rival.simulated(record) for rival in self.rivals]
        if not all(np.isfinite(v).all() for v in voltages):
            return np.zeros(len(ends_of(len(record.t))))
        self._worked(sum(len(rival.free) + len(rival.states) + 1 for rival in self.rivals), len(record.t))
        least: Floats | None = None
        for number, follower in enumerate(self.rivals):
            columns = follower.columns(record, voltages[number])
            if columns is None or not np.isfinite(columns).all():
                return np.zeros(len(ends_of(len(record.t))))
            for v in voltages[1:] if number == 0 else voltages[:1]:
                own = followed(columns, (v - voltages[number]) / follower.noise)
                least = own if least is None else np.minimum(least, own)
        assert least is not None
        return least

    def samples(self, course: Floats, n: int) -> float:
        """Samples after which a separation's course over a run of ``n`` reaches what is asked; beyond the run as if it
        were repeated."""
        reached = np.flatnonzero(course >= self.asked)
        if not len(reached):
            return n * self.asked / max(float(course[-1]), 1e-12)
        ends, i = ends_of(n), int(reached[0])
        begin, before = (0, 0.0) if i == 0 else (ends[i - 1], float(course[i - 1]))
        # It rises by orders of magnitude where a condition steps: straight in its logarithm.
        low = max(before / self.asked, FAINT)
        return begin + (ends[i] - begin) * float(np.log(low) / np.log(low * self.asked / course[i]))

    def _screened(self) -> list[Design]:
        """The best of the library, over the shortest horizon within which one decides; the first is looked at in full,
        however little work there may be."""
        courses = self.player.courses()
        drives = [replace(d, steps=own) for own in courses for d in self.player.library(whole=not own)]
        most, horizon = self.player.room.samples, min(FIRST, self.player.room.samples)
        found: list[Design] = []
        while True:
            before, found = found, []
            bounds = self._bounds(drives, horizon)
            for bound in bounds[:TRIED]:
                if self.over(SCREENED) and horizon > FIRST:
                    break
                if bound.price < min((other.price for other in found), default=np.inf):
                    found.append(self._evaluated(bound, horizon))
            found.sort(key=lambda own: own.price)
            hopeless = horizon >= LATER and min((own.samples for own in bounds), default=np.inf) > HOPELESS * most
            if self.over(SCREENED) or hopeless or horizon == most or (found and found[0].samples <= horizon):
                return (found or before)[:BEST]
            # Those that did least are left: a longer run is dearer.
            drives = [bound.drive for bound in bounds[: max(TRIED, len(bounds) // 2)]]
            horizon = min(GROWTH * horizon, most)

    def _bounds(self, drives: Sequence[Drive], horizon: int) -> list[Design]:
        """Each drive with the samples that it takes at least, by what the rivals differ by where nothing follows, the
        most promising first, of every course of the conditions in turn: what one follows of another, they all may."""

        def bound(drive: Drive) -> Design:
            least, scale = self._least(drive, horizon, horizon)
            return Design(drive, least, horizon, scale)

        found: list[Design] = []
        for begin in range(0, len(drives), TOGETHER):
            if self.over(SCREENED) and horizon > FIRST:
                break
            some = drives[begin : begin + TOGETHER]
            found += self.simulator.each(bound, some)
            self._worked(len(some) * len(self.rivals), self.table(horizon))
        return _in_turn(sorted(found, key=lambda own: own.price))

    def _least(self, drive: Drive, n: int, horizon: int, scale: float = 1.0) -> tuple[float, float]:
        """Samples of a run of ``n`` at least, infinite where the voltage can't be kept; and the scale that keeps it."""
        limit = np.array(self.player.room.voltage)
        for _ in range(3):
            record = self.player.record(drive, self.table(n), horizon, scale)
            try:
                voltages = [rival.simulated(record) for rival in self.rivals]
            finally:
                self.simulator.forget([record])
            peak = max(float((np.abs(v) / limit).max()) for v in voltages)
            if not np.isfinite(peak):
                return np.inf, scale
            if peak <= 1:
                noise = self.rivals[0].noise
                first, *others = voltages
                errors = [np.cumsum(np.sum((first - v)[:n] ** 2, axis=1)) / noise**2 for v in others]
                course = np.min(errors, axis=0)
                return self.samples(course[np.array(ends_of(n)) - 1], n), scale
            scale *= KEPT / peak
        return np.inf, scale

    def _evaluated(self, design: Design, n: int) -> Design:
        """With what a run of ``n`` samples brings after all rivals have followed."""
        record = self.player.record(design.drive, n, design.horizon, design.scale)
        try:
            return replace(design, samples=self.samples(self.separation(record), n))
        finally:
            self.simulator.forget([record])

    def _improved(self, found: Sequence[Design]) -> Design | None:
        """The best after changes to the best few."""
        designs, size = list(found), 0.3
        for number in range(CHANGES):
            if self.over(IMPROVED) or not designs or min(own.samples for own in designs) <= MINIMUM_SAMPLES:
                break
            turn = number % len(designs)
            now = designs[turn]
            designs[turn] = self._tried(now, *changed(now.drive, now.horizon, self.player, self.rng, size))
            if number % (CHANGES // 4) == CHANGES // 4 - 1:
                # What is far behind is left.
                designs = sorted(designs, key=lambda own: own.price)[: max(1, len(designs) // 2)]
                size /= 2
        return min(designs, key=lambda own: own.price, default=None)

    def _tried(self, design: Design, drive: Drive, horizon: int, room: float = 1.0) -> Design:
        """The ``design``, or another of ``drive`` whose price is below ``room`` times its own."""
        n = int(np.clip(np.ceil(room * design.samples), MINIMUM_SAMPLES, self.player.room.samples))
        least, scale = self._least(drive, n, horizon, design.scale)
        self._worked(len(self.rivals), self.table(n))
        other = Design(drive, least, horizon, scale)
        if other.price >= room * design.price:
            return design
        other = self._evaluated(other, n)
        return other if other.price < room * design.price else design

    def _settled(self, design: Design) -> Design:
        """With the time that one run takes, if one may last so long."""
        most = self.player.room.samples
        n = min(max(MINIMUM_SAMPLES, int(np.ceil(design.samples))), most)
        while not self.over(OVERTIME):
            _, scale = self._least(design.drive, n, design.horizon, design.scale)
            design = self._evaluated(replace(design, scale=scale), n)
            if design.samples <= n or n == most:
                break
            # What rises at a step is told too late by what it was before.
            n = min(int(np.ceil(min(design.samples, LONGER * n))), most)
        return design

    def _simplified(self, design: Design) -> Design:
        """Without what hardly helps."""
        most = SIMPLER * design.price
        for less in simpler(design.drive):
            if self.over():
                break
            design = self._tried(design, less(design.drive), design.horizon, most / design.price)
        return design


def _in_turn(designs: Sequence[Design]) -> list[Design]:
    """Every other one without a change of conditions, the rest one of each course in turn."""
    courses: dict[Steps, list[Design]] = {}
    for own in designs:
        courses.setdefault(own.drive.steps, []).append(own)
    still = courses.pop((), [])
    moved = [own for turn in zip_longest(*courses.values()) for own in turn if own is not None]
    return [own for turn in zip_longest(still, moved) for own in turn if own is not None]
