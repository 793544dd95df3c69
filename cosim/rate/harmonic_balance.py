"""Periodic motion of a device under its drive loop, from the effect files, by alternating frequency and time.

Every state is a Fourier series of H harmonics of the drive frequency; the equations of motion hold for their first H
harmonics. What the effects do is evaluated at N instants of a period and taken apart into harmonics again, so that
any expression will do (T. M. Cameron, J. H. Griffin, Journal of Applied Mechanics 56, 1989; M. Krack, J. Gross,
Harmonic Balance for Nonlinear Vibration Problems, Springer 2019, chapter 2). Newton's method solves for the
coefficients, the frequency and the forces at once, with derivatives from the expressions:

    ω² a'' - harmonics of (force/m) = 0,  a state of first order: ω a' - harmonics of its rate = 0
    u_x = Re(iF e^{iψ} e^{iθ}),  u_y = Re(U e^{iψ} e^{iθ}),  ψ = ω (advance - delay)
    first harmonic of v_x as the drive loop holds it; of v_y zero where the sense loop is closed

The delay and the amplifier's lag are exact. An actuator with play remembers: its loop is closed by going round twice.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, Function, Heaviside, Pow, Symbol, lambdify, sympify

from gyro_model import symbols
from gyro_model.dynamics import Dynamics
from gyro_model.errors import InputError

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

LEVELS: Final = ((4, 32), (8, 128), (16, 512), (32, 1024))
"""Harmonics and instants, coarse to fine. Corners need many instants: a high Q keeps their harmonics out of the
motion, but not out of the force."""
MOVED: Final = 1e-10
"""The finer level is the last where it moves the first harmonics by less, over the swing of the drive, and the drive
force by less than a hundred times that, relative."""
STEP: Final = 1e-10
"""Newton's method ends with a step below this, relative: its error is then the square of that, or rounding."""
STEPS: Final = 30
SHORTEST: Final = 1 / 64
"""A Newton step is halved no further."""
LEAST: Final = 1e-3
"""Continuation gives up where the effects can't grow by this share at once."""


class Wanted(NamedTuple):
    """What the loops hold.

    amplitude of x [m]: held where ``voltage`` is None, else a first guess; voltage: first harmonic of v_x times
    ``correction`` [V]; advance: by how much the commands come early [s]; closed: the first harmonic of v_y is zero.
    """

    amplitude: float
    voltage: float | None
    correction: complex
    advance: float
    closed: bool


class Periodic(NamedTuple):
    """A periodic motion: ω [rad/s], force F [N], first harmonic of x [m] and of both voltages, corrected [V]; force U
    on y [N]; slope: what a rate adds to the sense channel [V or N per rad/s]; moved: by how much the last refinement
    moved the first harmonics, over the amplitude."""

    omega: float
    force: float
    x: complex
    v_x: complex
    v_y: complex
    u_y: complex
    slope: complex
    moved: float


class Unsettled(Exception):
    """No periodic motion was found; ``walls``: names of the parameters of the plates that it reached."""

    def __init__(self, walls: tuple[str, ...] = ()) -> None:
        super().__init__("no periodic motion")
        self.walls = walls


class Harmonics(NamedTuple):
    """Series a_0 + Σ a_k cos kθ + b_k sin kθ, coefficients in that order, on instants θ: values = ``series`` @
    coefficients, coefficients = ``parts`` @ values; ``slope`` @ coefficients are those of d/dθ. ``first`` @ values is
    the complex first harmonic."""

    theta: Floats
    series: Floats
    parts: Floats
    slope: Floats
    first: Complexes


@cache
def harmonics(count: int, instants: int) -> Harmonics:
    """``count`` harmonics on so many instants."""
    theta = 2 * np.pi * np.arange(instants) / instants
    angle = theta[:, None] * np.arange(1, count + 1)
    series = np.ones((instants, 2 * count + 1))
    series[:, 1::2], series[:, 2::2] = np.cos(angle), np.sin(angle)
    parts = 2 / instants * series.T
    parts[0] = 1 / instants
    slope = np.zeros((2 * count + 1, 2 * count + 1))
    for k in range(1, count + 1):
        slope[2 * k - 1, 2 * k], slope[2 * k, 2 * k - 1] = k, -k
    return Harmonics(theta, series, parts, slope, 2 / instants * np.exp(-1j * theta))


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


class _Evaluated(NamedTuple):
    """Residuals and their Jacobian in scaled unknowns; by_rate: derivative of the residuals by the rate of turn; first
    harmonics of the voltages, corrected, and what unknowns and rate do to them."""

    residual: Floats
    jacobian: Floats
    by_rate: Floats
    voltage: Complexes
    voltage_slopes: Complexes
    voltage_by_rate: Complexes


class Balance:
    """The balance of one device with parameters ``p`` under what the loops hold, at one level of detail.

    The unknowns are scaled: coefficients coordinate by coordinate, over the amplitude where they are lengths, then ω,
    F and, where the sense loop is closed, Re U and Im U.
    """

    def __init__(
        self, of: Equations, p: Mapping[str, float], wanted: Wanted, scale: tuple[float, float], level: tuple[int, int]
    ) -> None:
        self.of, self.wanted, self.level = of, wanted, level
        self.basis = harmonics(*level)
        self.omega_z = p["omega_z"]
        self.p = [p[symbol.name] for symbol in of.parameters]
        self.delay, self.lag = of.fixed(*self.p)
        self.omega, self.gain = scale
        length = wanted.amplitude
        sizes = [length if c.unit == "m" else 1.0 for c in of.coordinates]
        self.width = 2 * level[0] + 1
        forces = [p["m"] * self.omega**2 * length] * (3 if wanted.closed else 1)
        self.scales = np.array([*np.repeat(sizes, self.width), self.omega, *forces])
        orders = [1 if c.velocity is None else 2 for c in of.coordinates]
        volts = abs(self.gain * length)
        self.residual_scales = np.array(
            [
                *np.repeat([s * self.omega**n for s, n in zip(sizes, orders, strict=True)], self.width),
                *[volts] * (4 if wanted.closed else 2),
            ]
        )
        rest = of.wall_values(*np.zeros(len(of.variables)), *self.p)
        self.signs = [np.sign(value) for value in rest]

    def started(self) -> Floats:
        """The start of the search: x swings with the amplitude at its resonance, all else rests."""
        z = np.zeros(len(self.scales))
        z[1] = 1.0
        z[len(self.of.coordinates) * self.width] = 1.0
        return z

    def refined(self, z: Floats, level: tuple[int, int]) -> Floats:
        """The unknowns ``z`` of this level as those of a finer one."""
        n, width = len(self.of.coordinates), 2 * level[0] + 1
        padded = np.zeros((n, width))
        padded[:, : self.width] = z[: n * self.width].reshape(n, -1)
        return np.concatenate([padded.ravel(), z[n * self.width :]])

    def evaluate(self, scaled: Floats) -> _Evaluated:
        """Residuals and Jacobian. Raises Unsettled where the motion goes through a wall or an expression has no
        value."""
        z = scaled * self.scales
        n, h, of = len(self.of.coordinates), self.basis, self.of
        coefficients, omega = z[: n * self.width].reshape(n, -1), z[n * self.width]
        variables, moved = self._motion(coefficients, omega, z[n * self.width + 1 :])
        with np.errstate(all="ignore"):
            self._check_walls(variables)
            values = [np.broadcast_to(v, h.theta.shape) for v in of.motion.values(*variables, *self.p)]
            slopes = of.motion.slopes(*variables, *self.p)
        along, by_rate = self._along(of.motion.places, slopes, moved, len(values))
        rows, jacobian, by_rates = [], [], []
        for i, coordinate in enumerate(of.coordinates):
            order = 1 if coordinate.velocity is None else 2
            turned = np.linalg.matrix_power(h.slope, order)
            rows.append(omega**order * turned @ coefficients[i] - h.parts @ values[i])
            part = -h.parts @ along[i]
            part[:, i * self.width : (i + 1) * self.width] += omega**order * turned
            part[:, n * self.width] += order * omega ** (order - 1) * turned @ coefficients[i]
            jacobian.append(part)
            by_rates.append(-h.parts @ by_rate[i])
        voltage, by_unknown, by_omega_z = self._voltage(values[n:], along[n:], by_rate[n:], omega)
        held = self._held(voltage, by_unknown, by_omega_z, coefficients[0])
        residual = np.concatenate([*rows, held[0]]) / self.residual_scales
        whole = np.vstack([*jacobian, held[1]]) * self.scales / self.residual_scales[:, None]
        if not (np.isfinite(residual).all() and np.isfinite(whole).all()):
            raise Unsettled
        return _Evaluated(
            residual,
            whole,
            np.concatenate([*by_rates, held[2]]) / self.residual_scales,
            voltage,
            by_unknown * self.scales,
            by_omega_z,
        )

    def _motion(self, coefficients: Floats, omega: float, forces: Floats) -> tuple[list[Any], list[Floats | None]]:
        """Every variable at the instants, and its derivatives by the unknowns, shape (N, unknowns); None: of omega_z,
        which is none."""
        h, of, unknowns = self.basis, self.of, len(self.scales)
        first_force = len(of.coordinates) * self.width + 1
        states: dict[int, tuple[Floats, Floats]] = {}
        for i, c in enumerate(of.coordinates):
            columns = slice(i * self.width, (i + 1) * self.width)
            moved = np.zeros((len(h.theta), unknowns))
            moved[:, columns] = h.series
            states[c.state] = h.series @ coefficients[i], moved
            if c.velocity is not None:
                turning = h.series @ h.slope
                moved = np.zeros((len(h.theta), unknowns))
                moved[:, columns] = omega * turning
                moved[:, first_force - 1] = turning @ coefficients[i]
                states[c.velocity] = omega * moved[:, first_force - 1], moved
        late = self.wanted.advance - self.delay
        carrier = np.exp(1j * (h.theta + omega * late))
        # One column each of F, Re U, Im U: envelopes over them.
        envelopes = (np.array([1j]), np.array([1.0, 1j]))
        commands = []
        for axis, first in ((0, 0), (1, 1)):
            own = forces[first : first + len(envelopes[axis])]
            moved = np.zeros((len(h.theta), unknowns))
            values = np.zeros(len(h.theta))
            if len(own):
                each = (carrier[:, None] * envelopes[axis]).real
                moved[:, first_force + first : first_force + first + len(own)] = each
                moved[:, first_force - 1] = (1j * late * carrier[:, None] * envelopes[axis]).real @ own
                values = each @ own
            commands.append((values, moved))
        known = [*(states[i] for i in range(len(states))), *commands]
        known += self._remembered([*known])
        return [*(value for value, _ in known), self.omega_z], [*(moved for _, moved in known), None]

    def _remembered(self, known: list[tuple[Floats, Floats]]) -> list[tuple[Floats, Floats]]:
        """What is remembered from the instant before, once a period has gone by, with its derivatives."""
        of, instants = self.of, len(self.basis.theta)
        count, first = len(of.memories), len(known)
        if count == 0:
            return []
        # Commands depend on ω and the forces alone.
        place = len(of.coordinates) * self.width
        rows = np.column_stack([value for value, _ in known]).tolist()
        driven = np.array([moved[:, place:] for _, moved in known])
        values = np.zeros((count, instants))
        moved = np.zeros((count, instants, len(self.scales)))
        held, by = [0.0] * count, np.zeros((count, len(self.scales) - place))
        for row in rows:
            held = of.now.values(*row, *held, self.omega_z, *self.p)
        for j, row in enumerate(rows):
            values[:, j], moved[:, j, place:] = held, by
            at = (*row, *held, self.omega_z, *self.p)
            after = np.zeros_like(by)
            for (i, k), slope in zip(of.now.places, of.now.slopes(*at), strict=True):
                if slope:
                    after[i] += slope * (driven[k, j] if k < first else by[k - first])
            held, by = of.now.values(*at), after
        return list(zip(values, moved, strict=True))

    def _check_walls(self, variables: list[Any]) -> None:
        reached = [
            wall
            for wall, sign, value in zip(
                self.of.walls, self.signs, self.of.wall_values(*variables, *self.p), strict=True
            )
            if not np.all(np.sign(value) == sign)
        ]
        if reached:
            names = {symbol.name for wall in reached for symbol in wall.free_symbols - set(self.of.variables)}
            raise Unsettled(tuple(sorted(names)))

    def _along(
        self, places: tuple[tuple[int, int], ...], slopes: list[Any], moved: list[Floats | None], count: int
    ) -> tuple[list[Floats], list[Floats]]:
        """Derivatives of so many expressions by the unknowns, (N, unknowns), and by the rate of turn, (N,)."""
        instants = len(self.basis.theta)
        along = [np.zeros((instants, len(self.scales))) for _ in range(count)]
        by_rate = [np.zeros(instants) for _ in range(count)]
        for (i, j), slope in zip(places, slopes, strict=True):
            if (by := moved[j]) is None:
                by_rate[i] += slope
            else:
                along[i] += by * (slope if np.ndim(slope) == 0 else slope[:, None])
        return along, by_rate

    def _voltage(
        self, values: list[Any], along: list[Floats], by_rate: list[Floats], omega: float
    ) -> tuple[Complexes, Complexes, Complexes]:
        """First harmonics of the sampled voltages times the correction, shape (2,), and their derivatives by the
        unknowns, (2, unknowns), and by the rate of turn, (2,)."""
        h, place = self.basis, len(self.of.coordinates) * self.width
        # Value, unknowns, rate: columns that pass the lag alike.
        both = [np.column_stack([values[i], along[i], by_rate[i]]) for i in (0, 1)]
        if self.of.sample is None:
            passed = [h.first @ signal / (1 + 1j * omega * self.lag) for signal in both]
            for first in passed:
                first[1 + place] -= first[0] * 1j * self.lag / (1 + 1j * omega * self.lag)
        else:
            late = [self._lagged(signal, omega) for signal in both]
            arguments = [late[0][:, 0], late[1][:, 0], *self.p]
            sampled = [np.zeros_like(signal) for signal in late]
            for (i, j), slope in zip(self.of.sample.places, self.of.sample.slopes(*arguments), strict=True):
                sampled[i] += late[j] * (slope if np.ndim(slope) == 0 else slope[:, None])
            for signal, value in zip(sampled, self.of.sample.values(*arguments), strict=True):
                signal[:, 0] = value
            passed = [h.first @ signal for signal in sampled]
        rows = self.wanted.correction * np.array(passed)
        return rows[:, 0], rows[:, 1:-1], rows[:, -1]

    def _lagged(self, signal: Floats, omega: float) -> Floats:
        k = np.arange(len(signal) // 2 + 1)[:, None]
        spectrum = np.fft.rfft(signal, axis=0) / (1 + 1j * k * omega * self.lag)
        place = 1 + len(self.of.coordinates) * self.width
        spectrum[:, place] -= spectrum[:, 0] * (1j * k * self.lag / (1 + 1j * k * omega * self.lag))[:, 0]
        return np.fft.irfft(spectrum, len(signal), axis=0)

    def _held(
        self, voltage: Complexes, by_unknown: Complexes, by_rate: Complexes, x: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """What the loops make zero [V], and its derivatives by the unknowns and by the rate of turn."""
        target = self.wanted.voltage
        rows = [voltage[0].imag, voltage[0].real - (target or 0.0)]
        jacobian, by_rates = [by_unknown[0].imag, by_unknown[0].real], [by_rate[0].imag, by_rate[0].real]
        if target is None:
            # (|X|² - A²)/2A, as volts of a straight pickoff.
            amplitude = self.wanted.amplitude
            rows[1] = self.gain * (x[1] ** 2 + x[2] ** 2 - amplitude**2) / (2 * amplitude)
            jacobian[1] = np.zeros(len(self.scales))
            jacobian[1][1:3] = self.gain * x[1:3] / amplitude
            by_rates[1] = 0.0
        if self.wanted.closed:
            rows += [voltage[1].real, voltage[1].imag]
            jacobian += [by_unknown[1].real, by_unknown[1].imag]
            by_rates += [by_rate[1].real, by_rate[1].imag]
        return np.array(rows), np.array(jacobian), np.array(by_rates)

    def solved(self, z: Floats) -> Floats:
        """The unknowns that balance, by Newton's method from ``z``. Raises Unsettled."""
        now = self.evaluate(z)
        for _ in range(STEPS):
            step = _solve(now.jacobian, -now.residual)
            share = 1.0
            while True:
                try:
                    after = self.evaluate(z + share * step)
                    small = np.max(np.abs(step)) < STEP
                    if small or np.linalg.norm(after.residual) < (1 - 0.1 * share) * np.linalg.norm(now.residual):
                        break
                except Unsettled as reached:
                    if share <= SHORTEST:
                        raise reached from None
                if share <= SHORTEST:
                    raise Unsettled
                share /= 2
            z, now = z + share * step, after
            if share == 1.0 and np.max(np.abs(step)) < STEP:
                return z
        raise Unsettled

    def firsts(self, z: Floats) -> Floats:
        """The first harmonics of the coordinates and ω, scaled; the forces so that 1e-8 of the drive force counts as
        1e-10 of the amplitude: it is known to rounding times Q."""
        n = len(self.of.coordinates)
        series, omega, forces = z[: n * self.width].reshape(n, -1), z[n * self.width], z[n * self.width + 1 :]
        return np.array([*series[:, :3].ravel(), omega, *0.01 * forces / max(abs(forces[0]), 1e-12)])

    def periodic(self, z: Floats, moved: float) -> Periodic:
        """The motion that the unknowns say."""
        now = self.evaluate(z)
        n = len(self.of.coordinates)
        real = z * self.scales
        forces = real[n * self.width + 1 :]
        by_rate = _solve(now.jacobian, -now.by_rate)
        if self.wanted.closed:
            [re, im] = by_rate[-2:] * self.scales[-2:]
            slope = complex(re, im)
        else:
            slope = complex(now.voltage_slopes[1] @ by_rate + now.voltage_by_rate[1])
        return Periodic(
            float(real[n * self.width]),
            float(forces[0]),
            complex(real[1], -real[2]),
            complex(now.voltage[0]),
            complex(now.voltage[1]),
            complex(*forces[1:]) if self.wanted.closed else 0j,
            slope,
            moved,
        )


UNDETERMINED: Final = 10.0
"""A Newton step of so many scales comes from what next to nothing determines, such as the mean of a hysteresis that
never turns: of the solutions the smallest is taken."""


def _solve(matrix: Floats, right: Floats) -> Floats:
    try:
        step = np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
        if np.max(np.abs(step)) < UNDETERMINED:
            return step
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=1e-12)[0], dtype=np.float64)


def balanced(of: Equations, p: Mapping[str, float], neutral: Mapping[str, float], wanted: Wanted) -> Periodic:
    """The periodic motion of the device with parameters ``p`` [SI], held inputs among them.

    Where Newton's method finds none from the linear motion, the sizes of its effects grow from ``neutral``, by name.
    Raises Unsettled.
    """

    def at(share: float, level: tuple[int, int]) -> Balance:
        values = {**p, **{name: (1 - share) * n + share * p[name] for name, n in neutral.items()}}
        return Balance(of, values, wanted, scale_of(of, values), level)

    whole = at(1.0, LEVELS[0])
    try:
        z = whole.solved(whole.started())
    except Unsettled:
        z = _grown(at)
    for level in LEVELS[1:]:
        finer = at(1.0, level)
        next_z = finer.solved(whole.refined(z, level))
        moved = float(np.max(np.abs(finer.firsts(next_z) - whole.firsts(z))))
        whole, z = finer, next_z
        if moved < MOVED:
            break
    return whole.periodic(z, moved)


def scale_of(of: Equations, p: Mapping[str, float]) -> tuple[float, float]:
    """The resonance of x [rad/s] and the gain of its pickoff [V/m], for small motions about zero.

    Raises InputError where x has no stiffness.
    """
    at = [*np.zeros(len(of.variables)), *(p[symbol.name] for symbol in of.parameters)]
    with np.errstate(all="ignore"):
        slopes = dict(zip(of.motion.places, of.motion.slopes(*at), strict=True))
    stiffness, gain = -slopes[0, 0], slopes[len(of.coordinates), 0]
    if not stiffness > 0:
        raise InputError("x has no stiffness left at rest: make softening, v_bias or what else takes it away smaller")
    return float(stiffness) ** 0.5, float(gain)


def _grown(at: Callable[[float, tuple[int, int]], Balance]) -> Floats:
    """The unknowns of the coarsest level with all effects at their sizes, by continuation from none."""
    level = LEVELS[0]
    none = at(0.0, level)
    z, share, more = none.solved(none.started()), 0.0, 0.5
    while share < 1.0:
        more = min(more, 1.0 - share)
        try:
            z = at(share + more, level).solved(z)
        except Unsettled:
            more /= 4
            if more < LEAST:
                raise
            continue
        share, more = share + more, 2 * more
    return z
