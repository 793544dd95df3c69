"""The generated C function of each effect, callable on its own: a small generated harness around ``effects.h``."""

import ctypes as ct
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from gyro_model import build, compiling, symbols
from gyro_model.anatomy import Delay, Effect, Follow, Force, Lag, Law, Map
from gyro_model.model import Model

_EXPORT = '__attribute__((visibility("default"))) void' if not hasattr(ct, "WinDLL") else "__declspec(dllexport) void"
_OWN = (
    *(symbols.t, symbols.after, symbols.normal_x, symbols.normal_y, symbols.omega_z_change),
    *(symbols.v_x_rate, symbols.v_y_rate),
    *symbols.PINK,
    symbols.since,
)
_SIGNALS = ("u_x", "u_y", "q_x", "q_y", "v_x", "v_y")
_BODY = """
{export} {name}(const double *p, const double *s, const double *signals, const double *own,
    const double *memories, double *out)
{{
    gyro_view view = {{0}};
    for (int i = 0; i < GYRO_N_VARIABLES; i++) view.p[i] = p[i];
    for (int i = 0; i < GYRO_N_STATES; i++) view.s[i] = s[i];
    for (int i = 0; i < 2; i++) {{
        view.u[i] = signals[i]; view.q[i] = signals[2 + i]; view.v[i] = signals[4 + i];
        view.drawn[{effect}][i] = own[2 + i] + own[7 + i]; /* normal or pink, the other is 0 */
    }}
    view.change[GYRO_OMEGA_Z] = own[4];
    view.v_rate[0] = own[5]; view.v_rate[1] = own[6];
    view.t = own[0];
    view.after[{effect}] = own[1];
    view.since = own[9];
    for (int i = 0; i < GYRO_N_MEMORIES; i++) view.remembered[i] = view.remembered_now[i] = memories[i];
    {call}
}}
"""


def _call(effect: Effect) -> str:
    first = len(effect.made())
    copies = ""
    for i, name in enumerate(list(effect.terms())[first:]):
        what, memory = name.split("_", 1)
        function, where = {
            "start": ("begin", "remembered"),
            "now": ("recall", "remembered_now"),
            "sample": ("renew", "remembered"),
        }[what]
        copies += (
            f" {{ gyro_view other = view; {function}_effect_{effect.id}(&other);"
            f" out[{first + i}] = other.{where}[GYRO_MEMORY_{memory.upper()}]; }}"
        )
    return copies + _made(effect)


def _made(effect: Effect) -> str:
    if isinstance(effect, Delay):
        return "out[0] = force_delay(&view);"
    if isinstance(effect, Lag):
        return "out[0] = lag_time_constant(&view);"
    if isinstance(effect, Follow):
        return " ".join(f"out[{i}] = view.p[GYRO_{c.name.upper()}];" for i, c in enumerate(effect.follows.values()))
    if isinstance(effect, Law):
        copies = (f"out[{i}] = view.p[GYRO_{name.upper()}];" for i, name in enumerate(effect.made()))
        return f"effect_{effect.id}(&view); " + " ".join(copies)
    if isinstance(effect, Force) and effect.impulse:
        return f"effect_{effect.id}(&view, out); impulse_effect_{effect.id}(&view, out + 2);"
    if isinstance(effect, Force) and effect.states:
        rates = (f"out[{2 + i}] = rate[GYRO_STATE_{s.symbol.name.upper()}];" for i, s in enumerate(effect.states))
        return f"double rate[GYRO_N_STATES]; effect_{effect.id}(&view, out, rate); " + " ".join(rates)
    assert isinstance(effect, (Force, Map))
    return f"effect_{effect.id}(&view, out);"


class EffectLibrary:
    """The compiled effects of a model."""

    def __init__(self, model: Model, folder: Path) -> None:
        self.model = model
        build.write_sources(model, folder)
        parts = [
            _BODY.format(export=_EXPORT, name=f"call_{e.id}", effect=f"GYRO_EFFECT_{e.id.upper()}", call=_call(e))
            for e in model.effects
        ]
        (folder / "harness.c").write_text('#include "generated/effects.h"\n' + "".join(parts), encoding="utf-8")
        library = folder / "harness.so"
        compiling.compile_library(folder, ["harness.c", "gyro_math.c", "gyro_trigonometry.c"], library)
        self.library = ct.CDLL(str(library))

    def evaluate(self, effect: Effect, values: Mapping[str, float]) -> dict[str, float]:
        """The terms of ``effect`` by its C function; symbols that are not in ``values`` are 0."""
        p = np.array([values.get(q.name, 0.0) for q in self.model.quantities])
        s = np.array([values.get(symbol.name, 0.0) for symbol in self.model.state_symbols])
        signals = np.array([values.get(name, 0.0) for name in _SIGNALS])
        own = np.array([values.get(symbol.name, 0.0) for symbol in _OWN])
        memories = np.array([values.get(memory.symbol.name, 0.0) for memory in self.model.memories] or [0.0])
        out = np.zeros(2 + len(self.model.states) + len(effect.terms()))
        function = getattr(self.library, f"call_{effect.id}")
        function(*(array.ctypes.data_as(ct.POINTER(ct.c_double)) for array in (p, s, signals, own, memories, out)))
        return {name: float(value) for name, value in zip(effect.terms(), out, strict=False)}
