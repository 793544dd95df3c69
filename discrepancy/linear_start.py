"""Nominal values from nothing but the record: where the lab believes nothing, its own response says m, k and d.

The peaks of the response give the modes, and least squares of the weak form about them the rest (``linear_fit.py``).
The gain of the sensors is a gauge: m, k and d are those of the gain that is given. Without a force the mass is a gauge
too, held at 1 kg.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from scipy.signal import welch

from discrepancy.linear_fit import WeakForm, equations, weak_form
from discrepancy.record import Floats, Record

WINDOWS: Final = 8
"""Of a run, for its spectra."""
LOWEST: Final = 4
"""Bins below which a peak is an offset or a drift."""
ROUNDS: Final = 3
"""Of the fit, whose weights follow the values found."""
BADLY: Final = 0.7
"""Share of the force that is left, from which there is no linear model to start from."""
QUALITY: Final = 1e5
"""Highest quality factor that is believed: a damping that comes out lower, or negative, is set to it."""


def linear_start(records: Sequence[Record], gains: Sequence[float] = (1.0, 1.0)) -> dict[str, float] | None:
    """Nominal values by FMU name, SI, for sensors of so many ``gains`` [V/m]; None where no linear model explains the
    runs."""
    axes = records[0].axes
    driven = any(record.u.any() for record in records)
    peaks = [2 * np.pi * _peak(records, axis, driven) for axis in range(axes)]
    values = {"m": 1.0, "kxx": peaks[0] ** 2, "dxx": peaks[0] / 100, "sense_gain_x": gains[0]}
    if axes == 2:
        values |= {"kyy": peaks[1] ** 2, "dyy": peaks[1] / 100, "kxy": 0.0, "dxy": 0.0, "sense_gain_y": gains[1]}
    for _ in range(ROUNDS):
        forms = [form for form in (weak_form(record, values) for record in records) if form is not None]
        if not forms:
            return None
        arrays = zip(*((f.force, f.q, f.velocity, f.acceleration, f.turning) for f in forms), strict=True)
        found = _solved(WeakForm(*(np.concatenate(parts, axis=1) for parts in arrays)), values, driven)
        if found is None:
            return None
        values |= found
    return values


def _solved(form: WeakForm, values: Mapping[str, float], driven: bool) -> dict[str, float] | None:
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
    a, b = np.vstack((columns.real, columns.imag)), np.concatenate((target.real, target.imag))
    size = np.linalg.norm(a, axis=0)
    if not (size > 0).all() or not np.isfinite(a).all():
        return None
    solution = np.linalg.lstsq(a / size, b, rcond=None)[0]
    left = float(np.sum((b - a / size @ solution) ** 2) / np.sum(b**2))
    found = dict(zip(names, (solution / size).tolist(), strict=True))
    m = found.get("m", values["m"])
    if left > BADLY or m <= 0 or any(found[k] <= 0 for k in ("kxx", "kyy") if k in found):
        return None
    for axis in "xy"[: 1 if one else 2]:
        least = float(np.sqrt(found[f"k{axis}{axis}"] * m)) / QUALITY
        found[f"d{axis}{axis}"] = max(found[f"d{axis}{axis}"], least)
    if not one:
        for kind in "kd":
            room = 0.9 * float(np.sqrt(found[f"{kind}xx"] * found[f"{kind}yy"]))
            found[f"{kind}xy"] = float(np.clip(found[f"{kind}xy"], -room, room))
    return found


def _peak(records: Sequence[Record], axis: int, driven: bool) -> float:
    """The frequency [Hz] at which a channel answers most to the force, or, without one, is strongest."""
    ratios: list[Floats] = []
    length = min(len(record.t) for record in records) // WINDOWS
    for record in records:
        f, out = welch(record.v[:, axis] - record.v[:, axis].mean(), record.sample_rate, nperseg=length)
        power = sum(welch(u, record.sample_rate, nperseg=length)[1] for u in record.u.T) if driven else np.ones_like(f)
        # Where nothing drives there is no answer to speak of.
        ratios.append(out / np.maximum(power, 1e-3 * power.max()))
    mean = np.mean(ratios, axis=0)[LOWEST:]
    return float(f[LOWEST:][int(np.argmax(mean))])
