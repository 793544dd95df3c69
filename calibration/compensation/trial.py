"""A compensation fitted on some cycles and tested on one that nothing of it has seen."""

from dataclasses import replace
from typing import Final, NamedTuple

from calibration.compensation.choose import Choice, candidates, choose, inputs_of_all
from calibration.compensation.cycles import MEMORY, by_cycle, count, covered, last_cycle, memory_of
from calibration.compensation.derived import derived
from calibration.compensation.floors import Floors, floors
from calibration.compensation.measures import Result, judge
from calibration.compensation.methods.method import Asked
from calibration.compensation.model import Compensation
from calibration.compensation.points import bias_points
from calibration.compensation.record import Blocks, joined
from calibration.compensation.residual import Cause, name_residual
from gyro_model.progress import Progress

UNTESTED: Final = "Another cycle is untested"


class Judged(NamedTuple):
    """A method with what it leaves of the fitted and of the held-out blocks; score: rms of residual over noise by
    inner validation."""

    compensation: Compensation
    score: float
    fitted: Result
    held_out: Result


class Trial(NamedTuple):
    """judged: the methods, best by inner validation first; tested: the blocks held out; hold_out: a sentence on them;
    untested: no whole cycle was held out; choice: all that was tried; floors: what nothing can remove; residual: what
    the first method's is made of."""

    judged: list[Judged]
    tested: Blocks
    hold_out: str
    untested: bool
    choice: Choice
    floors: Floors
    residual: list[Cause]

    @property
    def chosen(self) -> Compensation:
        """The compensation that is written."""
        return self.judged[0].compensation


def trial(blocks: Blocks, test: Blocks | None, asked: Asked, outside: str, progress: Progress | None = None) -> Trial:
    """Fits what is asked for and judges it on ``test``; without one on the last cycle, and where there is only one on
    contiguous parts of it. progress: as of ``choose``. Raises InputError where nothing can be fitted, and as ``judge``
    does."""
    among = candidates(blocks, asked)
    names = inputs_of_all(among)
    blocks = blocks.with_inputs(names)
    fitted, tested, text, untested = _held_out(blocks, None if test is None else test.with_inputs(names))
    if untested:
        # Parts of one cycle reach a little beyond the rest of it; what is clamped is counted.
        outside = "clamp"
    choice = choose(fitted, asked, among, progress)
    judged = []
    for candidate in choice.best:
        compensation = candidate.fit(fitted)
        results = judge(fitted, compensation, "clamp"), judge(tested, compensation, outside)
        judged.append(Judged(compensation, candidate.held_out, *results))
    whole = blocks if test is None else joined([blocks, test.with_inputs(names)])
    chosen = judged[0].compensation
    applied = chosen.at(whole, "clamp")
    left = bias_points(whole, applied.scale).value - applied.bias[whole.at_rest]
    causes = name_residual(whole, chosen, left)
    compensated = replace(whole, rate=whole.rate / applied.scale - applied.bias)
    remembers = any(derived(i.name).kind for i in chosen.inputs)
    least = floors(by_cycle(whole), by_cycle(compensated), remembers=remembers)
    return Trial(judged, tested, text, untested, choice, least, causes)


def _held_out(blocks: Blocks, test: Blocks | None) -> tuple[Blocks, Blocks, str, bool]:
    """What is fitted, what is tested, a sentence on it, and whether another cycle is untested."""
    cycles = count(blocks)
    if test is not None:
        return blocks, test, f"Fitted on {_cycles(cycles)}, tested on {_cycles(count(test))} of {test.name}.", False
    memory = memory_of(blocks)
    held = last_cycle(blocks, MEMORY * memory)
    if held.whole:
        text = f"Fitted on {_cycles(cycles - 1)}, tested on the last, which nothing of the fit has seen."
        return blocks.part(held.fitted), blocks.part(held.left_out), text, False
    tested = blocks.part(covered(blocks, held))
    gaps = len(blocks) - int(held.fitted.sum() + held.left_out.sum())
    text = (
        f"{UNTESTED}: the record holds one. Held out are contiguous parts of it, {gaps} blocks of gaps beside them "
        f"(what a smooth curve leaves goes on for {memory:.3g} s). Turn-on, walk and hysteresis of another cycle are "
        "in none of the numbers: record two or more cycles, or give --test."
    )
    return blocks.part(held.fitted), tested, text, True


def _cycles(number: int) -> str:
    return "one cycle" if number == 1 else f"{number} cycles"
