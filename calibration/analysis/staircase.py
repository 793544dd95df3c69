"""Scale factor, linearity and threshold, from a run through plateaus of the rate (terms as in IEEE Std 528)."""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.analysis.regression import least_squares
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

PPM: Final = 1e6
PARTS: Final = 8
"""A plateau's standard error comes from the scatter of this many parts of it."""
ROWS: Final = 3 * PARTS
"""A plateau of fewer settled rows is left out."""
RESPONSE: Final = 0.5
"""A plateau is seen where the output is at least this share of what the scale factor makes of the rate."""
SURE: Final = 2.0
"""And where it differs from the output at rest by this many standard errors."""


class Plateaus(NamedTuple):
    """Plateaus of constant rate. begin [s]; rate: true, measured, its standard error [rad/s]; shapes (m,)."""

    begin: Floats
    rate: Floats
    measured: Floats
    error: Floats


class Staircase(NamedTuple):
    """What the plateaus show: measured = scale_factor * rate + bias.

    scale_factor_ppm: its error, 1e6 (scale_factor - 1); bias [rad/s]; each with its standard error; residual_ppm: of
    each plateau, of full scale, the largest rate; nonlinearity_ppm: the largest of these; asymmetry_ppm: scale factor
    of positive rates less that of negative ones, with its standard error, None where one side is missing; response:
    output of each plateau over what the scale factor makes of its rate, NaN where that is nothing, with its standard
    error; threshold: the smallest rate from which on all plateaus are seen [rad/s], None where the largest is not.
    """

    plateaus: Plateaus
    scale_factor_ppm: float
    scale_factor_error_ppm: float
    bias: float
    bias_error: float
    residual_ppm: Floats
    nonlinearity_ppm: float
    asymmetry_ppm: float | None
    asymmetry_error_ppm: float | None
    response: Floats
    response_error: Floats
    threshold: float | None


def plateaus(t: Floats, angle: Floats, rate: Floats, settling: float) -> Plateaus:
    """The plateaus of ``rate`` [rad/s], held from each row to the next, with the slope of ``angle`` [rad] on each.

    t [s], rising; shapes (n,). Rows within ``settling`` [s] after a change are left out, and plateaus with too few
    rows or a row without a number.
    """
    changes = np.flatnonzero(np.diff(rate) != 0) + 1
    found = []
    for begin, end in zip([0, *changes.tolist()], [*changes.tolist(), len(t)], strict=True):
        rows = slice(begin + int(np.searchsorted(t[begin:end] - t[begin], settling)), end)
        if rows.stop - rows.start >= ROWS and np.isfinite(angle[rows]).all():
            found.append((t[begin], rate[begin], *slope_with_error(t[rows], angle[rows])))
    if not found:
        raise InputError(
            f"no plateau of the rate has {ROWS} rows more than {settling:g} s after its begin: give longer plateaus"
        )
    return Plateaus(*np.array(found).T)


def staircase(found: Plateaus) -> Staircase:
    """Scale factor, linearity, asymmetry and threshold of plateaus. Raises InputError where there are fewer than three
    or all have one rate."""
    rate, measured = found.rate, found.measured
    line = least_squares(np.stack([rate, np.ones_like(rate)], axis=1), measured)
    scale, bias = line.values.tolist()
    residual = PPM * line.residual / np.abs(rate).max()
    # At rest the output is the bias itself; the line's also bends with what is not linear.
    rest = float(measured[rate == 0].mean()) if (rate == 0).any() else bias
    expected = np.where(scale * rate == 0, np.nan, scale * rate)
    response = (measured - rest) / expected
    response_error = found.error / np.abs(expected)
    seen = (response >= RESPONSE) & (np.abs(measured - rest) >= SURE * found.error)
    return Staircase(
        found,
        PPM * (scale - 1),
        PPM * float(line.errors[0]),
        bias,
        float(line.errors[1]),
        residual,
        float(np.abs(residual).max()),
        *_asymmetry(rate, measured),
        response,
        response_error,
        _threshold(np.abs(rate), seen),
    )


def _asymmetry(rate: Floats, measured: Floats) -> tuple[float | None, float | None]:
    """Of measured = bias + scale * rate + half the asymmetry * abs(rate)."""
    if not ((rate > 0).any() and (rate < 0).any() and len(np.unique(np.abs(rate))) > 1 and len(rate) > 3):
        return None, None
    fit = least_squares(_lopsided(rate), measured)
    return PPM * float(fit.values[0]), PPM * float(fit.errors[0])


def _lopsided(rate: Floats) -> Floats:
    return np.stack([np.abs(rate) / 2, rate, np.ones_like(rate)], axis=1)


def asymmetry_errors(rate: Floats, noise: float) -> tuple[float, float]:
    """Standard errors of scale factor and asymmetry of plateaus at ``rate`` [rad/s], shape (n,), each with the error
    ``noise``, in its unit over rad/s."""
    design = _lopsided(rate)
    line = design[:, 1:]
    scale = np.linalg.inv(line.T @ line)[0, 0]
    return noise * float(scale) ** 0.5, noise * float(np.linalg.inv(design.T @ design)[0, 0]) ** 0.5


def _threshold(size: Floats, seen: NDArray[np.bool_]) -> float | None:
    """The smallest rate above every plateau that is not seen."""
    missed = size[(size > 0) & ~seen].max(initial=0.0)
    above = size[size > missed]
    return float(above.min()) if len(above) else None


def slope_with_error(t: Floats, values: Floats) -> tuple[float, float]:
    """Slope of ``values`` [rad] over ``t`` [s], shapes (n,), n >= ROWS, and its standard error by the scatter of the
    slopes of PARTS parts: right for a random walk of the angle, too large for white noise on it.

    Raises InputError for fewer rows.
    """
    if len(t) < ROWS:
        raise InputError(f"{len(t)} rows: a slope and its error need {ROWS}")
    parts = zip(np.array_split(t, PARTS), np.array_split(values, PARTS), strict=True)
    slopes = np.array([_slope(*part) for part in parts])
    return _slope(t, values), float(slopes.std(ddof=1)) / PARTS**0.5


def _slope(t: Floats, values: Floats) -> float:
    since = t - t.mean()
    return float(since @ values / (since @ since))
