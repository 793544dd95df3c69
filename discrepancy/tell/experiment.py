"""The shortest further experiment that tells apart effects between which the data can't decide, as a table to play."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl
from scipy.stats import norm

from discrepancy.data.record import Record
from discrepancy.fit.simulate import Simulator
from discrepancy.tell.design import Design, Designer
from discrepancy.tell.drives import STEPPED, Drive, Player
from discrepancy.tell.limits import REST, Limits, Room, room_of
from discrepancy.tell.rivals import Rival
from gyro_model.errors import InputError

SURE: Final = 0.95
"""Probability with which the right effect has to fit better."""
ASKED: Final = float(4 * norm.ppf(SURE) ** 2)
"""Separation that this takes."""
SECONDS: Final = 10.0
"""Of work for a design."""
RUNS: Final = 100
"""Runs at most: what takes more tells nothing apart."""
HIGHEST: Final = 1e6
"""Odds above are not told: the noise is not normal so far out."""
UNITS: Final = {"v_bias": "V", "omega_z": "rad/s", "temperature": "K", "a_x": "m/s²", "a_y": "m/s²"}


@dataclass(frozen=True)
class Experiment:
    """A further run that would decide. text: for the reader; seconds: of it until the right effect fits better in 95 %
    of cases, whichever it is; odds to one at its end; runs: so often to be made; enough: it decides within them all;
    record: what to drive the device with, v that of the first rival, noise aside."""

    text: str
    seconds: float
    odds: float
    runs: int
    enough: bool
    record: Record = field(repr=False)
    drive: Drive = field(repr=False)

    @property
    def table(self) -> pl.DataFrame:
        """What a generator plays: t [s], forces [N] and every condition [SI], one row a sample."""
        run = self.record
        played = {
            name: values for name, values in run.channels.items() if not name.startswith("v_") or name == "v_bias"
        }
        return pl.DataFrame({"t": run.t, **played})

    def write(self, path: Path) -> None:
        """Writes the table as CSV."""
        self.table.write_csv(path)


def next_experiment(
    simulator: Simulator,
    records: Sequence[Record],
    fitted_by_id: Mapping[str, Mapping[str, float]],
    noise_rms: float,
    limits: Limits | None = None,
    seconds: float = SECONDS,
) -> Experiment | None:
    """The shortest run found within ``limits`` that tells the first of the rivals from all others that any tells it
    from.

    fitted_by_id: for each rival effect by id the full set of parameters (FMU names, SI) fitted with it to ``records``;
    noise_rms: of a sample [V]; seconds: of work. None where nothing can be played within the limits. Raises InputError
    where there are not two rivals, or the noise is not positive.
    """
    if len(fitted_by_id) < 2:
        raise InputError(f"rivals {', '.join(fitted_by_id) or 'none'}: give the parameters of two effects or more")
    if not 0 < noise_rms < np.inf:
        raise InputError(f"noise_rms = {noise_rms!r}: give a positive number in V")
    limits = limits or Limits()
    first, *others = (Rival(simulator, records, name, values, noise_rms) for name, values in fitted_by_id.items())
    told = others
    if len(others) > 1:
        share = seconds / 2 / len(others)
        told = [other for other in others if _decides(designer_of([first, other], records, limits, share))] or others
        seconds /= 2
    designer = designer_of([first, *told], records, limits, seconds)
    design = designer.find()
    if design is None:
        return None
    found = _played(designer, design)
    left = ", ".join(other.name for other in others if other not in told)
    return replace(found, text=f"{found.text}; from {left} nothing within the limits tells it") if left else found


def designer_of(rivals: Sequence[Rival], records: Sequence[Record], limits: Limits, seconds: float) -> Designer:
    """What looks for a design."""
    loudest = max(records, key=lambda r: float(np.mean(r.u**2)))
    player = Player(room_of(limits, records), rivals[0].values, loudest)
    return Designer(rivals, player, ASKED, seconds)


def _decides(designer: Designer) -> bool:
    """Whether any design does."""
    design = designer.find()
    return design is not None and design.samples <= RUNS * designer.player.room.samples


def odds_of(separation: float) -> float:
    """Odds to one that the right effect fits better."""
    wrong = float(norm.sf(np.sqrt(max(separation, 0.0)) / 2))
    return min((1 - wrong) / max(wrong, 1e-300), HIGHEST)


def _played(designer: Designer, design: Design) -> Experiment:
    """The table of a design, longer than it needs, and what it brings."""
    room = designer.player.room
    n = designer.table(design.samples)
    record, course = designer.play(design, n)
    samples = designer.samples(course, n)
    runs = max(1, int(np.ceil(min(samples / n, 10 * RUNS))))
    enough = runs <= RUNS
    first = designer.rivals[0]
    shown = first.simulated(record)
    designer.simulator.forget([record])
    record = replace(record, v=shown)
    odds = odds_of(runs * float(course[-1]))
    text = _told([rival.name for rival in designer.rivals], design.drive, record, room, design.horizon,
                 samples / room.rate, odds, runs, enough=enough)  # fmt: skip
    return Experiment(text, samples / room.rate, odds, runs, enough, record, design.drive)


def _told(
    names: Sequence[str], drive: Drive, record: Record, room: Room, horizon: int, seconds: float, odds: float,
    runs: int, *, enough: bool,
) -> str:  # fmt: skip
    both = f"{names[0]} from {', '.join(names[1:])}"
    played = f"{_force(drive, record, horizon / room.rate)}{_courses(drive, record, room, horizon / room.rate)}"
    if not enough:
        return f"nothing within the limits tells {both} in {RUNS} runs; nearest comes {played}"
    more = "more than " if odds >= HIGHEST else ""
    length = len(record.t) / room.rate
    often = f"{runs} runs of {_time(length)}" if runs > 1 else f"a run of {_time(length)}"
    return (
        f"{played}: tells {both} with {SURE:.0%} after {_time(seconds)}, with odds of {more}{odds:.3g}:1 after {often}"
    )


def _force(drive: Drive, record: Record, length: float) -> str:
    if not record.u.any():
        return "no force"
    tones = ", ".join(f"{f:.5g}" for f in drive.frequency)
    peaks = [(axis, float(np.abs(record.u[:, i]).max())) for i, axis in enumerate("xy"[: record.axes])]
    sizes = " and ".join(f"{peak:.3g} N on {axis}" for axis, peak in peaks if peak > 0)
    if not drive.frequency.any():
        kind = "constant force"
    else:
        form = "square wave" if drive.hard else "sine"
        kind = f"{form} of {tones} Hz" if len(drive.frequency) == 1 else f"{form}s of {tones} Hz together"
    growing = ", growing" if drive.rise < 1 else ""
    off = f", off after {_time(drive.off * length)}" if drive.off < 1 else ""
    return f"force as a {kind}, at most {sizes}{growing}{off}"


def _courses(drive: Drive, record: Record, room: Room, length: float) -> str:
    told = []
    for name, values in drive.steps:
        way = " to ".join(f"{v:.4g}" for v in (room.base.get(name, REST[name]), *values))
        told.append(f"; {name} from {way} {UNITS[name]}, first after {_time(STEPPED * length)}")
    return "".join(told)


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"
