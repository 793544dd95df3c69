"""What comes late on the way of force or voltage, in the place of what else does.

A linear device does not tell a delay of its force from a lag of its voltage. Beside a force that is not linear they
are two: the mass moves elsewhere then, and no column of the one, where the other is in the model, says how well it
would fit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from discrepancy.fit.defect import Defect, Distortion
from discrepancy.name.accepted import Accepted
from discrepancy.name.columns import Candidate
from discrepancy.name.scan import Scored
from discrepancy.name.search import Search
from gyro_model.anatomy import Delay, Effect, Force, Lag
from gyro_model.linear_forces import bends


def other_lags(search: Search, entry: Accepted, scored: Sequence[Scored]) -> list[Scored]:
    """Of a delay or a lag beside a force that is not linear the others, as late as it is."""
    late = _late(entry.candidate, search.at.parameters)
    if not late or not has_its_place(search):
        return []
    others = [(c, s, _late(c, {**c.shapes, c.probes[0].quantity.name: c.probes[0].step})) for c, s in scored]
    return [(c, replace(s, amplitudes=(late / each,), moves={})) for c, s, each in others
            if each and c.effect.id != entry.id]  # fmt: skip


def has_its_place(search: Search) -> bool:
    """Whether something that comes late stands beside a force that is not linear, so that its place shows."""
    own = [a.candidate.effect for a in search.accepted]
    forces = [effect for effect in own if isinstance(effect, Force)]
    return any(map(_comes_late, own)) and any(bends(force, search.simulator.model) for force in forces)


def _comes_late(effect: Effect | Defect) -> bool:
    return isinstance(effect, Delay | Lag) or (isinstance(effect, Distortion) and effect.late is not None)


def _late(candidate: Candidate, parameters: Mapping[str, float]) -> float:
    """By how much a slow signal comes later [s]; 0 where the effect is none of these."""
    effect = candidate.effect
    if isinstance(effect, Delay | Lag):
        return parameters[(effect.delay if isinstance(effect, Delay) else effect.time_constant).name]
    return effect.late(parameters) if isinstance(effect, Distortion) and effect.late else 0.0
