"""What the motion is as a differential equation: its continuous states by name, and the variables that show them."""

from typing import NamedTuple

from gyro_model.anatomy import Force
from gyro_model.form import Form
from gyro_model.model import Model

# How large a state typically is, by unit: a micrometre, its velocity at 3 kHz, a volt, room temperature.
_TYPICAL = {"m": 1e-6, "m/s": 0.02, "V": 1.0, "K": 298.15}


class ContinuousState(NamedTuple):
    """One state: ``reference`` is the value reference of the variable that shows it, ``rate_reference`` of its rate."""

    name: str
    unit: str
    nominal: float
    description: str
    reference: int
    rate_reference: int

    @property
    def rate_name(self) -> str:
        """The name of its time derivative."""
        return f"der({self.name})"


def continuous_states(model: Form) -> tuple[ContinuousState, ...]:
    """The states in order: those of the motion, which are outputs, those of effects, the voltages behind the
    amplifier's lag, what lags, what effects remember that flows. None of a form for co-simulation
    only.

    Beyond the variables of the model and ``time`` come the states that are no outputs, then all rates.
    """
    if not (isinstance(model, Model) and model.EQUATION):
        return ()
    own = {s.symbol.name: s for e in model.effects if isinstance(e, Force) for s in e.states}
    rows: list[tuple[str, str, str]] = []
    for name in (symbol.name for symbol in model.state_symbols):
        quantity = own.get(name) or model.by_name[name]
        rows.append((name, quantity.unit, quantity.description))
    rows += [(f"v_{axis}_lagged", "V", f"{axis} voltage behind the amplifier's lag, where it has one") for axis in "xy"]
    rows += [
        (f"{target.name}_lagging", model.by_name[target.name].unit, f"{target.name} as it lags, where it does")
        for target in model.followed
    ]
    rows += [(m.symbol.name, m.unit, m.description) for m in model.memories if m.flows]
    shown = {q.name: reference for reference, q in enumerate(model.quantities)}
    free = first_local(model)
    references = []
    for name, *_ in rows:
        references.append(shown.get(name, free))
        free += name not in shown
    return tuple(
        ContinuousState(name, unit, _TYPICAL.get(unit, 1.0), text, references[i], free + i)
        for i, (name, unit, text) in enumerate(rows)
    )


def first_local(model: Form) -> int:
    """The first value reference beyond the variables of the model and ``time``."""
    return len(model.quantities) + 1


def first_clock(model: Form) -> int:
    """The first value reference of a clock, beyond all other variables."""
    return first_local(model) + len(hidden_states(model)) + len(continuous_states(model))


def hidden_states(model: Form) -> tuple[ContinuousState, ...]:
    """The states that are no outputs."""
    return tuple(state for state in continuous_states(model) if state.reference >= first_local(model))
