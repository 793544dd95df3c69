"""What the package goes through in a run: its rate and its temperature against time, held over each sample."""

from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.rate_profile import RateProfile
from gyro_model import units
from gyro_model.errors import InputError, nearest
from gyro_model.tables import Table, misread, read_table, stated_unit

Floats = NDArray[np.float64]

ZERO_CELSIUS: Final = units.ZERO_CELSIUS
"""0 °C in K."""
COLDEST: Final = 100.0
HOTTEST: Final = 600.0
"""Temperatures beyond these [K] are taken for a wrong unit."""
STEP_PATTERN: Final = (0, 1, 0, -1)
"""A rate step: rest, +R, rest, -R, each for a quarter of the period."""
TIME: Final = "t"
TEMPERATURES: Final = {"temperature_deg_c": "degC", "temperature": "K"}
"""Headings of a temperature profile that name no unit, and what it is."""
LARGEST_JUMP: Final = 1.0
"""A temperature may change by this much from one row of the record to the next [K]: 0.15 Hz of a 5 kHz resonance,
which no phase loop in use loses; a jump would ring through every row that follows."""


class Course(NamedTuple):
    """A quantity against time. values: t [s], shape (n,), to its value there; length [s]; text: for the report; stays:
    between two steps [s], inf where there are none; means: of the samples (first, count, period), where they are known
    better than by the values in their middle."""

    values: Callable[[Floats], Floats]
    length: float
    text: str
    stays: float = np.inf
    means: Callable[[int, int, float], Floats] | None = None

    def held(self, first: int, count: int, period: float) -> Floats:
        """The values held over the samples first .. first + count - 1 at ``period`` [s], shape (count,)."""
        if self.means is not None:
            return self.means(first, count, period)
        return self.values((np.arange(first, first + count) + 0.5) * np.float64(period))


def constant(value: float, text: str) -> Course:
    """A course that stays."""
    return Course(lambda t: np.full(len(t), value), np.inf, text)


LARGEST_STEP = 1e5
"""Rate step at most [deg/s]: ten times what gyroscopes for projectiles measure."""
LARGEST_RATE = np.deg2rad(LARGEST_STEP)


def rate_step(rate: float, period: float) -> Course:
    """Rest, +``rate``, rest, -``rate`` [rad/s], over ``period`` [s] and again."""
    if not 0 < rate <= LARGEST_RATE:
        raise InputError(f"rate step {np.rad2deg(rate):g} deg/s: give a rate above 0, up to {LARGEST_STEP:g} deg/s")
    if not (np.isfinite(period) and period > 0):
        raise InputError(f"rate period {period:g} s: give a positive time")
    pattern = rate * np.array(STEP_PATTERN, dtype=float)

    def values(t: Floats) -> Floats:
        return pattern[np.floor(t / period * len(pattern)).astype(int) % len(pattern)]

    text = f"0, +{np.rad2deg(rate):g}, 0, -{np.rad2deg(rate):g} deg/s over {period:g} s"
    return Course(values, np.inf, text, period / len(pattern))


def rate_profile(profile: RateProfile) -> Course:
    """A measured rate: the slope of its angle, so that no turn is lost between samples."""
    rate = profile.angle.derivative()
    return Course(lambda t: rate(np.minimum(t, profile.length)), profile.length, f"measured: {profile.name}")


def constant_temperature(celsius: float) -> Course:
    """One temperature [°C]."""
    _check_temperature(celsius + ZERO_CELSIUS)
    return constant(celsius + ZERO_CELSIUS, f"{celsius:g} °C")


def _check_temperature(value: float) -> None:
    if not COLDEST < value < HOTTEST:
        raise InputError(f"temperature {value - ZERO_CELSIUS:g} °C: give one from -173 to 326 °C")


def temperature_ramp(start: float, stop: float, ramp: float) -> Course:
    """From ``start`` to ``stop`` [K] at ``ramp`` [K/min], then held."""
    _check_temperature(start)
    _check_temperature(stop)
    if not (np.isfinite(ramp) and ramp > 0) or start == stop:
        raise InputError(
            f"temperature {start - ZERO_CELSIUS:g},{stop - ZERO_CELSIUS:g},{ramp:g}: "
            "give START,STOP,RAMP in °C, °C, °C/min with START other than STOP and RAMP > 0"
        )
    length = abs(stop - start) / ramp * 60
    text = f"{start - ZERO_CELSIUS:g} to {stop - ZERO_CELSIUS:g} °C at {ramp:g} °C/min"
    return Course(lambda t: np.interp(t, (0.0, length), (start, stop)), length, text)


def temperature_table(path: Path) -> Course:
    """A temperature profile from a table of any kind, straight lines between the rows.

    Time: the column t, else the first, in the unit of its heading, else s. Temperature: the column whose heading names
    a unit, such as T [°C] or T_degC; temperature_deg_c is in °C, temperature in K. Others are left aside.

    Raises InputError for a file that can't be read, no such column or more than one, fewer than two rows, values that
    are no numbers, time that does not increase, a first time that is not 0, and temperatures that are in another unit.
    """
    if not path.is_file():
        raise InputError(f"temperature profile {path}: no such file; give a table or START,STOP,RAMP in °C, °C/min")
    table = read_table(path)
    heading = _temperature_heading(table)
    time = TIME if TIME in table.headings else table.headings[0]
    if time == heading:
        raise InputError(f"temperature profile {path}: no column of times: give one named {TIME}, or let it be first")
    if len(table) < 2:
        raise InputError(f"temperature profile {path}: {len(table)} rows; give two or more")
    t, temperature = table.times(time), table.quantity(heading, "K", TEMPERATURES.get(heading))
    if t[0] != 0:
        raise InputError(f"temperature profile {path}: begins at t = {t[0]:g} s; let it begin at 0")
    doubt = misread(temperature)
    if doubt is not None:
        remedy = f"name the unit in the heading, such as temperature [{doubt.likely or 'degC'}]"
        raise InputError(f"temperature profile {path}: column {heading!r} {doubt.text}; {remedy}")
    return Course(lambda s: np.interp(s, t, temperature), float(t[-1]), f"profile {path.name}")


def _temperature_heading(table: Table) -> str:
    found = [h for h in table.headings if h in TEMPERATURES or stated_unit(h, "K") is not None]
    if len(found) == 1:
        return found[0]
    near = next((near for h in table.headings if (near := nearest(h, TEMPERATURES))), "")
    some = f"more than one temperature ({', '.join(found)}): leave one" if found else f"no temperature{near}"
    raise InputError(
        f"temperature profile {table.name} has {some} (columns: {', '.join(table.headings)}); "
        "give t [s] and one of temperature_deg_c [°C], temperature [K], or a heading with its unit, such as T [°C]"
    )


def check_jumps(temperature: Course, duration: float, interval: float) -> None:
    """Raises InputError where ``temperature`` changes by over LARGEST_JUMP from one row of the record to the next,
    ``interval`` [s] later."""
    rows = temperature.values(np.arange(0.0, duration + interval, interval))
    jump = np.abs(np.diff(rows))
    if len(jump) and jump.max() > LARGEST_JUMP:
        row = int(jump.argmax())
        raise InputError(
            f"temperature changes by {jump[row]:.3g} °C within one row of the record at t = {row * interval:.6g} s: "
            f"give a ramp of at most {LARGEST_JUMP / interval:.3g} °C/s, or more rows a second with --output-rate"
        )


def check_rate(rate: Course, duration: float, interval: float, full_scale: float) -> None:
    """Raises InputError where ``rate`` is beyond the full scale of the device [rad/s], looked at ten times a row."""
    step = interval / 10
    # In pieces: hours at a fine step would fill the memory.
    for first in range(0, round(duration / step) + 1, 1_000_000):
        count = min(1_000_000, round(duration / step) + 1 - first)
        values = np.abs(rate.values((np.arange(first, first + count) + 0.5) * np.float64(step)))
        if values.max() > full_scale:
            worst = int(values.argmax())
            raise InputError(
                f"rate {np.rad2deg(values[worst]):.4g} deg/s at t = {(first + worst) * step:.4g} s is beyond the full "
                f"scale of {np.rad2deg(full_scale):.4g} deg/s: give a smaller rate, or a device with another full_scale"
            )
