"""The anatomy of an effect: what one file in ``gyro_model/effects`` states, as data.

An effect belongs to one stage, and each stage is a class: ``Law`` changes parameters, ``Follow`` makes them lag,
``Force`` adds a force (and states of its own), ``Map`` rewrites the signal at its place in the chain, ``Delay`` and
``Lag`` hold a signal back. A law, or a map of the actuators, may remember: each ``Memory`` is a number drawn at the
start, a random walk, a slow lag or a loop of hysteresis.

Expressions are sympy, in the symbols of ``gyro_model.symbols`` and the effect's own parameters. Every class checks
itself where it is built and raises InputError.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

from sympy import Expr, Symbol, sympify

from gyro_model import symbols
from gyro_model.errors import InputError, nearest
from gyro_model.quantities import Quantity

Pair = tuple[Expr, Expr]

U, Q, V = (symbols.u_x, symbols.u_y), (symbols.q_x, symbols.q_y), (symbols.v_x, symbols.v_y)


class Slot(NamedTuple):
    """A place in the chain: the pair of signals that enters it and the pair that leaves it."""

    enters: tuple[Symbol, Symbol]
    leaves: tuple[Symbol, Symbol]


SLOTS: Mapping[str, Slot] = {
    "actuator delay": Slot(U, U),
    "actuator play": Slot(U, U),
    "actuator curve": Slot(U, U),
    "actuator gain": Slot(U, U),
    "actuator misalignment": Slot(U, U),
    "pickoff misalignment": Slot(Q, Q),
    "pickoff pair": Slot(Q, Q),
    "pickoff gain": Slot(Q, V),
    "pickoff gain mismatch": Slot(V, V),
    "pickoff parasitic": Slot(V, V),
    "amplifier feedthrough": Slot(V, V),
    "amplifier lag": Slot(V, V),
    "amplifier offset": Slot(V, V),
    "amplifier drift": Slot(V, V),
    "sampled noise": Slot(V, V),
    "sampled clip": Slot(V, V),
    "sampled round": Slot(V, V),
}
"""The chain in its order (docs/theory/effects.md, eq. 1); the first word is the stage. Forces act on the
displacement after the actuator slots."""


@dataclass(frozen=True)
class Limit:
    """A case worked out by hand: at the values ``at`` (others at their start), the term is ``gives``; ``why`` is the
    working."""

    why: str
    at: Mapping[str, float]
    gives: Mapping[str, float]


class BoucWen(NamedTuple):
    """How a state z follows the displacement ``of``, x or y, alone: length dz/dx = 1 - (beta sgn(z dx) + gamma) |z|^n.

    Beside z = 0, where |z|^n has no power series, the plant takes z from the displacement instead of from its rate.
    """

    of: Symbol
    length: Symbol
    beta: Symbol
    gamma: Symbol
    n: Symbol


@dataclass(frozen=True)
class State:
    """A continuous state that an effect brings along: ``rate`` is its time derivative. ``follows`` says the same of one
    that is a Bouc-Wen hysteresis. ``start``: the parameter that says its value as the run begins; None: zero, as it is
    where the effect begins to act later."""

    symbol: Symbol
    unit: str
    description: str
    rate: Expr
    follows: BoucWen | None = None
    start: Quantity | None = None


@dataclass(frozen=True)
class Memory:
    """A number [unit] that an effect carries from instant to instant, saved with the state of the device.

    ``start``: as the run begins, or the effect does. ``now``: the time ``since`` after it was ``symbol``, all that the
    effect reads being held; where ``since`` is not in it, it is the same however often it is taken on the way there.
    ``sample``: at each sample after the first (in the envelope form: at each internal step), ``since`` being the time
    from one to the next. ``start`` and ``sample`` may draw ``normal_x, normal_y``. By default it is zero and stays.
    """

    symbol: Symbol
    unit: str
    description: str
    start: Expr = sympify(0)
    now: Expr | None = None
    sample: Expr | None = None

    @property
    def flows(self) -> bool:
        """Whether it changes by time itself: then it is a continuous state."""
        return self.now is not None and symbols.since in self.now.free_symbols

    @property
    def rate(self) -> Expr:
        """The time derivative of one that flows."""
        return sympify(self.now).diff(symbols.since).subs(symbols.since, 0)

    def terms(self) -> dict[str, Expr]:
        """What it is made of by name; what stays is not said."""
        named = {"start": self.start, "now": self.now, "sample": self.sample}
        return {f"{what}_{self.symbol.name}": sympify(e) for what, e in named.items() if e is not None}


@dataclass(frozen=True)
class Energy:
    """The power balance of a force while nothing drives: force·velocity + d(stored)/dt + dissipated = 0, ``dissipated``
    never negative.

    Both zero for a gyroscopic force. ``None`` in place of an Energy: the force exchanges energy with the outside.
    """

    stored: Expr = sympify(0)
    dissipated: Expr = sympify(0)


@dataclass(frozen=True, kw_only=True)
class Effect:
    """What every effect states. ``id`` is the name of its file; ``nominal`` effects are the device itself and always
    act.

    ``doc`` is the docstring of the file, filled in by the registry.
    """

    STAGE: ClassVar[str] = ""

    id: str
    parameters: tuple[Quantity, ...] = ()
    signature: str
    host_experiment: str
    limits: tuple[Limit, ...]
    memories: tuple[Memory, ...] = ()
    nominal: bool = False
    noise: bool = False
    doc: str = ""

    def __post_init__(self) -> None:
        if not (self.id.isidentifier() and self.id.isascii()):
            raise InputError(f"effect {self.id!r}: an id is a C identifier; use letters, digits and _, no digit first")
        if not (self.nominal or self.sizes):
            raise InputError(f"effect {self.id}: has no size parameter; add one that is neutral by default")
        if not self.limits:
            raise InputError(f"effect {self.id}: give at least one limit case computed by hand")
        if self.memories and self.stage not in ("parameter law", "actuator"):
            raise InputError(f"effect {self.id}: laws and maps of the actuators remember; others have states or none")

        usual = {p.name for p in self.parameters if p.search is not None and p.search.kind == "usual"}
        for p in self.parameters:
            if p.search is not None and p.search.kind == "rest" and p.search.of not in usual:
                raise InputError(
                    f"effect {self.id}: {p.name} is the rest to {p.search.of!r}{nearest(p.search.of, usual)}; name a "
                    "shape of the effect with search=Grid.usual"
                )

    @property
    def stage(self) -> str:
        """The stage that the effect belongs to (docs/theory/effects.md)."""
        return self.STAGE

    @property
    def sizes(self) -> tuple[Quantity, ...]:
        """The parameters that switch the effect on."""
        return tuple(p for p in self.parameters if p.role == "size")

    @property
    def starts(self) -> tuple[Quantity, ...]:
        """The parameters that are states of the effect as the run begins."""
        return tuple(p for p in self.parameters if p.role == "start")

    def terms(self) -> dict[str, Expr]:
        """The expressions of the effect by the name that a limit case uses."""
        return self.made() | {name: expr for memory in self.memories for name, expr in memory.terms().items()}

    def made(self) -> dict[str, Expr]:
        """``terms`` without those of what the effect remembers."""
        raise NotImplementedError

    def neutral(self) -> dict[str, Expr]:
        """What each of ``made`` is where the effect is switched off; rates of its states are left out."""
        raise NotImplementedError

    @cached_property
    def symbols(self) -> frozenset[Symbol]:
        """Every symbol that a term uses."""
        return frozenset().union(*(expr.free_symbols for expr in self.terms().values()))

    @property
    def drawn(self) -> bool:
        """Whether the effect draws numbers at each sample."""
        starts = {f"start_{memory.symbol.name}" for memory in self.memories}
        return _draws(expr for name, expr in self.terms().items() if name not in starts)

    @property
    def drawn_at_start(self) -> bool:
        """Whether the effect draws numbers once, as it begins to act."""
        return _draws(memory.start for memory in self.memories)


def _draws(exprs: Iterable[Expr]) -> bool:
    numbers = {*symbols.NORMAL, *symbols.PINK}
    return any(sympify(expr).free_symbols & numbers for expr in exprs)


def _sympified(terms: Mapping[str, Expr]) -> dict[str, Expr]:
    return {name: sympify(expr) for name, expr in terms.items()}


@dataclass(frozen=True, kw_only=True)
class Law(Effect):
    """Changes parameters: ``changes`` gives the new value of each target, written with the target's own symbol for
    the old value.

    ``event`` is the time parameter at which the symbol ``after`` turns from 0 to 1; the integrator stops there.
    """

    STAGE: ClassVar[str] = "parameter law"
    changes: Mapping[Symbol, Expr]
    event: Symbol | None = None

    def made(self) -> dict[str, Expr]:
        return _sympified({target.name: expr for target, expr in self.changes.items()})

    def neutral(self) -> dict[str, Expr]:
        return {target.name: target for target in self.changes}


@dataclass(frozen=True, kw_only=True)
class Follow(Effect):
    """Makes a held quantity lag: each target of ``follows`` nears its value as set as a first-order lag of the time
    constant [s] beside it. It starts at that value; with a time constant of 0 it follows at once.

    Parameter laws come after it.
    """

    STAGE: ClassVar[str] = "parameter law"
    follows: Mapping[Symbol, Symbol]

    def made(self) -> dict[str, Expr]:
        return {f"time_constant_{target.name}": constant for target, constant in self.follows.items()}

    def neutral(self) -> dict[str, Expr]:
        return dict.fromkeys(self.made(), sympify(0))


@dataclass(frozen=True, kw_only=True)
class Force(Effect):
    """Adds a force [N] to each axis. A force that uses ``normal_x, normal_y`` is drawn anew at each sample and held.

    ``impulse`` [N·s] acts at once where a held input changes, before the step in which the new value holds; what the
    first step finds is no change. In ``u_x, u_y``, the force as the actuators give it, a force without states belongs
    to the actuators' stage.
    """

    force: Pair
    energy: Energy | None
    states: tuple[State, ...] = ()
    impulse: Pair | None = None

    @property
    def stage(self) -> str:
        """The stage that the force belongs to."""
        return "actuator" if self.symbols & set(U) and not self.states else "force"

    def made(self) -> dict[str, Expr]:
        impulse = dict(zip(("impulse_x", "impulse_y"), self.impulse or (), strict=False))
        rates = {f"d_{state.symbol.name}": state.rate for state in self.states}
        return _sympified({"force_x": self.force[0], "force_y": self.force[1], **impulse, **rates})

    def neutral(self) -> dict[str, Expr]:
        return {name: sympify(0) for name in self.made() if not name.startswith("d_")}


@dataclass(frozen=True, kw_only=True)
class Map(Effect):
    """Rewrites the pair of signals at ``slot``: ``output`` is the new pair, written with the signal that enters the
    slot.

    Effects that share a slot see the same entering signal, and their changes add up.
    """

    slot: str
    output: Pair

    def __post_init__(self) -> None:
        if self.slot not in SLOTS:
            raise InputError(f"effect {self.id}: slot {self.slot!r} is unknown{nearest(self.slot, SLOTS)}")
        super().__post_init__()

    @property
    def stage(self) -> str:
        """The stage that the slot belongs to."""
        word = self.slot.split()[0]
        return "sampled block" if word == "sampled" else word

    def made(self) -> dict[str, Expr]:
        leaving = (symbol.name for symbol in SLOTS[self.slot].leaves)
        return _sympified(dict(zip(leaving, self.output, strict=True)))

    def neutral(self) -> dict[str, Expr]:
        return {symbol.name: symbol for symbol in SLOTS[self.slot].enters}


@dataclass(frozen=True, kw_only=True)
class Delay(Effect):
    """Holds the force back by exactly ``delay`` [s]: the integration is cut where the delayed force changes."""

    STAGE: ClassVar[str] = "actuator"
    slot: ClassVar[str] = "actuator delay"
    delay: Symbol

    def made(self) -> dict[str, Expr]:
        return {"delay": self.delay}

    def neutral(self) -> dict[str, Expr]:
        return {"delay": sympify(0)}


@dataclass(frozen=True, kw_only=True)
class Lag(Effect):
    """A first-order lag of the voltage with ``time_constant`` [s], updated exactly for a signal that is a polynomial in
    time over a step."""

    STAGE: ClassVar[str] = "amplifier"
    slot: ClassVar[str] = "amplifier lag"
    time_constant: Symbol

    def made(self) -> dict[str, Expr]:
        return {"time_constant": self.time_constant}

    def neutral(self) -> dict[str, Expr]:
        return {"time_constant": sympify(0)}
