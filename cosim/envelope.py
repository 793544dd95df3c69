"""The envelope form of the plant as a slow loop sees it: amplitudes around a carrier, for hours of simulated time.

Signals are s(t) = Re{(s_i + i s_q) e^(iφ)}, φ' = 2π carrier_frequency (``gyro_model/envelope.py``). Steps go through
the same compiled ``exchange`` as those of the full plant.
"""

from collections.abc import Mapping
from math import pi, sqrt
from typing import Final

from cosim.fmu import Plant
from gyro_model.build import build
from gyro_model.envelope import INTERNAL_STEP, EnvelopeModel, envelope_model
from gyro_model.errors import InputError
from gyro_model.model import Model
from gyro_model.quantities import PARAMETERS

INPUT_NAMES: Final = (
    *("u_x_i", "u_x_q", "u_y_i", "u_y_q", "carrier_frequency"),
    *("omega_z", "temperature", "a_x", "a_y", "v_bias"),
)
OUTPUT_NAMES: Final = (
    *("v_x_i", "v_x_q", "v_y_i", "v_y_q", "x_i", "x_q", "y_i", "y_q"),
    *("temperature_structure", "temperature_circuit"),
)


class EnvelopePlant(Plant):
    """An initialised instance of the FMU GyroscopeEnvelope, to be used as a context manager."""

    input_names = INPUT_NAMES
    output_names = OUTPUT_NAMES


def envelope_parameters(parameters: Mapping[str, float], internal_step: float, carrier: float) -> dict[str, float]:
    """The envelope FMU's parameters [SI] for the ``parameters`` of the full one: a start at (x, x') is that of the
    amplitude x - i x'/(2π carrier), ``carrier`` in Hz."""
    # What nobody says is as in the full model, whose start values are those of another device.
    full = {q.name: q.start for q in PARAMETERS if q.name not in ("internal_step", "step_limit")}
    own = {name: value for name, value in {**full, **parameters}.items() if not name.endswith("_start")}
    for axis in "xy":
        own[f"{axis}_start_i"] = parameters.get(f"{axis}_start", 0.0)
        own[f"{axis}_start_q"] = -parameters.get(f"{axis}_dot_start", 0.0) / (2 * pi * carrier)
    return own | {"internal_step": internal_step}


def _settled(parameters: Mapping[str, float], form: EnvelopeModel) -> dict[str, float]:
    """``parameters`` without what states of effects start at. Raises InputError where they don't start at rest."""
    owner = {q.name: effect.id for effect in form.effects for q in effect.starts}
    for name in owner.keys() & parameters.keys():
        if parameters[name] != 0.0:
            raise InputError(
                f"{name} = {parameters[name]:g}: the envelope form shows {owner[name]} settled, wherever it starts; "
                "give 0, or use the full plant"
            )
    return {name: value for name, value in parameters.items() if name not in owner}


def open_envelope(
    parameters: Mapping[str, float],
    internal_step: float = INTERNAL_STEP.start,
    carrier: float | None = None,
    model: Model | None = None,
) -> EnvelopePlant:
    """The envelope form of the device with ``parameters`` (FMU names of the full model, SI, kxx and m among them), its
    FMU built where that has not been done.

    internal_step: [s], the period of noise draws and unit of time. carrier: first carrier_frequency [Hz]; by default
    that of the x axis alone. Raises InputError as ``cosim.fmu.open_plant`` does, and where a state of an effect does
    not start at zero.
    """
    form = envelope_model(model)
    first = carrier or sqrt(parameters["kxx"] / parameters["m"]) / (2 * pi)
    own = envelope_parameters(_settled(parameters, form), internal_step, first)
    return EnvelopePlant(build(form).fmi3, own | {"carrier_frequency": first}, form)
