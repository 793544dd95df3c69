"""The answer of a diagnosis as data, and as the contents of report.json (docs/theory/records.md)."""

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field, replace
from math import isfinite, isnan, nan
from typing import Any, Literal

from discrepancy.criteria import Criteria
from discrepancy.data.record import Floats
from discrepancy.fit.locate import Place
from discrepancy.name.score import Step
from discrepancy.tell.backbone import Bent
from discrepancy.tell.experiment import Experiment
from gyro_model.model import Model

Verdict = Literal["missing effects", "nothing missing", "partly explained", "unexplained"]


@dataclass(frozen=True)
class Value:
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Finding:
    """An effect that is missing; ``either``: others that the data can't tell from it.

    forces: sympy text by ``force_x``, ``force_y``, empty where it is no force; share of the residual's square that it
    takes away; next_experiment: what would tell it from the others; probability: of this name against its rivals and
    against none of them; NaN of what is no name.
    """

    id: str
    either: tuple[str, ...]
    parameters: Mapping[str, Value]
    forces: Mapping[str, str] = field(default_factory=dict)
    share: float = 0.0
    next_experiment: str = ""
    probability: float = nan


@dataclass(frozen=True)
class Stage:
    """The model at one stage ("nominal", "refit", then an effect's id) on the held-out runs.

    parameters: all of them; misfit by run, ``""`` for all; residuals by run, (n, axes) [V]; starts:
    how many first samples of each gave its initial state.
    """

    name: str
    parameters: Mapping[str, float]
    misfit: Mapping[str, float]
    residuals: Mapping[str, Floats] = field(repr=False)
    starts: Mapping[str, int] = field(default_factory=dict, repr=False)


@dataclass(frozen=True)
class Diagnosis:
    """The answer. effects: largest first, by what the output loses without each; device: every fitted parameter of the
    improved model with its interval; parameters: all its values.

    rivals: by finding, the parameters of the model with each other effect of its ``either`` in its place; removed: by
    effect, what taking it out changes in the output of each held-out run, (n, axes) [V]; absent: by effect that is not
    named and its parameters, the size that a linear fit beside the final model finds, whatever its bounds; steps: how
    it was found; doubts: what the reader should know about the fit, one line each; left: share of the refit's residual
    power that is left, noise taken off; record: defects of the measurement; criteria: the thresholds used; bent: how
    frequency and damping go with amplitude, where a run shows it; experiments: by finding, what to play to tell it from
    its ``either``; model: with every effect named.
    """

    verdict: Verdict
    effects: tuple[Finding, ...]
    immaterial: tuple[Finding, ...]
    noise: Mapping[str, Value]
    misfit: Mapping[str, Any]
    located: tuple[Place, ...]
    detectable: Mapping[str, Mapping[str, float]]
    device: Mapping[str, Value]
    parameters: Mapping[str, float] = field(default_factory=dict)
    rivals: Mapping[str, Mapping[str, Mapping[str, float]]] = field(default_factory=dict)
    steps: tuple[Step, ...] = field(repr=False, default=())
    stages: tuple[Stage, ...] = field(repr=False, default=())
    removed: Mapping[str, Mapping[str, Floats]] = field(repr=False, default_factory=dict)
    absent: Mapping[str, Mapping[str, Value]] = field(repr=False, default_factory=dict)
    doubts: tuple[str, ...] = ()
    left: float = 0.0
    record: tuple[Finding, ...] = ()
    criteria: Criteria = field(default_factory=Criteria)
    bent: Bent | None = field(repr=False, default=None)
    experiments: Mapping[str, Experiment] = field(repr=False, default_factory=dict)
    model: Model = field(repr=False, kw_only=True)

    @property
    def spoken_of(self) -> set[str]:
        """Ids of the effects and defects that it names, rivals of theirs included."""
        return {name for f in (*self.effects, *self.immaterial, *self.record) for name in (f.id, *f.either)}

    def without(self, unused: Collection[str]) -> "Diagnosis":
        """The answer, and its model, without effects that stood ready in vain."""
        model = Model(tuple(e for e in self.model.effects if e.id not in unused), self.model.starts)
        detectable = {name: sizes for name, sizes in self.detectable.items() if name not in unused}
        absent = {name: sizes for name, sizes in self.absent.items() if name not in unused}
        return replace(self, model=model, detectable=detectable, absent=absent)

    def report(self) -> dict[str, Any]:
        """The contents of report.json: plain Python, null where a number is not finite."""
        return _plain({
            "verdict": self.verdict,
            "doubts": self.doubts,
            "left": self.left,
            "record": [_listed(f) for f in self.record],
            "effects": [_listed(f) for f in self.effects],
            "immaterial": [_listed(f) for f in self.immaterial],
            "noise": {name: asdict(value) for name, value in self.noise.items()},
            "misfit": self.misfit,
            "located": [asdict(place) for place in self.located],
            "detectable": self.detectable,
            "criteria": asdict(self.criteria),
        })  # fmt: skip


def _listed(finding: Finding) -> dict[str, Any]:
    values = {name: asdict(value) for name, value in finding.parameters.items()}
    said = {} if isnan(finding.probability) else {"probability": finding.probability}
    more = {"next_experiment": finding.next_experiment} if finding.either else {}
    return {"id": finding.id, "either": list(finding.either), **said, "parameters": values, **finding.forces, **more}


def _plain(value: Any) -> Any:
    """``value`` in types that JSON has."""
    if isinstance(value, Mapping):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if isinstance(value, (str, bool)) or value is None:
        return value
    return float(value) if isfinite(value) else None
