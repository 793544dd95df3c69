"""Changes of a drive, by which a design is improved, and ways to make it simpler."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from discrepancy.data.record import MINIMUM_SAMPLES
from discrepancy.tell.drives import HIGHEST, Drive, Player

Change = Callable[[Drive, np.random.Generator, float, float], Drive]
"""Of a drive, with random numbers, how large it is, and the highest frequency [Hz]."""

SHORTEST: Final = 0.05
"""Share of a run during which a force acts at least."""


def changed(drive: Drive, horizon: int, player: Player, rng: np.random.Generator, size: float) -> tuple[Drive, int]:
    """One or two things about a drive, and what it is laid out for, drawn anew near where they are."""
    top = HIGHEST * player.room.rate
    for kind in rng.choice(len(CHANGES) + 1, size=rng.integers(1, 3), replace=False):
        if kind < len(CHANGES):
            drive = CHANGES[kind](drive, rng, size, top)
        else:
            longer = horizon * np.exp(size * rng.standard_normal())
            horizon = int(np.clip(longer, MINIMUM_SAMPLES, player.room.samples))
    return drive, horizon


def simpler(drive: Drive) -> Iterator[Callable[[Drive], Drive]]:
    """Ways to play less: a condition not changed, one level, one axis, a tone less."""
    for name in dict(drive.steps):
        yield lambda own, name=name: replace(own, steps=tuple(s for s in own.steps if s[0] != name))  # type: ignore[misc]
    yield lambda own: replace(own, rise=1.0)
    yield lambda own: replace(own, off=1.0)
    yield lambda own: replace(own, share=np.where(np.abs(own.share) > np.abs(own.share).max() / 3, own.share, 0.0))
    for _ in range(len(drive.frequency) - 1):
        yield lambda own: _without(own, int(np.argmin(np.abs(own.weight).sum(axis=1))))


def _frequency(drive: Drive, rng: np.random.Generator, size: float, top: float) -> Drive:
    f = drive.frequency * np.exp(0.3 * size * rng.standard_normal(len(drive.frequency)))
    return replace(drive, frequency=np.minimum(f, top))


def _phase(drive: Drive, rng: np.random.Generator, size: float, top: float) -> Drive:
    return replace(drive, phase=drive.phase + 3 * size * rng.standard_normal(drive.phase.shape))


def _weight(drive: Drive, rng: np.random.Generator, size: float, top: float) -> Drive:
    return replace(drive, weight=drive.weight * np.exp(2 * size * rng.standard_normal(drive.weight.shape)))


def _share(drive: Drive, rng: np.random.Generator, size: float, top: float) -> Drive:
    share = drive.share + 2 * size * rng.standard_normal(len(drive.share))
    return replace(drive, share=np.clip(share, -1, 1))


def _tones(drive: Drive, rng: np.random.Generator, size: float, top: float) -> Drive:
    """A tone more, anywhere, or one less."""
    if len(drive.frequency) > 1 and rng.random() < 0.5:
        return _without(drive, int(rng.integers(len(drive.frequency))))
    axes = drive.weight.shape[1]
    # More of them low, where the modes are.
    frequency = np.append(drive.frequency, top * rng.random() ** 2)
    weight = np.vstack((drive.weight, np.full((1, axes), 0.5)))
    return replace(drive, frequency=frequency, weight=weight,
                   phase=np.vstack((drive.phase, rng.uniform(0, 2 * np.pi, (1, axes)))))  # fmt: skip


def _form(drive: Drive, rng: np.random.Generator, size: float, top: float) -> Drive:
    """A square wave or not, or off at another time."""
    if rng.random() < 0.5:
        return replace(drive, hard=not drive.hard)
    return replace(drive, off=float(np.clip(drive.off + size * rng.standard_normal(), SHORTEST, 1)))


def _without(drive: Drive, tone: int) -> Drive:
    left = np.arange(len(drive.frequency)) != tone
    return replace(drive, frequency=drive.frequency[left], weight=drive.weight[left], phase=drive.phase[left])


CHANGES: Final[tuple[Change, ...]] = (_frequency, _phase, _weight, _share, _tones, _form)
