"""A slider for every input, start and effect, made from what the model itself says: unit, bounds, typical size."""

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final, Literal

from gyro_model.anatomy import Effect
from gyro_model.model import Model
from gyro_model.quantities import Quantity
from gyro_model.units import DISPLAYED, Conversion

REACH: Final = 10.0
"""Ends of a slider over the typical size: a decade, as far as a search for an effect looks."""
UNLIMITED: Final = 1e100
"""A neutral value beyond this stands for "no limit"."""
TOLERANCE: Final = 0.1
"""Reach of a slider for a number of the device itself, as a share of it: what leaves a device the same kind."""
SPAN: Final = {"K": 100.0}
"""By unit: the way to both ends where differences matter, not the distance from zero."""
_POWERS: Final = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_SHOWN: Final = {"1": "", "deg/s": "°/s", "degC": "°C", "Hz0.5": "√Hz", "V/Hz0.5": "V/√Hz"}

Scale = Literal["linear", "cubic", "logarithmic", "limit"]


@dataclass(frozen=True)
class Slider:
    """One number that the page lets a user change.

    name, reference: of the FMI variable; effect: id of the effect that owns it, or ""; label: its description; unit: as
    shown, with shown = factor * SI + offset; start (on the device), neutral (of the model), low, high: in SI. scale:
    how the way along the slider becomes the value: "cubic" is fine around zero, "limit" is logarithmic with no limit
    (``neutral``) at its upper end. tunable: whether it may change while the FMU runs.
    """

    name: str
    reference: int
    effect: str
    label: str
    unit: str
    factor: float
    offset: float
    start: float
    neutral: float
    low: float
    high: float
    scale: Scale
    tunable: bool

    def data(self) -> dict[str, Any]:
        """As the page reads it."""
        return asdict(self)


def slider(model: Model, name: str, start: float, effect: str = "") -> Slider:
    """The slider of a quantity, of ``effect`` or of the device itself, that is ``start`` [SI] on the device shown."""
    quantity = model.by_name[name]
    conversion = DISPLAYED.get(quantity.unit, {}).get(quantity.display, Conversion(1.0))
    typical = quantity.typical if abs(quantity.start) < UNLIMITED else quantity.nominal or 1.0
    scale, low, high = _range(quantity, start, typical)
    return Slider(
        name=name,
        reference=model.quantities.index(quantity),
        effect=effect,
        label=quantity.description,
        unit=shown_unit(quantity.display or quantity.unit),
        factor=conversion.factor,
        offset=conversion.offset,
        start=start,
        neutral=quantity.start,
        low=low,
        high=high,
        scale=scale,
        tunable=quantity.role == "input" or name in model.tunable,
    )


def sliders_of(model: Model, effect: Effect, parameters: Mapping[str, float]) -> list[Slider]:
    """The sliders of an effect of a device with ``parameters`` [SI]."""
    return [slider(model, q.name, parameters[q.name], effect.id) for q in effect.parameters]


def shown_unit(unit: str) -> str:
    """A unit as a reader expects it: N/(m·V²) for N/m.V2, nothing for 1."""
    if unit in _SHOWN:
        return _SHOWN[unit]
    above, slash, below = unit.partition("/")
    parts = [
        re.sub(r"(?<=[A-Za-z])-?\d+", lambda power: power[0].translate(_POWERS), part).replace(".", "·")
        for part in (above, below)
    ]
    return parts[0] if not slash else f"{parts[0]}/({parts[1]})" if "·" in parts[1] else "/".join(parts)


def _range(quantity: Quantity, start: float, typical: float) -> tuple[Scale, float, float]:
    """Scale and ends [SI]."""

    def within(value: float) -> float:
        return min(max(value, quantity.low), quantity.high)

    if abs(quantity.start) >= UNLIMITED:
        return "limit", within(typical / REACH), within(typical * REACH)
    if quantity.unit in SPAN:
        return "linear", within(start - SPAN[quantity.unit]), within(start + SPAN[quantity.unit])
    if quantity.role == "parameter" and quantity.start:
        return "linear", within(start - TOLERANCE * abs(start)), within(start + TOLERANCE * abs(start))
    if quantity.start == 0:
        reach = max(REACH * (typical or 1.0), abs(start))
        return "cubic", within(-reach), within(reach)
    if quantity.role == "shape" and quantity.start > 0:
        return "logarithmic", within(min(typical / REACH, start)), within(max(typical * REACH, start))
    return "linear", within(start - typical), within(start + typical)
