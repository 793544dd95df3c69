"""A measured rate profile: read, checked, and resampled to one held rate a sample.

Resampling: a cubic spline through the readings (continuous acceleration, so that the resampled
rate has no content of its own above the record's), and for each hold interval the spline's exact
mean, as the difference of its antiderivative. The held rate then turns through exactly the angle
of the smooth rate in every interval, so that the true angle, the integral of what the plant sees,
is at every sample also the integral of the measured motion; the midpoint value would leave an
error of second order in the sample period.
"""

from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gyro_model.errors import InputError
from gyro_model.tables import read_table, stated_unit
from gyro_model.units import conversion

Floats = NDArray[np.float64]

PACKAGED: Final = Path(__file__).parent / "profiles" / "hand_motion.csv"
PACKAGED_COLUMN: Final = "omega_z"
PACKAGED_UNIT: Final = "deg/s"
MINIMUM_ROWS: Final = 4
"""A cubic needs four points."""
HOLE: Final = 10.0
"""Steps without a reading at most: what a cubic makes of a longer hole is no measurement."""
SLOW: Final = 1.0
"""A rate that is read so seldom [s] is more likely one whose time is in ms or µs."""


class RateProfile(NamedTuple):
    """A rate against time as a smooth curve.

    name: file and column; length [s]; angle: the antiderivative [rad] of the cubic spline of the
    rate [rad/s], against the time since the first reading [s].
    """

    name: str
    length: float
    angle: CubicSpline

    def held(self, start: float, first: int, count: int, period: float) -> Floats:
        """Return the rate [rad/s] held over `count` samples from index `first`, shape (count,).

        Sample k is held over [k, k + 1) `period` after `start` [s] seconds into the record. Raises
        InputError where the record does not cover that.
        """
        self.check(start, (first + count) * period)
        instants = start + np.arange(first, first + count + 1) * period
        # The last instant may pass the record's end by rounding.
        angle: Floats = self.angle(np.minimum(instants, self.length))
        return np.diff(angle) / period

    def check(self, start: float, duration: float) -> None:
        """Raise InputError unless `duration` [s] from `start` [s] lies within the record."""
        if not 0 <= start < self.length:
            raise InputError(
                f"start {start:g} s lies outside the rate profile {self.name}, "
                f"which lasts {self.length:.6g} s: choose a start within it"
            )
        # A picosecond of room for the rounding of index * period.
        if not start + duration <= self.length + 1e-12:
            raise InputError(
                f"rate profile {self.name} is too short: it lasts {self.length:.6g} s and the run "
                f"needs {duration:g} s from {start:g} s: shorten the duration or start earlier"
            )


def read_profile(path: Path, column: str, unit: str | None = None, time_column: str | None = None) -> RateProfile:
    """Read a rate and its time from a .csv, .csv.gz or .parquet file.

    The rate is in `unit`; None: in that of its heading. The first column is the time [s] unless `time_column` names
    another. Raises InputError for a file that can't be read, a missing column, no unit or a wrong one, a value that is
    no finite number, time that does not increase, or in steps of seconds without saying so, a hole, and fewer than four
    rows.
    """
    try:
        conversion(unit or "rad/s", "rad/s")
    except InputError as error:
        raise InputError(f"rate {error}") from None
    table = read_table(path)
    column = table.heading(column)
    if unit is None and column in table.headings and stated_unit(column, "rad/s") is None:
        raise InputError(f"{path}: column {column!r} names no unit: give --rate-unit deg/s or rad/s")
    rate = table.quantity(column, "rad/s", unit)
    if len(table) < MINIMUM_ROWS:
        raise InputError(f"{path} is too short: {len(table)} rows, and a smooth rate needs {MINIMUM_ROWS} or more")
    t = table.times(time_column)
    _check_unit(path, time_column or table.headings[0], t)
    check_holes(path, t)
    # Time from the first reading: an epoch time would cost the spline its digits.
    spline = CubicSpline(t - t[0], rate)
    name = f"{path.name}:{column}"
    return RateProfile(name, float(t[-1] - t[0]), spline.antiderivative())


def _check_unit(path: Path, heading: str, t: Floats) -> None:
    usual = float(np.median(np.diff(t)))
    if usual >= SLOW and stated_unit(heading, "s") is None:
        raise InputError(
            f"{path}: rows come every {usual:g} s: is {heading!r} in ms or µs? Name its unit in the heading, such as "
            "t [ms], or t [s] where it is so"
        )


def check_holes(path: Path, t: Floats) -> None:
    """Raises InputError where readings at ``t`` [s], shape (n,), through which a cubic is drawn, leave a hole."""
    step = np.diff(t)
    usual = float(np.median(step))
    if step.max() > HOLE * usual:
        row = int(step.argmax()) + 1
        raise InputError(
            f"{path}: {step[row - 1]:.6g} s without a reading after row {row} (t = {t[row - 1]:.9g} s), others come "
            f"every {usual:g} s: cut the record there, or fill the hole with rows"
        )


def packaged_profile() -> RateProfile:
    """Return the profile that ships with the package (6 s of hand motion)."""
    return read_profile(PACKAGED, PACKAGED_COLUMN, PACKAGED_UNIT)


def true_angle(held_rate: Floats, period: float) -> Floats:
    """Return the angle [rad] at the start of each hold: the integral of `held_rate`, shape (n,)."""
    angle = np.empty_like(held_rate)
    angle[:1] = 0.0
    np.cumsum(held_rate[:-1] * period, out=angle[1:])
    return angle
