"""Device files: what one device is, as FMU parameters, with the controller that fits it.

format = 1, name, [parameters], optional [intervals] (name = [low, high], 95 %), optional [controller], optional
[rate_mode]
"""

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import atan2, cos, hypot, inf, isfinite, pi, radians, sin, sqrt
from pathlib import Path
from typing import Any

from gyro_model.anatomy import Effect, Law
from gyro_model.errors import InputError, nearest
from gyro_model.model import Model, load_model
from gyro_model.toml_text import read_toml_file
from gyro_model.whole_file import whole_file

FOLDER = Path(__file__).parent / "devices"
FORMAT = 1

CONTROLLER_UNITS = {"k": "N/m", "tone_amplitude": "N", "tone_x": "Hz", "tone_y": "Hz"}
RATE_MODE_UNITS = {
    "drive_amplitude": "m",
    "full_scale": "rad/s",
    "phase_bandwidth": "Hz",
    "amplitude_bandwidth": "Hz",
    "sense_bandwidth": "Hz",
    "output_bandwidth": "Hz",
    "demodulator_bandwidth": "Hz",
}

# Of the resonance and of the static deflection: the reference device's tones (docs/theory/plant.md), scaled.
TONE_RATIO_X, TONE_RATIO_Y, TONE_DEFLECTION = 0.15, 1 / 6, 0.5e-6

PLAUSIBLE = {
    "frequency": (1.0, 1e7, " Hz"),
    "q": (1.0, 1e10, ""),
    "q_upper": (1.0, 1e10, ""),
    "mass": (1e-18, 1e3, " kg"),
    "gain": (1e-6, 1e15, " V/m"),
    "gap": (1e-9, 1e-2, " m"),
}
"""Range and unit of what a designer states. Wider than any vibratory gyroscope, from a disk at some MHz to a
demonstrator of the laboratory; narrower than where the arithmetic overflows or the motion is no vibration."""


@dataclass(frozen=True)
class Device:
    """A device: ``parameters`` by FMU name in SI, ``intervals`` likewise as (low, high), ``controller`` as in
    CONTROLLER_UNITS, ``rate_mode`` as in RATE_MODE_UNITS; ``fitted``: to a record, of whatever mechanism that is.

    Raises InputError where a name is unknown, a value is out of bounds, or stiffness or damping is not that of a
    passive device.
    """

    name: str
    parameters: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    controller: Mapping[str, float] = field(default_factory=dict)
    model: Model = field(default_factory=load_model, repr=False, compare=False)
    rate_mode: Mapping[str, float] = field(default_factory=dict)
    fitted: bool = False

    def __post_init__(self) -> None:
        for name, value in self.parameters.items():
            self.model.parameter(name).check(value)
        for name in self.intervals:
            self.model.parameter(name)
        _check_table("controller", self.controller, CONTROLLER_UNITS)
        _check_table("rate_mode", self.rate_mode, RATE_MODE_UNITS)
        check_passive(self.all_parameters)
        if not self.fitted:
            _check_describable(self.all_parameters)

    @property
    def all_parameters(self) -> dict[str, float]:
        """Every FMU parameter: this device's value, or the FMU's start value."""
        return dict(self._all_parameters)

    @cached_property
    def _all_parameters(self) -> dict[str, float]:
        starts = {q.name: self.model.start(q) for q in self.model.quantities if q.role not in ("input", "output")}
        return starts | dict(self.parameters)

    @classmethod
    def from_designer(
        cls,
        *,
        frequency: float,
        split: float,
        q: float,
        mass: float,
        axis_angle: float = 0.0,
        q_upper: float | None = None,
        gain: float | None = None,
        noise: float | None = None,
        gap: float | None = None,
        name: str = "my_device",
    ) -> "Device":
        """Make a device of what a designer knows.

        Parameters
        ----------
        frequency, split : float
            Frequency of the lower mode, and by how much the other lies above it [Hz].
        q, q_upper : float
            Quality factor of the lower mode, and of the upper one; None: the same.
        mass : float
            Proof mass [kg].
        axis_angle : float
            From x to the axis of the lower mode [deg].
        gain : float
            Of both pickoffs [V/m]; None: the FMU's start value.
        noise : float
            White noise of both pickoffs, rms a sample [V]; None: none.
        gap : float
            Of the sensing capacitors [m], whose voltage then is not linear in the displacement; None: linear.
        name : str
            Of the device.

        Returns
        -------
        Device

        Raises
        ------
        InputError
            If a number lies outside of what this model describes; the message gives the range.

        Examples
        --------
        >>> device = Device.from_designer(frequency=3000, split=30, q=2000, mass=1e-7)
        >>> [round(f, 3) for f in device.frequencies]
        [3000.0, 3030.0]

        """
        return design_device(
            name,
            frequency=frequency,
            split=split,
            q=q,
            axis_angle=axis_angle,
            mass=mass,
            q_upper=q_upper,
            gain=gain,
            noise=noise,
            gap=gap,
        )

    @property
    def frequencies(self) -> tuple[float, float]:
        """Natural frequencies of the two modes [Hz], the lower one first."""
        p = self.all_parameters
        return _frequencies(p)

    @property
    def quality_factors(self) -> tuple[float, float]:
        """Quality factors of the two modes, that of the lower frequency first; infinite without damping."""
        p = self.all_parameters
        angle = 0.5 * atan2(2 * p["kxy"], p["kxx"] - p["kyy"]) + pi / 2
        low, high = (_along(p["dxx"], p["dyy"], p["dxy"], a) for a in (angle, angle + pi / 2))
        w = [2 * pi * f for f in self.frequencies]
        first, second = (p["m"] * w / d if d > 0 else inf for w, d in zip(w, (low, high), strict=True))
        return first, second

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

    @cached_property
    def acting_laws(self) -> tuple[Law, ...]:
        """The laws of its parameters that act."""
        return tuple(law for law in self.model.laws if self.acts(law))

    def _switched_on(self, effect: Effect) -> bool:
        return any(self.parameters.get(q.name, self.model.start(q)) != q.start for q in effect.sizes)

    def with_parameters(self, changes: Mapping[str, float]) -> "Device":
        """The device with some parameters changed."""
        return replace(self, parameters=dict(self.parameters) | dict(changes))


def _check_table(table: str, entries: Mapping[str, float], units: Mapping[str, str]) -> None:
    for name, value in entries.items():
        if name not in units:
            raise InputError(f"{table} {name!r} is unknown{nearest(name, units)}")
        if not (_is_number(value) and value > 0):
            raise InputError(f"{table} {name} = {value!r}: give a positive number in {units[name]}")


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
        return _device(read_toml(path, ("parameters", "intervals", "controller", "rate_mode")), model or load_model())
    except InputError as error:
        raise InputError(f"device file {path}: {error}") from None


def read_toml(path: Path, tables: Collection[str]) -> dict[str, Any]:
    """The content of a device file, or of one of its form with these ``tables``, each checked to be one. Raises
    InputError without the path."""
    data = read_toml_file(path)
    known = ("format", "name", *tables)
    for key in data:
        if key not in known:
            raise InputError(f"key {key!r} is unknown{nearest(key, known)}")
    if data.get("format") != FORMAT:
        raise InputError(f"format = {data.get('format')!r}: this program reads format = {FORMAT}")
    if not isinstance(data.get("name"), str):
        raise InputError('name is missing: add name = "..."')
    for key in tables:
        if not isinstance(data.get(key, {}), dict):
            raise InputError(f"{key} = {data[key]!r}: make it a table [{key}]")
    return data


def _device(data: Mapping[str, Any], model: Model) -> Device:
    intervals = {name: interval(name, pair) for name, pair in data.get("intervals", {}).items()}
    parameters, controller, rate_mode = (data.get(key, {}) for key in ("parameters", "controller", "rate_mode"))
    return Device(data["name"], parameters, intervals, controller, model, rate_mode)


def interval(name: str, pair: object) -> tuple[float, float]:
    """The two bounds of an interval as read. Raises InputError where it is none."""
    if not (isinstance(pair, list) and len(pair) == 2 and all(map(_is_number, pair)) and pair[0] <= pair[1]):
        raise InputError(f"interval {name} = {pair!r}: give [low, high]")
    return float(pair[0]), float(pair[1])


def design_device(
    name: str,
    *,
    frequency: float,
    split: float,
    q: float,
    axis_angle: float,
    mass: float,
    q_upper: float | None = None,
    gain: float | None = None,
    noise: float | None = None,
    gap: float | None = None,
) -> Device:
    """The device that a designer knows by its modes; arguments as in ``Device.from_designer``.

    K = R diag(m w1², m w2²) Rᵀ and D = R diag(m w1/q, m w2/q_upper) Rᵀ. Raises InputError where a number is outside
    PLAUSIBLE.
    """
    upper = q if q_upper is None else q_upper
    given = {"frequency": frequency, "q": q, "q_upper": upper, "mass": mass, "gain": gain, "gap": gap}
    for key, value in given.items():
        _check_plausible(key, value)
    for key, value in (("split", split), ("noise", noise)):
        if value is not None and not (isfinite(value) and value >= 0):
            raise InputError(f"{key} = {value!r}: give 0 or a positive number")
    _check_plausible("frequency", frequency + split, "frequency + split")
    if not isfinite(axis_angle):
        raise InputError(f"axis_angle = {axis_angle!r}: give an angle in degrees")
    w = [2 * pi * frequency, 2 * pi * (frequency + split)]
    kxx, kyy, kxy = _rotated([mass * value**2 for value in w], radians(axis_angle))
    dxx, dyy, dxy = _rotated([mass * w[0] / q, mass * w[1] / upper], radians(axis_angle))
    parameters = {"m": mass, "kxx": kxx, "kyy": kyy, "kxy": kxy, "dxx": dxx, "dyy": dyy, "dxy": dxy}
    if gain is not None:
        parameters |= {"sense_gain_x": gain, "sense_gain_y": gain}
    if noise is not None:
        parameters["sense_noise"] = noise
    if gap is not None:
        parameters["pickoff_inverse_gap"] = 1 / gap
    return Device(name, parameters, {}, controller_for(mass * w[0] ** 2, mass))


def _check_plausible(key: str, value: float | None, shown: str = "") -> None:
    low, high, unit = PLAUSIBLE[key]
    # A designer's value at the limit comes back from K, D and m some roundings off.
    if value is not None and not (isfinite(value) and low * (1 - 1e-9) <= value <= high * (1 + 1e-9)):
        raise InputError(f"{shown or key} = {value:g}: give {low:g} to {high:g}{unit}; this model describes no other")


def _check_describable(p: Mapping[str, float]) -> None:
    """Raises InputError where mass, modes or gains are none that this model describes."""
    _check_plausible("mass", p["m"], "m")
    for value in _frequencies(p):
        _check_plausible("frequency", value, "frequency of a mode by kxx, kyy, kxy and m")
    w = (p["kxx"] / p["m"]) ** 0.5
    if p["dxx"] > 0:
        _check_plausible("q", p["m"] * w / p["dxx"], "quality factor by m, kxx and dxx")
    for gain in ("sense_gain_x", "sense_gain_y"):
        if p[gain]:
            _check_plausible("gain", abs(p[gain]), f"size of {gain}")


def _frequencies(p: Mapping[str, float]) -> tuple[float, float]:
    mean, half = 0.5 * (p["kxx"] + p["kyy"]), hypot(0.5 * (p["kxx"] - p["kyy"]), p["kxy"])
    # The product of the two is the determinant: no digits are lost where they differ much.
    upper = mean + half
    lower = (p["kxx"] * p["kyy"] - p["kxy"] ** 2) / upper
    return sqrt(lower / p["m"]) / (2 * pi), sqrt(upper / p["m"]) / (2 * pi)


def _along(xx: float, yy: float, xy: float, angle: float) -> float:
    """The quadratic form along ``angle`` [rad]."""
    c, s = cos(angle), sin(angle)
    return xx * c * c + yy * s * s + 2 * xy * c * s


def _rotated(values: list[float], angle: float) -> tuple[float, float, float]:
    along, across, c, s = *values, cos(angle), sin(angle)
    # Adding zero turns a cross term of -0.0 into 0.0.
    return along * c * c + across * s * s, along * s * s + across * c * c, (along - across) * c * s + 0.0


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
    tables: dict[str, tuple[Mapping[str, Any], Mapping[str, str]]] = {
        "parameters": (dict(device.parameters), units),
        "intervals": (dict(device.intervals), {}),
        "controller": (dict(device.controller), CONTROLLER_UNITS),
        "rate_mode": (dict(device.rate_mode), RATE_MODE_UNITS),
    }
    write_file(path, device.name, tables, note)


def write_file(
    path: Path, name: str, tables: Mapping[str, tuple[Mapping[str, Any], Mapping[str, str]]], note: str = ""
) -> None:
    """Writes a file of the form of a device file: ``tables`` by name as (entries, units), each entry a number or a
    pair; empty ones are left out, but for [parameters]. An existing file is replaced whole."""
    lines = [*(f"# {line}" for line in note.splitlines()), f"format = {FORMAT}", f"name = {_quoted(name)}"]
    for table, (entries, units) in tables.items():
        if entries or table == "parameters":
            lines += ["", f"[{table}]", *(_entry(key, value, units.get(key)) for key, value in entries.items())]
    if not path.parent.is_dir():
        raise InputError(f"file {path}: there is no folder {path.parent}; make it, or name another place")
    try:
        with whole_file(path) as file:
            file.write(("\n".join(lines) + "\n").encode())
    except OSError as error:
        raise InputError(f"file {path}: {error.strerror}; name another place") from None


def _entry(name: str, value: Any, unit: str | None) -> str:
    text = f"[{', '.join(map(_digits, value))}]" if isinstance(value, tuple) else _digits(value)
    return f"{name} = {text}" + (f" # {unit}" if unit else "")
