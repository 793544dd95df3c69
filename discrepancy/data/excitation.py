"""What a data set can say about the nominal parameters: their Cramér–Rao bounds by the linear model.

The samples are v = G q(m, k, d, initial state) + white noise; each run has an initial state of its own, which takes its
share of what the run tells. Sense gains are held (gauge: with them free, nothing fixes m).
"""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from scipy.signal import lfilter

from discrepancy.data.linear_fit import Complexes, fit, mode_frequencies, parameter_scale, weak_form
from discrepancy.data.record import Floats, Record, is_driven

PARAMETERS: Final = {1: ("m", "kxx", "dxx"), 2: ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy")}
UNKNOWN: Final = 1e-11
"""Eigenvalue of the information matrix (unit diagonal) that counts as zero. Derivatives by differences are good to
1e-8, so that a direction without information shows up to 1e-16 times some tens; a bandwidth of 1e-3 of the frequency
tells k from m with 1e-6."""


def cramer_rao_bounds(records: tuple[Record, ...], nominal: Mapping[str, float]) -> dict[str, float]:
    """Relative bound (one standard deviation over ``parameter_scale``) of each nominal parameter from ``records``
    together; inf where they say nothing."""
    axes = records[0].axes
    names: tuple[str, ...] = PARAMETERS[axes]
    if not is_driven(records):
        # Without a force no sample knows the mass: it is held.
        names = names[1:]
    point = working_point(records, nominal)
    scale = np.array([parameter_scale(nominal, name) for name in names])
    information = sum((_information(record, point, names, scale) for record in records), np.zeros((len(names),) * 2))
    return dict(zip(names, _bounds(information).tolist(), strict=True))


def working_point(records: tuple[Record, ...], nominal: Mapping[str, float]) -> dict[str, float]:
    """Where to take derivatives: at the linear fit (median of the runs), since a resonance that is driven where it
    truly is would not answer at its nominal place; at the nominal values where the fit explains less than half."""
    forms = [weak_form(record, nominal) for record in records]
    fits = [fit(form, nominal) for form in forms if form is not None and form.force.any()]
    good = [found.values for found in fits if found.unexplained < 0.5]
    values = {name: float(np.median([found[name] for found in good])) for name in (good[0] if good else ())}
    # A damping that the fit left near zero would ring for ever.
    usable = all(values[name] > 0.1 * nominal[name] for name in values if name in ("dxx", "dyy"))
    if "dxy" in values:
        usable = usable and values["dxx"] * values["dyy"] > values["dxy"] ** 2
    return dict(nominal) | (values if usable else {})


def noise_level(v: Floats, sample_rate: float, highest_mode: float) -> float:
    """The white noise [V rms a sample] of one channel (n,).

    From the density between five times the highest mode and 0.45 of the sample rate, by its median, which single lines
    don't move; where there is no such band, from the lowest tenth of all densities.
    """
    n = len(v)
    window = np.hanning(n)
    power = np.abs(np.fft.rfft((v - v.mean()) * window)) ** 2 / np.sum(window**2)
    f = np.fft.rfftfreq(n, 1 / sample_rate)
    band = (f > 5 * highest_mode) & (f < 0.45 * sample_rate)
    # Of an exponential distribution, the median is ln 2 and the first decile -ln 0.9 of the mean.
    if np.count_nonzero(band) >= 20:
        variance = float(np.median(power[band])) / np.log(2)
    else:
        variance = float(np.quantile(power[1:], 0.1)) / -np.log(0.9)
    # A file without any noise still rounds: 1e-9 of the signal.
    return max(np.sqrt(variance), 1e-9 * float(np.std(v)), 1e-300)


def _information(record: Record, point: Mapping[str, float], names: tuple[str, ...], scale: Floats) -> Floats:
    """The information on the relative parameters from one run, its initial state taken out, (p, p)."""
    free = _free_motion(record, point)
    start, sigma = _start(record, point, free)
    step = _steps(record, point, names)
    columns = []
    for name, size, h in zip(names, scale, step, strict=True):
        high = _motion(record, dict(point) | {name: point[name] + h * size}, start)
        low = _motion(record, dict(point) | {name: point[name] - h * size}, start)
        columns.append((high - low) / (2 * h))
    # (n, axes, columns) in units of the noise, clipped samples out.
    weight = (_gains(point, record.axes) / sigma)[None, :, None]
    sensitivity = (np.stack(columns, axis=2) * weight)[record.valid].reshape(-1, len(names))
    nuisance = (free * weight)[record.valid].reshape(-1, free.shape[2])
    basis, _ = np.linalg.qr(nuisance / np.maximum(np.linalg.norm(nuisance, axis=0), 1e-300))
    left = sensitivity - basis @ (basis.T @ sensitivity)
    return np.asarray(left.T @ left)


def _bounds(information: Floats) -> Floats:
    """Square roots of the diagonal of the inverse, inf along directions without information."""
    size = np.sqrt(np.diag(information))
    if not size.all():
        bounds = np.full(len(size), np.inf)
        if size.any():
            told = size > 0
            bounds[told] = _bounds(information[np.ix_(told, told)])
        return bounds
    eigenvalues, vectors = np.linalg.eigh(information / np.outer(size, size))
    blind = eigenvalues < UNKNOWN
    variance = (vectors[:, ~blind] ** 2 / eigenvalues[~blind]).sum(axis=1)
    variance[(np.abs(vectors[:, blind]) > 1e-3).any(axis=1)] = np.inf
    return np.asarray(np.sqrt(variance) / size)


def _steps(record: Record, point: Mapping[str, float], names: tuple[str, ...]) -> list[float]:
    """Relative steps of the central differences.

    For m, k so small that the phase at the end moves by 1e-2 rad (error 1e-5 of the derivative); for d, by which the
    phase hardly moves, 1e-3."""
    phase = 2 * np.pi * mode_frequencies(point, record.axes)[-1] * (record.t[-1] - record.t[0])
    return [1e-3 if name.startswith("d") else min(1e-2 / phase, 1e-3) for name in names]


def _gains(point: Mapping[str, float], axes: int) -> Floats:
    return np.array([point["sense_gain_x"], point.get("sense_gain_y", 0.0)][:axes])


class _Modes(NamedTuple):
    """One sample of the motion with u held, by eigenmodes with Im >= 0 (the others are their conjugates).

    factor (modes,): of a sample; start (modes, s): from a state [q, q']; drive (modes, axes): from u; shape (axes,
    modes): to q, doubled where a conjugate stands behind it.
    """

    factor: Complexes
    start: Complexes
    drive: Complexes
    shape: Complexes


def _modes(record: Record, point: Mapping[str, float]) -> _Modes:
    """The run's modes, with its mean rate throughout."""
    axes = record.axes
    pairs = {kind: np.array([[point[kind + "xx"]]]) for kind in "kd"}
    if axes == 2:
        pairs = {k: np.array([[point[k + "xx"], point[k + "xy"]], [point[k + "xy"], point[k + "yy"]]]) for k in "kd"}
        rate = float(np.mean(record.conditions.get("omega_z", 0.0)))
        pairs["d"] = pairs["d"] + 2 * point["m"] * rate * np.array([[0.0, -1.0], [1.0, 0.0]])
    matrix = np.zeros((2 * axes, 2 * axes))
    matrix[:axes, axes:] = np.eye(axes)
    matrix[axes:] = np.hstack((-pairs["k"], -pairs["d"])) / point["m"]
    rates, vectors = np.linalg.eig(matrix.astype(np.complex128))
    start = np.linalg.inv(vectors)
    factor = np.exp(rates / record.sample_rate)
    drive = start[:, axes:] / point["m"] * ((factor - 1) / rates)[:, None]
    # Rounding leaves the imaginary part of a real eigenvalue at 1e-16 of its size.
    single = np.abs(rates.imag) < 1e-9 * np.abs(rates)
    kept = single | (rates.imag > 0)
    shape = np.where(single, 1, 2) * vectors[:axes]
    return _Modes(factor[kept], start[kept], drive[kept], shape[:, kept])


def _motion(record: Record, point: Mapping[str, float], start: Floats) -> Floats:
    """Q (n, axes) [m] from the state ``start`` (s,)."""
    q = np.zeros(record.v.shape)
    modes = _modes(record, point)
    for factor, first, drive, shape in zip(modes.factor, modes.start @ start, modes.drive, modes.shape.T, strict=True):
        entering = np.empty(len(q), np.complex128)
        entering[0] = first
        entering[1:] = sum(drive[i] * record.u[:-1, i] for i in range(record.axes))
        amplitude = lfilter([1], [1, -factor], entering)
        for i in range(record.axes):
            q[:, i] += shape[i].real * amplitude.real - shape[i].imag * amplitude.imag
    return q


def _free_motion(record: Record, point: Mapping[str, float]) -> Floats:
    """Q (n, axes, s) [m] from each unit start without force."""
    modes = _modes(record, point)
    time = np.arange(len(record.t))
    q = np.zeros((len(time), record.axes, 2 * record.axes))
    for factor, start, shape in zip(modes.factor, modes.start, modes.shape.T, strict=True):
        amplitude = np.exp(time * np.log(factor))[:, None, None]
        pattern = np.outer(shape, start)
        q += pattern.real * amplitude.real - pattern.imag * amplitude.imag
    return q


def _without_force(left: Floats, u: Floats) -> Floats:
    """What the model leaves (n, axes) without what follows u at once or a sample later: a feedthrough or a delay is
    no noise."""
    columns = np.hstack((u, np.vstack((u[:1], u[:-1])))) / max(float(np.abs(u).max()), 1e-300)
    solution = np.linalg.lstsq(columns, left, rcond=None)[0]
    return np.asarray(left - columns @ solution)


def _start(record: Record, point: Mapping[str, float], free: Floats) -> tuple[Floats, Floats]:
    """The state at t_0 (s,) that fits the first two periods of the lowest mode, 16 samples at least; and the noise of
    each channel (axes,) [V], from what the model leaves.

    An axis whose free motion there is below the noise (fitted to noise alone it comes to a third of it) starts at rest.
    """
    axes, modes = record.axes, mode_frequencies(point, record.axes)
    n = min(max(16, int(2 * record.sample_rate / modes[0])), len(record.t))
    gains = _gains(point, axes)
    forced = _motion(record, point, np.zeros(2 * axes))
    q = (record.v / gains - forced)[:n]
    columns = free[:n].reshape(-1, free.shape[2])
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    start = np.linalg.lstsq(columns / size, q.ravel(), rcond=None)[0] / size
    left = _without_force(record.v - gains * (forced + free @ start), record.u)
    sigma = np.array([noise_level(v, record.sample_rate, float(modes[-1])) for v in left.T])
    still = gains * np.sqrt(np.mean((free[:n] @ start) ** 2, axis=0)) < sigma
    start[:axes][still] = start[axes:][still] = 0.0
    return start, sigma
