"""Allan deviation of a record at rest, what is read off it, and the limits that the device itself sets.

Angle random walk N: sigma = N/sqrt(tau) where the slope is -1/2; bias instability B: the flat bottom over
sqrt(2 ln 2/π) = 0.664 (IEEE Std 952, annex C).
"""

from math import log, pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.rate.settings import Nominal
from gyro_model.errors import InputError
from gyro_model.symbols import BOLTZMANN

Floats = NDArray[np.float64]

FLAT: Final = sqrt(2 * log(2) / pi)
MINIMUM_ROWS: Final = 100
"""Fewer rows give no slope to read from."""
FIT_ERROR: Final = 2.5
"""The standard error of N is this times that of the deviation at the window's start: 2.1 to 2.9 in 150 records each of
white noise, windows of 0.05 to 0.5 s in 400 s."""
MEMORIES: Final = 40.0
"""Angle random walk is read from this many delays of the output filter on: from 10 on an open loop 50 Hz off reads 3 %
too much, from 40 on 1 %."""
DECAYS: Final = 3.0
"""And in an open loop from this many decay times of the sense mode on: until then the deviation follows the phase of
its ringing at the split. At Q = 38,000 and a split of 9.7 Hz N reads 69 % too much from 40 delays on, up to 10 % from
one decay on, 1 to 3 % from two, 1 % from three, where five records of 2000 s know it to 5 %."""
LONGEST_SHARE: Final = 1 / 9
"""Averaging times up to this share of the record: eight differences and more, 25 % of statistical error."""


class Allan(NamedTuple):
    """tau [s], deviation [rad/s] and its statistical standard error [rad/s], shape (n,).

    angle_random_walk [rad/sqrt(s)] with its standard error; bias_instability [rad/s], at instability_tau [s]:
    None where the deviation still falls at the end of the record.
    """

    tau: Floats
    deviation: Floats
    error: Floats
    angle_random_walk: float
    angle_random_walk_error: float
    bias_instability: float | None
    instability_tau: float | None


def allan_deviation(rate: Floats, interval: float, white_from: float) -> Allan:
    """Of a record of ``rate`` [rad/s], shape (n,), one each ``interval`` [s]; overlapping estimator.

    white_from: averaging time [s] below which filters and the sense axis show (RateRun.white_from). Raises InputError
    where the record is too short, saying how long it must be.
    """
    shortest = max(interval, white_from)
    needed = max(MINIMUM_ROWS * interval, 4 * shortest / LONGEST_SHARE)
    if len(rate) * interval < needed:
        raise InputError(f"record at rest of {len(rate) * interval:.4g} s: an Allan deviation needs {needed:.4g} s")
    tau, deviation = overlapping(rate, interval)
    # Independent differences in the overlapping estimator of white noise: about 3/2 of n tau_0/tau.
    error = deviation / np.sqrt(2 * 1.5 * len(rate) * interval / tau)
    walk, walk_error = _random_walk(tau, deviation, error, shortest)
    return Allan(tau, deviation, error, walk, walk_error, *bottom(tau, deviation, float(error[-1])))


def overlapping(rate: Floats, interval: float) -> tuple[Floats, Floats]:
    """Averaging times [s], some 40 up to LONGEST_SHARE of the record, and the overlapping Allan deviation there
    [rad/s], of a ``rate`` [rad/s], shape (n,), one each ``interval`` [s] (IEEE Std 952, annex C)."""
    longest = max(int(LONGEST_SHARE * len(rate)), 1)
    averaged = np.unique(np.rint(np.geomspace(1, longest, 40)).astype(int))
    angle = np.concatenate([[0.0], np.cumsum(rate - rate.mean())]) * interval
    tau = averaged * interval
    squares = [np.mean((angle[2 * m :] - 2 * angle[m:-m] + angle[: -2 * m]) ** 2) for m in averaged.tolist()]
    return tau, np.sqrt(np.array(squares) / 2) / tau


def bottom(tau: Floats, deviation: Floats, last_error: float) -> tuple[float | None, float | None]:
    """Bias instability [rad/s] and its averaging time [s]: None where the deviation has not risen again, by two of the
    standard errors at its end."""
    lowest = int(deviation.argmin())
    risen = deviation[lowest:].max() > deviation[lowest] + 2 * last_error and lowest < len(tau) - 1
    return (float(deviation[lowest] / FLAT), float(tau[lowest])) if risen else (None, None)


def _random_walk(tau: Floats, deviation: Floats, error: Floats, shortest: float) -> tuple[float, float]:
    """N and its standard error, by least squares over the decade from ``shortest`` on:

        sigma² tau = N² + C/tau

    C takes what noise beyond 1/tau leaves: the peak of an open loop at the split adds, the output filter takes off.
    """
    used = (tau >= shortest) & (tau <= 10 * shortest)
    power = deviation[used] ** 2 * tau[used]
    weight = deviation[used] / (error[used] * power)
    design = np.stack([np.ones(used.sum()), 1 / tau[used]], axis=1)
    solution, *_ = np.linalg.lstsq(design * weight[:, None], power * weight, rcond=None)
    relative = FIT_ERROR * float((error[used] / deviation[used]).min())
    # A record of little but the peak can leave a negative N².
    walk = sqrt(max(float(solution[0]), 0.0))
    return walk, relative * sqrt(float(power.mean()))


class NoiseLimits(NamedTuple):
    """Angle random walks [rad/sqrt(s)] that the device sets. thermal: sqrt(k_B T/(m ω Q A²))/λ of the sense mode;
    electronics: of the converter's white noise on v_y; reference: on v_x, turned by the quadrature; total."""

    thermal: float
    electronics: float
    reference: float

    @property
    def total(self) -> float:
        """Root of the sum of squares."""
        return sqrt(self.thermal**2 + self.electronics**2 + self.reference**2)


def noise_limits(known: Nominal, temperature: float, period: float) -> NoiseLimits:
    """The limits of an open loop at ``temperature`` [K] with samples each ``period`` [s].

    Thermal force, one-sided 4 k_B T D: its part in the phase of the Coriolis force has twice that density, the Coriolis
    force is 2mλωAΩ, and N² is the two-sided density. Converter noise σ a sample: one-sided 2σ²T, likewise doubled.
    """
    p, calibration = known.p, known.calibration
    w = 2 * pi * calibration.frequency
    q = p["m"] * w / p["dyy"] if p["dyy"] > 0 else np.inf
    thermal = sqrt(BOLTZMANN * temperature / (p["m"] * w * q * calibration.amplitude**2)) / p["angular_gain"]
    variance = p["sense_noise"] ** 2 + p["adc_lsb"] ** 2 / 12
    # Volts at v_y for 1 rad/s: the open loop's scale, or the force's through the sense mode.
    volts = abs(calibration.scale)
    if calibration.drive.closed:
        volts *= p["sense_gain_y"] / abs(p["kyy"] - p["m"] * w**2 + 1j * w * p["dyy"])
    white = sqrt(2 * variance * period)
    quadrature = abs(p["kxy"]) / (2 * p["m"] * w * p["angular_gain"])
    return NoiseLimits(p["thermal_force"] * thermal, white / volts, quadrature * white / calibration.drive.voltage)
