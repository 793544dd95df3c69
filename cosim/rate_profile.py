"""A measured rate profile: read, checked, and resampled to one held rate a sample.

Resampling: a cubic spline through the readings (continuous acceleration, so that the resampled
rate has no content of its own above the record's), and for each hold interval the spline's exact
mean, as the difference of its antiderivative. The held rate then turns through exactly the angle
of the smooth rate in every interval, so that the true angle, the integral of what the plant sees,
is at every sample also the integral of the measured motion; the midpoint value would leave an
error of second order in the sample period.
"""

import gzip
from pathlib import Path
from typing import Final, Literal, NamedTuple, get_args

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from gyro_model.errors import InputError, nearest

Floats = NDArray[np.float64]
RateUnit = Literal["deg/s", "rad/s"]

PACKAGED: Final = Path(__file__).parent / "profiles" / "hand_motion.csv"
PACKAGED_COLUMN: Final = "omega_z"
PACKAGED_UNIT: Final[RateUnit] = "deg/s"
MINIMUM_ROWS: Final = 4
"""A cubic needs four points."""


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


def read_profile(path: Path, column: str, unit: str, time_column: str | None = None) -> RateProfile:
    """Read a rate [`unit`] and its time [s] from a .csv or .csv.gz file with a header line.

    The first column is the time unless `time_column` names another. Raises InputError for a file
    that can't be read, a missing column, a wrong unit, a value that is no finite number, time that
    does not increase, and fewer than four rows.
    """
    if unit not in get_args(RateUnit):
        raise InputError(f"rate unit {unit!r} is not known: use deg/s or rad/s")
    table = _read_table(path)
    time_column = time_column or table.columns[0]
    rate = _numbers(table, column, path)
    t = _numbers(table, time_column, path)
    _check_heading(column, unit, path)
    if len(t) < MINIMUM_ROWS:
        raise InputError(f"{path} is too short: {len(t)} rows, and a smooth rate needs {MINIMUM_ROWS} or more")
    step = np.diff(t)
    if not (step > 0).all():
        row = int(np.argmax(step <= 0)) + 1
        raise InputError(
            f"{path}: time {time_column!r} does not increase at row {row + 1} "
            f"({t[row - 1]:.9g} then {t[row]:.9g} s): sort the rows and remove repeated ones"
        )
    if unit == "deg/s":
        rate = np.deg2rad(rate)
    # Time from the first reading: an epoch time would cost the spline its digits.
    spline = CubicSpline(t - t[0], rate)
    name = f"{path.name}:{column}"
    return RateProfile(name, float(t[-1] - t[0]), spline.antiderivative())


def packaged_profile() -> RateProfile:
    """Return the profile that ships with the package (6 s of hand motion)."""
    return read_profile(PACKAGED, PACKAGED_COLUMN, PACKAGED_UNIT)


def true_angle(held_rate: Floats, period: float) -> Floats:
    """Return the angle [rad] at the start of each hold: the integral of `held_rate`, shape (n,)."""
    angle = np.empty_like(held_rate)
    angle[:1] = 0.0
    np.cumsum(held_rate[:-1] * period, out=angle[1:])
    return angle


def _read_table(path: Path) -> pl.DataFrame:
    try:
        content = path.read_bytes()
        if path.suffix == ".gz":
            content = gzip.decompress(content)
        table = pl.read_csv(content, infer_schema_length=None)
    except FileNotFoundError:
        raise InputError(f"rate profile {path} does not exist: check the path") from None
    except (OSError, EOFError) as error:
        raise InputError(f"rate profile {path} can't be read: {error}") from None
    except pl.exceptions.PolarsError as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"rate profile {path} is no table with a header line: {reason}") from None
    return table


def _numbers(table: pl.DataFrame, column: str, path: Path) -> Floats:
    """Return one column as finite numbers."""
    if column not in table.columns:
        raise InputError(
            f"{path} has no column {column!r}{nearest(column, table.columns)} (columns: {', '.join(table.columns)})"
        )
    values = table[column].cast(pl.Float64, strict=False).to_numpy()
    finite = np.isfinite(values)
    if not finite.all():
        row = int(np.argmin(finite))
        raise InputError(
            f"{path}: column {column!r} is {table[column][row]!r} in row {row + 1}, "
            "not a finite number: remove or mend the row"
        )
    return values


def _check_heading(column: str, unit: str, path: Path) -> None:
    """Refuse a unit that the column's own heading contradicts."""
    other = "rad/s" if unit == "deg/s" else "deg/s"
    if other in column and unit not in column:
        raise InputError(
            f"{path}: column {column!r} is in {other} by its heading, not in {unit}: give the unit as {other}"
        )
