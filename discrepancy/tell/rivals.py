"""How far an effect can follow what another one shows: the separation of rivals, through the time of a run.

Each rival is refitted to what another would show: device parameters, sizes and the initial state move as far as the
runs measured so far let them (linearised). What then remains between the two, over the noise, is the separation D, a
chi-square: the logarithm of the likelihood ratio is normal with mean D/2 and variance D, so that the right one fits
better with the probability Φ(√D/2) (S. M. Kay, Fundamentals of Statistical Signal Processing: Detection Theory, 1998,
section 4.4).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy.data.algebra import inverse_scaled
from discrepancy.data.record import LEVELS, Floats, Record
from discrepancy.fit.defect import effect_of, quantity_of
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Job, Simulator
from gyro_model.errors import InputError

STEP: Final = 1e-4
"""Relative step of a size's difference quotient."""
ENDS: Final = 40
"""Moments of a run at which the separation is told."""
QUOTIENT: Final = 1e-5
"""Step of an initial state over the largest that it may be: errors of second order are as small."""


class Rival:
    """An effect as fitted to ``records``: simulates a run, and follows what another effect shows as far as it can.

    values: all parameters (FMU names, SI); noise: rms of a sample [V]. Raises InputError where no size is fitted, or
    its motion leaves all bounds.
    """

    def __init__(
        self, simulator: Simulator, records: Sequence[Record], name: str, values: Mapping[str, float], noise: float
    ) -> None:
        self.simulator, self.name, self.values, self.noise = simulator, name, dict(values), noise
        fitter = Fitter(simulator, records)
        own = {n: values[n] for n in values if quantity_of(simulator.model, n).role == "parameter"}
        nominal = fitter.begin(own)
        begun = fitter.evaluated(Fitted(self.values, fitter.starts(self.values), (), fitter.plain(values), ()))
        if not np.isfinite(begun.cost):
            raise InputError(f"rival {name}: its motion leaves all bounds on a run; leave it out")
        free = (*nominal.free, *self._sizes(name))
        at = fitter.with_grams(replace(fitter.fit(begun, rounds=2), free=free))
        assert at.grams is not None
        self.free = at.free
        self.states = [name for name in fitter.state_names(at) if name not in LEVELS]
        step = np.array([own.step for own in at.free])
        # A linearisation chooses its own steps: only by the unit are two of them alike.
        known = at.grams.sum(axis=0)[:-1, :-1] / np.outer(step, step) / noise**2
        values_, vectors = np.linalg.eigh(_scaled(inverse_scaled(known), step))
        # Directions of the parameters, one standard deviation each by the runs so far.
        self.spread = vectors * np.sqrt(np.maximum(values_, 0)) * step[:, None]
        reach = max(float(np.abs(r.v).max()) for r in records) / values["sense_gain_x"]
        speed = reach * float(np.sqrt(values["kxx"] / values["m"]))
        self.reach = {state: speed if "dot" in state else reach for state in self.states}

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

    def simulated(self, record: Record) -> Floats:
        """The voltage [V] that this effect would show."""
        return self.simulator.run(record, self.values)

    def columns(self, record: Record, shown: Floats) -> Floats | None:
        """What it can do to the voltage ``shown`` (n, axes), over the noise: a standard deviation in each direction of
        its parameters, and initial states as large as any measured motion, (p, n, axes); None where the FMU refuses
        one."""
        changed: list[tuple[str, float, float]] = []
        for own in self.free:
            value = self.values[own.name]
            side = -1.0 if value + own.step > own.high or (own.name in ("kxy", "dxy") and value > 0) else 1.0
            changed.append((own.name, value, side * own.step))
        changed += [(state, 0.0, QUOTIENT * self.reach[state]) for state in self.states]
        jobs: list[Job] = [(record, {**self.values, name: value + step}) for name, value, step in changed]
        quotients = np.empty((len(jobs), *shown.shape))
        for column, (_, _, step), v in zip(quotients, changed, self.simulator.try_all(jobs), strict=True):
            if v is None:
                return None
            np.divide(v - shown, step * self.noise, out=column)
        p = len(self.free)
        quotients[p:] *= np.array(list(self.reach.values()))[:, None, None]
        quotients[:p] = np.tensordot(self.spread.T, quotients[:p], axes=1)
        return quotients


def followed(columns: Floats, error: Floats) -> Floats:
    """D at ENDS moments of a run, (ENDS,): what is left of ``error`` (n, axes), over the noise, after ``columns`` have
    followed it, each of them a standard deviation by what is known without this run."""
    n = len(error)
    ends = ends_of(n)
    whole = np.concatenate((columns, error[None]))
    grams = [_gram(whole[:, begin:end]) for begin, end in zip((0, *ends[:-1]), ends, strict=True)]
    total = np.cumsum(grams, axis=0)
    matrix, right = total[:, :-1, :-1] + np.eye(len(columns)), total[:, :-1, -1:]
    # Initial states may be as large as any motion, a million times the noise: rounding needs a unit diagonal.
    size = np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))[:, :, None]
    solved = np.linalg.solve(matrix / (size * size.transpose(0, 2, 1)), right / size)
    return np.asarray(np.maximum(total[:, -1, -1] - np.sum(right / size * solved, axis=(1, 2)), 0.0))


def ends_of(n: int) -> list[int]:
    """Samples after which the separation of a run of ``n`` is told."""
    return [int(end) for end in np.linspace(0, n, ENDS + 1)[1:].round()]


def _gram(part: Floats) -> Floats:
    flat = part.reshape(len(part), -1)
    return np.asarray(flat @ flat.T)


def _scaled(inverse: Floats, step: Floats) -> Floats:
    return np.asarray(inverse / np.outer(step, step))
