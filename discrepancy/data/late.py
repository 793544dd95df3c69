"""By how much the voltage comes late, as the response shows before any model is fitted.

A filter before the converter, or one behind that of the force, is a delay to what is slow against it. Where that is a
good part of a period of a mode, no mass, spring and damper come near the record, and what is fitted to it without the
delay is none of the device's.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import ceil
from typing import Final, NamedTuple

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.optimize import minimize_scalar

from discrepancy.data.linear_fit import LOWEST, is_held, mode_frequencies
from discrepancy.data.linear_start import response
from discrepancy.data.record import Floats, Record, is_driven

ASTRAY: Final = 0.1
"""Share of the force that a model without delay leaves, from which a fit of it may end astray: a phase of 0.3 rad."""
SLIGHTLY: Final = 1e-3
"""The same where a delay that no model has would be taken for other effects: a phase of 0.03 rad."""
DECISIVE: Final = 3.0
"""Times less of the force that the delayed model must leave: as for the hold, whose half sample is a delay as well."""
LONGEST: Final = 0.3
"""Longest delay, in periods of the highest mode. From half a period on a delay is a turned sensor."""
SAMPLES: Final = 40_000
"""Of the first runs, that are looked at: more make the delay no plainer, and each trial takes as long as they are."""
SURE: Final = 1e-4
"""Of the longest delay, to which the best is found: what is taken from a voltage too much no device can make up for."""
POINTS: Final = 13
"""Delays tried at first: from one to the next the phase turns by 0.16 rad."""


class Late(NamedTuple):
    """delay [s] of the voltage; runs without it."""

    delay: float
    records: tuple[Record, ...]


def synchronised(
    records: Sequence[Record], nominal: Mapping[str, float], most: float
) -> tuple[tuple[Record, ...], tuple[str, ...]]:
    """The runs without a delay that is longer than ``most`` [s], that of any device, and what to say; as they are where
    those to fit show none, or no spring holds the mass."""
    fit = [record for record in records if record.role == "fit"]
    if not fit:
        return tuple(records), ()
    if not is_held(fit, nominal) or most * mode_frequencies(nominal, fit[0].axes)[-1] > LONGEST:
        return tuple(records), ()
    late = lateness(fit, nominal, SLIGHTLY)
    if late is None or late.delay <= most:
        return tuple(records), ()
    text = (
        f"v comes {late.delay:.3g} s after what u makes, and no device is later than {most:.3g} s: taken as that much "
        "earlier; give both channels one clock"
    )
    return tuple(_cut(record, late.delay) for record in records), (text,)


def _cut(record: Record, delay: float) -> Record:
    """The run with its voltage earlier by ``delay`` [s], without the samples that it then lacks."""
    [moved] = _earlier([record], delay)
    kept = len(record.t) - ceil(delay * record.sample_rate)
    return replace(moved, valid=moved.valid & (np.arange(len(record.t)) < kept))


def lateness(records: Sequence[Record], nominal: Mapping[str, float], astray: float = ASTRAY) -> Late | None:
    """The delay that the runs show; None where a model without one leaves no more than ``astray``."""
    if not is_driven(records):
        return None

    first = _first(records)

    def left(delay: float) -> float:
        told = response(_earlier(first, delay), nominal, driven=True, lowest=LOWEST)
        passive = told is not None and all(told[0].get(name, 1.0) > 0 for name in ("m", "kxx", "kyy"))
        return told[1] if told is not None and passive else 1.0

    without = left(0.0)
    if without < astray:
        return None
    longest = LONGEST / float(mode_frequencies(nominal, records[0].axes)[-1])
    delays = np.linspace(0.0, longest, POINTS)
    best = int(np.argmin([without, *(left(float(delay)) for delay in delays[1:])]))
    if not 0 < best < POINTS - 1:
        return None
    found = minimize_scalar(left, bounds=(delays[best - 1], delays[best + 1]), method="bounded",
                            options={"xatol": SURE * longest})  # fmt: skip
    delay = float(found.x)
    return Late(delay, _earlier(records, delay)) if DECISIVE * found.fun < without else None


def _first(records: Sequence[Record]) -> list[Record]:
    """The first SAMPLES of all runs together, a whole run at least."""
    ends = np.cumsum([0, *(len(r.t) for r in records)])
    return [r for r, begin in zip(records, ends, strict=False) if begin < SAMPLES]


def _earlier(records: Sequence[Record], delay: float) -> tuple[Record, ...]:
    """Runs whose voltage comes earlier by ``delay`` [s]; their last samples are repeated."""
    if delay == 0.0:
        return tuple(records)
    return tuple(replace(r, v=_moved(r, delay * r.sample_rate)) for r in records)


def _moved(record: Record, samples: float) -> Floats:
    n = len(record.v)
    places = np.minimum(np.arange(n) + samples, n - 1)
    return np.asarray(make_interp_spline(np.arange(n), record.v, k=3)(places))
