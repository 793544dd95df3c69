"""What is left of the equations of motion and of what the loops hold, and its Jacobian, at one level of detail."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cosim.rate.harmonic_balance.equations import Equations
from cosim.rate.harmonic_balance.series import Complexes, Floats, harmonics


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


class Unsettled(Exception):
    """No periodic motion was found; ``walls``: names of the parameters of the plates that it reached."""

    def __init__(self, walls: tuple[str, ...] = ()) -> None:
        super().__init__("no periodic motion")
        self.walls = walls


class Evaluated(NamedTuple):
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

    def evaluate(self, scaled: Floats) -> Evaluated:
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
        return Evaluated(
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
