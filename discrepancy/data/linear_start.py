"""Nominal values from nothing but the record: where the lab believes nothing, its own response says m, k and d.

The peaks of the response give the modes, and least squares of the weak form about them the rest (``linear_fit.py``).
The gain of the sensors is a gauge: m, k and d are those of the gain that is given, and where none is, a sensor has
1 V/m, or -1 V/m where it is connected the other way round. Without a force the mass is a gauge too, held at 1 kg.
"""

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from scipy.signal import csd, welch

from discrepancy.data.absorbers import carried
from discrepancy.data.cubes import cubes
from discrepancy.data.linear_fit import LOWEST, PERIODS, Complexes, WeakForm, axis_scales, equations, joined_form
from discrepancy.data.modes import Mode, answering
from discrepancy.data.record import Floats, Record, is_driven
from discrepancy.data.resisted import alternatives
from discrepancy.data.rubbed import rubbed
from discrepancy.data.sticking import sticking

WINDOWS: Final = 8
"""Of a run, for its spectra."""
FEW_PERIODS: Final = 8
"""Of the lowest mode in a window, where no run is as long as one of PERIODS: from the mode's harmonic, the eighth, to
LOWEST is the half width of a window's lobe."""
ROUNDS: Final = 3
"""Of the fit, whose weights follow the values found."""
RUBS: Final = 0.95
"""Share of what forces of third order leave of the force, that a friction beside them leaves at most: 0.02 to 0.93 of
19 of 22 sets that rub under sweeps, 0.99 of the other three, whose accelerometers see a friction of a thirtieth of the
force; 0.97 and more of 40 that do not rub."""
BADLY: Final = 0.7
"""Share of the force that is left, from which there is no linear model to start from."""
STRAIGHTER: Final = 0.25
"""Share of what a linear model leaves, below which forces of third order are beside it from the start: without them a
mass came out at 0.03 to 1.02 of itself, on 20 devices that a spring bends far, and with them at 0.98 to 1.01. There
they leave 3e-5 to 0.025 of what a linear model does."""
STICKING: Final = 0.3
"""The same of the force while a mass moves that friction holds otherwise: with the friction only noise is left."""
PARTS: Final = 4
"""Of a run without a mode, for its windows."""
LEAST: Final = 0.01
"""Periods of a run over which a spring is one."""
ALIKE: Final = 1.5
"""Ratio of two sensors' gains up to which an unlike mass on the two axes is left to the effects that say so."""
QUALITY: Final = 1e5
"""Highest quality factor that is believed: a damping that comes out lower, or negative, is set to it."""


def linear_start(records: Sequence[Record], gains: Sequence[float]) -> dict[str, float] | None:
    """Nominal values by FMU name, SI, for sensors of so many ``gains`` [V/m]; None where no linear model explains the
    runs."""
    driven = is_driven(records)
    found = _held(records, gains, driven, WINDOWS, PERIODS)
    if found is None and driven:
        # Of several modes, a mass that nothing holds may take up enough to pass for what moves.
        found = _of_modes(records, gains) or _hardly_held(records, gains)
    found = found or _held(records, gains, driven, 1, FEW_PERIODS)
    return found or (_while_it_moves(records, gains) if driven else None)


def _of_modes(records: Sequence[Record], gains: Sequence[float]) -> dict[str, float] | None:
    """The mass of a structure of more modes than one an axis, none of which explains the runs by itself, on springs
    that hold it at the frequencies of its first modes."""
    modes = answering(records)
    told = carried(records, modes, gains) if len(modes) > records[0].axes else None
    if told is None:
        return None
    values = _values([mode.frequency for mode in modes[: records[0].axes]], gains)
    scaled = {name: told.m * value for name, value in values.items() if name[0] in "kd"}
    return {**values, **scaled, "m": told.m}


def _held(
    records: Sequence[Record], gains: Sequence[float], driven: bool, windows: int, periods: float
) -> dict[str, float] | None:
    """The same of masses on springs, whose modes are seen in so many ``windows`` of a run and fitted in windows of so
    many ``periods``."""
    values = _values([_peak(records, axis, driven, windows) for axis in range(records[0].axes)], gains)
    for number in range(ROUNDS):
        found = _solved(records, values, driven, LOWEST, periods)
        if found is None and number and not driven:
            # The few windows of a short decay may move over a masked sample, or beyond its end.
            return values
        if found is None or any(found[k] <= 0 for k in ("kxx", "kyy") if k in found):
            return None
        values |= _passive(found, values)
    return values


def _while_it_moves(records: Sequence[Record], gains: Sequence[float]) -> dict[str, float] | None:
    """The same of a mass on a spring that a friction holds for most of the time."""
    told = sticking(records, gains[0])
    if told is None or told.left > STICKING:
        return None
    values = _values([0.0], gains)
    return values | _passive({"m": told.m, "kxx": told.k, "dxx": told.d}, values)


def sensor_gains(records: Sequence[Record]) -> list[float]:
    """Gains [V/m] that nobody knows: that of x is 1 V/m, that of y such that one mass moves on both axes; negative
    where the response would otherwise be that of a negative mass and stiffness."""
    axes = records[0].axes
    if not is_driven(records):
        return [1.0] * axes
    values = _values([_peak(records, axis, driven=True) for axis in range(axes)], [1.0] * axes)
    form = joined_form(records, values, LOWEST)
    masses = [scale or 1.0 for scale in axis_scales(form, values)] if form else [1.0] * axes
    gains = [abs(masses[0]) / mass for mass in masses]
    return [float(np.sign(gain) if 1 / ALIKE < abs(gain) < ALIKE else gain) for gain in gains]


def _hardly_held(records: Sequence[Record], gains: Sequence[float]) -> dict[str, float] | None:
    """The same of masses that hardly any spring holds, so that no mode is seen: windows are then a part of a run."""
    duration = min(len(record.t) / record.sample_rate for record in records)
    # All that may resist: of steps of a torque that fits as well without, the mass came out five times too large.
    told = min(alternatives(records, gains[0]), key=lambda own: own.left, default=None)
    if told is not None and told.left <= BADLY:
        least = told.m * (2 * np.pi * LEAST / duration) ** 2
        return _values([0.0], gains) | _passive({"m": told.m, "kxx": least, "dxx": told.d}, {"m": told.m})
    values = _values([PARTS * PERIODS / duration] * records[0].axes, gains)
    found = _solved(records, values, driven=True, lowest=0)
    if found is None:
        return None
    # A spring that turns the motion by no more than a hundredth of a period over a run is none.
    least = found["m"] * (2 * np.pi * LEAST / duration) ** 2
    found |= {k: max(found[k], least) for k in ("kxx", "kyy") if k in found}
    return values | _passive(found, values)


def _values(peaks: Sequence[float], gains: Sequence[float]) -> dict[str, float]:
    """A mass of 1 kg with modes at ``peaks`` [Hz]."""
    w = [2 * np.pi * peak for peak in peaks]
    values = {"m": 1.0, "kxx": w[0] ** 2, "dxx": w[0] / 100, "sense_gain_x": gains[0]}
    if len(w) == 2:
        values |= {"kyy": w[1] ** 2, "dyy": w[1] / 100, "kxy": 0.0, "dxy": 0.0, "sense_gain_y": gains[1]}
    return values


def _solved(
    records: Sequence[Record], values: Mapping[str, float], driven: bool, lowest: int, periods: float = PERIODS
) -> dict[str, float] | None:
    """m, k, d as ``response``; None where they explain too little."""
    plain = response(records, values, driven, lowest, periods)
    bent = response(records, values, driven, lowest, periods, bent=True)
    # A line through the same rows: a wider band tells more by itself.
    line = response(records, values, driven, lowest, periods, wide=True)
    if plain is None or bent is None or line is None:
        return None
    straighter = bent[1] < STRAIGHTER * line[1]
    tried = [plain]
    if straighter or plain[1] > BADLY:
        tried.insert(0 if driven and straighter else 1, bent)
    for found, left in tried:
        if left <= BADLY and found.get("m", values["m"]) > 0:
            return found
    return None


def response(
    records: Sequence[Record],
    values: Mapping[str, float],
    driven: bool,
    lowest: int,
    periods: float = PERIODS,
    *,
    bent: bool = False,
    rubbing: bool = False,
    wide: bool = False,
) -> tuple[dict[str, float], float] | None:
    """m, k, d by the weak form in windows as for ``values`` from the harmonic ``lowest`` on, and the share of the force
    that they leave unexplained; None where there is no such window. ``bent``: beside forces x³ and x² x' of each axis,
    without which a device that swings by itself, or is far from linear, has hardly a response; ``rubbing``: beside a
    friction of each; ``wide``: up to where the motion is strongest, as for ``bent``, if no mode is as high."""
    told = _told(records, values, driven, lowest, periods, bent=bent, rubbing=rubbing, wide=wide)
    return told and (dict(zip(told.names, told.solution, strict=False)), told.left)


class Bent(NamedTuple):
    """m, k, d beside forces -k3 x³ and -d2 x² x' of each axis, (k3, d2) [N/m³, N.s/m³], and the share of the force that
    all leave unexplained; friction: of each axis [N], zero where none plainly shows."""

    linear: dict[str, float]
    cubic: tuple[tuple[float, float], ...]
    left: float
    friction: tuple[float, ...]


def bent_response(records: Sequence[Record], values: Mapping[str, float], periods: float = PERIODS) -> Bent | None:
    """That of runs by the weak form in windows of so many ``periods``, without a force for a mass that is known; None
    where it has no window."""
    axes = records[0].axes
    told = _least_told(records, values, periods, rubbing=False)
    if told is None:
        return None
    friction = (0.0,) * axes
    beside = _least_told(records, values, periods, rubbing=True)
    if beside and beside.left < RUBS * told.left and min(beside.solution[-axes:]) > 0:
        told, friction = beside, tuple(beside.solution[-axes:])
    count = len(told.names)
    # The second column is the derivative of the first, 3 x² x'.
    own = told.solution[count : count + 2 * axes]
    cubic = tuple((k3, 3 * d2) for k3, d2 in zip(own[::2], own[1::2], strict=True))
    return Bent(dict(zip(told.names, told.solution, strict=False)), cubic, told.left, friction)


def one_an_axis(records: Sequence[Record], values: Mapping[str, float]) -> list[Mode] | None:
    """The modes of the linear part of ``bent_response``, of what nothing holds at the frequency of hardly any spring;
    None where that is none."""
    told = bent_response(records, values)
    if told is None or told.linear.get("m", values["m"]) <= 0:
        return None
    own = {**values, **told.linear}
    axes = "xy"[: records[0].axes]
    k, d = (np.array([[own[kind + "".join(sorted(a + b))] for a in axes] for b in axes]) for kind in "kd")
    squares, shapes = np.linalg.eigh(k / own["m"])
    least = 2 * np.pi * LEAST / min(len(record.t) / record.sample_rate for record in records)
    speeds = np.sqrt(np.maximum(squares, least**2))
    losses = np.maximum(np.diag(shapes.T @ d @ shapes) / own["m"], speeds / QUALITY)
    return [Mode(float(w / (2 * np.pi)), float(w / loss)) for w, loss in zip(speeds, losses, strict=True)]


def _least_told(
    records: Sequence[Record], values: Mapping[str, float], periods: float, *, rubbing: bool
) -> "_Told | None":
    """By all harmonics, or by those which an offset of the sensor or a constant force has no part in."""
    driven = is_driven(records)
    found = [_told(records, values, driven, lowest, periods, bent=True, rubbing=rubbing) for lowest in (0, LOWEST)]
    return min((own for own in found if own), key=lambda own: own.left, default=None)


class _Told(NamedTuple):
    """Of a weak form: the parameters' names, their values and those of other columns, the share of the force left."""

    names: tuple[str, ...]
    solution: list[float]
    left: float


def _told(
    records: Sequence[Record],
    values: Mapping[str, float],
    driven: bool,
    lowest: int,
    periods: float = PERIODS,
    *,
    bent: bool,
    rubbing: bool = False,
    wide: bool = False,
) -> _Told | None:
    records = rubbed(records) if rubbing else records
    # A spring that bends answers where no mode is.
    top_hz = max(_peak(records, axis, driven) for axis in range(records[0].axes)) if bent or wide else 0.0
    form = joined_form(records, values, lowest, periods, top_hz)
    if form is None:
        return None
    one = len(form.force) == 1
    names: tuple[str, ...] = ("m", "kxx", "dxx") if one else ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy")
    columns, target = equations(form, values, names)
    if not one:
        # Coriolis force is in proportion to the mass, which is sought.
        turning = np.concatenate((form.turning[1], -form.turning[0]))
        columns[:, 0] -= turning
        target = target - values["m"] * turning
    if not driven:
        columns, target, names = columns[:, 1:], target - values["m"] * columns[:, 0], names[1:]
    if bent:
        columns = np.column_stack((columns, cubes(records, values, lowest, periods, top_hz)))
    if rubbing:
        columns = np.column_stack((columns, _frictions(form)))
    a, b = np.vstack((columns.real, columns.imag)), np.concatenate((target.real, target.imag))
    size = np.linalg.norm(a, axis=0)
    if not (size > 0).all() or not np.isfinite(a).all():
        return None
    solution = np.linalg.lstsq(a / size, b, rcond=None)[0]
    left = float(np.sum((b - a / size @ solution) ** 2) / np.sum(b**2))
    return _Told(names, (solution / size).tolist(), left)


def _frictions(form: WeakForm) -> Complexes:
    """Columns of a friction of 1 N in the equation of each axis."""
    axes, rows = form.course.shape
    columns = np.zeros((axes, rows, axes), np.complex128)
    for axis in range(axes):
        columns[axis, :, axis] = -form.course[axis]
    return columns.reshape(axes * rows, axes)


def _passive(found: dict[str, float], values: Mapping[str, float]) -> dict[str, float]:
    """What was found, dampings of a passive device beside it."""
    m, one = found.get("m", values["m"]), "kyy" not in found
    for axis in "xy"[: 1 if one else 2]:
        least = float(np.sqrt(found[f"k{axis}{axis}"] * m)) / QUALITY
        found[f"d{axis}{axis}"] = max(found[f"d{axis}{axis}"], least)
    if not one:
        for kind in "kd":
            room = 0.9 * float(np.sqrt(found[f"{kind}xx"] * found[f"{kind}yy"]))
            found[f"{kind}xy"] = float(np.clip(found[f"{kind}xy"], -room, room))
    return found


def _peak(records: Sequence[Record], axis: int, driven: bool, windows: int = WINDOWS) -> float:
    """The frequency [Hz] at which a channel answers most to the force, or, without one, is strongest."""
    ratios: list[Floats] = []
    length = min(len(record.t) for record in records) // windows
    for record in records:
        v, rate = record.v[:, axis] - record.v[:, axis].mean(), record.sample_rate
        f, out = welch(v, rate, nperseg=length)
        if driven:
            power = sum(welch(u, rate, nperseg=length)[1] for u in record.u.T)
            # What the force has a part in: a line of the mains, where nothing drives, is no answer.
            told = sum(np.abs(csd(u, v, rate, nperseg=length)[1]) ** 2 for u in record.u.T)
            out = told / np.maximum(power, 1e-3 * power.max()) ** 2
        ratios.append(out)
    mean = np.mean(ratios, axis=0)[LOWEST:]
    return float(f[LOWEST:][int(np.argmax(mean))])
