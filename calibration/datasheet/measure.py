"""Runs the tests of a datasheet, one after the other."""

from collections.abc import Callable
from math import exp
from typing import Any, Final, NamedTuple

from calibration.datasheet.figure import Outcome
from calibration.datasheet.kept import KeptTests, key_of
from calibration.datasheet.procedure import Procedure, procedures
from gyro_model.errors import InputError
from gyro_model.progress import Progress

TYPICAL: Final = 100.0
"""Simulated seconds after which a test is told to be two thirds done: it does not say before how long it takes."""


class Test(NamedTuple):
    """A procedure that was run, by name, and what it gave."""

    id: str
    procedure: Procedure
    outcome: Outcome


def measure(
    make_bench: Callable[[Callable[[float], None]], Any],
    mode: str,
    progress: Progress | None,
    kept: KeptTests | None = None,
) -> list[Test]:
    """All tests of a ``mode`` on the bench that ``make_bench`` gives; it is handed what to call with the simulated time
    of each record [s]. Tests that ``kept`` holds are not done again."""
    chosen = procedures(mode)
    total = sum(procedure.share for procedure in chosen.values())
    done = within = 0.0
    share = 1.0

    def advance(seconds: float) -> None:
        nonlocal within
        within += seconds
        if progress is not None:
            progress(done + share * (1 - exp(-within / (TYPICAL * share))), total)

    bench = make_bench(advance)
    if kept is not None:
        kept.begin(key_of(bench, mode))
    found: list[Test] = []
    failed: InputError | None = None
    for name, procedure in chosen.items():
        within, share = 0.0, procedure.share
        try:
            outcome = _done(name, procedure, bench, kept)
        except InputError as error:
            # One test that this device does not stand is a line of its datasheet, not the end of it.
            outcome, failed = Outcome(reason=str(error)), failed or error
        found.append(Test(name, procedure, outcome))
        done += procedure.share
    if failed is not None and not any(test.outcome.figures for test in found):
        raise failed
    return found


def _done(name: str, procedure: Procedure, bench: Any, kept: KeptTests | None) -> Outcome:
    if kept is None:
        return procedure.measure(bench)
    outcome = kept.found(name)
    if outcome is None:
        outcome = procedure.measure(bench)
        kept.keep(name, outcome)
    return outcome
