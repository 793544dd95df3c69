"""How the force ran between samples, by a model that has what bends the response.

The response alone shows it of what is nearly linear (``data/hold.py``). A strong effect hides half a sample: the loss
of a hysteresis is a phase too. Once the effect is in the model, what is left is that half, to which no other effect
gives a name.
"""

from dataclasses import replace

from discrepancy.data.hold import DECISIVE, RUNS_ON
from discrepancy.data.record import is_driven
from discrepancy.fit.continuation import FEW, beginnings
from discrepancy.fit.defect import Distortion
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.openings import parts
from discrepancy.fit.refit import Fitter
from discrepancy.name.columns import on_the_way
from discrepancy.name.exchange import delete
from discrepancy.name.search import Search
from gyro_model.anatomy import Delay, Lag


def let_run_on(search: Search) -> Search:
    """With a force that ran on between samples where nobody has said that it was held, and the present model then
    leaves plainly less, of the shortest openings and of whole runs, without a delay or a filter."""
    data = search.dataset
    told = data.hold_stated or not is_driven(data.fit) or data.hold != "zero"
    if told or search.fitter is not search.whole:
        return search
    other = Fitter(search.simulator, data.held(RUNS_ON).fit, criteria=search.criteria)
    if not _plainly_less(search.whole, other, search.at):
        return search
    run_on = search.held(RUNS_ON).fitted(search.at)
    if run_on.fitter.off(run_on.at) ** 2 * DECISIVE >= search.fitter.off(search.at) ** 2:
        return search
    # What has made up for half a sample is needless. What is late still may be so by half a sample more, or not.
    found = delete(run_on, on_the_way)
    if any(isinstance(entry.candidate.effect, Delay | Lag | Distortion) for entry in found.accepted):
        return search
    search.progress("the force ran on between samples")
    return found


def _plainly_less(held: Fitter, other: Fitter, at: Fitted) -> bool:
    """Whether ``at``, a fit of ``held``, leaves so much less of the openings, fitted to those of ``other``: than it
    leaves there, and than it does where it is fitted to them as well."""
    number = parts(held.records)[0]
    openings = [beginnings(fitter, number) if number > 1 else fitter for fitter in (held, other)]
    begun = [own.evaluated(replace(at, whiten=own.plain(at.parameters))) for own in openings]

    def fitted(which: int) -> float:
        return openings[which].off(openings[which].fit(begun[which], FEW)) ** 2

    limit = fitted(1) * DECISIVE
    less = limit < openings[0].off(begun[0]) ** 2 and (number == 1 or limit < fitted(0))
    for own in (*(openings if number > 1 else ()), other):
        held.simulator.forget(own.records)
    return less
