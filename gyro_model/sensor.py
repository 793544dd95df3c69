"""The gyroscope as a datasheet knows it: rate in, rate out, with the errors of its output, for system models.

    u = s(T, V, Ω) (Ω_z + μ_x Ω_x + μ_y Ω_y) + b(T, V, a) + turn-on + white + flicker + walk + self-test
    analogue output = F u,  sample = the same, limited to ± full scale and rounded to whole steps

s and b have hysteresis: they follow where the temperature came from, by the play operators of thermal hysteresis.

``fmu_src/sensor`` says how each is computed; ``calibration.sensor.model`` finds the numbers of a datasheet.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import Any, ClassVar, Final

from gyro_model.anatomy import Effect
from gyro_model.effects.thermal_hysteresis import WIDTHS
from gyro_model.form import Form
from gyro_model.quantities import PARAMETERS, Quantity, Role

__all__ = ["INPUTS", "KNOTS", "OUTPUTS", "PARAMETER_TABLE", "SECTIONS", "WIDTHS", "SensorModel"]

KNOTS: Final = 17
"""Temperatures at which bias and scale factor are given, evenly from temperature_low to temperature_high."""
SECTIONS: Final = 2
"""Of the filter, each of second order."""


def _q(
    role: Role, name: str, unit: str, start: float, text: str, low: float = -inf, high: float = inf, **more: Any
) -> Quantity:
    return Quantity(name, unit, start, text, role, low, high, **more)


def _over_temperature(name: str, unit: str, text: str, **more: Any) -> tuple[Quantity, ...]:
    """What ``name`` changes by at each knot."""
    place = f"of {KNOTS - 1} parts of the way from temperature_low to temperature_high"
    return tuple(
        _q("parameter", f"{name}_temperature_{k}", unit, 0.0, f"{text} at {k} {place}", **more) for k in range(KNOTS)
    )


_RATE: Final[dict[str, Any]] = {"nominal": 1.0, "display": "deg/s", "terminal": "inertial"}
_G: Final[dict[str, Any]] = {"nominal": 10.0, "display": "g", "terminal": "inertial"}
INPUTS: Final = (
    _q("input", "omega_z", "rad/s", 0.0, "rate about the input axis", **_RATE),
    _q("input", "omega_x", "rad/s", 0.0, "rate about the x axis, across the input axis", **_RATE),
    _q("input", "omega_y", "rad/s", 0.0, "rate about the y axis, across the input axis", **_RATE),
    _q("input", "a_x", "m/s2", 0.0, "acceleration along x", **_G),
    _q("input", "a_y", "m/s2", 0.0, "acceleration along y", **_G),
    _q("input", "a_z", "m/s2", 0.0, "acceleration along the input axis", **_G),
    _q("input", "temperature", "K", 298.15, "ambient temperature", 0.0, display="degC", terminal="thermal"),
    _q("input", "supply", "V", 3.3, "supply voltage", 0.0, terminal="electrical"),
    _q("input", "self_test", "1", 0, "1: the self-test pushes the output by self_test_rate", 0, 1, integer=True,
       discrete=True, terminal="electrical"),
)  # fmt: skip
OUTPUTS: Final = (
    _q("output", "rate", "rad/s", 0.0, "rate, analogue; 0 while the sensor is off or starts", nominal=1.0,
       display="deg/s", terminal="electrical"),
    _q("output", "rate_sampled", "rad/s", 0.0, "rate at the latest sample instant, limited and rounded", nominal=1.0,
       display="deg/s", terminal="electrical", discrete=True),
    _q("output", "data_ready", "1", 0, "1 for half a sample period from each valid sample on", integer=True,
       discrete=True, terminal="electrical"),
    _q("output", "temperature_structure", "K", 298.15, "temperature of the structure", display="degC",
       terminal="thermal"),
)  # fmt: skip
_SHARED = {q.name: q for q in PARAMETERS}
PARAMETER_TABLE: Final = (
    _q("parameter", "scale_factor", "1", 1.0, "output over rate at supply_ref, its change with temperature apart",
       nominal=1.0),
    *_over_temperature("scale_factor", "1", "change of the scale factor", nominal=1e-2),
    _q("parameter", "scale_factor_supply", "1/V", 0.0, "change of the scale factor with the supply", nominal=1e-3),
    _q("parameter", "nonlinearity_2", "s/rad", 0.0, "scale factor of positive rates rises by this times the rate",
       nominal=1e-3),
    _q("parameter", "nonlinearity_3", "s2/rad2", 0.0, "scale factor rises by this times the square of the rate",
       nominal=1e-3),
    _q("parameter", "misalignment_x", "1", 0.0, "share of omega_x that the input axis sees", nominal=1e-3),
    _q("parameter", "misalignment_y", "1", 0.0, "share of omega_y that the input axis sees", nominal=1e-3),
    _q("parameter", "bias", "rad/s", 0.0, "output at rest at supply_ref, its change with temperature apart",
       nominal=1e-2, display="deg/s"),
    *_over_temperature("bias", "rad/s", "change of the bias", nominal=1e-2, display="deg/s"),
    _q("parameter", "bias_supply", "rad/(s.V)", 0.0, "change of the bias with the supply", nominal=1e-3),
    *(
        _q("parameter", f"acceleration_sensitivity_{axis}", "rad.s/m", 0.0, f"change of the bias with a_{axis}",
           nominal=1e-5)
        for axis in "xyz"
    ),
    _q("parameter", "thermal_hysteresis", "rad/s", 0.0, "bias after warming less that after cooling, half of it",
       nominal=1e-4, display="deg/s"),
    _q("parameter", "scale_factor_hysteresis", "1", 0.0,
       "scale factor after warming less that after cooling, half of it", nominal=1e-3),
    *(replace(width, role="parameter") for width in WIDTHS),
    _q("parameter", "temperature_low", "K", 233.15, "below it bias and scale factor change no more", 0.0,
       display="degC"),
    _q("parameter", "temperature_high", "K", 358.15, "above it bias and scale factor change no more", 0.0,
       display="degC"),
    _q("parameter", "structure_lag", "s", 0.0, "time constant of the structure's temperature", 0.0, nominal=100.0),
    _q("parameter", "supply_ref", "V", 3.3, "supply at which bias and scale factor are as given", 0.0),
    _q("parameter", "supply_low", "V", 0.0, "the sensor is off below it, and turns on anew above it", 0.0,
       nominal=3.0),
    _q("parameter", "start_up_time", "s", 0.0, "from turning on to the first valid output", 0.0, 1e4, nominal=0.1,
       display="ms"),
    *(
        quantity
        for k in range(1, SECTIONS + 1)
        for quantity in (
            _q("parameter", f"filter_frequency_{k}", "Hz", 100.0, f"natural frequency of section {k}", 1e-3, 1e6),
            _q("parameter", f"filter_damping_{k}", "1", 0.8, f"damping ratio of section {k}", 1e-5, 1e3),
            _q("parameter", f"filter_lead_{k}", "s", 0.0, f"time constant of the zero of section {k}", -1e3, 1e3,
               nominal=1e-3, display="ms"),
        )
    ),
    _q("parameter", "noise_lead", "s", 0.0, "time constant of the zero of section 1 for noise", -1e3, 1e3,
       nominal=1e-3, display="ms"),
    _q("parameter", "angle_random_walk", "rad/s0.5", 0.0, "N: white noise", 0.0, nominal=1e-5),
    _q("parameter", "bias_instability", "rad/s", 0.0, "B: flicker noise, flat Allan deviation 0.664 B", 0.0,
       nominal=1e-6, display="deg/s"),
    _q("parameter", "rate_random_walk", "rad/s1.5", 0.0, "K: random walk of the rate", 0.0, nominal=1e-7),
    _q("parameter", "turn_on", "rad/s", 0.0, "bias of a turn-on, rms", 0.0, nominal=1e-5, display="deg/s"),
    _q("parameter", "full_scale", "rad/s", 8.7266463, "largest sample either way", 0.0, display="deg/s"),
    _q("parameter", "lsb", "rad/s", 0.0, "step of the samples; 0: they are not rounded", 0.0, nominal=1e-4,
       display="deg/s"),
    _q("parameter", "self_test_rate", "rad/s", 0.1, "by which the self-test pushes the output", display="deg/s"),
    _q("parameter", "internal_step", "s", 1e-3, "between draws of noise, which is held", 1e-5, 1.0, display="ms"),
    _q("parameter", "sample_period", "s", 1e-2, "time between samples", 1e-5, 10.0, display="ms"),
    _SHARED["seed"],
    _SHARED["step_limit"],
)  # fmt: skip


@dataclass(frozen=True)
class SensorModel(Form):
    """The sensor; ``starts``: parameters (name, value) [SI] that start at another value than the table says."""

    NAME: ClassVar[str] = "GyroscopeSensor"
    DESCRIPTION: ClassVar[str] = "Rate gyroscope of one axis as its datasheet describes it, for system models"
    CONVENTIONS: ClassVar[tuple[str, ...]] = (
        "The input axis is z. Inputs act as held from one communication point to the next; any step serves, of 0.1 ms, "
        "more or less, and no number depends on how time is divided into steps.",
        "rate_sampled is taken at multiples of sample_period, just before inputs change there, and stands until the "
        "next. data_ready is 1 for half a period from each on, so that it is 1 wherever a step ends at a sample.",
        "A turn-on is drawn from the seed: another seed, or another crossing of supply_low, is another turn-on.",
        "The Allan deviation of the output at rest is N²/τ + (0.664 B)² + K²τ/3, squared, from some delays of the "
        "filter on. Noise is drawn every internal_step and held.",
    )
    STEP_SIZE: ClassVar[str] = "1e-2"
    LAYERS: ClassVar[tuple[str, ...]] = ("co_simulation", "sensor")

    starts: tuple[tuple[str, float], ...] = ()
    effects: tuple[Effect, ...] = ()

    @cached_property
    def quantities(self) -> tuple[Quantity, ...]:
        """Every FMI variable; the index is its value reference: inputs, outputs, parameters."""
        return (*INPUTS, *OUTPUTS, *PARAMETER_TABLE)

    def starting_at(self, parameters: Mapping[str, float]) -> "SensorModel":
        """The same sensor whose FMU starts with ``parameters`` [SI]. Raises InputError for an unknown name or a value
        out of bounds."""
        return SensorModel(tuple((name, self.parameter(name).check(value)) for name, value in parameters.items()))
