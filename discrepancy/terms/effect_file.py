"""A term that was found, as the text of an effect file, and where it was seen to hold."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline
from sympy import Abs

from discrepancy.data.record import Record
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter
from discrepancy.terms.library import SIGNALS, Form
from gyro_model.anatomy import Effect, Force
from gyro_model.errors import InputError
from gyro_model.model import Model

UNITS: Final = {"x": "m", "y": "m", "x_dot": "m/s", "y_dot": "m/s", "u_x": "N", "u_y": "N"}

_DOC: Final = """A force that no effect file states, found in measured data.

Chosen from a library of terms by the Bayesian information criterion (G. Schwarz, Annals of Statistics 6, 1978).

{formula}

A formula that fits, no explanation: it holds where it was seen, {range}.
"""

_TEXT: Final = '''"""{doc}"""

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


@dataclass(frozen=True)
class Term:
    """A term that was found. form: its id is that of the effect; peaks: the largest |signal| seen, by name, SI."""

    form: Form
    peaks: Mapping[str, float]

    @property
    def id(self) -> str:
        """Of the effect that it is."""
        return self.form.id

    @cached_property
    def effect(self) -> Force:
        """The term as an effect of a model: what its file defines, made without the file."""
        made = self.form.effect(self.form.energy())
        return replace(made, doc=_doc(made, self.peaks))

    def write(self, folder: Path) -> Path:
        """Writes the effect file, and its folder where there is none. Raises InputError where that can't be."""
        path = folder / f"{self.id}.py"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            path.write_text(effect_text(self.effect), encoding="utf-8")
        except OSError as error:
            raise InputError(f"effect file {path}: can't be written ({error}); choose another folder") from None
        return path


def joined(model: Model, effects: Iterable[Effect]) -> Model:
    """The model with further effects, in the order of ``load_model``."""
    return Model(tuple(sorted((*model.effects, *effects), key=lambda e: (not e.nominal, e.id))), model.starts)


def _doc(effect: Force, peaks: Mapping[str, float]) -> str:
    seen = [s.name for s in SIGNALS if s in effect.symbols]
    return _DOC.format(
        formula="\n".join(f"    F_{a} = {e}" for a, e in zip("xy", effect.force, strict=True) if e != 0),
        range=", ".join(f"|{name}| <= {peaks[name]:.3g} {UNITS[name]}" for name in seen),
    )


def effect_text(effect: Force) -> str:
    """The Python of the effect file."""
    used = [s.name for s in SIGNALS if s in effect.symbols | _balance(effect)]
    limit = effect.limits[0]
    sizes = "\n".join(
        f'{q.name.upper()} = size("{q.name}", "{q.unit}", "{q.description}")\n{q.name} = {q.name.upper()}.symbol'
        for q in effect.sizes
    )
    magnitudes = any(e.has(Abs) for e in (*effect.force, *_powers_of(effect)))
    text = _TEXT.format(
        doc=effect.doc,
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
