"""A design: all that the loop may know of a device. What the device is, its device file says; no other value of it
reaches observer, controller or angle unit.

A design file has the form of a device file: [parameters] are nominal values, [intervals] (95 %) what is uncertain. The
seven constants of the plant are always estimated; where the file does not give them, first estimates are drawn 10 to
50 % off by the seed, as TW 201137310 does. An effect's parameter without an interval is known, with one it is
estimated; effects that the file does not name are taken to be absent. Gains, noise and start are those stated in the
device file. [scaling] and [reference] let the intervals of a packaged design fit devices of any size.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from cosim.known_model import KnownModel, can_be_estimated
from cosim.layout import PARAMETER_NAMES
from gyro_model.device import Device, interval, read_toml, write_file
from gyro_model.errors import InputError, nearest
from gyro_model.model import Model
from gyro_model.quantities import Quantity

Floats = NDArray[np.float64]

FOLDER: Final = Path(__file__).parent / "designs"
DEFAULT: Final = "plain"
SIGMAS: Final = 2 * 1.959963984540054
"""Width of a 95 % interval in standard deviations."""
FIRST_ERROR: Final = (0.1, 0.5)
"""First estimates that are drawn are off by this much, relative, least and most."""
FIRST_DEVIATION: Final = 0.3
"""Standard deviation, relative, of the seven where no interval says another: errors uniform on 10 to 50 % have an rms
of 32 %."""
CROSS_DEVIATION: Final = 0.03
"""Of a cross stiffness or damping at least, as a part of the geometric mean: it may be zero and still be uncertain."""
DEFAULT_AMPLITUDE: Final = 1e-6
"""Amplitude of the pattern of a device that starts at rest [m]."""
FROM_DEVICE: Final = ("sense_gain_x", "sense_gain_y", "x_start", "x_dot_start", "y_start", "y_dot_start")
"""Stated in the device file where the design does not give them, as is all noise."""
ALWAYS_NOISE: Final = "sense_noise"
"""The loop always reckons with it: a filter without noise is singular (see NOISE_FLOOR in cosim/running.py)."""
TABLES: Final = ("parameters", "intervals", "controller", "monitor", "scaling", "reference")


@dataclass(frozen=True)
class Design:
    """What the loop knows: ``values`` by FMU name (SI), known or first estimates; ``deviations``, standard deviations
    of what is estimated; ``controller`` and ``monitor``, settings by name.

    Raises InputError for an unknown name, and for a parameter that the loop can't estimate.
    """

    name: str
    values: Mapping[str, float]
    deviations: Mapping[str, float]
    model: Model = field(repr=False, compare=False)
    controller: Mapping[str, float] = field(default_factory=dict)
    monitor: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in (*self.values, *self.deviations):
            self.model.parameter(name)
        for name in PARAMETER_NAMES:
            if name not in self.values or not self.deviations.get(name, 0.0) > 0:
                raise InputError(f"design {self.name}: {name} has no value or no uncertainty; give both")
        if not self.values["m"] > 0:
            raise InputError(f"design {self.name}: m = {self.values['m']:g} kg: give a positive mass")
        self.known_model  # noqa: B018  (refuses what can't be estimated)

    @property
    def all_values(self) -> dict[str, float]:
        """Every parameter of the model: the design's value, or the neutral one."""
        return dict(self._all_values)

    @cached_property
    def _all_values(self) -> dict[str, float]:
        return {q.name: q.start for q in self.model.quantities if q.role not in ("input", "output")} | dict(self.values)

    @cached_property
    def known_model(self) -> KnownModel:
        """The model that observer and controller work on."""
        values = self.all_values
        acting = [
            effect.id
            for effect in self.model.effects
            if not effect.nominal
            and (
                effect.id == ALWAYS_NOISE
                or any(values[q.name] != q.start or q.name in self.deviations for q in effect.sizes)
            )
        ]
        estimated = tuple(name for name in self.deviations if name not in PARAMETER_NAMES)
        return KnownModel(self.model, tuple(acting), estimated)

    @property
    def amplitude(self) -> float:
        """Amplitude that the controller holds [m]: that of the start."""
        return float(np.hypot(self.all_values["x_start"], self.all_values["y_start"])) or DEFAULT_AMPLITUDE

    @property
    def stiffness(self) -> float:
        """Stiffness of the isotropic oscillator that the controller makes of the device [N/m]."""
        return float(self.controller.get("k", self.values["kxx"]))

    @property
    def oscillation_hz(self) -> float:
        """Its frequency, as far as the nominal mass tells."""
        return float(np.sqrt(self.stiffness / self.values["m"]) / (2 * np.pi))

    def without_estimates(self) -> "Design":
        """The same where every effect counts as known at its nominal value, for an observer that estimates none."""
        return replace(self, deviations={name: self.deviations[name] for name in PARAMETER_NAMES})

    def write(self, path: Path) -> None:
        """Writes a complete file: ``load_design`` needs nothing of a device to read it."""
        units = {name: self.model.parameter(name).unit for name in self.values}
        half = {name: 0.5 * SIGMAS * deviation for name, deviation in self.deviations.items()}
        intervals = {name: (self.values[name] - by, self.values[name] + by) for name, by in half.items()}
        tables: dict[str, tuple[Mapping[str, Any], Mapping[str, str]]] = {
            "parameters": (dict(self.values), units),
            "intervals": (intervals, units),
            "controller": (dict(self.controller), {}),
            "monitor": (dict(self.monitor), {}),
        }
        write_file(path, self.name, tables, "All that the loop knew in this run.")


def packaged_designs() -> dict[str, Path]:
    """The design files that come with the package, by name."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}


def chosen_design(given: "str | Design | None", device: Device, seed: int, default: str = DEFAULT) -> Design:
    """The design ``given``, by name, file or itself; None: ``default``, with the controller that the device states.

    Raises InputError where there is none or it is wrong.
    """
    if given is not None:
        return given if isinstance(given, Design) else load_design(given, device, seed)
    design = load_design(default, device, seed)
    return replace(design, controller={**device.controller, **design.controller})


def load_design(name: str, device: Device, seed: int) -> Design:
    """The design of a packaged name or of a file, complete: what it leaves open is drawn or taken from what ``device``
    states.

    Raises InputError where there is none or it is wrong.
    """
    seed = int(device.model.parameter("seed").check(seed))
    packaged = packaged_designs()
    path = packaged.get(name, Path(name))
    if not path.is_file():
        hint = nearest(name, packaged) or f"; packaged are {', '.join(packaged)}"
        raise InputError(f"design {name!r}: neither a packaged design nor a file{hint}")
    try:
        return _complete(read_toml(path, (*TABLES, "rate_mode")), device, seed)
    except InputError as error:
        raise InputError(f"design file {path}: {error}") from None


def _complete(data: Mapping[str, Any], device: Device, seed: int) -> Design:
    model = device.model
    tables: dict[str, dict[str, Any]] = {key: data.get(key, {}) for key in TABLES}
    given = {name: model.parameter(name).check(value) for name, value in tables["parameters"].items()}
    for name in (*given, *tables["intervals"]):
        if model.parameter(name).role == "start":
            raise InputError(f"{name}: no loop knows what a device does as it starts; leave it out of the design")
    stated = [*FROM_DEVICE, *(q.name for e in model.effects if e.noise for q in e.parameters)]
    values = {name: device.all_parameters[name] for name in stated} | _drawn(device, seed) | given
    reference = tables["reference"]
    sizes = values | {"x_start": float(np.hypot(values["x_start"], values["y_start"])) or DEFAULT_AMPLITUDE}
    factors = {
        name: float(np.prod([(sizes[key] / reference[key]) ** power for key, power in powers.items()]))
        for name, powers in tables["scaling"].items()
    }
    deviations = {name: FIRST_DEVIATION * abs(values[name]) for name in PARAMETER_NAMES}
    for cross, first, second in (("kxy", "kxx", "kyy"), ("dxy", "dxx", "dyy")):
        mean = float(np.sqrt(abs(values[first] * values[second])))
        deviations[cross] = max(deviations[cross], CROSS_DEVIATION * mean)
    for name, pair in tables["intervals"].items():
        low, high = (factors.get(name, 1.0) * bound for bound in interval(name, pair))
        quantity = model.parameter(name)
        if name in FROM_DEVICE:
            raise InputError(
                f"interval {name}: it is a gauge of the loop, or its start; give pickoff_gain_mismatch or a value"
            )
        _check_width(quantity, low, high)
        values[name] = given.get(name, min(max(0.5 * (low + high), quantity.low), quantity.high))
        # What the loop can't find out it takes as known.
        if high > low and (name in PARAMETER_NAMES or can_be_estimated(model, name)):
            deviations[name] = (high - low) / SIGMAS
    controller = dict(tables["controller"])
    for tone in ("tone", "tone2"):
        if f"{tone}_deflection" in controller:
            deflection = controller.pop(f"{tone}_deflection")
            controller[f"{tone}_amplitude"] = deflection * controller.get("k", values["kxx"])
    return Design(str(data["name"]), values, deviations, model, controller, dict(tables["monitor"]))


def _check_width(quantity: Quantity, low: float, high: float) -> None:
    """Raises InputError where an interval is none of ``quantity``: beside all that it can be, or wider. One that
    reaches beyond an end is: it stands for a deviation about a value that may be near there."""
    beside = high < quantity.low or low > quantity.high
    # The ends of one that a design has written are rounded.
    if beside or high - low > (quantity.high - quantity.low) * (1 + 1e-9):
        raise InputError(
            f"interval {quantity.name} = [{low:g}, {high:g}] {quantity.unit}: it can be {quantity.low:g} to "
            f"{quantity.high:g} {quantity.unit} at all; give an interval within that, in {quantity.unit}"
        )


def _drawn(device: Device, seed: int) -> dict[str, float]:
    """First estimates of the seven, 10 to 50 % off the device's own, sign and size drawn by the seed."""
    rng = np.random.default_rng(seed)
    # Of each run sixteen numbers are drawn: the states and the rate came first, and seeds keep their meaning.
    count = len(PARAMETER_NAMES) + 5
    error = rng.uniform(*FIRST_ERROR, count) * rng.choice((-1.0, 1.0), count)
    true = device.all_parameters
    return {name: true[name] * (1 + e) for name, e in zip(PARAMETER_NAMES, error[5:].tolist(), strict=True)}
