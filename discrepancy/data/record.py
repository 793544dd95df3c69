"""One measured run as arrays: what every later step of a diagnosis works on."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Final, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from discrepancy.data.clipping import flat_tops
from gyro_model.errors import InputError, nearest

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Role = Literal["fit", "held-out"]
Hold = Literal["zero", "first", "band-limited"]
Senses = Literal["position", "velocity", "acceleration"]
Course = Literal["friction", "cube"]
SENSES: Final[tuple[Senses, ...]] = get_args(Senses)

CONDITIONS: Final = ("omega_z", "temperature", "a_x", "a_y", "v_bias")
"""Inputs beside the forces, as the FMU names them; a record may hold any of them."""

MINIMUM_SAMPLES: Final = 100
"""The first 50 samples give the initial state (docs/theory/records.md, eq. 2); as many must be left to be scored."""

MOST_MISSING: Final = 0.2
"""Share of the samples of v that may be missing: beyond, windows between them get rare."""

DRIVEN: Final = 1e-3
"""Of the force in the band where it is strongest, each two octaves wide, from which a band counts as driven."""

LEVELS: Final = ("v_x_level", "v_y_level")
"""Names of what the mean that was taken out of a velocity had of the motion [V], by axis: a shaft that turns freely
keeps one from its start on, which no sample tells from an offset of the sensor."""

RATE_TOLERANCE: Final = 1e-3
"""Relative. A crystal is good to 1e-4 and a time column printed with a few digits to less over a whole record; 1e-3
would already shift k/m by 2e-3."""


class Drift(NamedTuple):
    """What a sensor wanders by: taken out of a voltage [V] (n, axes), polynomials over the run to an ``order``."""

    taken: Floats
    order: int


@dataclass(frozen=True)
class Record:
    """One run. Sample k of ``v`` is taken at t_k, just before the force changes to u_k.

    name: the file's; sample_rate [Hz]; t (n,) [s]; u (n, axes) [N]; v (n, axes) [V]; conditions by FMU name, each (n,),
    SI; valid (n,): False where a sample is clipped. ``hold`` says how u runs between samples; ``senses``: what v shows;
    ``reference``: where that is no position, the frequency w [rad/s] at which gains are those of one
    (docs/theory/records.md, eq. 8); ``begun``: place [m] and speed [m/s] of x at its start, each times the gain, where
    these are known and no fit finds them; ``courses``: by kind, of forces that the motion makes itself beside u, each
    (n, axes) (``courses.py``); ``centred``: whether v is a velocity of which the mean was taken out; ``drift``: what a
    sensor wandered by, which was taken out of v, and beside which nothing slow counts (``wander.py``). Built by
    ``make_record``, or raises InputError where the arrays make no record.
    """

    name: str
    role: Role
    hold: Hold
    sample_rate: float
    t: Floats
    u: Floats
    v: Floats
    conditions: Mapping[str, Floats]
    valid: Bools
    senses: Senses = "position"
    reference: float = 1.0
    begun: tuple[float, float] | None = None
    courses: Mapping[Course, Floats] = field(default_factory=dict)
    centred: bool = False
    drift: Drift | None = None

    def __post_init__(self) -> None:
        try:
            _check_choice("role", self.role, get_args(Role))
            _check_choice("hold", self.hold, get_args(Hold))
            _check_choice("senses", self.senses, SENSES)
            self._check_shapes()
            self._check_numbers()
            check_time(self.t, self.sample_rate)
        except InputError as error:
            raise InputError(f"run {self.name}: {error}") from None

    @property
    def axes(self) -> int:
        """1 (x alone) or 2."""
        return int(self.v.shape[1])

    @property
    def order(self) -> int:
        """The derivative of the position that the sensors sense."""
        return SENSES.index(self.senses)

    @property
    def channels(self) -> dict[str, Floats]:
        """Every column but t by its name, each (n,)."""
        pairs = {f"{kind}_{axis}": values[:, i] for kind, values in (("u", self.u), ("v", self.v))
                 for i, axis in enumerate("xy"[: self.axes])}  # fmt: skip
        return pairs | dict(self.conditions)

    def steady(self, values: Floats) -> Floats:
        """``values`` (n, axes) [V] without the curves that a drift may be; as they are where v has none."""
        if self.drift is None:
            return values
        slow: Floats = curves(len(values), self.drift.order) @ (self._slow @ values[self.valid])
        return values - slow

    @cached_property
    def _slow(self) -> Floats:
        """What gives the numbers of the curves, (curves, valid samples): by weights that fall to nothing at both ends,
        so that a motion of some turns leaves less in them there."""
        assert self.drift
        n = len(self.t)
        weights = np.sqrt(np.sin(np.pi * (np.arange(n) + 0.5) / n))[self.valid]
        own = curves(n, self.drift.order)[self.valid]
        return np.asarray(np.linalg.pinv(own * weights[:, None]) * weights, np.float64)

    def _check_shapes(self) -> None:
        n = len(self.t)
        if n < MINIMUM_SAMPLES:
            raise InputError(f"{n} samples: a run needs at least {MINIMUM_SAMPLES}, 50 of which give its initial state")
        if self.u.shape != self.v.shape or self.v.shape not in ((n, 1), (n, 2)):
            raise InputError(f"t has shape ({n},), u {self.u.shape}, v {self.v.shape}: give (n,), (n, axes), (n, axes)")
        for kind, course in self.courses.items():
            if course.shape != self.u.shape:
                raise InputError(f"{kind} has shape {course.shape}, u {self.u.shape}: give the course of each axis")
        for name, values in self.conditions.items():
            if name not in CONDITIONS:
                raise InputError(f"condition {name!r} is unknown{nearest(name, CONDITIONS)}")
            if values.shape != (n,):
                raise InputError(f"{name} has shape {values.shape}: give ({n},)")
        if self.valid.shape != (n,):
            raise InputError(f"valid has shape {self.valid.shape}: give ({n},)")

    def _check_numbers(self) -> None:
        for name, values in {"t": self.t, **self.channels}.items():
            finite = np.isfinite(values)
            if not finite.all():
                row = int(np.argmin(finite))
                raise InputError(
                    f"column {name} holds no finite number in data row {row + 1} ({len(finite) - int(finite.sum())} "
                    "such rows): cut the run there into two files, or mend the rows"
                )


@lru_cache(maxsize=2)
def curves(n: int, order: int) -> Floats:
    """What is slow over a run of n samples: Legendre polynomials to that order, (n, order + 1)."""
    return np.asarray(np.polynomial.legendre.legvander(np.linspace(-1, 1, n), order), np.float64)


def make_record(
    name: str,
    t: ArrayLike,
    u: ArrayLike,
    v: ArrayLike,
    *,
    sample_rate: float | None = None,
    role: str = "fit",
    hold: str = "zero",
    senses: str = "position",
    conditions: Mapping[str, ArrayLike] | None = None,
) -> Record:
    """A record from arrays: t (n,) [s], u [N] and v [V] (n,) or (n, axes), conditions (n,).

    sample_rate: by default what t says. Velocity and acceleration of a mass that is held have no mean, which is taken
    out but of a velocity that is ``unheld``; ``reference`` is the frequency at which they are strongest. Clipped
    samples are found and masked, and so are those without a number in v, up to MOST_MISSING of them. Raises InputError
    as ``Record`` does.
    """
    time = np.ascontiguousarray(t, dtype=np.float64)
    force, voltage = (_columns(values) for values in (u, v))
    given = {key: np.ascontiguousarray(values, dtype=np.float64) for key, values in (conditions or {}).items()}
    rate = measured_rate(time) if sample_rate is None and len(time) > 1 else sample_rate
    gaps: Bools = np.logical_not(np.isfinite(voltage).all(axis=1))
    masked = 0 < gaps.sum() <= MOST_MISSING * len(gaps)
    if masked:
        k = np.arange(len(gaps))
        voltage = np.column_stack([np.interp(k, k[~gaps], column[~gaps]) for column in voltage.T])
    valid: Bools = np.logical_not(flat_tops(voltage).any(axis=1) | (gaps & masked))
    reference, centred = 1.0, False
    if senses != "position":
        # Under a window that no oscillation of a few periods has a mean in.
        window = valid * np.sin(np.pi * (np.arange(len(time)) + 0.5) / len(time)) ** 6
        centred = senses == "velocity" and not unheld(force, voltage)
        if centred or senses == "acceleration":
            voltage = voltage - window @ voltage / window.sum()
        reference = _strongest(voltage, rate or measured_rate(time))
    return Record(name, role, hold, rate, time, force, voltage, given, valid, senses, reference,  # type: ignore[arg-type]
                  centred=centred)  # fmt: skip


def is_driven(records: Iterable[Record]) -> bool:
    """Whether a force acts in any of the records; else all are free decays."""
    return any(record.u.any() for record in records)


def unheld(u: Floats, v: Floats) -> bool:
    """Whether velocities v (n, axes) answer most to the slowest part of a force u (n, axes), as those of a mass that no
    spring holds do: one that is held hardly moves then."""
    window = np.hanning(len(u))[:, None]
    force, answer = (np.sum(np.abs(np.fft.rfft((s - s.mean(axis=0)) * window, axis=0)) ** 2, axis=1) for s in (u, v))
    band = np.log2(np.arange(1, len(force))).astype(int) // 2
    pushed, moved = np.bincount(band, force[1:]), np.bincount(band, answer[1:])
    driven = pushed > DRIVEN * pushed.max()
    ratio = moved[driven] / pushed[driven]
    return bool(pushed.max() > 0 and driven[0] and ratio[0] == ratio.max())


def _strongest(v: Floats, rate: float) -> float:
    """The frequency [rad/s] at which v (n, axes) is strongest."""
    spectrum = np.abs(np.fft.rfft((v - v.mean(axis=0)) * np.hanning(len(v))[:, None], axis=0)).sum(axis=1)
    return 2 * np.pi * max(int(np.argmax(spectrum)), 1) * rate / len(v)


def measured_rate(t: Floats) -> float:
    """The samples a second [Hz] that t (n,) [s] says, holes aside: steps beyond 1.5 medians are none."""
    step = np.diff(t)
    return 1 / float(np.mean(step[step < 1.5 * np.median(step)]))


def check_time(t: Floats, sample_rate: float) -> None:
    """Raises InputError unless t (n,) [s] increases at ``sample_rate`` [Hz]."""
    step = np.diff(t)
    if not (step > 0).all():
        row = int(np.argmax(step <= 0)) + 1
        raise InputError(
            f"t does not increase in data row {row + 1} ({t[row - 1]:.9g} s, then {t[row]:.9g} s): "
            "sort the rows and remove repeated ones, or give t with more digits"
        )
    if isinstance(sample_rate, bool) or not isinstance(sample_rate, (int, float)) or not 0 < sample_rate < np.inf:
        raise InputError(f"sample_rate = {sample_rate!r}: give a positive number in Hz")
    rate = measured_rate(t)
    # The first and the last stamp may be off by a quarter of a period each, which counts in a short part of a run.
    if abs(rate / sample_rate - 1) > RATE_TOLERANCE + 0.5 / len(step):
        raise InputError(f"sample_rate = {sample_rate:g} Hz, but t steps at {rate:.6g} Hz{_guess(rate / sample_rate)}")


def _guess(ratio: float) -> str:
    """What a wrong rate is likely to come from; ``ratio`` is the rate by t over the rate stated."""
    units = {1e-3: "ms", 1e-6: "µs", 1e-9: "ns"}
    for factor, unit in units.items():
        if abs(ratio / factor - 1) < 0.01:
            return f": t looks as if it were in {unit}; give it in s"
    return ": correct sample_rate, or t (in s)"


def _columns(values: ArrayLike) -> Floats:
    array = np.asarray(values, dtype=np.float64)
    return np.ascontiguousarray(array[:, None] if array.ndim == 1 else array)


def _check_choice(key: str, value: object, valid: tuple[str, ...]) -> None:
    if value not in valid:
        raise InputError(f"{key} = {value!r}: use one of {', '.join(valid)}{nearest(str(value), valid)}")
