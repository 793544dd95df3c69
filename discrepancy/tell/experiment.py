"""The cheapest further experiment that tells apart effects between which the data can't decide.

Each experiment of the menu is simulated under each rival. Every other rival is refitted to what that one would show:
its device parameters, sizes and the initial state move as far as the runs measured so far let them (linearised). What
then remains between the two, over the noise, is the separation D, a chi-square: the logarithm of the likelihood ratio
is normal with mean D/2 and variance D, so that the right one fits better with the probability Φ(√D/2) (S. M. Kay,
Fundamentals of Statistical Signal Processing: Detection Theory, 1998, section 4.4).
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from scipy.stats import norm

from discrepancy.data.algebra import inverse_scaled
from discrepancy.data.record import Floats, Record
from discrepancy.fit.defect import effect_of, quantity_of
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.tell.menu import Proposal, menu
from gyro_model.errors import InputError

ASKED: Final = 99.0
"""Odds that an experiment has to reach: right in 99 % of cases."""
HIGHEST: Final = 1e6
"""Odds above are not told: the noise is not normal so far out."""
STEP: Final = 1e-4
"""Relative step of a size's difference quotient."""

Information = tuple[tuple[Free, ...], Floats]


@dataclass(frozen=True)
class Experiment:
    """A further run that would decide. text: for the reader; name: on the menu; odds to one that the right effect
    fits better, whichever it is; record: what to drive the device with, v that of the first rival, noise aside.
    ``enough``: the odds reach what was asked; if not, this is the best of the menu."""

    text: str
    name: str
    odds: float
    enough: bool
    record: Record = field(repr=False)


def next_experiment(
    simulator: Simulator,
    records: Sequence[Record],
    fitted_by_id: Mapping[str, Mapping[str, float]],
    noise_rms: float,
    asked: float = ASKED,
) -> Experiment:
    """The first of the menu that reaches the odds ``asked``, or the best of all where none does.

    fitted_by_id: for each rival effect by id the full set of parameters (FMU names, SI) fitted with it to ``records``;
    noise_rms: of a sample [V]. Raises InputError where there are not two rivals, or the noise is not positive.
    """
    if len(fitted_by_id) < 2:
        raise InputError(f"rivals {', '.join(fitted_by_id) or 'none'}: give the parameters of two effects or more")
    if not 0 < noise_rms < np.inf:
        raise InputError(f"noise_rms = {noise_rms!r}: give a positive number in V")
    rivals = {name: _Rival(simulator, records, name, values, noise_rms) for name, values in fitted_by_id.items()}
    best: tuple[float, Proposal] | None = None
    for proposal in menu(records, next(iter(fitted_by_id.values()))):
        separation = min(rivals[b].separation(proposal.record, rivals[a]) for a, b in itertools.permutations(rivals, 2))
        odds = _odds(separation)
        if best is None or odds > best[0]:
            best = odds, proposal
        if odds >= asked:
            break
    assert best is not None
    odds, proposal = best
    shown = next(iter(rivals.values())).simulated(proposal.record)
    text = _told(proposal, tuple(rivals), odds, asked)
    return Experiment(text, proposal.name, odds, odds >= asked, replace(proposal.record, v=shown))


def _odds(separation: float) -> float:
    wrong = float(norm.sf(np.sqrt(max(separation, 0.0)) / 2))
    return min((1 - wrong) / max(wrong, 1e-300), HIGHEST)


def _told(proposal: Proposal, names: Sequence[str], odds: float, asked: float) -> str:
    both = f"{names[0]} from {', '.join(names[1:])}"
    more = "more than " if odds >= HIGHEST else ""
    if odds >= asked:
        return f"{proposal.text}: tells {both} with odds of {more}{odds:.0f}:1"
    return f"nothing on the menu tells {both} with odds of {asked:.0f}:1; best is {proposal.text}, {odds:.3g}:1"


class _Rival:
    """An effect as fitted: simulates a run, and follows what another effect shows as far as it can."""

    def __init__(
        self, simulator: Simulator, records: Sequence[Record], name: str, values: Mapping[str, float], noise: float
    ) -> None:
        self.simulator, self.values, self.noise = simulator, dict(values), noise
        fitter = Fitter(simulator, records)
        own = {n: values[n] for n in values if quantity_of(simulator.model, n).role == "parameter"}
        nominal = fitter.begin(own)
        self.free = (*nominal.free, *self._sizes(name))
        self.plain = fitter.plain(values)
        begun = fitter.evaluated(Fitted(self.values, fitter.at_rest, (), self.plain, ()))
        at = fitter.with_grams(replace(fitter.fit(begun, rounds=2), free=self.free))
        # What the runs so far say of the free parameters.
        self.known = self._information(at)[:-1, :-1]

    def _sizes(self, name: str) -> list[Free]:
        """Sizes that are not neutral, of the rival and of any effect beside it."""
        effect = effect_of(self.simulator.model, name)
        known = (quantity_of(self.simulator.model, n) for n in self.values)
        sizes = [q for q in known if q.role == "size" and self.values[q.name] != q.start]
        if not any(q in effect.sizes for q in sizes):
            raise InputError(
                f"rival {name}: none of its sizes is fitted; give {', '.join(q.name for q in effect.sizes)}"
            )
        return [Free(q.name, STEP * abs(self.values[q.name] - q.start), q.low, q.high) for q in sizes]

    def _information(self, at: Fitted) -> Floats:
        """Grams of the free parameters [1/SI²] and the residual, over the noise."""
        assert at.grams is not None
        # A linearisation chooses its own steps: only by the unit are two of them alike.
        step = np.array([*(free.step for free in at.free), 1.0])
        return np.asarray(at.grams.sum(axis=0) / np.outer(step, step) / self.noise**2)

    def simulated(self, record: Record) -> Floats:
        """The voltage that this effect would show."""
        return self.simulator.run(record, self.values)

    def separation(self, record: Record, truth: "_Rival") -> float:
        """What of ``truth`` this effect can't follow in a further run, as a chi-square."""
        fitter = Fitter(self.simulator, [replace(record, v=truth.simulated(record))])
        at = fitter.evaluated(Fitted(self.values, fitter.at_rest, self.free, self.plain, ()))
        linear = fitter.with_grams(at)
        if linear.grams is None or not np.isfinite(linear.grams).all():
            return 0.0
        total = self._information(linear)
        matrix, right = total[:-1, :-1], total[:-1, -1]
        matrix += self.known
        return float(total[-1, -1] - right @ inverse_scaled(matrix) @ right)
