"""The model: all effects found in the effect folders, joined into one table of quantities and one ordered chain."""

import importlib.util
import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import ClassVar

from sympy import Symbol

from gyro_model import symbols
from gyro_model.anatomy import SLOTS, Delay, Effect, Follow, Force, Lag, Law, Map, Memory, State
from gyro_model.errors import InputError, nearest
from gyro_model.form import Form
from gyro_model.quantities import INPUTS, OUTPUTS, PARAMETERS, Quantity

EFFECTS_FOLDER = Path(__file__).parent / "effects"


@dataclass(frozen=True)
class Model(Form):
    """Effects in a fixed order (nominal ones first, then by id) with what follows from them; ``starts``: parameters
    (name, value) [SI] whose FMU starts at another value than the table of quantities says.

    Raises InputError where two effects claim one name, a symbol is unknown, or a delay or lag is not alone in its slot.
    """

    NAME: ClassVar[str] = "Gyroscope"
    DESCRIPTION: ClassVar[str] = (
        "MEMS vibratory gyroscope: two coupled axes, actuators, pickoff and amplifier with their effects"
    )
    CONVENTIONS: ClassVar[tuple[str, ...]] = (
        "A positive rate turns the package from x to y; seen from the package a free vibration then turns from y to x: "
        "F_x = 2 m omega_z y_dot, F_y = -2 m omega_z x_dot.",
        "Forces act as held from one communication point to the next, in the direction of their axis. The voltages "
        "v_x, v_y are samples: that number k is taken at k sample_period, just before inputs change there, and stands "
        "until the next. x, y, their velocities and the temperatures are for analysis.",
        "A size parameter switches its effect on where it differs from its start. Tunable ones may be set while the "
        "FMU runs and act from that instant; the others are fixed once initialization ends.",
    )
    STEP_SIZE: ClassVar[str] = "5e-6"
    LAYERS: ClassVar[tuple[str, ...]] = ("device", "full")
    EQUATION: ClassVar[bool] = True

    effects: tuple[Effect, ...]
    starts: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        common = ((q.name, "gyro_model/quantities.py") for q in (*INPUTS, *OUTPUTS, *PARAMETERS))
        _refuse_twins("quantity", [*common, *self._by_effect(lambda e: [q.name for q in e.parameters])])
        _refuse_twins("state", self._by_effect(_carried))
        for held in (Delay, Lag):
            alone = [(held.__name__, f"effect {e.id}") for e in self.effects if isinstance(e, held)]
            _refuse_twins(f"{held.__name__.lower()} in the chain:", alone)
        _refuse_twins("lag of", self._by_effect(lambda e: [t.name for t in e.follows] if isinstance(e, Follow) else []))
        for effect in self.effects:
            self._check_symbols(effect)
        self._check_targets()

    def _by_effect(self, names: Callable[[Effect], Iterable[str]]) -> list[tuple[str, str]]:
        """Names that effects claim, each with the effect."""
        return [(name, f"effect {effect.id}") for effect in self.effects for name in names(effect)]

    def __hash__(self) -> int:
        # An effect holds mappings, which have no hash.
        return hash((tuple(effect.id for effect in self.effects), self.starts))

    def starting_at(self, parameters: Mapping[str, float]) -> "Model":
        """The same model whose FMU, where nobody sets a parameter, is the device with ``parameters`` [SI].

        What an effect is neutral at stays. Raises InputError for an unknown name or a value out of bounds.
        """
        return Model(self.effects, tuple((name, self.parameter(name).check(v)) for name, v in parameters.items()))

    def parameter(self, name: str) -> Quantity:
        """The parameter of that name. Raises InputError with the nearest name where there is none."""
        try:
            return super().parameter(name)
        except InputError as error:
            if all((EFFECTS_FOLDER / f"{effect.id}.py").is_file() for effect in self.effects):
                where = "the folder of an effect of your own is named by --effects DIR, in Python effects=[folder]"
                raise InputError(f"{error}; {where}") from None
            raise

    def _check_symbols(self, effect: Effect) -> None:
        private = ("t", "since", "after", "q_x", "q_y", *(number.name for number in (*symbols.NORMAL, *symbols.PINK)))
        always = {*private, *(change.name for change in symbols.CHANGES)}
        if isinstance(effect, Map) and effect.stage == "sampled block":
            always |= {symbols.v_x_rate.name, symbols.v_y_rate.name}
        known = {*self.by_name, *always, *(state.symbol.name for state in self.states)}
        known |= {memory.symbol.name for memory in effect.memories}
        targets = effect.changes if isinstance(effect, Law) else effect.follows if isinstance(effect, Follow) else ()
        for name in sorted(symbol.name for symbol in effect.symbols | set(targets)):
            if name not in known:
                raise InputError(f"effect {effect.id}: symbol {name!r} is unknown{nearest(name, known)}")

        if effect.symbols & set(symbols.NORMAL) and effect.symbols & set(symbols.PINK):
            raise InputError(f"effect {effect.id}: uses normal and pink numbers; make two effects of it")

    def _check_targets(self) -> None:
        fixed = {symbols.m: "m, by which every force is divided beforehand"}
        for effect in self.effects:
            if isinstance(effect, Delay):
                fixed[effect.delay] = f"{effect.delay.name}, for which past forces are kept"
        for law in self.laws:
            for target in law.changes:
                if target in fixed:
                    raise InputError(f"effect {law.id}: a law can't change {fixed[target]}")

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """Every FMI variable; the index is its value reference: inputs, outputs, parameters, then effect by effect."""
        return (*INPUTS, *OUTPUTS, *PARAMETERS, *(p for effect in self.effects for p in effect.parameters))

    @cached_property
    def tunable(self) -> frozenset[str]:
        """The parameters that may change while the device runs: the sizes, but for a delay, for which past forces are
        kept."""
        kept = {effect.delay.name for effect in self.effects if isinstance(effect, Delay)}
        return frozenset(q.name for q in self.quantities if q.role == "size" and q.name not in kept)

    @cached_property
    def states(self) -> tuple[State, ...]:
        """The continuous states that effects bring, after x, x_dot, y, y_dot."""
        return tuple(state for effect in self.effects if isinstance(effect, Force) for state in effect.states)

    @cached_property
    def start_of(self) -> dict[str, str]:
        """By the name of a state of the motion that of the parameter it starts at; the others start at zero."""
        own = {state.symbol.name: state.start.name for state in self.states if state.start}
        return {symbol.name: f"{symbol.name}_start" for symbol in symbols.STATES} | own

    @cached_property
    def memories(self) -> tuple[Memory, ...]:
        """What effects remember, that which flows first."""
        every = (memory for effect in self.effects for memory in effect.memories)
        return tuple(sorted(every, key=lambda memory: not memory.flows))

    @cached_property
    def state_symbols(self) -> tuple[Symbol, ...]:
        """All continuous states in order."""
        return (*symbols.STATES, *(state.symbol for state in self.states))

    @property
    def forces(self) -> tuple[Force, ...]:
        """The effects of the force stage."""
        return tuple(e for e in self.effects if isinstance(e, Force))

    @cached_property
    def laws(self) -> tuple[Law, ...]:
        """The parameter laws, each after those that change what it reads.

        Raises InputError where they go round in a circle.
        """
        waiting = [e for e in self.effects if isinstance(e, Law)]
        ordered: list[Law] = []
        while waiting:
            ready = next((law for law in waiting if not any(_reads(law, other) for other in waiting)), None)
            if ready is None:
                circle = ", ".join(law.id for law in _circle(waiting))
                raise InputError(f"effects {circle}: each law reads what another of them changes; break the circle")
            waiting.remove(ready)
            ordered.append(ready)
        return tuple(ordered)

    @cached_property
    def followed(self) -> dict[Symbol, Follow]:
        """The quantities that may lag, in order, with the effect that makes them."""
        return {target: e for e in self.effects if isinstance(e, Follow) for target in e.follows}

    def wakers(self, effect: Effect) -> tuple[Law, ...]:
        """The laws that change a size of ``effect``: where one acts, the effect does."""
        sizes = {q.symbol for q in effect.sizes}
        return tuple(law for law in self.laws if sizes & set(law.changes))

    def in_slot(self, slot: str) -> tuple[Map, ...]:
        """The maps at one place of the chain."""
        return tuple(e for e in self.effects if isinstance(e, Map) and e.slot == slot)

    def effect(self, effect_id: str) -> Effect:
        """The effect of that id. Raises InputError with the nearest id where there is none."""
        for effect in self.effects:
            if effect.id == effect_id:
                return effect
        raise InputError(f"effect {effect_id!r} is unknown{nearest(effect_id, [e.id for e in self.effects])}")


def _reads(law: Law, other: Law) -> bool:
    # Laws that change one target, each from the other's value, come in any order.
    return law is not other and bool(set(other.changes) & (law.symbols - set(law.changes)))


def _circle(waiting: list[Law]) -> list[Law]:
    """Of laws that wait for one another, those that another one waits for."""
    awaited = [law for law in waiting if any(_reads(other, law) for other in waiting)]
    return waiting if len(awaited) == len(waiting) else _circle(awaited)


def _carried(effect: Effect) -> list[str]:
    """States of the motion and memories of an effect, by name."""
    states = effect.states if isinstance(effect, Force) else ()
    return [*(s.symbol.name for s in states), *(m.symbol.name for m in effect.memories)]


def _refuse_twins(kind: str, named: Iterable[tuple[str, str]]) -> None:
    """Of names, each with where it is defined, none may come twice, capitals or not: the C names them in capitals."""
    seen: dict[str, str] = {}
    for name, where in named:
        if name.upper() in seen:
            raise InputError(f"{kind} {name!r} is defined twice, by {seen[name.upper()]} and by {where}; rename one")
        seen[name.upper()] = where


def _load_effect(path: Path) -> Effect:
    # The packaged files keep their importable name, so that one may use another's symbols; a user's files get a
    # private one.
    packaged = path.parent == EFFECTS_FOLDER
    name = f"gyro_model.effects.{path.stem}" if packaged else f"_user_effect_{path.stem}"
    if packaged and name in sys.modules:
        module = sys.modules[name]
    else:
        spec = importlib.util.spec_from_file_location(name, path)
        if spec is None or spec.loader is None:
            raise InputError(f"effect file {path}: can't be loaded as Python")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except InputError:
            raise
        except (Exception, SystemExit) as error:
            raise InputError(f"effect file {path}: {type(error).__name__}: {error}") from error
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        kinds = "Law, Follow, Force, Map, Delay, Lag"
        raise InputError(f"effect file {path}: defines no EFFECT; assign one of {kinds} to it")
    if effect.id != path.stem:
        raise InputError(f"effect file {path}: its id is {effect.id!r}; name the file {effect.id}.py")
    return replace(effect, doc=module.__doc__ or "")


@cache
def load_model(*folders: Path) -> Model:
    """The model of the packaged effects and those in further ``folders``, each file ``<id>.py`` with its ``EFFECT``.

    Raises InputError as ``read_model`` does, and where an effect in ``folders`` does not pass the checks of
    ``gyro_model.contract``.
    """
    model = read_model(*folders)
    if folders:
        from gyro_model.contract import check_files

        check_files(folders, model)
    return model


@cache
def read_model(*folders: Path) -> Model:
    """The same without the checks, for effects that are not finished.

    Raises InputError where a folder is missing, a file is no effect, or effects contradict one another.
    """
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"effect folder {folder}: is not a folder; name one that holds effect files")
    paths = [path for folder in (EFFECTS_FOLDER, *folders) for path in folder.glob("*.py") if path.stem != "__init__"]
    effects = [_load_effect(path) for path in paths]
    _refuse_twins("effect", ((effect.id, str(path)) for effect, path in zip(effects, paths, strict=True)))
    return Model(tuple(sorted(effects, key=lambda e: (not e.nominal, e.id))))


def chain(model: Model) -> tuple[tuple[str, tuple[Map, ...]], ...]:
    """The slots that some map occupies, in the order of the chain."""
    return tuple((slot, model.in_slot(slot)) for slot in SLOTS if model.in_slot(slot))
