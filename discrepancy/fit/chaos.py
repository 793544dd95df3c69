"""Motions that go their own way after the least change, as in chaos: no model follows them from end to end."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from discrepancy.data.record import Record
from discrepancy.fit.simulate import Simulator

NUDGE: Final = 1e-7
"""Of the motion, rms, by which another first place is off."""
GROWN, FIRST_PART = 10.0, 20
"""Times as far as over so small a part of a run at its start, that it is off later, where runs go their own way. Of 21
springs that bend far, of three runs each, it is 4,000 and more in one run of each of ten that are chaotic, 27 of one
that is not, 7 at most of the others."""


def go_their_own_way(simulator: Simulator, records: Sequence[Record], parameters: Mapping[str, float]) -> bool:
    """Whether one of the records, simulated from rest with these parameters, does: each axis begins elsewhere. Raises
    OutOfTime as ``run``."""
    for record in records:
        scales = zip("xy", record.v.std(axis=0), strict=False)
        nudged = {f"{axis}_start": NUDGE * float(v) / abs(parameters[f"sense_gain_{axis}"]) for axis, v in scales}
        one, other = simulator.try_all([(record, parameters), (record, {**parameters, **nudged})])
        if one is None or other is None:
            continue
        off = np.abs(other - one).max(axis=1)
        if off.max() > GROWN * off[: max(len(off) // FIRST_PART, 1)].max():
            return True
    return False
