"""The equations of a device as numpy functions, with their derivatives, from its effect files."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from sympy import Expr, Function, Heaviside, Pow, Symbol, lambdify, sympify

from gyro_model import symbols
from gyro_model.dynamics import Dynamics


class Coordinate(NamedTuple):
    """A state that has coefficients of its own; velocity: index of the state that is its rate, if one is; unit."""

    state: int
    velocity: int | None
    unit: str


_Function = Callable[..., list[Any]]


class _step(Function):
    """Heaviside's step, ½ at zero, which numpy has no expression for that takes arrays and numbers together."""


_ARRAYS: Final[list[Any]] = [{"_step": lambda value: np.heaviside(value, 0.5)}, "numpy"]
_NUMBERS: Final[list[Any]] = [{"_step": lambda value: 0.5 * ((value > 0) + (value >= 0))}, "math"]


class Compiled(NamedTuple):
    """Expressions as numpy functions: ``values``; ``slopes``: derivatives that are not zero, by ``places`` (expression,
    variable). Both take the variables, then the parameters."""

    values: _Function
    slopes: _Function
    places: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Equations:
    """The equations of the device with some effects, laws not among them, compiled. absent: parameters that are not
    there, with what they are then."""

    dynamics: Dynamics
    absent: tuple[tuple[str, float], ...]

    @cached_property
    def _all_rates(self) -> tuple[Expr, ...]:
        return self._present(self.dynamics.rates)

    def _present(self, exprs: Iterable[Expr]) -> tuple[Expr, ...]:
        known = {Symbol(name, real=True): sympify(value) for name, value in self.absent}
        return tuple(expr.subs(known) for expr in exprs)

    @cached_property
    def _reaching(self) -> tuple[int, ...]:
        """The states that x, y and the voltage depend on: a hysteresis of an axis that has none does not show."""
        every = self.dynamics.states
        shown = {*symbols.STATES} | {s for expr in self._present(self.dynamics.voltage) for s in expr.free_symbols}
        while True:
            rates = (rate for state, rate in zip(every, self._all_rates, strict=True) if state in shown)
            more = {symbol for rate in rates for symbol in rate.free_symbols}
            if more <= shown:
                return tuple(i for i, state in enumerate(every) if state in shown)
            shown |= more

    @property
    def states(self) -> tuple[Symbol, ...]:
        """The states that show."""
        return tuple(self.dynamics.states[i] for i in self._reaching)

    @property
    def rates(self) -> tuple[Expr, ...]:
        """Their rates."""
        return tuple(self._all_rates[i] for i in self._reaching)

    @cached_property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """The states without those that are the rate of another one."""
        states, units = self.states, [self.dynamics.state_units[i] for i in self._reaching]
        of: dict[int, int] = {}
        for i, rate in enumerate(self.rates):
            # One velocity belongs to one state, and is none that has a velocity itself.
            if rate in states and (j := states.index(rate)) not in of.values() and self.rates[j] not in states:
                of[i] = j
        velocities = set(of.values())
        return tuple(Coordinate(i, of.get(i), units[i]) for i in range(len(states)) if i not in velocities)

    @cached_property
    def memories(self) -> tuple[Symbol, ...]:
        """What maps of the actuators remember."""
        return tuple(remembered.symbol for remembered in self.dynamics.remembered)

    @cached_property
    def variables(self) -> tuple[Symbol, ...]:
        """What moves within a period, and the rate of turn: states, u_x, u_y, memories, omega_z."""
        return (*self.states, symbols.u_x, symbols.u_y, *self.memories, symbols.omega_z)

    @cached_property
    def parameters(self) -> tuple[Symbol, ...]:
        """What stays, by name."""
        used: set[Symbol] = set()
        for expr in (*self._exprs, *self._nows, *self._sample, self.dynamics.delay, self.dynamics.time_constant):
            used |= sympify(expr).free_symbols
        moving = {*self.variables, *self._sampled}
        return tuple(sorted(used - moving, key=lambda symbol: symbol.name))

    @property
    def _sampled(self) -> tuple[Symbol, Symbol]:
        return symbols.v_x, symbols.v_y

    @cached_property
    def _exprs(self) -> tuple[Expr, ...]:
        own = (self.rates[c.state if c.velocity is None else c.velocity] for c in self.coordinates)
        return (*own, *self._present(self.dynamics.voltage))

    @cached_property
    def _sample(self) -> tuple[Expr, ...]:
        return self._present(self.dynamics.sample)

    @cached_property
    def _nows(self) -> tuple[Expr, ...]:
        return self._present(remembered.now for remembered in self.dynamics.remembered)

    @cached_property
    def motion(self) -> Compiled:
        """Accelerations, or rates, of the coordinates, then both voltages before the lag."""
        return self._compiled(self._exprs, self.variables)

    @cached_property
    def now(self) -> Compiled:
        """What is remembered now, of u_x, u_y and what was."""
        return self._compiled(self._nows, self.variables, _NUMBERS)

    @cached_property
    def sample(self) -> Compiled | None:
        """The sampled voltages, of those after the lag; None where they are the same."""
        return None if self._sample == self._sampled else self._compiled(self._sample, self._sampled)

    @cached_property
    def fixed(self) -> _Function:
        """Delay of the force and time constant of the lag [s]."""
        return lambdify([*self.parameters], [self.dynamics.delay, self.dynamics.time_constant])

    @cached_property
    def walls(self) -> tuple[Expr, ...]:
        """What a negative power is taken of and the motion may bring to zero, such as a gap."""
        moving = set(self.variables)
        powers = {power for expr in self._exprs for power in expr.atoms(Pow) if power.exp.is_negative}
        return tuple(sorted((power.base for power in powers if power.base.free_symbols & moving), key=str))

    @cached_property
    def wall_values(self) -> _Function:
        """The values of ``walls``, of variables and parameters."""
        return lambdify([*self.variables, *self.parameters], list(self.walls), cse=True)

    def _compiled(
        self, exprs: tuple[Expr, ...], variables: tuple[Symbol, ...], modules: list[Any] = _ARRAYS
    ) -> Compiled:
        slopes = {
            (i, j): slope.replace(Heaviside, lambda value, *_: _step(value))
            for i, expr in enumerate(exprs)
            for j, variable in enumerate(variables)
            if (slope := expr.diff(variable)) != 0
        }
        arguments = [*variables, *self.parameters]
        return Compiled(
            lambdify(arguments, list(exprs), modules=modules, cse=True),
            lambdify(arguments, list(slopes.values()), modules=modules, cse=True),
            tuple(slopes),
        )


@cache
def equations(dynamics: Dynamics, absent: tuple[tuple[str, float], ...]) -> Equations:
    """The equations of ``dynamics`` without what is ``absent``, compiled once."""
    return Equations(dynamics, absent)
