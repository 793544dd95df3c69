"""What defects of the record do to a run that is simulated: to the force on its way, and to the voltage after."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from discrepancy.data.record import Floats
from discrepancy.fit.defect import Distortion, Timing, distortions

Sizes = tuple[tuple[str, float], ...]
"""Of parameters, by name."""


@dataclass(frozen=True)
class Distorted:
    """The distortions that act on a run, and the sizes of all."""

    acting: tuple[Distortion, ...]
    sizes: Mapping[str, float]

    @classmethod
    def at(cls, parameters: Mapping[str, float]) -> "Distorted":
        """Those of some parameters."""
        acting = tuple(d for d in distortions() if d.acts(parameters))
        return cls(acting, {q.name: parameters.get(q.name, q.start) for d in acting for q in d.parameters})

    @property
    def on_force(self) -> Sizes:
        """Of those that change the force."""
        return tuple((q.name, self.sizes[q.name]) for d in self.acting if d.force for q in d.parameters)

    @property
    def within(self) -> bool:
        """Whether one acts on the voltage between samples."""
        return any(d.within for d in self.acting)

    @property
    def split(self) -> bool:
        """Whether one acts within a step."""
        return any(d.split for d in self.acting)

    def lengthened(self, values: Floats, samples: int, timing: Timing) -> Floats:
        """What drives the steps of so many samples, as far beyond as the voltage reaches."""
        beyond = max((d.beyond(samples, timing, self.sizes) for d in self.acting if d.beyond), default=0)
        more = np.repeat(values[-1:], beyond * len(values) // samples, axis=0)
        return np.concatenate((values, more)) if beyond else values

    def between_samples(self, v: Floats, timing: Timing) -> Floats:
        """The voltage of every step, after those that act on it before it is sampled."""
        return self._after([d for d in self.acting if d.within], v, timing)

    def at_samples(self, v: Floats, timing: Timing) -> Floats:
        """The voltage at samples, after the others."""
        return self._after([d for d in self.acting if not d.within], v, timing)

    def _after(self, own: Sequence[Distortion], v: Floats, timing: Timing) -> Floats:
        for distortion in own:
            if distortion.voltage and np.isfinite(v).all():
                v = distortion.voltage(v, timing, self.sizes)
        return v
