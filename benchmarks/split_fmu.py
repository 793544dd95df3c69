"""Records of normal operation from the full FMU: x driven on its resonance, Coriolis force and quadrature on y."""

from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from benchmarks.report import Row
from benchmarks.split_outcome import Outcome, Truth, judge, outcome_row
from calibration.mode_split import VoltageRecord, frequency_bound
from cosim.exchange import exchange
from cosim.fmu import FMI_ERROR, HANDLE_SIZE, open_plant
from gyro_model.build import build
from gyro_model.symbols import BOLTZMANN

MASS: Final = 1.8e-7
GAIN: Final = 1e6
F_X: Final = 3000.0
AMPLITUDE: Final = 1e-6
"""Of the drive [m]."""
QUADRATURE: Final = np.deg2rad(300.0)
RATE: Final = np.deg2rad(100.0)
"""Rates [rad/s] that make the line: quadrature and a steady turn."""
COUPLING: Final = 0.1
"""Largest quadrature over the split, both in rad/s: with more the modes are no longer drive and sense. A device with
so small a split has its quadrature nulled."""
SAMPLE_PERIOD: Final = 2e-5
INTERNAL_STEP: Final = 2e-6
SETTLING: Final = 14.0
"""Decay times before the record: the line's 17 mV ring down to 0.01 µV, a hundredth of a percent of thermal motion."""


class FmuPoint(NamedTuple):
    """Q of both axes, hump over the floor [dB], split [Hz]."""

    q: float
    hump_db: float
    split: float

    @property
    def nulled(self) -> float:
        """Share of QUADRATURE and RATE that is there."""
        return float(min(1.0, COUPLING * 2 * np.pi * abs(self.split) / QUADRATURE))

    @property
    def rate(self) -> float:
        """The steady turn [rad/s]."""
        return self.nulled * RATE

    @property
    def truth(self) -> tuple[float, float]:
        """Undamped frequencies [Hz] of the coupled modes."""
        return true_frequencies(device(self, 0), self.rate)


POINTS: Final = (FmuPoint(500, 20, 30), FmuPoint(500, 40, 30), FmuPoint(1885, 40, 50))


def device(point: FmuPoint, seed: int) -> dict[str, float]:
    """FMU parameters of a point."""
    w_x, w_y = 2 * np.pi * F_X, 2 * np.pi * (F_X + point.split)
    damping = MASS * w_y / point.q
    # One-sided density at the top: 4 k_B T d/(d ω)², in V²/Hz; the floor spread over half the sample rate.
    hump = 4 * float(BOLTZMANN) * 298.15 / (damping * w_y**2) * GAIN**2
    noise = np.sqrt(hump / 10 ** (point.hump_db / 10) * 0.5 / SAMPLE_PERIOD)
    return {
        "m": MASS, "kxx": MASS * w_x**2, "kyy": MASS * w_y**2, "kxy": 2 * MASS * w_x * point.nulled * QUADRATURE,
        "dxx": damping, "dyy": damping, "dxy": 0.01 * damping, "sense_gain_x": GAIN, "sense_gain_y": GAIN,
        "thermal_force": 1.0, "sense_noise": float(noise), "x_start": AMPLITUDE, "seed": seed,
        "sample_period": SAMPLE_PERIOD, "internal_step": INTERNAL_STEP,
    }  # fmt: skip


def true_frequencies(parameters: Mapping[str, float], rate: float) -> tuple[float, float]:
    """Undamped frequencies [Hz] of the coupled modes, |eigenvalue|/2π with the steady turn ``rate`` [rad/s]."""
    p = parameters
    stiffness = np.array([[p["kxx"], p["kxy"]], [p["kxy"], p["kyy"]]]) / p["m"]
    damping = np.array([[p["dxx"], p["dxy"]], [p["dxy"], p["dyy"]]]) / p["m"]
    turn = np.array([[0.0, -2 * rate], [2 * rate, 0.0]])
    system = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping - turn]])
    low, _, high, _ = np.sort(np.abs(np.linalg.eigvals(system))) / (2 * np.pi)
    return float(low), float(high)


def record(point: FmuPoint, duration: float, seed: int) -> tuple[VoltageRecord, float, float]:
    """v_y of one run, drive frequency and true sense frequency [Hz]."""
    parameters = device(point, seed)
    drive, f_y = point.truth
    settling = round(SETTLING * point.q / (np.pi * F_X) / SAMPLE_PERIOD)
    v = np.zeros(settling + round(duration / SAMPLE_PERIOD))
    # In phase with the velocity of x = A cos ωt: holds the amplitude against its damping.
    force = parameters["dxx"] * 2 * np.pi * drive * AMPLITUDE
    with open_plant(parameters) as plant:
        done = _drive(
            plant.handle, plant.inputs, plant.value_references(["v_y"]), force, drive, point.rate, SAMPLE_PERIOD, v
        )
    if done < len(v):
        raise RuntimeError(f"the plant stopped at sample {done}")
    return VoltageRecord(v[settling:], 1 / SAMPLE_PERIOD), drive, f_y


@njit(cache=True)
def _drive(handle, inputs, outputs, force, frequency, rate, period, v):  # type: ignore[no-untyped-def]
    """Fills v (n,) [V] under u_x = -force sin(2π frequency t), held over each sample."""
    values, out, flags = np.zeros(3), np.zeros(1), np.zeros(HANDLE_SIZE)
    values[2] = rate
    for k in range(len(v)):
        values[0] = -force * np.sin(2 * np.pi * ((frequency * k * period) % 1.0))
        if exchange(handle, inputs, values, outputs, out, flags, k * period, period) >= FMI_ERROR:
            return k
        v[k] = out[0]
    return len(v)


def measure(point: FmuPoint, seed: int) -> Outcome:
    """One record of T = 150 Q/(π f)."""
    f_y = point.truth[1]
    duration = 150 * point.q / (np.pi * f_y)
    voltage, drive, f_y = record(point, duration, seed)
    bound = frequency_bound(f_y, point.q, duration, 10 ** (point.hump_db / 10))
    return judge(voltage, Truth(drive, f_y, bound, 0.5 * f_y / point.q))


def fmu_rows(count: int, jobs: int) -> list[Row]:
    """The three points, ``count`` records each."""
    build()
    rows = []
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for point in POINTS:
            outcomes = list(pool.map(partial(measure, point), range(1, count + 1)))
            what = f"Q {point.q:g}, hump {point.hump_db:g} dB, split {point.split:g} Hz"
            rows.append(outcome_row(what, outcomes, True))
    return rows
