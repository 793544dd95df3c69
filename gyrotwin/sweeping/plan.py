"""The plan of a sweep: which task, at which points, what is kept of it and what is good enough."""

import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from math import isfinite
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from gyro_model.errors import InputError, nearest
from gyro_model.toml_text import read_toml_file
from gyrotwin import __version__

Floats = NDArray[np.float64]

FORMAT: Final = 1
KINDS: Final = ("grid", "values", "distribution")
KEYS: Final = ("format", "task", "seeds", "outputs", "fixed", "parameters", "sampling", "correlation", "limits")
METHODS: Final = ("sobol", "latin", "random", "saltelli", "morris")
"""Points: Sobol' sequence, Latin hypercube, independent; and those that Sobol' and Morris indices need."""
LEVELS: Final = 4
"""Levels of a Morris design (Morris 1991)."""
MOST_POINTS: Final = 1_000_000
DRAWN: Final = 64
"""Points of the distributions where a plan gives none: a power of two."""


class Point(NamedTuple):
    """One row to be: its number, the values of the parameters, the seed."""

    number: int
    values: Mapping[str, Any]
    seed: int


@dataclass(frozen=True)
class Plan:
    """A plan; fields as the keys of a plan file.

    task: ``run``, ``rate``, ``diagnose``, or ``FILE.py:FUNCTION``. parameters: by name, each with ``grid`` (all
    combinations), ``values`` (lists that go together) or ``distribution`` (a name of scipy.stats with its arguments).
    sampling: ``method``, ``points``, ``seed`` of the distributions. correlation: of two parameters ``"a,b"`` (Gaussian
    copula). limits: of outputs, [low, high]. Names with dots need no quotes.

    Raises InputError for whatever is wrong in it.
    """

    task: str
    parameters: Mapping[str, Mapping[str, Any]]
    seeds: Sequence[int] = (1,)
    outputs: Sequence[str] = ()
    fixed: Mapping[str, Any] = field(default_factory=dict)
    sampling: Mapping[str, Any] = field(default_factory=dict)
    correlation: Mapping[str, float] = field(default_factory=dict)
    limits: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.parameters:
            raise InputError("plan: no [parameters.NAME]: give at least one")
        for name, given in self.parameters.items():
            kinds = [kind for kind in KINDS if kind in given]
            if len(kinds) != 1:
                raise InputError(f"parameter {name}: give one of grid, values, distribution")
            if kinds != ["distribution"] and not (isinstance(given[kinds[0]], list) and given[kinds[0]]):
                raise InputError(f"parameter {name}: {kinds[0]} = {given[kinds[0]]!r}: give a list")
        lengths = {name: len(p["values"]) for name, p in self.parameters.items() if "values" in p}
        if len(set(lengths.values())) > 1:
            raise InputError(f"values of {', '.join(lengths)}: lists that go together have one length; use grid")
        if self.method not in METHODS:
            raise InputError(f"sampling method {self.method!r}: there are {', '.join(METHODS)}"
                             f"{nearest(self.method, METHODS)}")  # fmt: skip
        for key, pair in self.limits.items():
            if not (len(pair) == 2 and pair[0] <= pair[1]):
                raise InputError(f"limits {key} = {pair!r}: give [low, high]")
        for seed in self.seeds:
            if isinstance(seed, bool) or not isinstance(seed, int) or not 0 <= seed < 2**31:
                raise InputError(f"seed {seed!r}: give whole numbers from 0 to {2**31 - 1}")
        for name in self.random:
            _distribution(name, self.parameters[name])
        self._cholesky()

    @property
    def method(self) -> str:
        """How distributions are sampled."""
        return str(self.sampling.get("method", "sobol"))

    @property
    def random(self) -> list[str]:
        """Parameters with a distribution."""
        return [name for name, given in self.parameters.items() if "distribution" in given]

    def digest(self, source: bytes = b"") -> str:
        """Names the plan with ``source``, the text of its task's file if it has one, the files that it names and the
        version of this package: equal ones give equal rows."""
        found = hashlib.sha256(json.dumps([__version__, asdict(self)], sort_keys=True, default=list).encode() + source)
        for path in sorted(_files([self.fixed, self.parameters])):
            found.update(f"{path}\n".encode() + path.read_bytes())
        return found.hexdigest()[:16]

    def unit_sample(self) -> Floats:
        """Points of the distributions in the unit cube, (points, parameters)."""
        count, width = int(self.sampling.get("points", DRAWN)), len(self.random)
        if not 1 <= count <= MOST_POINTS:
            raise InputError(f"sampling points = {count}: give 1 to {MOST_POINTS}")
        seed = int(self.sampling.get("seed", 1))
        if self.method == "sobol":
            # A power of two keeps the sequence balanced; the first of it are taken.
            return np.asarray(stats.qmc.Sobol(width, seed=seed).random_base2((count - 1).bit_length()))[:count]
        if self.method == "latin":
            return np.asarray(stats.qmc.LatinHypercube(width, seed=seed).random(count))
        if self.method == "random":
            return np.random.default_rng(seed).random((count, width))
        from gyrotwin.sweeping.sensitivity import design

        return design(self.method, self.random, count, seed)

    def points(self) -> list[Point]:
        """All points, in the order of their numbers."""
        grids = {name: p["grid"] for name, p in self.parameters.items() if "grid" in p}
        lists = {name: p["values"] for name, p in self.parameters.items() if "values" in p}
        rows = [dict(zip(grids, row, strict=True)) for row in itertools.product(*grids.values())]
        together = [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)] or [{}]
        drawn = self._drawn() if self.random else [{}]
        total = len(rows) * len(together) * len(drawn) * len(self.seeds)
        if total > MOST_POINTS:
            raise InputError(f"plan: {total} points; at most {MOST_POINTS}: make grids or samples smaller")
        combined = itertools.product(rows, together, drawn, self.seeds)
        return [Point(n, {**a, **b, **c}, seed) for n, (a, b, c, seed) in enumerate(combined)]

    def _drawn(self) -> list[dict[str, float]]:
        u = self.unit_sample()
        # At the very ends of the cube a normal is infinite.
        u = np.clip(u, 1e-12, 1 - 1e-12)
        root = self._cholesky()
        if root is not None:
            u = stats.norm.cdf(stats.norm.ppf(u) @ root.T)
        columns = [_distribution(n, self.parameters[n]).ppf(u[:, k]) for k, n in enumerate(self.random)]
        return [dict(zip(self.random, map(float, row), strict=True)) for row in zip(*columns, strict=True)]

    def _cholesky(self) -> Floats | None:
        """Root of the correlation matrix; None where all are independent."""
        if not self.correlation:
            return None
        matrix = np.eye(len(self.random))
        for pair, value in self.correlation.items():
            names = [name.strip() for name in pair.split(",")]
            for name in names:
                if name not in self.random:
                    raise InputError(f"correlation {pair!r}: {name!r} has no distribution{nearest(name, self.random)}")
            if len(names) != 2 or not -1 < value < 1:
                raise InputError(f"correlation {pair!r} = {value!r}: give two names and a number between -1 and 1")
            i, j = map(self.random.index, names)
            matrix[i, j] = matrix[j, i] = value
        try:
            return np.asarray(np.linalg.cholesky(matrix))
        except np.linalg.LinAlgError:
            raise InputError("correlation: no such parameters exist, the matrix is not positive definite") from None


def _files(value: Any) -> set[Path]:
    """The files that texts within ``value`` name: device, design, profile; effects where it is a folder."""
    if isinstance(value, Mapping | list | tuple):
        parts = value.values() if isinstance(value, Mapping) else value
        return set().union(*map(_files, parts))
    if not isinstance(value, str | Path):
        return set()
    try:
        path = Path(value)
        return {path} if path.is_file() else set(path.glob("*.py")) if path.is_dir() else set()
    except (OSError, ValueError):
        # A text that can be no path.
        return set()


def _distribution(name: str, given: Mapping[str, Any]) -> Any:
    kind = given["distribution"]
    law = getattr(stats, str(kind), None)
    if not isinstance(law, stats.rv_continuous):
        known = [key for key in dir(stats) if isinstance(getattr(stats, key), stats.rv_continuous)]
        raise InputError(f"parameter {name}: distribution {kind!r} is none of scipy.stats{nearest(str(kind), known)}")
    arguments = {key: value for key, value in given.items() if key != "distribution"}
    try:
        frozen = law(**arguments)
        ends = frozen.ppf([0.25, 0.75])
    except (TypeError, ValueError) as error:
        raise InputError(f"parameter {name}: {kind}: {error}") from None
    if not all(map(isfinite, ends)):
        raise InputError(f"parameter {name}: {kind} with {arguments}: gives no numbers; check its arguments")
    return frozen


def load_plan(source: "str | Path | Mapping[str, Any] | Plan") -> Plan:
    """The plan of a file, of a mapping with the same keys, or itself. Raises InputError where it is wrong."""
    if isinstance(source, Plan):
        return source
    if isinstance(source, Mapping):
        return _plan(dict(source), Path())
    path = Path(source)
    if not path.is_file():
        raise InputError(f"plan {path}: no such file")
    try:
        return _plan(read_toml_file(path), path.parent)
    except InputError as error:
        raise InputError(f"plan {path}: {str(error).removeprefix('plan: ')}") from None


def _plan(data: dict[str, Any], folder: Path) -> Plan:
    for key in data:
        if key not in KEYS:
            raise InputError(f"key {key!r} is unknown{nearest(key, KEYS)}")
    if data.pop("format", FORMAT) != FORMAT:
        raise InputError(f"format: this program reads format = {FORMAT}")
    for key in ("fixed", "parameters", "sampling", "correlation", "limits"):
        if not isinstance(data.get(key, {}), Mapping):
            raise InputError(f"{key} = {data[key]!r}: make it a table [{key}]")
    data["parameters"] = dict(_flat(data.get("parameters", {}), _is_parameter))
    data["limits"] = dict(_flat(data.get("limits", {}), lambda limit: not isinstance(limit, Mapping)))
    if not isinstance(data.get("task"), str):
        raise InputError('task is missing: add task = "run"')
    seeds = data.get("seeds", [1])
    data["seeds"] = list(range(1, seeds + 1)) if isinstance(seeds, int) and not isinstance(seeds, bool) else seeds
    task: str = data["task"]
    if ".py:" in task and not Path(task).is_absolute():
        data["task"] = str(folder / task)
    return Plan(**data)


def _is_parameter(given: Any) -> bool:
    return not (isinstance(given, Mapping) and given and all(isinstance(value, Mapping) for value in given.values()))


def _flat(table: Mapping[str, Any], is_leaf: Callable[[Any], bool], group: str = "") -> Iterator[tuple[str, Any]]:
    """The entries of ``table`` by dotted names, which TOML takes for tables within tables unless they are quoted."""
    for key, value in table.items():
        if is_leaf(value):
            yield group + key, value
        else:
            yield from _flat(value, is_leaf, f"{group}{key}.")
