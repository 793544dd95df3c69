"""Fits that do not end in a wrong minimum: the runs are cut into pieces, whose length grows.

Over a long run a simulation with wrong parameters gets out of step with the motion, and its error has minima at every
turn. Pieces with initial states of their own are too short for that; what they give starts the next longer ones
(multiple shooting: H. G. Bock, in Modelling of Chemical Reaction Systems, Springer 1981; here without conditions of
continuity, which nothing needs in the end, when a piece is a run).
"""

from collections.abc import Mapping
from dataclasses import replace
from math import inf
from typing import Final, NamedTuple

import numpy as np

from discrepancy.clock import OutOfTime
from discrepancy.data.linear_fit import mode_frequencies
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import BLOCKS, Fitter
from discrepancy.fit.sampled import sampled_starts

IN_STEP: Final = 0.02
"""Residual over signal below which a simulation is in step with the motion: an error of phase of 0.02 rad, where what
is linear in it is right to 1e-2."""
ASTRAY: Final = 0.3
"""Residual over signal from which a fit of whole runs may have ended a turn off; below, what is left is what the model
lacks."""
ADDS_UP: Final = 0.1
"""The same of a mass that no spring holds, which can't be a turn off. Without a friction of a fiftieth of the
force a model of carts left 0.03 to 0.07 of whole runs, and it was found; of a fifteenth 0.11 to 0.24."""
SHORTEST: Final = 12.0
"""Periods of the lowest mode in the shortest piece: four states a piece, eight shared parameters."""
FIRST_PERIODS: Final = 2.0
"""Over which a device of any damping is followed by a linear one."""
BRIEF, FINEST = 3.0, 400
"""Periods of a piece, and pieces of all runs, to which they are cut further where no fit to pieces of SHORTEST stays in
step: where the motion goes its own way after the least change, as in chaos, it does so within ten periods, and a weak
form is a tenth and more off."""
ENOUGH: Final = 32
"""Pieces of all runs from which a first model is found."""
STUCK: Final = 10.0
"""Variances that another step promises where a fit has stopped, from which it is in no minimum: a judgement. Those that
a chaotic run held up had 40 to 1,600 left."""
LEAST: Final = 12
"""Samples of a piece that count at least: three a state."""
FEWEST, MOST = 100, 64
"""Samples of a piece, and pieces of a run of few periods: of a mass that hardly any spring holds."""
GROWTH: Final = 4
"""By which pieces grow: a frequency known to 1e-2 rad over one piece is known to 4e-2 over the next."""
FEW, ROUNDS, LAST_ROUNDS = 3, 8, 30
"""Steps before a fit under another filter, at a length that is not the last, and at the last."""
AT_FIRST, FIRST = 0.05, 1e-5
"""Shares of the cost that a first model may leave to further steps, before its filter is chosen and under it. It is to
show what it lacks: a hundredth of ``material`` is no part of that, and what long runs lack is far above their noise."""
SLIP: Final = 2.0
"""By how much more a longer piece may be off than a shorter one and count as in step: a model that lacks something is
off at any length."""

LEAVES: Final = 1.25
"""By how much more a fit may be off under the filter of a noise than without: noise moves parameters by their
deviations, which changes what is left by less than that; a mode that the model lacks, taken for a thermal motion, made
it 2.7 times as much."""


def settled(whole: Fitter, at: Fitted, enough: float = ASTRAY) -> tuple[Fitter, Fitted]:
    """``at`` fitted and whitened: over the whole runs, or, where no such fit stays in step, over the longest pieces
    that do, with the fitter of those pieces. ``at`` may come from pieces or from the whole; enough: residual over
    signal below which a fit of the whole is not questioned. Raises OutOfTime where there was no time for any."""
    # Under the filter of an earlier, larger gap a fit would predict a sample ahead and not care where the motion goes.
    at = replace(at, whiten=whole.plain(at.parameters))
    direct = whitened(whole, whole.fit(started(whole, at)))
    if whole.off(direct) < min(enough, _astray(whole, direct)) and not is_stuck(whole, direct):
        return whole, direct
    best = whole, direct
    now: Fitted | None = None
    lengths, lost = [_Length(number) for number in _numbers(whole, at)], False
    while lengths:
        number, counted = lengths.pop()
        fitter = cut(whole, number, counted)
        before = now
        try:
            now = fitter.fit(started(fitter, before or at), _rounds(number))
            # Of pieces that are not in step the innovations are for scores only: a fit to them would predict a sample
            # ahead.
            now = fitter.whitened(now) if number > 1 and fitter.off(now) > IN_STEP else whitened(fitter, now)
        except OutOfTime:
            break
        shorter = _shorter(whole, at, number) if before is None and not lost and fitter.off(now) > ASTRAY else []
        if shorter:
            lengths, lost, now = [*lengths, _Length(number), *shorter], True, None
            continue
        if before is None or fitter.off(now) < max(IN_STEP, SLIP * best[0].off(best[1])):
            best = fitter, now
        else:
            break
    if best[0] is whole or whole.off(direct) < max(IN_STEP, SLIP * best[0].off(best[1])):
        # In step as it was; the better of two minima.
        ends = [direct, *([now] if best[0] is whole and now is not None else [])]
        return whole, min(ends, key=lambda end: end.variance)
    return best


def is_stuck(fitter: Fitter, at: Fitted) -> bool:
    """Whether a fit has stopped out of step, in no minimum."""
    return at.left > STUCK and fitter.off(at) > IN_STEP


def roughly_settled(whole: Fitter, at: Fitted) -> tuple[Fitter, Fitted]:
    """As ``settled``, for a first model of long runs: no further than what it lacks is seen by, where whole runs stay
    in step."""
    begun = started(whole, replace(at, whiten=whole.plain(at.parameters)))
    direct = whitened(whole, whole.fit(begun, share=AT_FIRST), share=FIRST)
    return (whole, direct) if whole.off(direct) < _astray(whole, direct) else settled(whole, at)


def nearly_settled(whole: Fitter, at: Fitted) -> tuple[Fitter, Fitted]:
    """As ``settled``, but near the minimum only, where whole runs stay in step."""
    direct = whole.fit(whole.whitened(started(whole, at)), FEW)
    return (whole, direct) if whole.off(direct) < _astray(whole, direct) else settled(whole, at)


def started(fitter: Fitter, at: Fitted) -> Fitted:
    """``at`` on the runs of ``fitter``; where these are others, with initial states fitted to them first."""
    if [len(residual) for residual in at.residuals] == [len(record.t) for record in fitter.records]:
        return fitter.evaluated(at)
    return replace(with_starts(fitter, at, FEW), free=at.free, grams=None, fill=(), left=inf)


def with_starts(fitter: Fitter, at: Fitted, rounds: int) -> Fitted:
    """The parameters of ``at``, held, with initial states fitted to the runs of ``fitter``: from rest, or, where that
    ends astray, from what the samples show, or from how a linear device sets out and to beginnings that grow: a
    frequency that depends on the amplitude is far off at rest, and a friction lets nothing go there."""
    rest = fitter.evaluated(
        replace(at, starts=fitter.starts(at.parameters), free=(), whiten=fitter.plain(at.parameters))
    )
    if not fitter.signal:
        # What shows no motion at all is at rest.
        return rest
    found = fitter.fit(rest, rounds)
    if max(_each_off(fitter, found)) >= ASTRAY:
        found = _from_samples(fitter, found, rounds)
    if fitter.off(found) < ASTRAY:
        return found
    now = replace(rest, starts=_set_out(fitter, rest, rounds))
    for number in reversed(_numbers(fitter, at)):
        part = beginnings(fitter, number) if number > 1 else fitter
        now = part.fit(part.evaluated(now), rounds)
        fitter.simulator.forget(part.records if number > 1 else ())
    return min((found, now), key=lambda end: end.cost)


def _from_samples(fitter: Fitter, at: Fitted, rounds: int) -> Fitted:
    """``at``, or with initial states fitted from those that the samples show to ever more samples, run by run."""
    period, known, simulator = _period(fitter, at), fitter.starts(at.parameters), fitter.simulator
    shown = [sampled_starts(*simulator.place_of(r), period, at.parameters) for r in fitter.records]
    if not any(shown):
        return at
    other: Fitted | None = None
    for counted in (*_first_samples(period, min(len(r.t) for r in fitter.records)), None):
        records = [simulator.part(r, 0, len(r.t), counted) for r in fitter.records]
        if not any(r.valid.any() for r in records):
            continue
        part = Fitter(simulator, records, fitter.blocks, fitter.criteria)
        for number in range(max(map(len, shown)) if other is None else 0):
            # What a run shows less of than another, it shows again.
            new = (some[number % len(some)] if some else {} for some in shown)
            starts = tuple({**own, **other} for own, other in zip(known, new, strict=True))
            tried = part.evaluated(replace(at, starts=starts, whiten=part.plain(at.parameters)))
            other = tried if other is None else _better(part, tried, other)
        assert other is not None
        other = part.fit(part.evaluated(other), rounds)
        simulator.forget(records)
    assert other is not None
    return _better(fitter, fitter.evaluated(other), at) if np.isfinite(other.cost) else at


def _better(fitter: Fitter, one: Fitted, other: Fitted) -> Fitted:
    """Of two fits that differ by their initial states, those of each run that leave less of it."""
    ends = zip(one.starts, other.starts, _each_off(fitter, one), _each_off(fitter, other), strict=True)
    return fitter.evaluated(replace(other, starts=tuple(a if near < far else b for a, b, near, far in ends)))


def _each_off(fitter: Fitter, at: Fitted) -> list[float]:
    """Of each run the residual over the signal of all, rms."""
    pairs = zip(at.residuals, fitter.records, strict=True)
    # One that has left all bounds is off by more than any.
    with np.errstate(over="ignore"):
        return [float(np.sqrt(np.sum(e[r.valid] ** 2) / max(e[r.valid].size, 1))) / fitter.signal for e, r in pairs]


def _set_out(fitter: Fitter, at: Fitted, rounds: int) -> tuple[Mapping[str, float], ...]:
    """The initial states with which a linear device follows the first periods of each run."""
    own = {q.name for effect in fitter.simulator.model.effects for q in effect.sizes}
    linear = {name: value for name, value in at.parameters.items() if name not in own}
    length = max(FIRST_PERIODS * _period(fitter, at), FEWEST)
    part = beginnings(fitter, max(int(min(len(r.t) for r in fitter.records) / length), 1))
    found = part.fit(part.evaluated(replace(at, parameters=linear, starts=part.starts(linear))), rounds)
    fitter.simulator.forget(part.records)
    return found.starts


def grown(whole: Fitter, at: Fitted) -> Fitted:
    """``at`` over the beginnings of the runs, which grow, and near a fit of the whole: for a resonance with states of
    its own, which no later piece has free. It is found however far the coupling pulls it, since over a few periods it
    is broad."""
    now = at
    for number in reversed(_numbers(whole, at)):
        fitter = beginnings(whole, number) if number > 1 else whole
        begun = started(fitter, replace(now, whiten=fitter.plain(now.parameters)))
        now = fitter.fit(begun, ROUNDS if number > 1 else FEW)
        whole.simulator.forget(fitter.records if number > 1 else ())
    return whole.evaluated(replace(now, whiten=at.whiten))


def whitened(fitter: Fitter, at: Fitted, share: float = 0.0) -> Fitted:
    """``at`` fitted under the whitening that its own residuals ask for, to a ``share`` of the cost. Where that fit
    leaves the motion, since it predicts a sample ahead what the model lacks, ``at`` as it was, whitened for scores
    only."""
    for _ in range(3):
        setting = at.whiten.setting
        again = fitter.whitened(at)
        if setting.like(again.whiten.setting):
            break
        fitted = fitter.fit(again, share=share)
        if leaves(fitter, fitted, at, IN_STEP):
            return again
        at = fitted
    return at


def leaves(fitter: Fitter, at: Fitted, before: Fitted, enough: float = ASTRAY) -> bool:
    """Whether ``at``, a fit that may predict a sample ahead, has left the motion that ``before`` was nearer to.
    ``enough``: residual over signal up to which a model of many periods has not."""
    if unsprung(fitter, before):
        # What a free mass is off by has added up over the run: however little of the way it went that is, it counts.
        enough = 0.0
    elif _hardly_held(fitter, before):
        enough = min(enough, IN_STEP)
    return fitter.off(at) > max(enough, LEAVES * fitter.off(before))


def shortest(whole: Fitter, at: Fitted) -> tuple[int, Fitter]:
    """Into how many pieces runs are cut at most, and a fitter of these."""
    number = _numbers(whole, at)[-1]
    return number, cut(whole, number)


class _Length(NamedTuple):
    """Of pieces: into how many a run is cut, and how many samples of each count, all where None."""

    number: int
    counted: int | None = None


def finest(whole: Fitter, at: Fitted) -> int:
    """Into how many pieces runs are cut where no longer ones stay in step."""
    length = min(len(record.t) for record in whole.records)
    pieces = int(length / max(BRIEF * _period(whole, at), FEWEST))
    return max(min(pieces, FINEST // len(whole.records)), 1)


def _finer(whole: Fitter, at: Fitted) -> list[_Length]:
    """Those pieces, and before them ever fewer of their first samples: a record has a least length."""
    number = finest(whole, at)
    counted = _first_samples(_period(whole, at), min(len(record.t) for record in whole.records) // number)
    return [_Length(number), *(_Length(number, samples) for samples in reversed(counted))]


def _shorter(whole: Fitter, at: Fitted, number: int) -> list[_Length]:
    """The same, where they are shorter than those of so many."""
    found = _finer(whole, at)
    return found if len(found) > 1 or found[0].number > number else []


def in_pieces(whole: Fitter, at: Fitted) -> tuple[Fitter, Fitted]:
    """``at`` fitted to some of those pieces, the first of each run among them, with their fitter."""
    fitter, now = whole, at
    every = max(finest(whole, at) * len(whole.records) // ENOUGH, 1)
    for length in reversed(_finer(whole, at)):
        fitter = cut(whole, *length, every)
        now = fitter.fit(started(fitter, now), ROUNDS)
    return fitter, now


def _first_samples(period: float, length: int) -> list[int]:
    """How many of the first samples of pieces of some ``length`` count before all do, fewest first."""
    return [n for n in (max(int(share * BRIEF * period), LEAST) for share in (0.5, 1.0)) if n < length]


def cut(whole: Fitter, number: int, counted: int | None = None, every: int = 1) -> Fitter:
    """A fitter of the runs of ``whole``, each in ``number`` pieces, of which the first ``counted`` samples count; of
    these one in ``every`` so many."""
    if number == 1 and counted is None:
        return whole
    pieces = [piece for record in whole.records for piece in whole.simulator.cut(record, number, counted)[::every]]
    return Fitter(whole.simulator, pieces, max(1, BLOCKS // number), whole.criteria)


def beginnings(whole: Fitter, number: int) -> Fitter:
    """A fitter of the first of ``number`` pieces of each run: where every state begins as in the whole."""
    records = [whole.simulator.part(r, 0, len(r.t) // number) for r in whole.records]
    return Fitter(whole.simulator, records, max(1, BLOCKS // number), whole.criteria)


def _numbers(whole: Fitter, at: Fitted) -> list[int]:
    """Into how many pieces the runs are cut, fewest first."""
    length = min(len(record.t) for record in whole.records)
    least = length / MOST if _hardly_held(whole, at) else SHORTEST * _period(whole, at)
    most = max(int(length / max(least, FEWEST)), 1)
    return sorted({max(most // GROWTH**i, 1) for i in range(12)})


def _period(whole: Fitter, at: Fitted) -> float:
    """Samples in a period of the lowest mode; of a device that no spring brings back there is none."""
    lowest = float(mode_frequencies(at.parameters, whole.axes)[0])
    return whole.records[0].sample_rate / lowest if lowest else inf


def _hardly_held(whole: Fitter, at: Fitted) -> bool:
    """Whether runs have so few periods that what a model lacks adds up over them."""
    return min(len(record.t) for record in whole.records) < GROWTH * SHORTEST * _period(whole, at)


def unsprung(whole: Fitter, at: Fitted) -> bool:
    """Whether no run is as long as a period: the mass goes where forces push it, and none holds it."""
    return max(len(record.t) for record in whole.records) < _period(whole, at)


def _astray(whole: Fitter, at: Fitted) -> float:
    """Residual over signal from which a fit of whole runs is questioned."""
    if unsprung(whole, at):
        return ADDS_UP
    return IN_STEP if _hardly_held(whole, at) else ASTRAY


def _rounds(number: int) -> int:
    """How many steps a fit to so many pieces may take."""
    return ROUNDS if number > 1 else LAST_ROUNDS
