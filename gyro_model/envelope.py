"""The envelope form of the model: the same effects, seen as slow complex amplitudes around a carrier.

A fast signal is s(t) = Re{(s_i + i s_q) e^(iφ)}, φ' = 2π carrier_frequency. Forces come in and displacements and
voltages go out as such pairs; every other quantity, and all parameters of the device and its effects, are those of the
full model. ``fmu_src/envelope`` says how it moves.

What the envelope form leaves out, beside the harmonics above the third: the settling of delay and amplifier lag, and of
states that an effect brings (they follow at the carrier at once, whatever they start at, which is therefore no
parameter); voltages other than those at the carrier, so that
offset and drift show only where the converter clips; the noise of a sample is white around the carrier, a flicker
noise of density a²/f too, and rounding is white noise of lsb²/12 a sample.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi, sqrt
from typing import ClassVar

from gyro_model.model import Model, load_model
from gyro_model.quantities import INPUTS, OUTPUTS, PARAMETERS, Quantity, Role, Terminal

_TIMING = ("internal_step", "sample_period", "seed", "step_limit")
_PARTS = {"i": "part along cos φ", "q": "part along -sin φ"}


def _pairs(
    role: Role, unit: str, names: dict[str, str], nominal: float, display: str = "", terminal: Terminal = ""
) -> tuple[Quantity, ...]:
    return tuple(
        Quantity(
            f"{name}_{part}", unit, 0.0, f"{text}, {which}", role, nominal=nominal, display=display, terminal=terminal
        )
        for name, text in names.items()
        for part, which in _PARTS.items()
    )


# The device that is there where nobody sets another: the class of devices/rate-mode.toml, without its effects.
DEVICE = {"m": 2e-8, "kxx": 19.74, "kyy": 20.14, "kxy": 0.0, "dxx": 1.257e-7, "dyy": 1.058e-6, "dxy": 0.0}
DRIVE_AMPLITUDE = 4e-6
"""Of x [m]."""
RESONANCE = sqrt(DEVICE["kxx"] / DEVICE["m"]) / (2 * pi)
"""Of the x axis [Hz]."""
_STARTS = DEVICE | {"u_x_q": DEVICE["dxx"] * 2 * pi * RESONANCE * DRIVE_AMPLITUDE, "x_start_i": DRIVE_AMPLITUDE}


def _starting(quantities: Iterable[Quantity]) -> tuple[Quantity, ...]:
    return tuple(replace(q, start=_STARTS.get(q.name, q.start)) for q in quantities)


# A hertz keeps the motion oscillating: the model divides by the carrier.
CARRIER = Quantity(
    "carrier_frequency",
    "Hz",
    RESONANCE,
    "rate of the carrier's phase over 2π",
    "input",
    low=1.0,
    display="kHz",
    terminal="electrical",
)
INTERNAL_STEP = Quantity(
    "internal_step",
    "s",
    1e-3,
    "longest step of the envelopes, between draws of noise",
    low=1e-6,
    high=10.0,
    display="ms",
)

ENVELOPE_INPUTS = (
    *_starting(
        _pairs("input", "N", {"u_x": "force on the x axis", "u_y": "force on the y axis"}, 1e-6, "µN", "mechanical")
    ),
    CARRIER,
    *(q for q in INPUTS if q.name not in ("u_x", "u_y")),
)
ENVELOPE_OUTPUTS = (
    *(
        replace(q, discrete=True)
        for q in _pairs("output", "V", {"v_x": "x sensor voltage", "v_y": "y sensor voltage"}, 1.0, "", "electrical")
    ),
    *_pairs(
        "output",
        "m",
        {"x": "x displacement, for analysis", "y": "y displacement, for analysis"},
        1e-6,
        "µm",
        "mechanical",
    ),
    Quantity(
        "x_mean",
        "m",
        0.0,
        "mean x displacement, for analysis",
        "output",
        nominal=1e-9,
        display="µm",
        terminal="mechanical",
    ),
    Quantity(
        "y_mean",
        "m",
        0.0,
        "mean y displacement, for analysis",
        "output",
        nominal=1e-9,
        display="µm",
        terminal="mechanical",
    ),
    *(q for q in OUTPUTS if q.name.startswith("temperature")),
)
ENVELOPE_PARAMETERS = (
    *_starting(q for q in PARAMETERS if not q.name.endswith("_start") and q.name not in _TIMING),
    *_starting(
        _pairs(
            "parameter",
            "m",
            {"x_start": "x displacement at the start", "y_start": "y displacement at the start"},
            1e-6,
            "µm",
        )
    ),
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
    CONVENTIONS: ClassVar[tuple[str, ...]] = (
        "A pair (s_i, s_q) is the signal s(t) = Re{(s_i + i s_q) exp(i phi)} = s_i cos phi - s_q sin phi with phi' = "
        "2 pi carrier_frequency; phi is 0 at the start. Its amplitude is the absolute value, a peak, not an rms.",
        "A velocity is i 2 pi carrier_frequency times its displacement, so that a force in phase with the velocity, "
        "u_x_q > 0 for x_i > 0, drives, and one against it damps. At resonance u_x_q = dxx 2 pi carrier_frequency x_i "
        "holds x_i.",
        "A positive rate turns the package from x to y: with the drive x_i > 0 it pushes y by the Coriolis force "
        "u_y_q = -2 m 2 pi carrier_frequency omega_z x_i, and kxy (quadrature) by u_y_i = -kxy x_i: the two parts of "
        "v_y.",
        "The start values are a device that is driven at resonance: 4 um along x, 5 kHz, the sense mode 50 Hz above, "
        "Q = 5000 and 600, no quadrature, no noise.",
        "Tunable parameters may be set while the FMU runs and act from that instant; the others are fixed once "
        "initialization ends.",
    )
    STEP_SIZE: ClassVar[str] = "1e-3"
    LAYERS: ClassVar[tuple[str, ...]] = ("device", "co_simulation", "envelope")
    EQUATION: ClassVar[bool] = False

    def __post_init__(self) -> None:
        # The effects are written in the quantities of the full model.
        Model(self.effects)

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """Every FMI variable; the index is its value reference: inputs, outputs, parameters, then effect by effect."""
        own = (p for effect in self.effects for p in effect.parameters if p.role != "start")
        return (*ENVELOPE_INPUTS, *ENVELOPE_OUTPUTS, *ENVELOPE_PARAMETERS, *own)


def envelope_model(full: Model | None = None) -> EnvelopeModel:
    """The envelope form of ``full``, by default of the packaged model."""
    return EnvelopeModel((full or load_model()).effects)
