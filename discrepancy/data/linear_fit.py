"""The nominal linear model fitted to one run as given, and with channels swapped, turned or scaled.

The equations of motion are multiplied by windowed harmonics and integrated by parts, so that no derivative of a
measured signal is taken and m, k, d enter linearly (docs/theory/records.md, eq. 3); windows are as long as 25
periods of the lowest mode.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import comb
from typing import Final, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from discrepancy.data.record import Floats, Record
from discrepancy.data.stretches import stretches

Complexes = NDArray[np.complex128]

PERIODS: Final = 25
"""Of the lowest mode in a window: it resolves 8 % of a mode's frequency with the three bins of a main lobe."""
BAND: Final = 1.5
"""Highest frequency, over the highest mode: above, the sensor's noise counts (m w² grows) and the response says
little."""
LOWEST: Final = 4
"""Harmonic of a window from which on an offset of the sensor is not seen: the lobe of sin⁶ ends there."""
QUIET: Final = 0.02
"""Of the rms of a whole run, below which it is at rest for its first half period."""
BRIDGED: Final = 20
"""Part of a period that a gap of the record may be, over which a straight line is off by a hundredth."""
STIFFNESS_ROOM: Final = 0.5
"""m, k may differ from nominal by this, relative: the widest first guess that the loop is made for."""
DAMPING_ROOM: Final = 10.0
"""d may differ by this factor: Q is the least known of all before a measurement, and says nothing about sign or
unit."""


def mode_frequencies(nominal: Mapping[str, float], axes: int) -> Floats:
    """Frequencies [Hz] of the undamped modes, rising, shape (axes,)."""
    stiffness = np.array([[nominal["kxx"]]])
    if axes == 2:
        stiffness = np.array([[nominal["kxx"], nominal["kxy"]], [nominal["kxy"], nominal["kyy"]]])
    return np.sqrt(np.maximum(np.linalg.eigvalsh(stiffness), 0) / nominal["m"]) / (2 * np.pi)


def is_held(records: Sequence[Record], nominal: Mapping[str, float]) -> bool:
    """Whether the longest run is as long as a period of the lowest mode: else no spring holds the mass in it."""
    duration = max(len(record.t) / record.sample_rate for record in records)
    return bool(mode_frequencies(nominal, records[0].axes)[0] * duration >= 1)


@dataclass(frozen=True)
class WeakForm:
    """Windowed harmonics of a run: force (axes, rows) [N], and of q, q', q'' likewise; ``turning`` is 2 w q' with the
    window's mean rate w (0 where the run has none); ``course``: that of a friction, 0 where there is none. Rows are
    weighted so that a resonance does not lose to the rest."""

    force: Complexes
    q: Complexes
    velocity: Complexes
    acceleration: Complexes
    turning: Complexes
    course: Complexes


class Windows(NamedTuple):
    """Where a run is looked at. record: with a lead where it begins at rest; starts: first samples of the windows;
    gains [V/m], one an axis; weight: of each harmonic [m/N]."""

    record: Record
    window: "_Window"
    starts: NDArray[np.int_]
    gains: list[float]
    weight: Floats

    def weighted(self, harmonics: Complexes) -> Complexes:
        """Rows (axes, windows * bins) of ``harmonics`` (axes, windows, bins)."""
        return (self.weight * harmonics).reshape(self.record.axes, -1)


def windows(
    record: Record, nominal: Mapping[str, float], lowest: int, periods: float, top_hz: float = 0.0
) -> Windows | None:
    """Those of so many ``periods`` of the lowest mode, from the harmonic ``lowest`` on, windows with clipped samples
    out; None where not one is left. top_hz: where the motion is strongest, if that is above the modes."""
    modes = mode_frequencies(nominal, record.axes)
    n = int(periods * record.sample_rate / modes[0])
    if n < 2 * PERIODS or n > len(record.t):
        return None
    record = _from_rest(record, n)
    starts = np.arange(0, len(record.t) - n + 1, max(n // 2, 1))
    starts = _whole(record.valid, starts, n, int(record.sample_rate / modes[0] / BRIDGED))
    if len(starts) == 0:
        return None
    gains = [nominal["sense_gain_x"], nominal.get("sense_gain_y", 1.0)][: record.axes]
    bins = np.arange(lowest, int(BAND * max(float(modes[-1]), top_hz) * n / record.sample_rate) + 1)
    bins = bins[bins < n // 2]
    w = 2 * np.pi * bins * record.sample_rate / n
    # As an error of the output, q = force/(k - m w²), but with the room that the nominal frequency has.
    k = nominal["m"] * (2 * np.pi * top_hz) ** 2 if top_hz else nominal["kxx"]
    weight = 1 / (np.abs(k - nominal["m"] * w**2) + 0.1 * k)
    return Windows(record, _Window(n, record.sample_rate, bins, w), starts, gains, weight)


def _whole(valid: NDArray[np.bool_], starts: NDArray[np.int_], n: int, short: int) -> NDArray[np.int_]:
    """The starts of windows of ``n`` samples without any that are masked; where there is none, without gaps longer than
    ``short``, over which what was measured runs straight."""
    whole = starts[sliding_window_view(valid, n)[starts].all(axis=1)]
    if len(whole):
        return whole
    bridged = valid.copy()
    for begin, end in stretches(~valid):
        bridged[begin:end] = end - begin <= short
    return starts[sliding_window_view(bridged, n)[starts].all(axis=1)]


def weak_form(
    record: Record, nominal: Mapping[str, float], lowest: int = 0, periods: float = PERIODS, top_hz: float = 0.0
) -> WeakForm | None:
    """The weak form of a run in ``windows`` of it; None where there is none."""
    own = windows(record, nominal, lowest, periods, top_hz)
    if own is None:
        return None
    record, window, starts = own.record, own.window, own.starts
    force = _force(record, window, starts, nominal["kxx"] / nominal["m"])
    q, velocity, acceleration = window.derivatives(record.v / own.gains, starts)
    omega = record.conditions.get("omega_z")
    mean_rate = np.zeros(len(starts)) if omega is None else sliding_window_view(omega, window.n)[starts].mean(axis=1)
    turning = 2 * mean_rate[:, None] * velocity
    course = _course(record.courses["friction"], own) if "friction" in record.courses else np.zeros_like(force)
    return WeakForm(*map(own.weighted, (force, q, velocity, acceleration, turning, course)))


def _from_rest(record: Record, n: int) -> Record:
    """A run that begins at rest, with ``n`` samples of rest before it: a window sees the blow at the begin of a run
    only where it begins before."""
    lead = max(n // (2 * PERIODS), 4)
    quiet = all(np.std(a[:lead], axis=0).max() < QUIET * np.std(a, axis=0).max() for a in (record.u, record.v))
    if not quiet:
        return record
    t = record.t[0] + np.arange(-n, 0) / record.sample_rate
    u, v = (np.vstack((np.tile(a[:lead].mean(axis=0), (n, 1)), a)) for a in (record.u, record.v))
    before = {name: np.concatenate((np.repeat(a[:1], n), a)) for name, a in record.conditions.items()}
    valid = np.concatenate((np.ones(n, np.bool_), record.valid))
    courses = {kind: np.vstack((np.zeros((n, record.axes)), course)) for kind, course in record.courses.items()}
    return replace(record, t=np.concatenate((t, record.t)), u=u, v=v, valid=valid, conditions=before, courses=courses)


def _course(course: Floats, own: Windows) -> Complexes:
    """What the course of a force drives v by, no sample of which is held."""
    order = own.record.order
    return np.asarray(own.window.derivatives(course, own.starts)[order] / own.record.reference**order)


def _force(record: Record, window: "_Window", starts: NDArray[np.int_], square: float) -> Complexes:
    """What drives v in the equation of motion: the force as often differentiated as the motion is in v.

    An acceleration also holds u/m itself, not smoothed by the mass, as it was just before the sample: the term (D² +
    ``square``) (u_- - u) more, with D² of a mode on its resonance at first, square k/m [1/s²].
    """
    phase = window.w / record.sample_rate
    u = window.derivatives(record.u, starts)
    force = u[record.order] * held(record.hold, phase)
    if record.order == 2 and record.hold == "zero":
        force = force + (u[2] + square * u[0]) * (np.exp(-1j * phase) - held("zero", phase))
    return np.asarray(force / record.reference**record.order)


def joined_form(
    records: Sequence[Record],
    nominal: Mapping[str, float],
    lowest: int = 0,
    periods: float = PERIODS,
    top_hz: float = 0.0,
) -> WeakForm | None:
    """The weak form of all runs, as ``weak_form``; None where not one window is left."""
    runs = (weak_form(record, nominal, lowest, periods, top_hz) for record in records)
    forms = [form for form in runs if form is not None]
    arrays = zip(*((f.force, f.q, f.velocity, f.acceleration, f.turning, f.course) for f in forms), strict=True)
    return WeakForm(*(np.concatenate(parts, axis=1) for parts in arrays)) if forms else None


def held(hold: str, phase: Floats) -> Complexes:
    """What a hold of the force between samples does to a harmonic that turns by ``phase`` [rad] a sample."""
    box = np.sinc(phase / (2 * np.pi))
    if hold == "zero":
        return box * np.exp(-0.5j * phase)
    return (box**2 if hold == "first" else np.ones_like(box)).astype(np.complex128)


class _Window:
    """The window sin⁶ over n samples and its derivatives; harmonics at whole ``bins`` of its length."""

    def __init__(self, n: int, sample_rate: float, bins: NDArray[np.int_], w: Floats) -> None:
        a = np.pi * (np.arange(n) + 0.5) / n
        rate = np.pi * sample_rate / n
        s, c = np.sin(a), np.cos(a)
        self.shapes = (
            s**6,
            6 * rate * s**5 * c,
            rate**2 * (30 * s**4 * c**2 - 6 * s**6),
            rate**3 * (120 * s**3 * c**3 - 96 * s**5 * c),
        )
        self.n, self.bins, self.w = n, bins, w

    def derivatives(self, signal: Floats, starts: NDArray[np.int_], most: int = 2) -> list[Complexes]:
        """Harmonics of a signal and its derivatives up to that of order ``most``, 3 at the highest, by parts."""
        under = [self.harmonics(signal, starts, order) for order in range(most + 1)]
        # Those of the window times exp(-iwt), by the rule of Leibniz.
        return [
            sum(comb(n, k) * (-1) ** n * (-1j * self.w) ** (n - k) * under[k] for k in range(n + 1))
            for n in range(most + 1)
        ]

    def harmonics(self, signal: Floats, starts: NDArray[np.int_], order: int) -> Complexes:
        """Of signal (samples, axes) in each window, under the derivative ``order`` of it: (axes, windows, bins)."""
        pieces = sliding_window_view(signal, self.n, axis=0)[starts]  # (windows, axes, n)
        return np.fft.rfft(pieces * self.shapes[order], axis=2)[:, :, self.bins].transpose(1, 0, 2) / self.n


@dataclass(frozen=True)
class Arrangement:
    """Which measured channel stands for which: ``swapped`` v_x and v_y; signs (axes,) of v."""

    swapped: bool
    signs: tuple[int, ...]

    def apply(self, form: WeakForm, factors: Sequence[float] = (1.0, 1.0)) -> WeakForm:
        """The run as it would be with this arrangement, and then v of each axis times ``factors``."""
        order = slice(None, None, -1) if self.swapped else slice(None)
        sign = (np.array(self.signs) * factors[: len(self.signs)])[:, None]
        q, velocity, acceleration, turning, course = (
            sign * own[order] for own in (form.q, form.velocity, form.acceleration, form.turning, form.course)
        )
        return WeakForm(form.force, q, velocity, acceleration, turning, course)

    @property
    def text(self) -> str:
        """What it changes, in words."""
        words = ["v_x and v_y (or u_x and u_y) look swapped"] if self.swapped else []
        turned = [axis for axis, sign in zip("xy", self.signs, strict=False) if sign < 0]
        words += [f"v_{axis} (or u_{axis}) looks to have the wrong sign" for axis in turned]
        return " and ".join(words)


def arrangements(axes: int) -> list[Arrangement]:
    """All of them, as given first. Turned or swapped forces are the same but for names: turning u_x and swapping u
    is turning v and swapping v and naming the axes anew."""
    if axes == 1:
        return [Arrangement(False, (1,)), Arrangement(False, (-1,))]
    signs = [(1, 1), (-1, 1), (1, -1), (-1, -1)]
    return [Arrangement(swapped, pair) for swapped in (False, True) for pair in signs]


@dataclass(frozen=True)
class LinearFit:
    """values: m, k, d by name (SI); unexplained: the share of the force's power that the model leaves."""

    values: Mapping[str, float]
    unexplained: float


def fit(form: WeakForm, nominal: Mapping[str, float]) -> LinearFit:
    """m, k, d within their room about nominal that explain the force best; k_xy, d_xy within the room of the mean."""
    one = len(form.force) == 1
    names: tuple[str, ...] = ("m", "kxx", "dxx") if one else ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy")
    columns, target = equations(form, nominal, names)
    if not form.force.any():
        # Nothing says how heavy it is: the mass is a gauge, and what it does stands for the force.
        columns, target, names = columns[:, 1:], target - nominal["m"] * columns[:, 0], names[1:]
    scale = np.array([parameter_scale(nominal, name) for name in names])
    low, high = np.array([_room(name, nominal) for name in names]).T
    rows = _real(np.column_stack((columns * scale, target)))
    # The triangle of a QR holds all that the many rows say; the search under bounds then takes 8 of them.
    triangle = np.asarray(np.linalg.qr(rows, mode="r")) / np.linalg.norm(rows[:, -1])
    result = lsq_linear(triangle[:, :-1], triangle[:, -1], bounds=(low, high))
    values = dict(zip(names, (result.x * scale).tolist(), strict=True))
    return LinearFit(values, float(2 * result.cost))


def parameter_scale(nominal: Mapping[str, float], name: str) -> float:
    """What a relative size of a parameter refers to: its nominal value, for k_xy, d_xy (which may be 0) the geometric
    mean of the two that they couple."""
    if name in ("kxy", "dxy"):
        return float(np.sqrt(nominal[name[0] + "xx"] * nominal[name[0] + "yy"]))
    return nominal[name]


def _room(name: str, nominal: Mapping[str, float]) -> tuple[float, float]:
    if name == "dxy":
        return -DAMPING_ROOM, DAMPING_ROOM
    if name.startswith("d"):
        return 0.0, DAMPING_ROOM
    if name == "kxy":
        centre = nominal["kxy"] / parameter_scale(nominal, "kxy")
        return centre - STIFFNESS_ROOM, centre + STIFFNESS_ROOM
    return 1 - STIFFNESS_ROOM, 1 + STIFFNESS_ROOM


def equations(form: WeakForm, nominal: Mapping[str, float], names: tuple[str, ...]) -> tuple[Complexes, Complexes]:
    """Columns (axes*rows, parameters) and target (axes*rows) of the equations of motion (docs/theory/plant.md, eq. 1),
    Coriolis at the nominal mass."""
    q, velocity, zero = form.q, form.velocity, np.zeros_like(form.q[0])
    if len(q) == 1:
        return np.stack([form.acceleration[0], q[0], velocity[0]], axis=1), form.force[0]
    by_name = {
        "m": (form.acceleration[0], form.acceleration[1]),
        "kxx": (q[0], zero),
        "kyy": (zero, q[1]),
        "kxy": (q[1], q[0]),
        "dxx": (velocity[0], zero),
        "dyy": (zero, velocity[1]),
        "dxy": (velocity[1], velocity[0]),
    }
    columns = np.stack([np.concatenate(by_name[name]) for name in names], axis=1)
    coriolis = nominal["m"] * np.concatenate((form.turning[1], -form.turning[0]))
    return columns, np.concatenate((form.force[0], form.force[1])).astype(np.complex128) + coriolis


def axis_scales(form: WeakForm, nominal: Mapping[str, float]) -> list[float | None]:
    """For each axis, by how much m and k of its own equation come out larger than nominal (the geometric mean of the
    two, signed by the stiffness), unbounded; None where the axis is not driven or the two disagree by over 3 times."""
    scales: list[float | None] = []
    for i in range(len(form.force)):
        own = np.concatenate(([form.acceleration[i], form.q[i]], form.velocity, np.delete(form.q, i, axis=0)))
        force = _real(form.force[i])
        a = _real(own.T)
        size = np.linalg.norm(a, axis=0)
        if not force.any() or not size.all():
            scales.append(None)
            continue
        mass, stiffness = (np.linalg.lstsq(a / size, force, rcond=None)[0] / size)[:2]
        m, k = mass / nominal["m"], stiffness / nominal["kxx" if i == 0 else "kyy"]
        # A common factor is a unit; two different ones are something else.
        agree = m * k > 0 and 1 / 3 < m / k < 3
        scales.append(float(np.sign(k) * np.sqrt(m * k)) if agree else None)
    return scales


def coriolis_gain(form: WeakForm, nominal: Mapping[str, float]) -> tuple[float, float] | None:
    """The factor on the Coriolis force that the run shows (1 by theory) and its standard deviation; None without
    rate."""
    if len(form.force) == 1 or not form.turning.any():
        return None
    names = ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy")
    columns, target = equations(form, nominal, names)
    coriolis = nominal["m"] * np.concatenate((form.turning[1], -form.turning[0]))
    # Rates far too large must not hide in the target: the column stands alone.
    a, b = _real(np.column_stack((columns, -coriolis))), _real(target - coriolis)
    size = np.linalg.norm(a, axis=0)
    solution, residual, rank, _ = np.linalg.lstsq(a / size, b, rcond=None)
    if rank < len(size) or residual.size == 0:
        return None
    inverse = np.linalg.inv((a / size).T @ (a / size))
    # Half-overlapping windows and three bins a lobe: about a fifth of the rows are independent.
    deviation = np.sqrt(5 * residual[0] / len(b) * inverse[-1, -1]) / size[-1]
    return float(solution[-1] / size[-1]), float(deviation)


def _real(values: Complexes) -> Floats:
    return np.concatenate((values.real, values.imag))
