"""Device files: what one device is, as FMU parameters, with the controller that fits it (SYSTEM.md section 8).

format = 1, name, [parameters], optional [intervals] (name = [low, high], 95 %), optional [controller]
"""

import json
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import cos, isfinite, pi, radians, sin
from pathlib import Path
from typing import Any

from gyro_model.anatomy import Effect
from gyro_model.errors import InputError, nearest
from gyro_model.model import Model, load_model

FOLDER = Path(__file__).parent / "devices"
FORMAT = 1

CONTROLLER_UNITS = {"k": "N/m", "tone_amplitude": "N", "tone_x": "Hz", "tone_y": "Hz"}

# Of the resonance and of the static deflection: the reference device's tones (SYSTEM.md section 3), scaled.
TONE_RATIO_X, TONE_RATIO_Y, TONE_DEFLECTION = 0.15, 1 / 6, 0.5e-6


@dataclass(frozen=True)
class Device:
    """A device: ``parameters`` by FMU name in SI, ``intervals`` likewise as (low, high), ``controller`` as in
    CONTROLLER_UNITS.

    Raises InputError where a name is unknown, a value is out of bounds, or stiffness or damping is not that of a
    passive device.
    """

    name: str
    parameters: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    controller: Mapping[str, float] = field(default_factory=dict)
    model: Model = field(default_factory=load_model, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name, value in self.parameters.items():
            self.model.parameter(name).check(value)
        for name in self.intervals:
            self.model.parameter(name)
        for name, value in self.controller.items():
            if name not in CONTROLLER_UNITS:
                raise InputError(f"controller {name!r} is unknown{nearest(name, CONTROLLER_UNITS)}")
            if not (_is_number(value) and value > 0):
                raise InputError(f"controller {name} = {value!r}: give a positive number in {CONTROLLER_UNITS[name]}")
        check_passive(self.all_parameters)

    @property
    def all_parameters(self) -> dict[str, float]:
        """Every FMU parameter: this device's value, or the FMU's start value."""
        starts = {q.name: q.start for q in self.model.quantities if q.role not in ("input", "output")}
        return starts | dict(self.parameters)

    @property
    def all_controller(self) -> dict[str, float]:
        """Every entry of [controller]: as given, or scaled from the reference device to this one's stiffness and
        resonance."""
        values = self.all_parameters
        return controller_for(values["kxx"], values["m"]) | dict(self.controller)

    def acts(self, effect: Effect) -> bool:
        """Whether ``effect`` acts in this device: it is nominal, a size parameter differs from neutral, or a law that
        acts changes one."""
        return effect.nominal or any(map(self._switched_on, (effect, *self.model.wakers(effect))))

    def _switched_on(self, effect: Effect) -> bool:
        return any(self.parameters.get(q.name, q.start) != q.start for q in effect.sizes)

    def with_parameters(self, changes: Mapping[str, float]) -> "Device":
        """The device with some parameters changed."""
        return Device(self.name, dict(self.parameters) | dict(changes), self.intervals, self.controller, self.model)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and isfinite(value)


def check_passive(p: Mapping[str, float]) -> None:
    """Raises InputError unless the stiffness matrix is positive definite and the damping matrix feeds no energy."""
    if not (p["kxx"] > 0 and p["kxx"] * p["kyy"] > p["kxy"] ** 2):
        raise InputError(
            f"stiffness kxx = {p['kxx']:g}, kyy = {p['kyy']:g}, kxy = {p['kxy']:g} N/m is not positive definite: "
            "make kxx*kyy > kxy^2"
        )
    if p["dxx"] * p["dyy"] < p["dxy"] ** 2:
        raise InputError(
            f"damping dxx = {p['dxx']:g}, dyy = {p['dyy']:g}, dxy = {p['dxy']:g} N.s/m feeds energy: "
            "make dxx*dyy >= dxy^2"
        )


def controller_for(k: float, m: float) -> dict[str, float]:
    """The entries of [controller] for an oscillator of stiffness ``k`` [N/m] and mass ``m`` [kg]."""
    frequency = (k / m) ** 0.5 / (2 * pi)
    tones = {"tone_x": TONE_RATIO_X * frequency, "tone_y": TONE_RATIO_Y * frequency}
    return {"k": k, "tone_amplitude": TONE_DEFLECTION * k, **tones}


def packaged_devices() -> dict[str, Path]:
    """The device files that come with the package, by name."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}


def load_device(name: str, model: Model | None = None) -> Device:
    """The device of a packaged name or of the file at that path. Raises InputError where there is none or it is
    wrong."""
    packaged = packaged_devices()
    path = packaged.get(name, Path(name))
    if not path.is_file():
        hint = nearest(name, packaged) or f"; packaged are {', '.join(packaged)}"
        raise InputError(f"device {name!r}: neither a packaged device nor a file{hint}")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"device file {path}: not TOML: {error}") from None
    try:
        return _device(data, model or load_model())
    except InputError as error:
        raise InputError(f"device file {path}: {error}") from None


def _device(data: Mapping[str, Any], model: Model) -> Device:
    known = ("format", "name", "parameters", "intervals", "controller")
    for key in data:
        if key not in known:
            raise InputError(f"key {key!r} is unknown{nearest(key, known)}")
    if data.get("format") != FORMAT:
        raise InputError(f"format = {data.get('format')!r}: this program reads format = {FORMAT}")
    if not isinstance(data.get("name"), str):
        raise InputError('name is missing: add name = "..."')
    tables = {key: data.get(key, {}) for key in known[2:]}
    for key, table in tables.items():
        if not isinstance(table, dict):
            raise InputError(f"{key} = {table!r}: make it a table [{key}]")
    intervals = {name: _interval(name, pair) for name, pair in tables["intervals"].items()}
    return Device(data["name"], tables["parameters"], intervals, tables["controller"], model)


def _interval(name: str, pair: object) -> tuple[float, float]:
    if not (isinstance(pair, list) and len(pair) == 2 and all(map(_is_number, pair)) and pair[0] <= pair[1]):
        raise InputError(f"interval {name} = {pair!r}: give [low, high]")
    return float(pair[0]), float(pair[1])


def design_device(name: str, *, frequency: float, split: float, q: float, axis_angle: float, mass: float) -> Device:
    """The device that a designer knows by its modes.

    frequency: of the lower mode [Hz]; split: the other lies above it by this [Hz]; q: quality factor of both;
    axis_angle: from x to the axis of the lower mode [deg]; mass [kg]. K = R diag(m w1², m w2²) Rᵀ and D = R diag(m
    w1/q, m w2/q) Rᵀ. Raises InputError where one is not a positive number (split and axis_angle may be 0).
    """
    given = {"frequency": frequency, "split": split, "q": q, "mass": mass}
    for key, value in given.items():
        if not (isfinite(value) and (value > 0 or (key == "split" and value == 0))):
            raise InputError(f"{key} = {value!r}: give a positive number")
    if not isfinite(axis_angle):
        raise InputError(f"axis_angle = {axis_angle!r}: give an angle in degrees")
    w = [2 * pi * frequency, 2 * pi * (frequency + split)]
    kxx, kyy, kxy = _rotated([mass * value**2 for value in w], radians(axis_angle))
    dxx, dyy, dxy = _rotated([mass * value / q for value in w], radians(axis_angle))
    parameters = {"m": mass, "kxx": kxx, "kyy": kyy, "kxy": kxy, "dxx": dxx, "dyy": dyy, "dxy": dxy}
    return Device(name, parameters, {}, controller_for(mass * w[0] ** 2, mass))


def _rotated(values: list[float], angle: float) -> tuple[float, float, float]:
    along, across, c, s = *values, cos(angle), sin(angle)
    return along * c * c + across * s * s, along * s * s + across * c * c, (along - across) * c * s


def _digits(value: float) -> str:
    # A numpy float has another repr than the float that it is.
    return repr(value) if isinstance(value, int) else repr(float(value))


def _quoted(text: str) -> str:
    # JSON's escapes are TOML's, but for DEL, which JSON leaves as it is.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def write_device(device: Device, path: Path, note: str = "") -> None:
    """Writes a device file that ``load_device`` reads back to the last bit, each number with its unit. An existing
    file is replaced whole."""
    units = {name: device.model.parameter(name).unit for name in device.parameters}
    lines = [*(f"# {line}" for line in note.splitlines()), f"format = {FORMAT}", f"name = {_quoted(device.name)}"]
    lines += ["", "[parameters]"]
    lines += [f"{name} = {_digits(value)} # {units[name]}" for name, value in device.parameters.items()]
    if device.intervals:
        lines += ["", "[intervals]"]
        lines += [f"{name} = [{_digits(low)}, {_digits(high)}]" for name, (low, high) in device.intervals.items()]
    if device.controller:
        lines += ["", "[controller]"]
        lines += [f"{name} = {_digits(value)} # {CONTROLLER_UNITS[name]}" for name, value in device.controller.items()]
    beside = path.with_name(path.name + ".part")
    beside.write_text("\n".join(lines) + "\n", encoding="utf-8")
    os.replace(beside, path)
