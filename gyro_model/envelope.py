"""The envelope form of the model: the same effects, seen as slow complex amplitudes around a carrier.

A fast signal is s(t) = Re{(s_i + i s_q) e^(iφ)}, φ' = 2π carrier_frequency. Forces come in and displacements and
voltages go out as such pairs; every other quantity, and all parameters of the device and its effects, are those of the
full model. ``fmu_src/envelope`` says how it moves.

What the envelope form leaves out, beside the harmonics above the third: the settling of delay and amplifier lag, and of
states that an effect brings (they follow at the carrier at once); voltages other than those at the carrier, so that
offset and drift show only where the converter clips; the noise of a sample is white around the carrier, a flicker
noise of density a²/f too, and rounding is white noise of lsb²/12 a sample.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from gyro_model.model import Model, load_model
from gyro_model.quantities import INPUTS, OUTPUTS, PARAMETERS, Quantity, Role

_TIMING = ("internal_step", "sample_period", "seed", "step_limit")
_PARTS = {"i": "part along cos φ", "q": "part along -sin φ"}


def _pairs(
    role: Role, unit: str, names: dict[str, str], nominal: float, display: str = ""
) -> tuple[Quantity, ...]:
    return tuple(
        Quantity(f"{name}_{part}", unit, 0.0, f"{text}, {which}", role, nominal=nominal, display=display)
        for name, text in names.items()
        for part, which in _PARTS.items()
    )


# A hertz keeps the motion oscillating: the model divides by the carrier.
CARRIER = Quantity("carrier_frequency", "Hz", 3000.0, "rate of the carrier's phase over 2π", "input", low=1.0)
INTERNAL_STEP = Quantity(
    "internal_step", "s", 1e-3, "longest step of the envelopes, between draws of noise", low=1e-6, high=10.0
)

ENVELOPE_INPUTS = (
    *_pairs("input", "N", {"u_x": "force on the x axis", "u_y": "force on the y axis"}, 1e-6, "µN"),
    CARRIER,
    *(q for q in INPUTS if q.name not in ("u_x", "u_y")),
)
ENVELOPE_OUTPUTS = (
    *_pairs("output", "V", {"v_x": "x sensor voltage", "v_y": "y sensor voltage"}, 1.0),
    *_pairs("output", "m", {"x": "x displacement, for analysis", "y": "y displacement, for analysis"}, 1e-6, "µm"),
    Quantity("x_mean", "m", 0.0, "mean x displacement, for analysis", "output", nominal=1e-9, display="µm"),
    Quantity("y_mean", "m", 0.0, "mean y displacement, for analysis", "output", nominal=1e-9, display="µm"),
    *(q for q in OUTPUTS if q.name.startswith("temperature")),
)
ENVELOPE_PARAMETERS = (
    *(q for q in PARAMETERS if not q.name.endswith("_start") and q.name not in _TIMING),
    *_pairs("parameter", "m", {"x_start": "x displacement at the start", "y_start": "y displacement at the start"}, 1e-6, "µm"),
    INTERNAL_STEP,
    *(q for q in PARAMETERS if q.name in _TIMING[1:]),
)


@dataclass(frozen=True, eq=False)
class EnvelopeModel(Model):
    """The envelope form of the model of the same ``effects``."""

    NAME: ClassVar[str] = "GyroscopeEnvelope"
    DESCRIPTION: ClassVar[str] = (
        "MEMS vibratory gyroscope as slow complex amplitudes around a carrier, with the effects of the full model"
    )
    STEP_SIZE: ClassVar[str] = "1e-3"

    def __post_init__(self) -> None:
        # The effects are written in the quantities of the full model.
        Model(self.effects)

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """Every FMI variable; the index is its value reference: inputs, outputs, parameters, then effect by effect."""
        own = (p for effect in self.effects for p in effect.parameters)
        return (*ENVELOPE_INPUTS, *ENVELOPE_OUTPUTS, *ENVELOPE_PARAMETERS, *own)


def envelope_model(full: Model | None = None) -> EnvelopeModel:
    """The envelope form of ``full``, by default of the packaged model."""
    return EnvelopeModel((full or load_model()).effects)
