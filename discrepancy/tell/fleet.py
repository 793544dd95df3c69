"""Many devices, each diagnosed alone: which effects occur on which share, how their parameters are spread, which do not
belong."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Final

import numpy as np
from scipy.stats import binomtest

from discrepancy.data.linear_fit import mode_frequencies
from discrepancy.data.record import Floats
from discrepancy.tell.answer import Diagnosis, Value
from discrepancy.tell.population import WIDTH, Population, independent, population

CHANCE: Final = 0.05
"""Of calling any device of a fleet an outlier where all belong, over all parameters."""
FEW: Final = 0.05
"""Share of the devices up to which an effect that they alone name is worth a word about each."""
MANY: Final = 10
"""Devices from which on a name that one alone has is unusual."""
MODES: Final = ("frequency of the lower mode", "frequency of the upper mode")


@dataclass(frozen=True)
class Estimate:
    """A number with its standard deviation."""

    value: float
    deviation: float
    unit: str


@dataclass(frozen=True)
class Row:
    """What one device of the fleet showed; error: why it was not diagnosed, and then nothing else.

    effects: by id the parameters; either: what can't be told from it; values: of all parameters that were fitted, of
    noise and of the modes; absent: sizes of effects that are not named, by a linear fit; detectable: by effect and
    parameter the smallest size that this data would have shown.
    """

    name: str
    verdict: str = ""
    effects: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    either: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    record: tuple[str, ...] = ()
    values: Mapping[str, Estimate] = field(default_factory=dict)
    absent: Mapping[str, Estimate] = field(default_factory=dict)
    detectable: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    misfit: float | None = None
    floor: float | None = None
    error: str | None = None

    def estimate(self, parameter: str) -> Estimate | None:
        """What is known of a parameter."""
        return self.values.get(parameter) or self.absent.get(parameter)


def row_of(name: str, found: Diagnosis, axes: int) -> Row:
    """The row of a device whose data have ``axes`` axes."""
    values = {n: _estimate(v) for n, v in {**found.device, **found.noise}.items()}
    for modes, hertz in zip(MODES, mode_frequencies(found.parameters, axes), strict=False):
        values[modes] = Estimate(float(hertz), 0.0, "Hz")
    absent = {n: _estimate(v) for sizes in found.absent.values() for n, v in sizes.items()}
    return Row(
        name,
        found.verdict,
        {f.id: tuple(f.parameters) for f in found.effects},
        {f.id: f.either for f in found.effects if f.either},
        tuple(f.id for f in found.record),
        _finite(values),
        _finite(absent),
        found.detectable,
        found.misfit["final"],
        found.misfit["noise_floor"],
    )


def _finite(values: Mapping[str, Estimate]) -> dict[str, Estimate]:
    return {n: v for n, v in values.items() if np.isfinite((v.value, v.deviation)).all()}


def _estimate(of: Value) -> Estimate:
    # An interval that a bound cuts short is as wide as its other side.
    return Estimate(of.value, max(of.high - of.value, of.value - of.low) / WIDTH, of.unit)


@dataclass(frozen=True)
class Share:
    """How many of ``of`` devices name an effect, with the 95 % interval of their share (Wilson); uncertain: of them,
    how many could not tell it from another; seen: devices that name it or would have shown its median size."""

    count: int
    of: int
    low: float
    high: float
    uncertain: int
    seen: int


@dataclass(frozen=True)
class Spread:
    """A parameter over the fleet. devices: names, in the order of ``found``'s individuals; effect: which it belongs to,
    "" for the device itself."""

    unit: str
    effect: str
    devices: tuple[str, ...]
    estimates: tuple[Estimate, ...]
    found: Population


@dataclass(frozen=True)
class Outlier:
    """A device that does not belong, and why."""

    device: str
    reasons: tuple[str, ...]


@dataclass(frozen=True)
class Fleet:
    """The answer. columns: what is known of each device besides, by heading, as its position on a wafer."""

    rows: tuple[Row, ...]
    columns: Mapping[str, Mapping[str, float]]
    shares: Mapping[str, Share]
    record: Mapping[str, int]
    spreads: Mapping[str, Spread]
    outliers: tuple[Outlier, ...]

    def report(self) -> dict[str, Any]:
        """The contents of fleet.json."""
        return {
            "devices": {row.name: _listed(row) for row in self.rows},
            "columns": {name: dict(own) for name, own in self.columns.items()},
            "effects": {name: asdict(share) for name, share in self.shares.items()},
            "record": dict(self.record),
            "parameters": {name: _described(spread, tuple(self.columns)) for name, spread in self.spreads.items()},
            "outliers": {outlier.device: list(outlier.reasons) for outlier in self.outliers},
        }


def _listed(row: Row) -> dict[str, Any]:
    shown: dict[str, Any] = {"verdict": row.verdict, "effects": list(row.effects), "record": list(row.record),
                             "misfit": row.misfit, "noise_floor": row.floor}  # fmt: skip
    return {"error": row.error} if row.error else shown


def _described(spread: Spread, headings: Sequence[str]) -> dict[str, Any]:
    found = spread.found
    each = zip(spread.devices, spread.estimates, found.individuals, found.distances, strict=True)
    return {
        "unit": spread.unit,
        "effect": spread.effect,
        "mean": asdict(found.mean),
        "spread": asdict(found.spread),
        "slopes": {name: asdict(slope) for name, slope in zip(headings, found.slopes, strict=True)},
        "outliers": [spread.devices[i] for i in found.outliers],
        "devices": {
            name: {"alone": {"value": e.value, "deviation": e.deviation}, "among_others": asdict(own), "distance": far}
            for name, e, own, far in each
        },
    }


def fleet(rows: Sequence[Row], columns: Mapping[str, Mapping[str, float]] | None = None) -> Fleet:
    """The fleet of these devices; columns: by heading a number for each device, along which parameters may change."""
    known = _telling(columns or {})
    good = [row for row in rows if row.error is None]
    shares = _shares(good)
    spreads = _spreads(good, known, shares)
    return Fleet(tuple(rows), known, shares, _record(good), spreads, tuple(_outliers(rows, shares, spreads)))


def _telling(columns: Mapping[str, Mapping[str, float]]) -> dict[str, Mapping[str, float]]:
    """The columns without those that say nothing beside the ones before them: a constant, or another's multiple."""
    kept: dict[str, Mapping[str, float]] = {}
    for heading, own in columns.items():
        table = np.array([[other[name] for other in (*kept.values(), own)] for name in own])
        if independent(table):
            kept[heading] = own
    return kept


def _record(rows: Sequence[Row]) -> dict[str, int]:
    names = [name for row in rows for name in row.record]
    return {name: names.count(name) for name in sorted(set(names), key=lambda n: (-names.count(n), n))}


def _shares(rows: Sequence[Row]) -> dict[str, Share]:
    shares = {}
    for name in sorted({name for row in rows for name in row.effects}):
        naming = [row for row in rows if name in row.effects]
        interval = binomtest(len(naming), len(rows)).proportion_ci(method="wilson")
        uncertain = sum(name in row.either for row in naming)
        seen = len(naming) + sum(name not in row.effects and _would_show(row, name, naming) for row in rows)
        shares[name] = Share(len(naming), len(rows), float(interval.low), float(interval.high), uncertain, seen)
    return dict(sorted(shares.items(), key=lambda entry: -entry[1].count))


def _would_show(row: Row, effect: str, naming: Sequence[Row]) -> bool:
    """Whether the data of ``row`` would have shown the median size that those ``naming`` the effect have."""
    for parameter, least in row.detectable.get(effect, {}).items():
        sizes = [abs(own.values[parameter].value) for own in naming if parameter in own.values]
        if sizes and least <= np.median(sizes):
            return True
    return False


def _spreads(rows: Sequence[Row], columns: Mapping[str, Mapping[str, float]], shares: Mapping[str, Share]
             ) -> dict[str, Spread]:  # fmt: skip
    owner = {parameter: name for row in rows for name, own in row.effects.items() for parameter in own}
    names = dict.fromkeys(name for row in rows for name in row.values)
    chance = CHANCE / max(len(names) * len(rows), 1)
    spreads = {}
    for name in sorted(names, key=lambda n: (n in owner, n not in MODES)):
        known = [(row, own) for row in rows if (own := row.estimate(name)) is not None]
        values, deviations = np.array([(own.value, own.deviation) for _, own in known]).T
        found = population(values, deviations, _design([row for row, _ in known], columns), chance)
        if found is not None:
            devices, estimates = tuple(row.name for row, _ in known), tuple(own for _, own in known)
            spreads[name] = Spread(estimates[0].unit, owner.get(name, ""), devices, estimates, found)
    return spreads


def _design(rows: Sequence[Row], columns: Mapping[str, Mapping[str, float]]) -> Floats:
    return np.array([[own[row.name] for own in columns.values()] for row in rows], dtype=float).reshape(len(rows), -1)


def _outliers(rows: Sequence[Row], shares: Mapping[str, Share], spreads: Mapping[str, Spread]) -> list[Outlier]:
    found = []
    for row in rows:
        reasons = []
        for name in row.effects:
            share = shares[name]
            if share.of >= MANY and share.count <= max(1, FEW * share.of):
                reasons.append(f"names {name}, as {share.count} of {share.of} do")
        for name, spread in spreads.items():
            at = [i for i in spread.found.outliers if spread.devices[i] == row.name]
            for i in at:
                value, expected = spread.estimates[i].value, spread.found.expected[i]
                reasons.append(
                    f"{name} = {value:.4g} {spread.unit} where the others lead one to expect {expected:.4g}, "
                    f"{spread.found.distances[i]:+.1f} σ"
                )
        if reasons:
            found.append(Outlier(row.name, tuple(reasons)))
    return found
