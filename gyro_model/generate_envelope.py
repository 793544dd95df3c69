"""Writes ``envelope.h``: which effects are straight in the motion, and which must be followed around the cycle.

The effects' functions are those of ``effects.h``. A force or map is *straight* where it is linear in the signals that
it acts on (sympy tells); else it is *curved*, and ``fmu_src/envelope`` evaluates it at phases around the cycle.
"""

import textwrap
from collections.abc import Sequence

from gyro_model import symbols
from gyro_model.anatomy import SLOTS, Effect, Force, Map, Q, U, V
from gyro_model.c_printing import STAMP, effect_macro, state_macro
from gyro_model.effect_functions import added_forces, force_call, guarded
from gyro_model.generate_effects import slot_lines
from gyro_model.linear_forces import is_curved
from gyro_model.model import Model

_NAMES = tuple(SLOTS)
ACTUATOR = _NAMES[: _NAMES.index("pickoff misalignment")]
PICKOFF = _NAMES[_NAMES.index("pickoff misalignment") : _NAMES.index("amplifier lag")]
OUTPUT = _NAMES[_NAMES.index("amplifier lag") + 1 :]


def _is_shifted(effect: Map) -> bool:
    zero = dict.fromkeys((*U, *Q, *V), 0)
    return any(expr.subs(zero) != 0 for expr in effect.made().values())


def _is_bent(effect: Map) -> bool:
    """Whether the parts along cos φ and sin φ don't pass ``effect`` each on its own."""
    return is_curved(effect.made().values(), SLOTS[effect.slot].enters) or _is_shifted(effect)


def _couples(effect: Force) -> bool:
    """Whether the force on an axis depends on the other one, or on the command: then it is no stiffness of its axis."""
    other = ((symbols.y, symbols.y_dot, *U), (symbols.x, symbols.x_dot, *U))
    return any(expr.free_symbols & set(axis) for expr, axis in zip(effect.force, other, strict=True) if expr != 0)


def refused_effects(model: Model) -> tuple[Effect, ...]:
    """What the envelope form can't follow: forces with states of their own that are not linear, and maps that remember,
    whose answer to a cycle depends on the cycles before it."""
    moving = (*model.state_symbols, *U)
    forces = (e for e in added_forces(model) if e.states and is_curved(e.terms().values(), moving))
    return (*forces, *(e for e in model.effects if isinstance(e, Map) and e.memories))


def envelope(model: Model) -> str:
    """``envelope.h`` of ``model``. What ``refused_effects`` names is refused where it acts."""
    moving = (*model.state_symbols, *U)
    added = added_forces(model)
    curved = [e for e in added if is_curved(e.terms().values(), moving)]
    refused = refused_effects(model)
    curved = [e for e in curved if not e.states]
    crossed = [e for e in curved if _couples(e)]
    maps = [e for e in model.effects if isinstance(e, Map)]
    parts = [
        _any("curved_force", "a force is not linear in the motion", curved),
        _any("crossed_force", "such a force depends on the other axis or on the command", crossed),
        _refused(refused),
        _any("stateful_force", "a force has states of its own", [e for e in added if e.states and e not in refused]),
        _any("drawn_force", "a force is noise", [e for e in model.forces if e.drawn]),
        _any("curved_actuator", "the force is not in proportion to the command", _bent(maps, ACTUATOR)),
        _any("curved_pickoff", "the voltage is not in proportion to the motion", _bent(maps, PICKOFF)),
        _any("curved_output", "the sample is not affine in the voltage", _limiting(maps)),
        _any("drawn_sample", "the sample has noise of numbers drawn", [e for e in maps if e.drawn]),
        _any("rounded_sample", "the sample is rounded", _rounding(maps)),
        _list("drawn_forces", "forces that are noise", [e for e in model.forces if e.drawn]),
        _list("drawn_samples", "maps that draw numbers for the sample", [e for e in maps if e.drawn]),
        _list("rounding_effects", "maps that round the sample", _rounding(maps)),
        _straight_rate(model, [e for e in added if e not in (*curved, *refused)]),
        _curved_force(curved),
        _maps("limit", "What bounds the voltage after the amplifier's lag, noise apart.", maps, _quiet),
        _maps("add_noise", "The noise of the latest numbers on the voltage.", maps, lambda e: e.drawn),
        _maps("round_off", "The voltage in whole steps of the converter.", maps, lambda e: e in _rounding(maps)),
    ]
    guard = '#ifndef GYRO_ENVELOPE_H\n#define GYRO_ENVELOPE_H\n\n#include "effects.h"\n'
    return f"{STAMP}\n{guard}\n" + "\n".join(parts) + "\n#endif\n"


def _bent(maps: Sequence[Map], slots: Sequence[str]) -> list[Map]:
    return [e for e in maps if e.slot in slots and _is_bent(e)]


def _rounding(maps: Sequence[Map]) -> list[Map]:
    return [e for e in maps if e.noise and not e.drawn]


def _quiet(effect: Map) -> bool:
    return effect.slot in OUTPUT and not effect.noise


def _limiting(maps: Sequence[Map]) -> list[Map]:
    return [e for e in maps if _quiet(e) and is_curved(e.terms().values(), SLOTS[e.slot].enters)]


def _any(name: str, text: str, members: Sequence[Effect]) -> str:
    tests = " || ".join(f"g->active[{effect_macro(e)}]" for e in members)
    body = f"    return {tests};\n" if tests else "    (void)g;\n    return 0;\n"
    return f"/* Whether {text}. */\nstatic inline int any_{name}(const gyro_view *g)\n{{\n{body}}}\n"


def _refused(effects: Sequence[Effect]) -> str:
    lines = "".join(guarded(e, f'refused = "{e.id}";\n') for e in effects)
    return (
        "/* The id of an effect that acts and that this form can't follow: a force with states of its own that is not\n"
        "   linear, or a map that remembers. NULL where there is none. */\n"
        "static inline const char *refused_effect(const gyro_view *g)\n{\n    const char *refused = 0;\n    (void)g;\n"
        f"{textwrap.indent(lines, '    ')}    return refused;\n}}\n"
    )


def _list(name: str, text: str, members: Sequence[Effect]) -> str:
    entries = ", ".join([*map(effect_macro, members), "GYRO_N_EFFECTS"])
    return f"/* The {text}; GYRO_N_EFFECTS ends the list. */\nstatic const int {name}[] = {{{entries}}};\n"


def _straight_rate(model: Model, added: Sequence[Force]) -> str:
    nominal = "".join(f"    {force_call(e)}" for e in model.forces if e.nominal)
    others = "".join(guarded(e, force_call(e)) for e in added)
    quiet = "".join(f"    rate[{state_macro(s.symbol)}] = 0.0;\n" for s in model.states)
    return f"""/* Rate [SI/s] of every state by the straight forces alone, shape (GYRO_N_STATES). */
static inline void straight_rate(const gyro_view *g, double rate[GYRO_N_STATES])
{{
    double force[2] = {{0.0, 0.0}};
{quiet}{nominal}{textwrap.indent(others, "    ")}    rate[GYRO_STATE_X] = g->s[GYRO_STATE_X_DOT];
    rate[GYRO_STATE_Y] = g->s[GYRO_STATE_Y_DOT];
    rate[GYRO_STATE_X_DOT] = force[0] * g->inverse_mass;
    rate[GYRO_STATE_Y_DOT] = force[1] * g->inverse_mass;
}}
"""


def _curved_force(curved: Sequence[Force]) -> str:
    calls = textwrap.indent("".join(guarded(e, force_call(e)) for e in curved), "    ")
    return f"""/* The curved forces [N], added to `force`. */
static inline void curved_force(const gyro_view *g, double force[2])
{{
{calls or "    (void)g, (void)force;"}}}
"""


def _maps(name: str, text: str, maps: Sequence[Map], chosen) -> str:  # type: ignore[no-untyped-def]
    slots = [(slot, [e for e in maps if e.slot == slot and chosen(e)]) for slot in OUTPUT]
    body = "".join(slot_lines(slot, members, "") for slot, members in slots if members)
    declared = "    double out[2];\n" if body else "    (void)g;\n"
    return f"/* {text} */\nstatic inline void {name}(gyro_view *g)\n{{\n{declared}{body}}}\n"
