"""Modes that hardly answer beside others: what these leave is looked at as a record of its own, in its own band.

Below the band no peak shows a mode, but sensors see the structure move as a whole, on its suspension or held by
nothing, as the shaft of a drive: the residual mass of modal analysis (D. J. Ewins, Modal Testing, 2000, section 4.5).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import coherence, welch

from discrepancy.data.courses import KINDS, beside, left_by, may_act, plainly_act
from discrepancy.data.modes import APART, ENOUGH, LEAST, MOST, POWER, Mode, answering, apart, further_modes
from discrepancy.data.record import Floats, Record, is_driven
from discrepancy.data.residues import Columns, answered, columns_of
from discrepancy.data.speeds import are_displacements, as_speeds

WINDOWS: Final = 8
"""Of a run, for the coherence of force and voltage."""
FOLLOWS: Final = 0.3
"""Share of a voltage's power that follows the force apart from known modes, below which no mode is looked for in it:
0.06 of noise, 0.8 and more where a mode is left."""
BELOW: Final = (0.1, 0.2, 0.4, 0.8)
"""Of the lowest frequency of the force, where a structure moves as a whole."""
SUSPENDED: Final = 10.0
"""Quality factor there, which hardly shows."""
FREE: Final = 3e-3
"""Likewise of what nothing holds: its spring is 1e-5 of what its mass takes in the band."""
RATES: Final = np.geomspace(3e-3, 3.0, 7)
"""Of the same, over 2 pi: damping over mass of what nothing holds."""
BESIDE_FRICTION: Final = 0.85
"""Share of the power that modes leave beside a friction of what an accelerometer sees, below which it moves as a whole:
it sees less of that than of the jumps of a friction. 0.01 to 0.77 of ten motors, 0.93 and more of ten masses that
springs hold. Other sensors see no jumps: of six such masses by their place or speed one has 0.87."""
HELD: Final = 0.5
"""Share of the power that a suspended structure leaves, below which it is one that nothing holds: the fit of one may
have loads that push it away."""
FEWEST, LONGEST = 8.0, 10.0
"""Periods of the longest run below which, and times that run in which it dies away beyond which, what looks like a mode
beside a motion as a whole is a tone: 3 to 8 periods of five axes in their loops, or a quality of 1e4 at 1 Hz."""
LOBE: Final = 2
"""Bins to either side of a frequency that a window spreads it to."""


def all_modes(records: Sequence[Record]) -> tuple[list[Mode], list[Mode]]:
    """As ``further_modes``, with those besides that driven ``records`` show only in what the others leave: a sensor of
    displacement sees a mode at three times the frequency with a thirtieth of the power, beyond where almost all is. Of
    records that plainly show a friction beside them, or a spring that bends, those that they show with it. Where
    displacements show none, or one of a place that nothing holds, whose way hides what answers quickly, their speeds
    are asked too."""
    first, further = _with_all_views(records)
    return first, _without_tones(records, further)


def _with_all_views(records: Sequence[Record]) -> tuple[list[Mode], list[Mode]]:
    first, further = _beside_courses(records)
    known = [*first, *further]
    if not (is_driven(records) and are_displacements(records)) or (known and all(mode.seen for mode in known)):
        return first, further
    own, more = _beside_courses(as_speeds(records))
    if not known:
        return own, more
    new = [m for m in (*own, *more) if m.seen and all(apart(m.frequency, k.frequency) for k in known)]
    return first, sorted([*further, *new])[:MOST]


def _without_tones(records: Sequence[Record], modes: Sequence[Mode]) -> list[Mode]:
    """Those modes that a mass which nothing holds may carry: of a loop around it the friction makes the tones of the
    reference, which are slow or do not die away."""
    duration = max(len(record.t) / record.sample_rate for record in records)
    held = all(mode.seen for mode in modes)
    return [
        mode
        for mode in modes
        if held
        or not mode.seen
        or (mode.frequency * duration >= FEWEST and mode.quality <= LONGEST * np.pi * mode.frequency * duration)
    ]


def _beside_courses(records: Sequence[Record]) -> tuple[list[Mode], list[Mode]]:
    found, plain = _all_modes(records), True
    if not is_driven(records):
        return found
    known = sorted([*found[0], *found[1]])
    before = left_by(records, known)
    for kinds in KINDS:
        # Where neither shows alone, both do not.
        if len(kinds) > 1 and plain:
            break
        acting = beside(records, kinds)
        if not may_act(before, acting, known):
            continue
        new = _all_modes(acting)
        modes = sorted([*new[0], *new[1]])
        if plainly_act(before, acting, modes):
            found, plain, known, before = new, False, modes, left_by(acting, modes)
    return found


def _all_modes(records: Sequence[Record]) -> tuple[list[Mode], list[Mode]]:
    first, further = further_modes(records)
    if not is_driven(records):
        return first, further
    # Where a place that goes far hides all else, what hardly answers is looked for beside that.
    whole = [] if first or further else _as_a_whole(records, [])
    further = [*whole, *further]
    while (first or further) and len(further) < MOST:
        known = sorted([*first, *further])
        new = _hidden(records, known)
        if not (new or whole):
            # The motion as a whole hides others as well.
            new = whole = _as_a_whole(records, known)
        if not new:
            break
        further = sorted([*further, *new])[:MOST]
    # Alone it is no mode.
    return first, further if first or further != whole else []


def _as_a_whole(records: Sequence[Record], known: Sequence[Mode]) -> list[Mode]:
    """The mode below the force's band without which the ``known`` ones leave much more; none where there is none."""
    before = left_by(records, known)
    if before**2 < LEAST:
        return []
    lowest = min([*(mode.frequency for mode in known[:1]), *(_driven_from(record) for record in records)])
    kinds = [
        [Mode(share * lowest, SUSPENDED, seen=False) for share in BELOW],
        [_free(lowest, rate) for rate in RATES],
    ]
    others = columns_of(records, known)
    left = {mode: answered(records, [mode], beside=others).left for kind in kinds for mode in kind}
    suspended, free = (min(kind, key=left.__getitem__) for kind in kinds)
    enough = BESIDE_FRICTION if "friction" in records[0].courses and records[0].order == 2 else ENOUGH
    if min(left[suspended], left[free]) ** 2 > enough * before**2:
        return []
    return [_damped(records, others, lowest, free) if left[free] ** 2 < HELD * left[suspended] ** 2 else suspended]


def _free(lowest: float, rate: float) -> Mode:
    """Of what nothing holds, by what damps it over ``lowest`` [Hz]."""
    return Mode(FREE * lowest, FREE / rate, seen=False)


def _damped(records: Sequence[Record], others: Sequence[Columns], lowest: float, near: Mode) -> Mode:
    """What nothing holds, beside ``others``, damped as leaves least, from ``near`` it on."""
    about = np.log(FREE / near.quality) + np.log(RATES[1] / RATES[0]) * np.array([-1.0, 1.0])

    def left(rate: float) -> float:
        return answered(records, [_free(lowest, float(np.exp(rate)))], beside=others).left

    return _free(
        lowest, float(np.exp(minimize_scalar(left, bounds=about, method="bounded", options={"xatol": 0.01}).x))
    )


def _driven_from(record: Record) -> float:
    """The frequency [Hz] above which almost all of the forces' power is."""
    count = len(record.u)
    force = (record.u - record.u.mean(axis=0)) * np.hanning(count)[:, None]
    share = np.cumsum(np.abs(np.fft.rfft(force, axis=0)) ** 2 @ np.ones(record.u.shape[1]))
    return max(int((share < POWER * share[-1]).sum()), 1) * record.sample_rate / count


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
    # What no force drives shows no peak.
    lowest = min(_driven_from(record) for record in records)
    return [mode for mode in new if mode.frequency > lowest] if better else []


def _coherence(u: Floats, v: Floats, window: int) -> Floats:
    """Of a force and a voltage; none where there is no force."""
    with np.errstate(invalid="ignore"):
        return np.nan_to_num(coherence(u, v, nperseg=window)[1])


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
            told += sum(float(_coherence(u, v, window)[beside] @ own[beside]) for u in record.u.T if u.any())
            power += float(own.sum())
    return told / power if power else 0.0
