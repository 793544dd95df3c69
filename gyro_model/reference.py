"""The reference simulation: the same device by scipy's DOP853 at 1e-13, slow and independent of the C.

Sample k is taken just before the force changes to u_k, which is held until the next; a delayed force switches exactly
when it is due.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from sympy import Expr, Symbol, lambdify

from gyro_model import symbols
from gyro_model.anatomy import Delay, Lag, Law
from gyro_model.device import Device
from gyro_model.dynamics import Dynamics, normals_of
from gyro_model.errors import InputError
from gyro_model.quantities import INPUTS

Floats = NDArray[np.float64]
Normals = Callable[[str, int], tuple[float, float]]

TOLERANCE = 1e-13
STILL = (0.0, 0.0, 0.0, 0.0)
"""No voltage and no rate of it, where an expression depends on neither."""

FAR = 1.0
"""No device moves a metre: a simulation that does has diverged, and its steps would shrink without end."""

# What counts as zero beside rtol: 1e-12 of a picometre and of its velocity at 1 kHz, of the voltage that it makes at
# 1 V/um; of a kelvin.
_NEGLIGIBLE = {"m": 1e-24, "m/s": 1e-20, "V": 1e-18, "K": 1e-12, "1": 1e-18}


def no_noise(effect_id: str, sample: int) -> tuple[float, float]:
    """Random numbers of a simulation without noise."""
    return 0.0, 0.0


def simulate(device: Device, t: Floats, inputs: Mapping[str, Floats], normals: Normals = no_noise) -> dict[str, Floats]:
    """Simulates ``device`` over the samples at ``t`` [s], shape (n,), evenly spaced.

    inputs: by FMU name, SI, shape (n,), held over [t_k, t_{k+1}); missing ones stay at their start value. normals:
    numbers that an effect draws at a sample: standard normal, or pink where it uses pink ones. Gives v_x, v_y [V], both
    temperatures [K] and every state by name, each shape (n,), sample k as taken just before u changes to u_k. Raises
    InputError where shapes differ, an input is unknown, or the simulation diverges.
    """
    return _Simulation(device, t, inputs, normals).run()


class _Simulation:
    def __init__(self, device: Device, t: Floats, inputs: Mapping[str, Floats], normals: Normals) -> None:
        starts = {q.name: q.start for q in INPUTS}
        for name, values in inputs.items():
            if name not in starts or np.shape(values) != np.shape(t):
                raise InputError(f"input {name!r}: give a known input with one value a sample")
        self.t = t
        self.inputs = {name: np.broadcast_to(inputs.get(name, start), t.shape) for name, start in starts.items()}
        self.values: dict[str, Any] = device.all_parameters
        self.by_symbol = {Symbol(name, real=True): value for name, value in self.values.items()}
        self.normals = normals
        self.dynamics = Dynamics(tuple(e.id for e in device.model.effects if device.acts(e)), device.model)
        self.names = [state.name for state in self.dynamics.states]
        known = device.model.start_of
        self.starts = {place: known[name] for place, name in enumerate(self.names) if name in known}
        self.at_once = {f.state: f.source for f in self.dynamics.followers if self.values[f.time_constant.name] == 0}
        self.temperatures = self._compiled(self.dynamics.temperatures)
        self.rate = self._compiled(self.dynamics.rates)
        self.jumps = self._compiled(self.dynamics.jumps)
        self.voltage = self._compiled(self.dynamics.voltage)
        self.voltage_rate = self._compiled(self.dynamics.voltage_rate)
        self.sample = self._compiled(self.dynamics.sample)
        self.begun, self.now, self.renewed = (
            self._compiled(tuple(getattr(r, what) for r in self.dynamics.remembered))
            for what in ("start", "now", "sample")
        )
        self.flow = self._compiled(tuple(memory.start for memory in self.dynamics.flowing))
        self.memory = [0.0] * len(self.dynamics.remembered)
        self.delay = float(self.dynamics.delay.subs(self.by_symbol))
        self.lag = self._compiled((self.dynamics.time_constant,))
        self.lagging = any(isinstance(e, Lag) for e in self.dynamics.effects)
        units = (*self.dynamics.state_units, *(("V", "V") if self.lagging else ()))
        self.negligible = np.array([_NEGLIGIBLE[unit] for unit in units])

    def _compiled(self, exprs: tuple[Expr, ...]) -> Callable[..., Any]:
        drawn = [symbol for e in self.dynamics.effects for symbol in normals_of(e.id)]
        switches = [Symbol(f"after_{e.id}", real=True) for e in self.dynamics.effects]
        held = [symbols.BY_NAME[name] for name in self.inputs]
        arguments = (
            symbols.t,
            list(self.dynamics.states),
            [symbols.v_x, symbols.v_y, symbols.v_x_rate, symbols.v_y_rate],
            held,
            list(symbols.CHANGES),
            drawn,
            switches,
            [r.symbol for r in self.dynamics.remembered],
            symbols.since,
        )
        return lambdify(
            arguments,
            [expr.subs(self.at_once).subs(self.by_symbol) for expr in exprs],
            modules=[{"nearest_integer": np.rint}, "numpy"],
        )

    def _context(self, k: int, t: float, u: tuple[float, float], sample: int) -> tuple[Any, ...]:
        """What holds at ``t``: the inputs of index ``k``, the force ``u``, the noise of ``sample``, the switches, the
        memories and the sample period."""
        held = [
            u[0] if name == "u_x" else u[1] if name == "u_y" else float(values[k])
            for name, values in self.inputs.items()
        ]
        steps = (self.inputs[name.name] for name in symbols.CHANGES.values())
        changes = [float(values[k] - values[max(k - 1, 0)]) for values in steps]
        drawn = [number for e in self.dynamics.effects for number in self.normals(e.id, sample)]
        switches = [
            float(isinstance(e, Law) and e.event is not None and t >= self.values[e.event.name])
            for e in self.dynamics.effects
        ]
        return held, changes, drawn, switches, self.memory, self.t[1] - self.t[0]

    def _force(self, t: float) -> tuple[float, float]:
        """The force at the mass at time ``t``: the one commanded ``delay`` ago, before the start the first."""
        period = self.t[1] - self.t[0]
        # A hair before a switch is the switch.
        k = int(np.clip(np.floor((t - self.delay - self.t[0]) / period + 1e-9), 0, len(self.t) - 1))
        return float(self.inputs["u_x"][k]), float(self.inputs["u_y"][k])

    def _switches(self, begin: float, end: float) -> list[float]:
        """Instants inside (begin, end) at which the delayed force changes or an event falls."""
        events = [
            self.values[e.event.name] for e in self.dynamics.effects if isinstance(e, Law) and e.event is not None
        ]
        instants = [*events, *(self.t + self.delay if self.delay > 0 else [])]
        hair = 1e-9 * (end - begin)
        return sorted({float(s) for s in instants if begin + hair < s < end - hair})

    def _start(self) -> Floats:
        state = np.zeros(len(self.names))
        for place, start in self.starts.items():
            state[place] = self.values[start]
        for follower in self.dynamics.followers:
            state[self.names.index(follower.state.name)] = self.inputs[follower.source.name][0]
        context = self._context(0, self.t[0], self._force(self.t[0]), 0)
        if self.dynamics.flowing:
            state[-len(self.dynamics.flowing) :] = self.flow(self.t[0], state, STILL, *context)
        self.memory = self.begun(self.t[0], state, STILL, *context)
        return state

    def run(self) -> dict[str, Floats]:
        state = np.zeros(len(self.negligible))
        state[: len(self.names)] = self._start()
        acting = self._force(self.t[0])
        if self.lagging:
            state[-2:] = self.voltage(
                self.t[0], state[: len(self.names)], STILL, *self._context(0, self.t[0], acting, 0)
            )
        rows = []
        for k, t in enumerate(self.t):
            self.memory = self._renew(k, t, state, acting) if k > 0 else self.memory
            rows.append(self._row(k, t, state, acting))
            if k + 1 < len(self.t):
                state[[1, 3]] += self.jumps(t, state[: len(self.names)], STILL, *self._context(k, t, acting, k))
                border = [t, *self._switches(t, self.t[k + 1]), self.t[k + 1]]
                for begin, end in pairwise(border):
                    acting = self._force(0.5 * (begin + end))
                    state = self._advance(k, begin, end, state, acting)
        columns = np.array(rows).T
        return dict(
            zip(("v_x", "v_y", "temperature_structure", "temperature_circuit", *self.names), columns, strict=True)
        )

    def _renew(self, k: int, t: float, state: Floats, acting: tuple[float, float]) -> list[float]:
        """What is remembered from sample ``k`` on."""
        return list(self.renewed(t, state[: len(self.names)], STILL, *self._context(k - 1, t, acting, k)))

    def _row(self, k: int, t: float, state: Floats, acting: tuple[float, float]) -> list[float]:
        # The inputs are those held until now, the noise is that of this sample.
        own = state[: len(self.names)]
        context = self._context(max(k - 1, 0), t, acting, k)
        v = [*self.voltage(t, own, STILL, *context), *self.voltage_rate(t, own, STILL, *context)]
        if self.lagging:
            [lag] = self.lag(t, own, STILL, *context)
            v = [*state[-2:], *((v[:2] - state[-2:]) / lag if lag > 0 else v[2:])]
        temperatures = self.temperatures(t, own, v, *context)
        return [*self.sample(t, own, v, *context), *temperatures, *own]

    def _advance(self, k: int, begin: float, end: float, state: Floats, acting: tuple[float, float]) -> Floats:
        context = self._context(k, 0.5 * (begin + end), acting, k)
        n = len(self.names)

        def rate(t: float, s: Floats) -> list[float]:
            if not (abs(s[0]) < FAR and abs(s[2]) < FAR):
                raise InputError(f"reference diverged at {t:.9g} s: x or y is beyond {FAR:g} m; check effect sizes")
            moving = list(self.rate(t, s[:n], STILL, *context))
            if self.lagging:
                v = self.voltage(t, s[:n], STILL, *context)
                [lag] = self.lag(t, s[:n], STILL, *context)
                moving += [(v[i] - s[n + i]) / lag if lag > 0 else 0.0 for i in (0, 1)]
            return moving

        names = (*self.names, *(("v_x", "v_y") if self.lagging else ()))
        after = _solved(rate, begin, end, state, self.negligible, names)
        if self.lagging and self.lag(end, after[:n], STILL, *context)[0] <= 0:
            # No lag: the voltage is there at once.
            after[n:] = self.voltage(end, after[:n], STILL, *context)
        self.memory = list(self.now(end, after[:n], STILL, *context))
        return after


def _solved(
    rate: Callable[[float, Floats], Any],
    begin: float,
    end: float,
    state: Floats,
    negligible: float | Floats,
    names: Sequence[str],
) -> Floats:
    """The state at ``end``. Raises InputError where the integration does not come there, with the state that changes
    fastest there relative to itself."""
    result = solve_ivp(rate, (begin, end), state, method="DOP853", rtol=TOLERANCE, atol=negligible)
    reached = np.asarray(result.y[:, -1])
    if not result.success or not np.all(np.isfinite(reached)):
        with np.errstate(all="ignore"):
            haste = np.abs(np.asarray(rate(result.t[-1], reached), dtype=float)) / (np.abs(reached) + negligible)
        worst = int(np.argmax(np.where(np.isfinite(haste), haste, np.inf)))
        raise InputError(
            f"reference from {begin:.9g} s to {end:.9g} s: DOP853 stopped at {result.t[-1]:.9g} s with {names[worst]} "
            f"= {reached[worst]:.6g}, which changes fastest ({result.message}); check the sizes of effects on it"
        )
    return reached


def sensitivities(device: Device, names: tuple[str, ...], t: Floats, inputs: Mapping[str, Floats]) -> Floats:
    """Derivatives of the states at ``t`` by the parameters ``names``: shape (n, states, len(names)), by the
    variational equation.

    S' = (∂f/∂s) S + ∂f/∂p; at the start S is 1 where p is what the state starts at, else 0. Raises InputError as
    ``simulate`` does, and for a device with a delay, a lag, impulses or what remembers.
    """
    simulation = _Simulation(device, t, inputs, no_noise)
    left_out = [
        e.id
        for e in simulation.dynamics.effects
        if isinstance(e, (Delay, Lag)) or e.memories or getattr(e, "impulse", None)
    ]
    if left_out:
        raise InputError(f"sensitivities: {', '.join(left_out)} not covered; switch off first")
    dynamics, n = simulation.dynamics, len(simulation.names)
    by_state = simulation._compiled(tuple(dynamics.state_jacobian()))
    by_parameter = simulation._compiled(tuple(dynamics.parameter_jacobian(names)))
    state = np.zeros(n * (1 + len(names)))
    state[:n] = simulation._start()
    for place, start in simulation.starts.items():
        if start in names:
            state[n + place * len(names) + names.index(start)] = 1.0
    rows = [state]
    for k in range(len(t) - 1):
        acting = simulation._force(0.5 * (t[k] + t[k + 1]))
        context = simulation._context(k, 0.5 * (t[k] + t[k + 1]), acting, k)

        def rate(time: float, s: Floats, context: tuple[list[float], ...] = context) -> Floats:
            own, derivative = s[:n], s[n:].reshape(n, -1)
            jacobian = np.reshape(by_state(time, own, STILL, *context), (n, n))
            forcing = np.reshape(by_parameter(time, own, STILL, *context), (n, -1))
            moving = simulation.rate(time, own, STILL, *context)
            return np.concatenate((moving, (jacobian @ derivative + forcing).ravel()))

        labels = (*simulation.names, *(f"d{state}/d{name}" for state in simulation.names for name in names))
        rows.append(_solved(rate, t[k], t[k + 1], rows[-1], 1e-24, labels))
    return np.array(rows)[:, n:].reshape(len(t), n, len(names))
