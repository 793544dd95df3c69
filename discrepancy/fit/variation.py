"""Columns of a run by the variation of its motion: what other parameters add, to first order in what they add.

The motion is found once; each column then takes the rates of the other parameters along it (``fmu_src/varied``), which
costs a fifth of a simulation.
"""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from discrepancy.data.record import Floats
from gyro_model.symbols import STATES, x_dot, y_dot

NODES = 2
"""Places in a piece, a step or a part of one, at which rates are known."""

MOST_PARTS = 8
"""Parts a step, in the mean, from which simulations are quicker."""

COUNTS = frozenset(("until", "lies", "part"))
"""What is no real number of what is found."""

SPEEDS = [STATES.index(own) for own in (x_dot, y_dot)]
"""Places among the states, of which those of every model come first."""

Shapes = Mapping[str, tuple[int, ...]]

Kind = tuple[tuple[str, float | None], ...]
"""Of a column: names of what it changes, and of shapes beside a size their values."""


@dataclass(frozen=True)
class Seen:
    """Where the variation has given a column as a simulation does: ``kinds`` of columns, and ``bases``, what acts
    in the motion and on the record; False where it has not."""

    kinds: dict[Kind, bool] = field(default_factory=dict)
    bases: dict[frozenset[str], bool] = field(default_factory=dict)


class _Run(ctypes.Structure):
    """``gyro_run`` of fmu_src/varied/variation.h."""

    _fields_ = [
        *((name, ctypes.c_int64) for name in ("steps", "stride", "axes", "n_inputs")),
        *((name, ctypes.c_void_p) for name in ("inputs", "values", "command")),
        *((name, ctypes.c_double) for name in ("start", "step", "late")),
        *((name, ctypes.c_int64) for name in ("states", "moving", "room", "even", "shared", "kinds", "parts", "size")),
        *((name, ctypes.c_void_p) for name in ("state", "voltage", "acceleration", "slope", "until")),
        *((name, ctypes.c_void_p) for name in ("lies", "part", "length", "place")),
        *((name, ctypes.c_void_p) for name in ("within", "rate", "passage", "base", "weight")),
    ]


@dataclass(frozen=True)
class Driven:
    """What drives a run: values (steps, inputs) held over steps of ``step`` [s] from ``start`` [s], ``stride`` a
    sample; axes: 1 where y rests; inputs: value references; command: at samples (samples, 2) [N], where it is not held
    from one to another."""

    inputs: NDArray[np.uint32]
    values: Floats
    start: float
    step: float
    stride: int
    axes: int
    command: Floats | None

    @property
    def samples(self) -> int:
        """Of the run."""
        return len(self.values) // self.stride


Traveller = NDArray[np.float64]
"""As ``gyro_depart`` makes it."""


class Motion:
    """A run's motion, as ``gyro_follow`` finds it, with its accelerations where columns are to be of these."""

    def __init__(self, library: Any, driven: Driven, *, accelerations: bool = False) -> None:
        self._library, self._driven, self._accelerations = library, driven, accelerations
        self._found: dict[str, NDArray[Any]] = {}
        steps, command = (driven.samples - 1) * driven.stride, driven.command
        self._run = _Run(
            steps, driven.stride, driven.axes, len(driven.inputs),
            driven.inputs.ctypes.data, driven.values.ctypes.data, command.ctypes.data if command is not None else None,
            driven.start, driven.step,
        )  # fmt: skip

    def follow(self, instance: int) -> bool:
        """Runs an initialised instance; False where something acts that can't be followed."""
        own, run = ctypes.c_void_p(instance), ctypes.byref(self._run)
        if not self._library.gyro_measure(own, run):
            return False
        self._make_room(self._along())
        if not self._library.gyro_follow(own, run):
            return False
        while True:
            self._make_room(self._by_pieces())
            if self._library.gyro_linearise(own, run):
                return True
            self._run.parts *= 2
            if self._run.parts > MOST_PARTS * self._run.steps:
                return False

    def _along(self) -> Shapes:
        """What is known at ends of steps and at samples."""
        run, samples = self._run, self._driven.samples
        return {
            "state": (run.steps + 1, run.states),
            "voltage": (run.steps + 1, 2),
            "acceleration": (run.steps + 1, 2) if self._accelerations else (0,),
            "slope": (1 if run.even else samples, run.moving, 2) if self._accelerations else (0,),
            "until": (samples,),
            "base": (self._traveller,),
        }

    def _by_pieces(self) -> Shapes:
        """What is known by pieces."""
        run = self._run
        kept = run.steps if run.kinds == 1 else 2 * run.steps
        pieces = kept + run.parts
        return {
            **{name: (pieces,) for name in ("lies", "part", "length")},
            "place": (pieces, NODES),
            "within": (pieces, NODES, run.states),
            "rate": (pieces, NODES, run.states),
            "passage": ((run.kinds if run.shared else kept) + run.parts, run.moving, run.room),
            "weight": (run.kinds + run.parts, NODES, run.moving, run.room),
        }

    def _make_room(self, shapes: Shapes) -> None:
        for name, shape in shapes.items():
            own = np.empty(shape, np.int64 if name in COUNTS else np.float64)
            self._found[name] = own
            setattr(self._run, name, own.ctypes.data if own.size else None)

    @property
    def is_bent(self) -> bool:
        """Whether forces bend it in places."""
        return bool(self._run.parts)

    def found(self, order: int) -> Floats:
        """The voltage [V] at samples (n, 2), or by ``order`` speeds [m/s] or accelerations [m/s2]."""
        if order == 1:
            return np.asarray(self._found["state"][:: self._driven.stride, SPEEDS])
        return self._found["acceleration" if order else "voltage"][:: self._driven.stride]

    @property
    def _traveller(self) -> int:
        """Its size, in numbers."""
        return -(-int(self._run.size) // 8)

    def depart(self, instance: int) -> Traveller | None:
        """What goes along it with the parameters of another initialised instance; None where something acts that can't
        be followed."""
        made = np.zeros(self._traveller)
        found = self._library.gyro_depart(
            ctypes.c_void_p(instance), ctypes.byref(self._run), ctypes.c_void_p(made.ctypes.data)
        )
        return made if found else None

    def varied(self, travellers: Sequence[Traveller], order: int) -> Floats:
        """What each adds to the voltage [V], or by ``order`` to speeds [m/s] or accelerations [m/s2]: (travellers,
        samples, 2). It uses them up."""
        columns = np.empty((len(travellers), self._driven.samples, 2))
        addresses = ctypes.c_void_p * len(travellers)
        self._library.gyro_vary(
            ctypes.byref(self._run), ctypes.c_int64(len(travellers)),
            addresses(*(t.ctypes.data for t in travellers)), ctypes.c_int(order),
            addresses(*(c.ctypes.data for c in columns)),
        )  # fmt: skip
        return columns
