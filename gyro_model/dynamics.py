"""The whole device as expressions, composed from the effects that act: rates of the states, voltage, Jacobians.

The C of the FMU comes from the same effect files but not through here: it calls effect after effect. Both meet in the
tests.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeVar

from sympy import Expr, Matrix, Symbol

from gyro_model import symbols
from gyro_model.anatomy import SLOTS, Delay, Effect, Follow, Force, Lag, Map, Memory
from gyro_model.model import Model, load_model

Substitution = dict[Symbol, Expr]
_E = TypeVar("_E", bound=Effect)


def normals_of(effect_id: str) -> tuple[Symbol, Symbol]:
    """The two random numbers of one effect, told from those of others."""
    return Symbol(f"normal_x_{effect_id}", real=True), Symbol(f"normal_y_{effect_id}", real=True)


class Remembered(NamedTuple):
    """What an effect remembers and no state stands for: its ``symbol``, and what it is as it begins, now and after a
    sample, in ``symbol`` and the rest of the device, laws applied."""

    effect_id: str
    symbol: Symbol
    start: Expr
    now: Expr
    sample: Expr


class Follower(NamedTuple):
    """A quantity that lags: the state that stands for ``target`` nears ``source`` with ``time_constant`` [s]."""

    state: Symbol
    target: Symbol
    source: Symbol
    time_constant: Symbol


@dataclass(frozen=True)
class Dynamics:
    """The device with the effects ``acting`` (nominal ones always), in terms of states, inputs, parameters, t and
    switches ``after_ID``.

    ``u_x, u_y`` are the forces after the actuator delay. Raises InputError for an unknown effect id.
    """

    acting: tuple[str, ...] = ()
    model: Model = load_model()

    def __post_init__(self) -> None:
        for effect_id in self.acting:
            self.model.effect(effect_id)

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """The effects that act, in the model's order."""
        return tuple(e for e in self.model.effects if e.nominal or e.id in self.acting)

    @cached_property
    def states(self) -> tuple[Symbol, ...]:
        """x, x_dot, y, y_dot, then the states of acting effects, the quantities that lag, the memories that flow."""
        own = (state.symbol for e in self._of(Force) for state in e.states)
        lagging = (follower.state for follower in self.followers)
        return (*symbols.STATES, *own, *lagging, *(memory.symbol for memory in self.flowing))

    @cached_property
    def state_units(self) -> tuple[str, ...]:
        """The unit of each state."""
        own = (state.unit for e in self._of(Force) for state in e.states)
        lagging = (self.model.by_name[follower.source.name].unit for follower in self.followers)
        return ("m", "m/s", "m", "m/s", *own, *lagging, *(memory.unit for memory in self.flowing))

    @cached_property
    def flowing(self) -> tuple[Memory, ...]:
        """What acting effects remember that flows, as states."""
        return tuple(memory for e in self.effects for memory in e.memories if memory.flows)

    @cached_property
    def remembered(self) -> tuple[Remembered, ...]:
        """What acting effects remember besides."""
        rows = []
        for e in self.effects:
            terms = self._privately(e)
            for memory in e.memories:
                if not memory.flows:
                    start, now, sample = (
                        terms.get(f"{what}_{memory.symbol.name}", memory.symbol) for what in ("start", "now", "sample")
                    )
                    entering = self._entering(e, (start, now, sample))
                    rows.append(Remembered(e.id, memory.symbol, *self.under_laws(entering)))
        return tuple(rows)

    def _entering(self, effect: Effect, exprs: Iterable[Expr]) -> tuple[Expr, ...]:
        """``exprs`` with the signals that enter the slot of ``effect`` in terms of the command."""
        if not isinstance(effect, Map):
            return tuple(exprs)
        names = list(SLOTS)
        entering = self._along(names[1 : names.index(effect.slot)], symbols.u_x, symbols.u_y)
        known = dict(zip(SLOTS[effect.slot].enters, entering, strict=True))
        return tuple(expr.subs(known, simultaneous=True) for expr in exprs)

    @cached_property
    def followers(self) -> tuple[Follower, ...]:
        """The quantities that lag."""
        return tuple(
            Follower(Symbol(f"{target.name}_lagging", real=True), target, symbols.SET_BY.get(target, target), constant)
            for effect in self._of(Follow)
            for target, constant in effect.follows.items()
        )

    @cached_property
    def _actuated(self) -> tuple[Expr, Expr]:
        """The force after the actuators [N], laws not applied."""
        slots = [slot for slot in SLOTS if slot.startswith("actuator") and slot != Delay.slot]
        return self._along(slots, symbols.u_x, symbols.u_y)

    @cached_property
    def actuated(self) -> tuple[Expr, ...]:
        """The force after the actuators [N], from the one before them."""
        return self.under_laws(self._actuated)

    @cached_property
    def rates(self) -> tuple[Expr, ...]:
        """Time derivative of each state [SI/s]; TW 201137310, eq. 1, with the acting forces."""
        actuated = dict(zip((symbols.u_x, symbols.u_y), self.actuated, strict=True))
        return tuple(rate.subs(actuated, simultaneous=True) for rate in self.rates_under_force)

    @cached_property
    def rates_under_force(self) -> tuple[Expr, ...]:
        """The same where ``u_x, u_y`` are the force at the mass, after the actuators."""
        own: list[Expr] = []
        force: tuple[Expr, Expr] = (symbols.u_x, symbols.u_y)
        for effect in self._of(Force):
            terms = self._privately(effect)
            force = (force[0] + terms["force_x"], force[1] + terms["force_y"])
            own += [terms[f"d_{state.symbol.name}"] for state in effect.states]
        lagging = ((follower.source - follower.state) / follower.time_constant for follower in self.followers)
        flowing = (memory.rate for memory in self.flowing)
        rates = (symbols.x_dot, force[0] / symbols.m, symbols.y_dot, force[1] / symbols.m, *own, *lagging, *flowing)
        return self.under_laws(rates)

    @cached_property
    def jumps(self) -> tuple[Expr, Expr]:
        """By how much x_dot and y_dot jump where a held input changes by ``omega_z_change`` [m/s]."""
        impulses = [e.impulse for e in self._of(Force) if e.impulse is not None]
        total = (sum((i[axis] for i in impulses), symbols.t * 0) / symbols.m for axis in (0, 1))
        return self.under_laws(total)

    @cached_property
    def _picked_off(self) -> tuple[Expr, Expr]:
        """Voltage before the amplifier's lag [V], laws not applied."""
        names = list(SLOTS)
        slots = names[names.index("pickoff misalignment") : names.index("amplifier lag")]
        actuated = dict(zip((symbols.u_x, symbols.u_y), self._actuated, strict=True))
        first, second = self._under_force(slots)
        return first.subs(actuated, simultaneous=True), second.subs(actuated, simultaneous=True)

    def _under_force(self, slots: Iterable[str]) -> tuple[Expr, Expr]:
        return self._along(slots, symbols.x, symbols.y)

    @cached_property
    def picked_off(self) -> tuple[Expr, ...]:
        """Voltage before the amplifier's lag [V] where ``u_x, u_y`` are the force at the mass, after the actuators."""
        names = list(SLOTS)
        return self.under_laws(
            self._under_force(names[names.index("pickoff misalignment") : names.index("amplifier lag")])
        )

    @cached_property
    def amplified(self) -> tuple[Expr, ...]:
        """Voltage that enters the sampled block [V], from ``v_x, v_y`` after the amplifier's lag."""
        names = list(SLOTS)
        slots = names[names.index("amplifier offset") : names.index("sampled noise")]
        return self.under_laws(self._along(slots, symbols.v_x, symbols.v_y))

    def noise_force(self, effect: Effect) -> tuple[Expr, Expr]:
        """Force of an effect that draws numbers [N], in ``normal_x, normal_y``, laws not applied."""
        terms = effect.terms()
        return terms["force_x"], terms["force_y"]

    @cached_property
    def voltage(self) -> tuple[Expr, Expr]:
        """Voltage before the amplifier's lag [V]. What feeds through is the force as the actuators give it."""
        return self.under_laws(self._picked_off)

    @cached_property
    def voltage_rate(self) -> tuple[Expr, ...]:
        """Rate of ``voltage`` along the motion [V/s], parameters and inputs held."""
        by_time = self.under_laws(expr.diff(symbols.t) for expr in self._picked_off)
        along = [
            sum(slope * rate for slope, rate in zip(self.under_laws(slopes), self.rates, strict=True))
            for slopes in ([expr.diff(state) for state in self.states] for expr in self._picked_off)
        ]
        return tuple(still + moving for still, moving in zip(by_time, along, strict=True))

    @cached_property
    def sample(self) -> tuple[Expr, Expr]:
        """The sample [V] from ``v_x, v_y, v_x_rate, v_y_rate``: the voltage after the amplifier's lag and its rate."""
        names = list(SLOTS)
        first = names.index("sampled noise")
        entering, rates = (symbols.v_x, symbols.v_y), (symbols.v_x_rate, symbols.v_y_rate)
        amplified = self._along(names[names.index("amplifier offset") : first], *entering)
        moving = (
            sum((v.diff(symbol) * rate for symbol, rate in zip(entering, rates, strict=True)), v.diff(symbols.t))
            for v in amplified
        )
        known = dict(zip((*entering, *rates), (*amplified, *moving), strict=True))
        return self.under_laws(v.subs(known, simultaneous=True) for v in self._along(names[first:], *entering))

    @cached_property
    def delay(self) -> Expr:
        """Delay of the force [s]."""
        return next((self.under_laws((e.delay,))[0] for e in self._of(Delay)), symbols.t * 0)

    @cached_property
    def time_constant(self) -> Expr:
        """Time constant of the amplifier's lag [s]; 0 where there is none."""
        return next((self.under_laws((e.time_constant,))[0] for e in self._of(Lag)), symbols.t * 0)

    @cached_property
    def temperatures(self) -> tuple[Expr, ...]:
        """Temperature of the structure and of the circuit [K]."""
        return self.under_laws(symbols.SET_BY)

    def state_jacobian(self) -> Matrix:
        """Derivatives of ``rates`` by the states, shape (n, n)."""
        return Matrix(self.rates).jacobian(Matrix(self.states))

    def parameter_jacobian(self, names: Iterable[str]) -> Matrix:
        """Derivatives of ``rates`` by parameters of these names, shape (n, len(names)). Raises InputError for an
        unknown name."""
        return Matrix(self.rates).jacobian(Matrix([self.model.parameter(name).symbol for name in names]))

    def _of(self, kind: type[_E]) -> tuple[_E, ...]:
        return tuple(e for e in self.effects if isinstance(e, kind))

    def _privately(self, effect: Effect) -> dict[str, Expr]:
        numbers = symbols.PINK if effect.symbols & set(symbols.PINK) else symbols.NORMAL
        own = dict(zip(numbers, normals_of(effect.id), strict=True))
        own[symbols.after] = Symbol(f"after_{effect.id}", real=True)
        terms = {name: expr.subs(own) for name, expr in effect.terms().items()}
        # What holds is what is remembered as it is now.
        held = {m.symbol: terms[f"now_{m.symbol.name}"] for m in effect.memories if m.now is not None and not m.flows}
        return terms | {name: terms[name].subs(held) for name in effect.made()}

    @cached_property
    def _laws(self) -> Substitution:
        changed: Substitution = dict(symbols.SET_BY)
        changed |= {follower.target: follower.state for follower in self.followers}
        for law in self.model.laws:
            if law not in self.effects:
                continue
            terms = self._privately(law)
            changed |= {target: terms[target.name].subs(changed, simultaneous=True) for target in law.changes}
        return changed

    def under_laws(self, exprs: Iterable[Expr]) -> tuple[Expr, ...]:
        """``exprs`` with every parameter as the acting laws make it."""
        return tuple(expr.subs(self._laws, simultaneous=True) for expr in exprs)

    def _along(self, slots: Iterable[str], first: Expr, second: Expr) -> tuple[Expr, Expr]:
        signal = (first, second)
        for slot in slots:
            members = [e for e in self._of(Map) if e.slot == slot]
            outputs = [tuple(expr for name, expr in self._privately(e).items() if name in e.made()) for e in members]
            if outputs and SLOTS[slot].enters != SLOTS[slot].leaves:
                [changed] = outputs
            else:
                entering = SLOTS[slot].enters
                changed = tuple(entering[i] + sum(output[i] - entering[i] for output in outputs) for i in (0, 1))
            known = dict(zip(SLOTS[slot].enters, signal, strict=True))
            signal = (changed[0].subs(known, simultaneous=True), changed[1].subs(known, simultaneous=True))
        return signal
