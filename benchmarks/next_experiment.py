"""How much sooner a designed experiment tells two effects apart than the best of a menu of eight fixed ones.

Pairs are drawn by seed until 50 are found that their runs leave undecided (``inseparable_pairs``) and that a designed
run or one of the menu decides within ten minutes of record. Both keep the same largest force, twice that measured, and
may change the same conditions as far; the design keeps twice the largest voltage measured besides, the menu need not.
A time of the menu is that after which its record decides, or, where it ends before, as often repeated; and a second
time is that of the best of its experiments made shorter. No run is shorter than 100 samples.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.experiment_menu import menu
from benchmarks.inseparable_pairs import NOISE, RATE, Pair, draw_numbered, measured
from benchmarks.report import Options, Report, Row, Table, load, row, spread
from discrepancy.data.record import MINIMUM_SAMPLES, Record
from discrepancy.fit.defect import quantity_of
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.tell.design import Design, Designer
from discrepancy.tell.experiment import SECONDS, SURE, designer_of, odds_of
from discrepancy.tell.limits import Limits
from discrepancy.tell.rivals import Rival
from gyro_model.model import load_model

PAIRS: Final = 50
DECIDED: Final = 600 * RATE
"""Samples within which a pair counts: what takes longer by both says nothing of either."""
HOPELESS: Final = 10.0
"""Times that, of a design: the menu is not asked then, which in no pair did so much better."""
SHORTER: Final = 0.7
"""Of an experiment of the menu over the next longer one."""
SHARE: Final = 0.2
"""Of the menu's time that a design may take."""
CARRIED: Final = 8
"""Pairs whose experiment is carried out, with noise."""
DRAWS: Final = 20
"""Times each."""


@dataclass(frozen=True)
class Outcome:
    """Samples until 95 %: of the design, of the best of the menu (its name), and of the best that is made shorter."""

    pair: Pair
    design: float
    menu: float
    shortened: float
    name: str
    right: tuple[int, int] = (0, 0)
    expected: float = math.nan


def run(options: Options) -> Report:
    """Measures all pairs."""
    with threadpool_limits(1, "blas"), Simulator(load_model(), jobs=1) as simulator:
        found, drawn, open_ = _outcomes(simulator, options.seeds_or(PAIRS))
    return _report(found, drawn, open_)


def _outcomes(simulator: Simulator, count: int) -> tuple[list[Outcome], int, int]:
    """Outcomes, how many pairs were drawn, and how many nothing decides."""
    found: list[Outcome] = []
    number = undecided = 0
    while len(found) < count:
        pair = draw_numbered(simulator, number)
        number += 1
        if pair is None:
            continue
        outcome = measure(simulator, pair, carry=len(found) % (PAIRS // CARRIED) == 0)
        if outcome is None:
            undecided += 1
            continue
        found.append(outcome)
        print(_line(number, outcome), flush=True)
    return found, number, undecided


def measure(simulator: Simulator, pair: Pair, *, carry: bool = False) -> Outcome | None:
    """The times of a pair; None where neither decides; ``carry``: the design carried out under noise."""
    rivals = [Rival(simulator, pair.records, name, values, NOISE) for name, values in pair.fitted.items()]
    designer = designer_of(rivals, pair.records, Limits(), SECONDS)
    design = designer.find()
    if design is None or design.samples > HOPELESS * DECIDED:
        return None
    times = _menu_times(designer, pair.records)
    name = min(times, key=lambda own: times[own])
    designed, best = (max(samples, MINIMUM_SAMPLES) for samples in (design.samples, times[name]))
    if min(designed, best) > DECIDED:
        return None
    outcome = Outcome(pair, designed, best, _shortened(designer, pair.records, best), name)
    if carry and MINIMUM_SAMPLES <= design.samples <= designer.player.room.samples:
        return _carried(outcome, designer, design)
    return outcome


def _menu_times(designer: Designer, records: Sequence[Record]) -> dict[str, float]:
    """Samples that each experiment of the menu takes."""
    times = {}
    for proposal in menu(records, designer.rivals[0].values):
        n = len(proposal.record.t)
        times[proposal.name] = designer.samples(designer.separation(proposal.record), n)
        designer.simulator.forget([proposal.record])
    return times


def _shortened(designer: Designer, records: Sequence[Record], best: float) -> float:
    """Samples of the best of the menu where each may be made shorter."""
    n = int(SHORTER * len(records[0].t))
    while n >= MINIMUM_SAMPLES:
        now = min(_menu_times(designer, [_cut(r, n) for r in records]).values())
        if now > n:
            break
        best, n = min(best, max(now, MINIMUM_SAMPLES)), int(SHORTER * n)
    return best


def _cut(record: Record, n: int) -> Record:
    held = {name: values[:n] for name, values in record.conditions.items()}
    return replace(record, t=record.t[:n], u=record.u[:n], v=record.v[:n], conditions=held, valid=record.valid[:n])


def _carried(outcome: Outcome, designer: Designer, design: Design) -> Outcome:
    """How often the right effect fits better to the runs and the experiment, all with noise of their own."""
    n = math.ceil(design.samples)
    record, course = designer.play(design, n)
    rng, right, done = np.random.default_rng(n), 0, 0
    for draw in range(DRAWS):
        truth = designer.rivals[draw % 2]
        runs = [measured(designer.simulator, r, truth.values, rng) for r in (*outcome.pair.records, record)]
        whole = [r for r in runs if r is not None]
        cost = {rival.name: _cost(designer.simulator, whole, rival) for rival in designer.rivals}
        right += min(cost, key=lambda name: cost[name]) == truth.name
        done += 1
        designer.simulator.forget(whole)
    odds = odds_of(float(course[-1]))
    return replace(outcome, right=(right, done), expected=odds / (1 + odds))


def _cost(simulator: Simulator, records: Sequence[Record], rival: Rival) -> float:
    """Sum of squares that is left where the rival is refitted to all runs by full simulation."""
    fitter = Fitter(simulator, records)
    known = [quantity_of(simulator.model, own.name) for own in rival.free]
    free = tuple(Free(q.name, own.step, q.low, q.high) for q, own in zip(known, rival.free, strict=True))
    at = Fitted(rival.values, fitter.starts(rival.values), free, fitter.plain(rival.values), ())
    return fitter.fit(fitter.evaluated(at), rounds=6).cost


def _line(number: int, own: Outcome) -> str:
    carried = f", right {own.right[0]} of {own.right[1]} ({own.expected:.3f} expected)" if own.right[1] else ""
    return (
        f"{number}: {own.pair.names[0]} or {own.pair.names[1]}: {1e3 * own.design / RATE:.3g} ms, {own.name} "
        f"{1e3 * own.menu / RATE:.4g} ms, shortened {1e3 * own.shortened / RATE:.4g} ms, "
        f"ratio {own.design / own.menu:.3g}, {own.design / own.shortened:.3g}{carried}"
    )


def _report(found: Sequence[Outcome], drawn: int, undecided: int) -> Report:
    ratio, short = ([o.design / o.menu for o in found], [o.design / o.shortened for o in found])
    right, done = (sum(o.right[i] for o in found) for i in (0, 1))
    expected = [o.expected for o in found if o.right[1]]
    rows = [
        row("time of the design over that of the best of the menu", "", spread(ratio), limit=SHARE),
        row("the same, where the menu may be made shorter", "", spread(short), limit=SHARE),
        row("time of the design", "ms", spread([1e3 * o.design / RATE for o in found])),
        row("time of the best of the menu", "ms", spread([1e3 * o.menu / RATE for o in found])),
    ]
    shares = [
        _share("pairs told apart in a fifth of the menu's time", ratio),
        _share("pairs told apart in a fifth of the shortened menu's time", short),
        Row(f"right effect fits better, {done} experiments carried out", "", {"share": right / done if done else None},
            limit=None, note=f"{np.mean(expected):.3f} predicted" if expected else ""),
    ]  # fmt: skip
    notes = [
        f"{len(found)} pairs of {drawn} drawn; {undecided} besides that nothing decides within {DECIDED / RATE:g} s.",
        f"Told apart: the right effect fits better with {SURE:.0%}. {SECONDS:g} s of work for a design.",
        load(),
    ]
    tables = [Table("Time to tell two effects apart", rows), Table("How many", shares), _by_pair(found)]
    return Report("next_experiment", "The next experiment, designed", tables, notes, {"pairs": list(_data(found))})


def _share(what: str, ratios: Sequence[float]) -> Row:
    return Row(what, "", {"share": sum(r <= SHARE for r in ratios) / len(ratios)}, limit=1.0, at_least=True)


def _by_pair(found: Sequence[Outcome]) -> Table:
    """Median and worst ratio of each kind of pair."""
    kinds: dict[str, list[Outcome]] = {}
    for own in found:
        kinds.setdefault(" or ".join(sorted(own.pair.names)), []).append(own)
    rows = [
        row(kind, "", {"pairs": len(own), "median": float(np.median([o.design / o.menu for o in own])),
                       "worst": max(o.design / o.menu for o in own),
                       "worst, shortened": max(o.design / o.shortened for o in own)})
        for kind, own in sorted(kinds.items())
    ]  # fmt: skip
    return Table("By pair, time of the design over that of the menu", rows)


def _data(found: Sequence[Outcome]) -> Iterator[Mapping[str, object]]:
    for own in found:
        yield {"true": own.pair.names[0], "rival": own.pair.names[1], "gap": own.pair.gap, "gain": own.pair.gain,
               "design_samples": own.design, "menu_samples": own.menu, "menu_shortened_samples": own.shortened,
               "menu": own.name, "right": own.right[0], "of": own.right[1]}  # fmt: skip
