"""What a laboratory knows when it matches the modes: the design of device and loops, nothing of the plant."""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calibration.mode_split import split_slope
from cosim.rate.run import V_BIAS, RateRun
from gyro_model.device import Device
from gyro_model.errors import InputError


class Known(NamedTuple):
    """What every method is told.

    frequency: of the drive [Hz]; decay: of the sense mode, ω/2Q [1/s]; mass [kg]; amplitude: of the drive [m]; gain: of
    the sense pickoff [V/m]; slope: dΔf/dV² [Hz/V²]; first_bias, highest_bias [V]; full_scale [rad/s]; output_bandwidth,
    sense_bandwidth [Hz]; interval: of which blocks are multiples [s]; settling: after which the drive loop has
    caught up with a change [s].
    """

    frequency: float
    decay: float
    mass: float
    amplitude: float
    gain: float
    slope: float
    first_bias: float
    highest_bias: float
    full_scale: float
    output_bandwidth: float
    sense_bandwidth: float
    interval: float
    settling: float


class Sensed(NamedTuple):
    """What a block of a run shows, sample by sample at ``period`` [s], shape (n,).

    hold: over which the converter of the force holds it [s], 0 where the carrier itself is smooth (the envelope);
    voltage: v_y mixed with the drive [V]; force: the envelope of the force on y that follows each sample [N];
    frequency: of the drive [Hz].
    """

    period: float
    hold: float
    voltage: NDArray[np.complex128]
    force: NDArray[np.complex128]
    frequency: NDArray[np.float64]

    def after(self, first: int) -> "Sensed":
        """What is sensed from sample ``first`` on."""
        return self._replace(voltage=self.voltage[first:], force=self.force[first:], frequency=self.frequency[first:])


def designed_bias(design: Device, amplitude: float) -> float:
    """The bias [V] at which the modes of ``design`` match, x swinging by ``amplitude`` [m].

    Raises InputError where there is none.
    """
    p = design.all_parameters
    if p["softening"] == 0.0:
        raise InputError(
            "the design has no electrodes that tune: give softening [N/(m V²)] and electrode_gap [m], or the device "
            "mode_matched"
        )
    frequency = sqrt(p["kxx"] / p["m"]) / (2 * pi)
    slope = split_slope(p["softening"], p["electrode_gap"], amplitude, p["m"], frequency)
    split = sqrt(p["kyy"] / p["m"]) / (2 * pi) - frequency
    if split >= 0:
        raise InputError(
            f"the design has f_y {split:.4g} Hz above f_x without bias: the bias softens the drive, which swings, more "
            "than the sense mode; make kyy smaller than kxx"
        )
    return sqrt(-split / slope)


def known_of(run: RateRun, highest_bias: float) -> Known:
    """What the design of ``run`` tells. Raises InputError where the first bias is none or beyond the highest."""
    p = (run.design or run.device).all_parameters
    settings, nominal = run.settings, run.nominal
    first = float(run.first_inputs[V_BIAS])
    if not 0 < first < highest_bias:
        raise InputError(
            f"first bias {first:g} V: give one above 0 by --scenario, or a --highest-bias above {first:g} V"
        )
    frequency = nominal.calibration.frequency
    slope = split_slope(p["softening"], p["electrode_gap"], settings.drive_amplitude, p["m"], frequency)
    return Known(
        frequency, -nominal.pole.real, p["m"], settings.drive_amplitude, p["sense_gain_y"], slope, first, highest_bias,
        settings.full_scale, settings.output_bandwidth, settings.sense_bandwidth,
        run.interval, run.drive_settling,
    )  # fmt: skip


def virtual_rate_force(known: Known, rate: float) -> float:
    """Force of each side of a dither that is worth ``rate`` [rad/s]: half of 2 m Ω ω A [N]."""
    return known.mass * rate * 2 * pi * known.frequency * known.amplitude
