"""The sense voltage of a run as a record for ``gyrotwin split``: I and Q in the phase of the drive's oscillator.

    v_y(t) = Re (v_y_i + i v_y_q) e^{iφ(t)},  φ' = 2π carrier_frequency

The drive line stands at zero whatever the temperature does to its frequency, the thermal hump at the split.
"""

from collections.abc import Mapping
from math import pi

import numpy as np
import polars as pl
from numpy.typing import NDArray

from cosim.decimation import FLAT, Decimator
from cosim.rate.settings import Nominal
from gyro_model.errors import InputError


class SenseRecorder:
    """Collects v_y, decimated from the loop's ``period`` [s] to ``rate`` [Hz]."""

    def __init__(self, period: float, rate: float) -> None:
        factor = round(1 / (period * rate))
        self._period, self._step = period, period * factor
        self._voltage, self._frequency = Decimator(factor), Decimator(factor)
        self._parts: list[NDArray[np.complex128]] = []

    def take(self, sensed: NDArray[np.complex128]) -> None:
        """Takes in v_y mixed with the oscillator [V] and the oscillator's frequency [rad/s], shape (2, n)."""
        self._parts.append(np.stack([self._voltage.feed(sensed[0]), self._frequency.feed(sensed[1])]))

    def kept(self) -> dict[str, NDArray[np.complex128]]:
        """All that it remembers: what is decimated, shape (m, 2), and what the filters wait with, shape (n, 2)."""
        done = np.concatenate([np.zeros((2, 0), complex), *self._parts], axis=1)
        return {"sensed": done.T, "waiting": np.stack([self._voltage.waiting, self._frequency.waiting], axis=1)}

    def go_on(self, kept: Mapping[str, NDArray[np.complex128]]) -> None:
        """Becomes the recorder that gave ``kept``."""
        self._parts = [kept["sensed"].T]
        self._voltage.waiting, self._frequency.waiting = kept["waiting"].T.copy()

    def frame(self) -> pl.DataFrame:
        """Columns t [s] since the start of the run, v_y_i, v_y_q [V], carrier_frequency [Hz]; the ends that the filter
        does not see in full are left out."""
        voltage, frequency = np.concatenate(self._parts, axis=1)
        return pl.DataFrame(
            {
                "t": self._period * (self._voltage.taps // 2) + self._step * np.arange(len(voltage)),
                "v_y_i": voltage.real,
                "v_y_q": voltage.imag,
                "carrier_frequency": frequency.real / (2 * pi),
            }
        )


def check_sense_record(rate: float, loop_rate: float, known: Nominal, closed: bool) -> None:
    """Raises InputError where a record at ``rate`` [Hz] could not show the split of the device.

    loop_rate: of the loop [Hz], a multiple of ``rate``; closed: the sense loop rebalances.
    """
    if closed:
        raise InputError(
            "--sense-record with --sense closed: the force that rebalances shapes the spectrum; give --sense open"
        )
    f_x = known.calibration.frequency
    f_y, decay = f_x + known.pole.imag / (2 * pi), max(-known.pole.real, 1e-9)
    # The hump and its flanks lie in the flat band; that of the full plant is clear of its image at twice the drive.
    least, most = (abs(f_y - f_x) + 5 * decay / (2 * pi)) / FLAT, min(loop_rate, f_x)
    factor = max(round(loop_rate / rate), 1) if rate > 0 else 1
    if not least <= rate <= most:
        raise InputError(
            f"--sense-record {rate:g}: give {least:.4g} to {most:.4g} Hz, so that the split of "
            f"{f_y - f_x:.4g} Hz lies in its band"
        )
    if abs(loop_rate / factor / rate - 1) > 1e-9:
        raise InputError(
            f"--sense-record {rate:g}: give a whole part of the loop's {loop_rate:g} Hz, such as {loop_rate / factor:g}"
        )
