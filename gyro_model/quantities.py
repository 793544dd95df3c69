"""The table of quantities: every input, output and device parameter that no effect owns, each in one place.

Effects add their own parameters in their own files; ``gyro_model.model`` joins both into the table that the FMU, its
XML and the documentation are made from.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isfinite
from typing import Any, Literal

from sympy import Symbol

from gyro_model.errors import InputError, nearest
from gyro_model.grid import Grid
from gyro_model.units import DISPLAYED, dimension

__all__ = ["INPUTS", "OUTPUTS", "PARAMETERS", "Grid", "Quantity", "shape", "size", "start"]

Role = Literal["input", "output", "parameter", "size", "shape", "start"]
Terminal = Literal["mechanical", "electrical", "inertial", "thermal", ""]


LARGEST = 1.7976931348623157e308
"""The largest finite float; a whole number may be larger still."""


@dataclass(frozen=True)
class Quantity:
    """One number with a name: ``start`` is its value where nobody sets it (for a size parameter: neutral).

    ``low`` and ``high`` are inclusive bounds in ``unit``. ``role`` is ``input``, ``output``, ``parameter`` (the
    nominal device and the simulation), ``size`` (switches an effect on), ``shape`` (of an effect; switches nothing) or
    ``start`` (a state of an effect as the run begins; switches nothing). ``nominal`` is how large it typically is
    [unit]; 0: as large as ``start``. ``display`` is the unit in which a tool shows it, of
    ``gyro_model.units.DISPLAYED``; ``terminal`` groups inputs and outputs by what they connect to. ``search``: how a
    search for the effect tries it; None: it leaves a shape as it is, a size near neutral. ``discrete``: an input or
    output that changes at instants.
    """

    name: str
    unit: str
    start: float
    description: str
    role: Role = "parameter"
    low: float = -inf
    high: float = inf
    integer: bool = False
    nominal: float = 0.0
    display: str = ""
    terminal: Terminal = ""
    search: Grid | None = None
    discrete: bool = False

    def __post_init__(self) -> None:
        dimension(self.unit)
        if not self.name.isidentifier():
            raise InputError(f"quantity {self.name!r}: a name is a C identifier")
        if not (isfinite(self.start) and self.low <= self.start <= self.high):
            raise InputError(f"quantity {self.name}: start {self.start} is outside [{self.low}, {self.high}]")
        if not (isfinite(self.nominal) and self.nominal >= 0.0):
            raise InputError(f"quantity {self.name}: nominal {self.nominal} is no size; give a positive number")
        scaled = self.search is not None and self.search.of == "itself" and self.search.kind in ("log", "usual")
        if scaled and not self.typical:
            raise InputError(
                f"shape {self.name}: starts at 0, about which there is nothing to search; say nominal=, how large it "
                'typically is, search=Grid.instant, Grid.log(low, high, of="x"), or search=None'
            )
        known = DISPLAYED.get(self.unit, {})
        if self.display and self.display not in known:
            hint = nearest(self.display, known)
            raise InputError(f"quantity {self.name}: display unit {self.display!r} is none of {self.unit}{hint}")

    @property
    def typical(self) -> float:
        """How large it typically is [unit]; 0 where nobody has said so."""
        return self.nominal or abs(self.start)

    @property
    def symbol(self) -> Symbol:
        """The sympy symbol of the same name."""
        return Symbol(self.name, real=True)

    def check(self, value: float) -> float:
        """``value`` as a float. Raises InputError where it is not a finite number within the bounds, naming them."""
        unit = "" if self.unit == "1" else f" in {self.unit}"
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not -LARGEST <= value <= LARGEST:
            raise InputError(f"{self.name} = {value!r}: give a finite number{unit}")
        if not self.low <= value <= self.high:
            bounds = f"from {self.low:.10g} to {self.high:.10g}"
            raise InputError(f"{self.name} = {value:.10g}: give a number {bounds}{unit}")
        if self.integer and value != int(value):
            raise InputError(f"{self.name} = {value:g}: give a whole number")
        return float(value)


def size(
    name: str,
    unit: str,
    description: str,
    *,
    neutral: float = 0.0,
    low: float = -inf,
    high: float = inf,
    nominal: float = 0.0,
    display: str = "",
    search: Grid | None = None,
) -> Quantity:
    """A parameter that switches its effect on where it differs from ``neutral``. ``search``: where what it does is not
    in proportion to it, as of a time constant, the values at which a search for the effect tries it besides."""
    more = {"nominal": nominal, "display": display, "search": search}
    return Quantity(name, unit, neutral, description, "size", low, high, **more)  # type: ignore[arg-type]


def shape(
    name: str,
    unit: str,
    start: float,
    description: str,
    *,
    low: float = -inf,
    high: float = inf,
    nominal: float = 0.0,
    display: str = "",
    search: Grid | None = Grid.around,
    integer: bool = False,
) -> Quantity:
    """A parameter that shapes its effect and has a usable default; it switches nothing. ``search``: how a search for
    the effect tries it, by default a decade to either side of its typical value; a whole number (``integer``) stays as
    it was tried."""
    more = {"nominal": nominal, "display": display, "search": search, "integer": integer}
    return Quantity(name, unit, start, description, "shape", low, high, **more)  # type: ignore[arg-type]


def start(name: str, unit: str, description: str, *, nominal: float = 0.0, display: str = "") -> Quantity:
    """A parameter that is a state of its effect as the run begins (``State.start``), zero by default; it switches
    nothing."""
    return Quantity(name, unit, 0.0, description, "start", nominal=nominal, display=display)


def _of_role(role: Role) -> Callable[..., Quantity]:
    def quantity(
        name: str, unit: str, start: float, text: str, low: float = -inf, high: float = inf, **more: Any
    ) -> Quantity:
        return Quantity(name, unit, start, text, role, low, high, **more)

    return quantity


_input, _output, _parameter = _of_role("input"), _of_role("output"), _of_role("parameter")

INPUTS = (
    _input(
        "u_x",
        "N",
        0.0,
        "force on the x axis, held over a communication step",
        nominal=1e-6,
        display="µN",
        terminal="mechanical",
    ),
    _input(
        "u_y",
        "N",
        0.0,
        "force on the y axis, held over a communication step",
        nominal=1e-6,
        display="µN",
        terminal="mechanical",
    ),
    _input("omega_z", "rad/s", 0.0, "rate of the package about z", nominal=1.0, display="deg/s", terminal="inertial"),
    _input("temperature", "K", 298.15, "ambient temperature", low=0.0, display="degC", terminal="thermal"),
    _input("a_x", "m/s2", 0.0, "acceleration of the package along x", nominal=10.0, display="g", terminal="inertial"),
    _input("a_y", "m/s2", 0.0, "acceleration of the package along y", nominal=10.0, display="g", terminal="inertial"),
    _input("v_bias", "V", 0.0, "bias voltage of the electrodes", nominal=10.0, terminal="electrical"),
)

OUTPUTS = (
    _output(
        "v_x",
        "V",
        0.0,
        "x sensor voltage, latched at the last sample instant",
        nominal=1.0,
        terminal="electrical",
        discrete=True,
    ),
    _output(
        "v_y",
        "V",
        0.0,
        "y sensor voltage, latched at the last sample instant",
        nominal=1.0,
        terminal="electrical",
        discrete=True,
    ),
    _output("x", "m", 0.0, "x displacement, for analysis", nominal=1e-6, display="µm", terminal="mechanical"),
    _output("y", "m", 0.0, "y displacement, for analysis", nominal=1e-6, display="µm", terminal="mechanical"),
    # A micrometre at 3 kHz.
    _output("x_dot", "m/s", 0.0, "x velocity, for analysis", nominal=0.02, display="mm/s", terminal="mechanical"),
    _output("y_dot", "m/s", 0.0, "y velocity, for analysis", nominal=0.02, display="mm/s", terminal="mechanical"),
    _output(
        "temperature_structure",
        "K",
        298.15,
        "temperature of the structure, for analysis",
        display="degC",
        terminal="thermal",
    ),
    _output(
        "temperature_circuit",
        "K",
        298.15,
        "temperature of the circuit, for analysis",
        display="degC",
        terminal="thermal",
    ),
)

# The reference device (docs/theory/plant.md): symbols of TW 201137310, chosen numbers.
# The lowest mass and sample period exclude zero, by which the model divides.
PARAMETERS = (
    _parameter("m", "kg", 1.8e-7, "proof mass", low=1e-18, display="µg"),
    _parameter("kxx", "N/m", 63.955, "stiffness, x axis", low=0.0),
    _parameter("kyy", "N/m", 95.92, "stiffness, y axis", low=0.0),
    _parameter("kxy", "N/m", 12.779, "stiffness, cross axis", nominal=10.0),
    _parameter("dxx", "N.s/m", 1.8e-6, "damping, x axis", low=0.0),
    _parameter("dyy", "N.s/m", 1.8e-6, "damping, y axis", low=0.0),
    _parameter("dxy", "N.s/m", 3.6e-7, "damping, cross axis", nominal=1e-6),
    _parameter("sense_gain_x", "V/m", 1e6, "pickoff gain, x axis"),
    _parameter("sense_gain_y", "V/m", 1e6, "pickoff gain, y axis"),
    _parameter("x_start", "m", 0.0, "x displacement at the start", nominal=1e-6, display="µm"),
    _parameter("x_dot_start", "m/s", 0.0, "x velocity at the start", nominal=0.02, display="mm/s"),
    _parameter("y_start", "m", 0.0, "y displacement at the start", nominal=1e-6, display="µm"),
    _parameter("y_dot_start", "m/s", 0.0, "y velocity at the start", nominal=0.02, display="mm/s"),
    _parameter("internal_step", "s", 5e-6, "longest step of the integrator, whose grid it is", 1e-9, 1e3, display="µs"),
    _parameter("sample_period", "s", 5e-6, "time between samples and between draws of noise", 1e-9, 1e3, display="µs"),
    Quantity("seed", "1", 0, "seed of all noises", "parameter", 0, 2**31 - 1, integer=True),
    Quantity(
        "step_limit",
        "1",
        0,
        "internal steps after which a step ends early; 0: none",
        "parameter",
        0,
        2**31 - 1,
        integer=True,
    ),
)
