"""Defects of a record: what the measurement did to force and voltage, beside what the device is.

One file each in ``defects/``, found by a scan of that folder. Three kinds:

- ``Distortion`` has size parameters that are neutral by default, and changes the force before the model sees it or the
  voltage after. It is scored, refitted and questioned as an effect is, by the same columns.
- ``Blemish`` is found in the residuals of a fit and taken out of the record, run by run.
- ``Disturbance`` has nothing to take out: it scatters the samples, as the likelihood of the fit knows.
"""

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import ClassVar, Final, NamedTuple

from discrepancy.criteria import Criteria
from discrepancy.data.record import Floats, Record
from discrepancy.fit.fitted import Fitted
from gyro_model.anatomy import Effect
from gyro_model.errors import InputError
from gyro_model.model import Model
from gyro_model.quantities import Quantity

FOLDER: Final = Path(__file__).parents[1] / "defects"


class Timing(NamedTuple):
    """Where the samples of a simulated piece lie: ``first``, of its first one in the run; ``period`` [s]."""

    first: int
    period: float


Data = tuple[float, ...]
"""What a blemish keeps of a run: plain numbers, from which it can be taken out again."""


class Level(NamedTuple):
    """A value with its 95 % interval."""

    value: float
    low: float
    high: float


class Found(NamedTuple):
    """A blemish in runs: its data, run by run, and its parameters."""

    data: tuple[Data, ...]
    levels: Mapping[str, Level]


class Left(NamedTuple):
    """What a model leaves of runs. residuals: (n, axes) [V]; between: of a run, by its number, what its sensor gives in
    the model in PARTS of each sample, (n, PARTS, axes) [V], beginning with the sample itself; None where nothing makes
    it jump."""

    records: Sequence[Record]
    residuals: Sequence[Floats]
    between: Callable[[int], Floats | None] = lambda run: None


@dataclass(frozen=True, kw_only=True)
class Defect:
    """What every defect states. parameters: SI, neutral where it is absent; signature: what it looks like; source:
    where its formula stands; axes: the least that a record must have."""

    id: str
    parameters: tuple[Quantity, ...]
    signature: str
    source: str
    axes: int = 1

    nominal: ClassVar[bool] = False
    noise: ClassVar[bool] = False
    symbols: ClassVar[frozenset[object]] = frozenset()

    def __post_init__(self) -> None:
        if not (self.parameters and self.signature and self.source):
            raise InputError(f"defect {self.id}: give parameters, signature and source")

    @cached_property
    def sizes(self) -> tuple[Quantity, ...]:
        """The parameters that switch it on."""
        return tuple(q for q in self.parameters if q.role == "size")


@dataclass(frozen=True, kw_only=True)
class Distortion(Defect):
    """force: what acted, (n, axes) [N], of what the record says, on steps of ``step`` [s]; voltage: what was recorded,
    (n, axes, ...) [V], of what the sensor gave, which may reach ``beyond`` samples further, and of a sum the sum, so
    that columns go through it alone; both get the sizes by name. split: whether it acts within a step; within: whether
    it acts on the voltage before it is sampled, which it gets between samples too; gauge: whether no sample tells it
    from another mass, stiffness and damping, so that it is never named. levels: of some runs, sizes at which its first
    parameter is tried, where a small one changes nothing; late: of one that delays a slow signal, by how much [s]."""

    force: Callable[[Floats, float, Mapping[str, float]], Floats] | None = None
    voltage: Callable[[Floats, Timing, Mapping[str, float]], Floats] | None = None
    beyond: Callable[[int, Timing, Mapping[str, float]], int] | None = None
    levels: Callable[[Sequence[Record]], Sequence[float]] | None = None
    late: Callable[[Mapping[str, float]], float] | None = None
    split: bool = False
    within: bool = False
    gauge: bool = False

    def acts(self, parameters: Mapping[str, float]) -> bool:
        """Whether a size is not neutral."""
        return any(parameters.get(q.name, q.start) != q.start for q in self.sizes)


@dataclass(frozen=True, kw_only=True)
class Blemish(Defect):
    """find: the blemish in runs by what a fit leaves of them, None where there is none; without: a run
    without what its data say; again: the data of another run, by what was found, where it need not be found there;
    counted: whether what a better model shows of it later adds to what was found; by_motion: whether its data
    follow from the motion, so that no noise is among them by chance."""

    find: Callable[[Left, Criteria], Found | None]
    without: Callable[[Record, Data], Record]
    again: Callable[[Found, Record, Floats], Data] | None = None
    counted: bool = False
    by_motion: bool = False


def without_samples(record: Record, data: Data) -> Record:
    """The run with the samples of these numbers masked."""
    valid = record.valid.copy()
    valid[[int(k) for k in data if 0 <= k < len(valid)]] = False
    return replace(record, valid=valid)


@dataclass(frozen=True, kw_only=True)
class Disturbance(Defect):
    """find: its parameters by the final fit, None where it is not there; instead: noises of the device that are not
    said beside it, since it is what shows as such."""

    find: Callable[[Fitted, Sequence[Record], Criteria], Mapping[str, Level] | None]
    instead: tuple[str, ...] = ()


@cache
def defects() -> tuple[Defect, ...]:
    """All defects, by id. Raises InputError for a file that defines none."""
    found = []
    for path in sorted(FOLDER.glob("[a-z]*.py")):
        defect = getattr(importlib.import_module(f"discrepancy.defects.{path.stem}"), "DEFECT", None)
        if not isinstance(defect, Defect) or defect.id != path.stem:
            raise InputError(
                f"defect file {path}: assign a Distortion, a Blemish or a Disturbance with id {path.stem!r} to DEFECT"
            )
        found.append(defect)
    return tuple(found)


@cache
def distortions() -> tuple[Distortion, ...]:
    """Those with sizes that a fit can move."""
    return tuple(d for d in defects() if isinstance(d, Distortion))


@cache
def blemishes() -> tuple[Blemish, ...]:
    """Those that are found in residuals."""
    return tuple(d for d in defects() if isinstance(d, Blemish))


@cache
def disturbances() -> tuple[Disturbance, ...]:
    """Those that scatter the samples."""
    return tuple(d for d in defects() if isinstance(d, Disturbance))


@cache
def distortion_names() -> frozenset[str]:
    """Names of the parameters that are no device's."""
    return frozenset(q.name for d in distortions() for q in d.parameters)


def quantity_of(model: Model, name: str) -> Quantity:
    """The parameter of the model or of a defect. Raises InputError where there is none."""
    own = {q.name: q for d in defects() for q in d.parameters}
    return own.get(name) or model.parameter(name)


def effect_of(model: Model, name: str) -> "Effect | Defect":
    """The effect of the model or the defect of that id. Raises InputError where there is none."""
    return {d.id: d for d in defects()}.get(name) or model.effect(name)
