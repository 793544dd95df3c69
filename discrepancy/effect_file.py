"""A term that was found, as the text of an effect file, and where it was seen to hold."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline
from sympy import Abs

from discrepancy.fitted import Fitted
from discrepancy.library import SIGNALS, Form
from discrepancy.record import Record
from discrepancy.refit import Fitter
from gyro_model.anatomy import Effect, Force
from gyro_model.errors import InputError
from gyro_model.model import Model, load_model

UNITS: Final = {"x": "m", "y": "m", "x_dot": "m/s", "y_dot": "m/s", "u_x": "N", "u_y": "N"}

_TEXT: Final = '''"""A force that no effect file states, found in measured data (SYSTEM.md section 9).

{formula}

A formula that fits, no explanation: it holds where it was seen, {range}.
"""

from sympy import {sympy}

from gyro_model.anatomy import {anatomy}
from gyro_model.quantities import size
from gyro_model.symbols import {signals}

{sizes}

EFFECT = Force(
    id="{id}",
    parameters=({parameters},),
    force=({force_x}, {force_y}),
    energy={energy},
    signature="{signature}",
    host_experiment="{host_experiment}",
    limits=(
        Limit(
            why="{why}",
            at={at},
            gives={gives},
        ),
    ),
)
'''


def write_effect(form: Form, folder: Path, peaks: Mapping[str, float]) -> tuple[Effect, Path]:
    """Writes ``form`` as an effect file to ``folder``; gives the effect as loaded from there. peaks: largest |signal|
    seen, by name, SI. Raises InputError where the folder can't be written."""
    path = write_text(folder / f"{form.id}.py", effect_text(form, peaks))
    return load_effect(path), path


def write_text(path: Path, text: str) -> Path:
    """Writes an effect file, and its folder where there is none. Raises InputError where that can't be."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"effect file {path}: can't be written ({error}); choose another folder") from None
    return path


def load_effect(path: Path) -> Effect:
    """The effect of a file. Raises InputError where it is none."""
    # Past the cache: a folder that was loaded before holds a new file now.
    return load_model.__wrapped__(path.parent).effect(path.stem)


def joined(model: Model, effects: Iterable[Effect]) -> Model:
    """The model with further effects, in the order of ``load_model``."""
    return Model(tuple(sorted((*model.effects, *effects), key=lambda e: (not e.nominal, e.id))), model.starts)


def effect_text(form: Form, peaks: Mapping[str, float]) -> str:
    """The Python of the effect file."""
    effect = form.effect(form.energy())
    used = [s.name for s in SIGNALS if s in effect.symbols | _balance(effect)]
    seen = [s.name for s in SIGNALS if s in effect.symbols]
    limit = effect.limits[0]
    sizes = "\n".join(
        f'{q.name.upper()} = size("{q.name}", "{q.unit}", "{q.description}")\n{q.name} = {q.name.upper()}.symbol'
        for q in effect.sizes
    )
    magnitudes = any(e.has(Abs) for e in (*effect.force, *_powers_of(effect)))
    text = _TEXT.format(
        formula="\n".join(f"    F_{a} = {e}" for a, e in zip("xy", effect.force, strict=True) if e != 0),
        range=", ".join(f"|{name}| <= {peaks[name]:.3g} {UNITS[name]}" for name in seen),
        sympy="Abs",
        anatomy="Energy, Force, Limit" if effect.energy else "Force, Limit",
        signals=", ".join(sorted(used)),
        sizes=sizes,
        id=effect.id,
        parameters=", ".join(q.name.upper() for q in effect.sizes),
        force_x=effect.force[0],
        force_y=effect.force[1],
        energy=_energy(effect),
        signature=effect.signature,
        host_experiment=effect.host_experiment,
        why=limit.why,
        at=repr(dict(limit.at)),
        gives=repr(dict(limit.gives)),
    )
    return text if magnitudes else text.replace("from sympy import Abs\n\n", "")


def _powers_of(effect: Force) -> tuple[object, ...]:
    return (effect.energy.stored, effect.energy.dissipated) if effect.energy else ()


def _balance(effect: Force) -> set[object]:
    return set().union(*(e.free_symbols for e in _powers_of(effect)))  # type: ignore[attr-defined]


def _energy(effect: Force) -> str:
    if effect.energy is None:
        return "None"
    kept = {k: v for k, v in (("stored", effect.energy.stored), ("dissipated", effect.energy.dissipated)) if v != 0}
    return f"Energy({', '.join(f'{k}={v}' for k, v in kept.items())})"


def peaks_of(records: Sequence[Record], at: Fitted) -> dict[str, float]:
    """The largest |x|, |x'| ... that the model fitted to ``records`` saw, by name, SI."""
    peaks = dict.fromkeys(UNITS, 0.0)
    for record, residual in zip(records, at.residuals, strict=True):
        for i, axis in enumerate("xy"[: record.axes]):
            q = (record.v[:, i] - residual[:, i]) / at.parameters[f"sense_gain_{axis}"]
            speed = CubicSpline(record.t, q)(record.t, 1)
            for name, values in ((axis, q), (f"{axis}_dot", speed), (f"u_{axis}", record.u[:, i])):
                peaks[name] = max(peaks[name], float(np.abs(values).max()))
    return peaks


def scales_of(fitter: Fitter, at: Fitted) -> dict[str, float]:
    """The root mean square of the measured signals, speed by the stiffness, by name, SI; 0 of an axis not there."""
    scales = dict.fromkeys(UNITS, 0.0)
    for i, axis in enumerate("xy"[: fitter.axes]):
        v = np.concatenate([r.v[:, i] for r in fitter.records])
        u = np.concatenate([r.u[:, i] for r in fitter.records])
        scales[axis] = float(np.sqrt(np.mean(v**2))) / at.parameters[f"sense_gain_{axis}"]
        scales[f"{axis}_dot"] = scales[axis] * float(np.sqrt(at.parameters[f"k{axis}{axis}"] / at.parameters["m"]))
        scales[f"u_{axis}"] = float(np.sqrt(np.mean(u**2)))
    return scales
