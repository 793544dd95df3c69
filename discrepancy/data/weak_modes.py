"""Modes that hardly answer beside others: what these leave is looked at as a record of its own, in its own band."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.signal import coherence, welch

from discrepancy.data.modes import APART, ENOUGH, LEAST, MOST, Mode, answering, apart, further_modes
from discrepancy.data.record import Record, is_driven
from discrepancy.data.residues import answered

WINDOWS: Final = 8
"""Of a run, for the coherence of force and voltage."""
FOLLOWS: Final = 0.3
"""Share of a voltage's power that follows the force apart from known modes, below which no mode is looked for in it:
0.06 of noise, 0.8 and more where a mode is left."""
LOBE: Final = 2
"""Bins to either side of a frequency that a window spreads it to."""


def all_modes(records: Sequence[Record]) -> tuple[list[Mode], list[Mode]]:
    """As ``further_modes``, with those besides that driven ``records`` show only in what the others leave: a sensor of
    displacement sees a mode at three times the frequency with a thirtieth of the power, beyond where almost all is."""
    first, further = further_modes(records)
    while first and len(further) < MOST and is_driven(records):
        new = _hidden(records, sorted([*first, *further]))
        if not new:
            break
        further = sorted([*further, *new])[:MOST]
    return first, further


def _hidden(records: Sequence[Record], known: Sequence[Mode]) -> list[Mode]:
    """The modes as which what the ``known`` ones leave answers; none where it does not, or they take too little of
    it."""
    before = answered(records, known)
    if before.left**2 < LEAST:
        return []
    left = [replace(record, v=own) for record, own in zip(records, before.residuals, strict=True)]
    if _following(left, known) < FOLLOWS:
        return []
    new = [mode for mode in answering(left) if all(apart(mode.frequency, own.frequency) for own in known)]
    better = new and answered(records, [*known, *new]).left ** 2 < ENOUGH * before.left**2
    return new if better else []


def _following(records: Sequence[Record], known: Sequence[Mode]) -> float:
    """The share of the voltage's power that goes with the forces, by their coherence, beside the peaks of ``known``
    modes: an effect that changes one leaves most there."""
    told = power = 0.0
    for record in records:
        window = len(record.t) // WINDOWS
        f = np.fft.rfftfreq(window, 1 / record.sample_rate)
        beside = np.ones(len(f), bool)
        for mode in known:
            wide = max(mode.frequency / mode.quality, APART * mode.frequency, LOBE * f[1])
            beside &= np.abs(f - mode.frequency) > wide
        for v in record.v.T:
            own = welch(v, nperseg=window)[1]
            told += sum(float(coherence(u, v, nperseg=window)[1][beside] @ own[beside]) for u in record.u.T if u.any())
            power += float(own.sum())
    return told / power if power else 0.0
