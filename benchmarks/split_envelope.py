"""The envelope FMU in normal operation: records for the estimator."""

from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.report import Row
from benchmarks.split_fmu import AMPLITUDE, F_X, SETTLING, FmuPoint, device
from benchmarks.split_outcome import Outcome, Truth, judge, outcome_row
from calibration.mode_split import VoltageRecord, frequency_bound
from cosim.envelope import INPUT_NAMES, EnvelopePlant, open_envelope
from cosim.exchange import exchange
from cosim.fmu import FMI_ERROR, HANDLE_SIZE

GRID: Final = (
    *((q, db, 5.0) for q in (500.0, 5000.0, 50000.0) for db in (6.0, 20.0, 40.0)),
    *((q, 20.0, 50.0) for q in (500.0, 5000.0, 50000.0)),
)
"""Q, hump over the floor [dB], split in line widths f/Q."""
WIDTHS: Final = 1600.0
"""Rate of a record in line widths."""
LOWEST, HIGHEST = 250.0, 4000.0
"""Rate of a record [Hz]: the phase-locked loop needs the one; the other holds 300 half-widths of the widest hump."""
WIDE: Final = 1000.0
"""Below this Q the band searched ends BEYOND [Hz] past the split. The noise of the envelope form is symmetric about the
mode, (1 + δ/2f)² off the real one at the distance δ. That moves f_y of Q 500 and 40 dB by 0.6 of its bound over a band
of 1600 Hz, by 0.2 within 100 Hz, which takes 2 % more of deviation."""
BEYOND: Final = 70.0

# Inputs and outputs by place.
U_X_Q, CARRIER, OMEGA, TEMPERATURE, V_BIAS = (
    INPUT_NAMES.index(name) for name in ("u_x_q", "carrier_frequency", "omega_z", "temperature", "v_bias")
)
OUTPUTS: Final = ("v_x_i", "v_x_q", "v_y_i", "v_y_q")

PROPORTIONAL, INTEGRAL = 5.0, 40.0
"""Of the phase-locked loop [Hz/rad, Hz/(rad s)]: 31 /s, six times the decay rate of a drive with Q = 1885."""
RAMPING: Final = 1.0
"""How long a change of the bias takes [s]: at once it would throw the drive off its resonance by many line widths."""


@njit(cache=True)
def _run(handle, inputs, outputs, values, start, step, lock, bias_to, ramp, rate, samples, carriers):  # type: ignore[no-untyped-def]
    """Fills samples (n,) complex [V] of v_y and carriers (n,) [Hz]; gives the count done.

    lock f8[2]: nominal carrier and integral of the phase [Hz, Hz]; bias goes to ``bias_to`` [V] within ``ramp`` samples
    (linear in V²); rate [K/s] of the temperature; start: index of the first sample.
    """
    out, flags = np.zeros(4), np.zeros(HANDLE_SIZE)
    square, aim = values[V_BIAS] ** 2, bias_to**2
    phase = 0.0
    for k in range(len(samples)):
        share = min((k + 1) / ramp, 1.0)
        values[V_BIAS] = np.sqrt(square + share * (aim - square))
        values[CARRIER] = lock[0] + lock[1] + PROPORTIONAL * phase
        if exchange(handle, inputs, values, outputs, out, flags, (start + k) * step, step) >= FMI_ERROR:
            return k
        values[TEMPERATURE] += rate * step
        phase = np.arctan2(out[1], out[0])
        lock[1] += INTEGRAL * phase * step
        samples[k] = out[2] + 1j * out[3]
        carriers[k] = values[CARRIER]
    return len(samples)


class EnvelopeRun:
    """The envelope FMU with its drive held on resonance by a phase-locked loop."""

    def __init__(
        self, plant: EnvelopePlant, force: float, carrier: float, omega_z: float, temperature: float, step: float
    ) -> None:
        """Starts with a force [N] on x in phase with its velocity and a carrier [Hz]; step [s]."""
        self.plant, self.step, self.done = plant, step, 0
        self.values = np.zeros(len(INPUT_NAMES))
        self.values[[U_X_Q, OMEGA, TEMPERATURE]] = force, omega_z, temperature
        self.lock = np.array([carrier, 0.0])
        self.outputs = plant.value_references(OUTPUTS)

    def advance(
        self, duration: float, v_bias: float = 0.0, rate: float = 0.0
    ) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """v_y (n,) [V] around the carrier (n,) [Hz] over ``duration`` [s]."""
        count = round(duration / self.step)
        samples, carriers = np.zeros(count, complex), np.zeros(count)
        plant, ramp = self.plant, max(RAMPING / self.step, 1.0)
        done = _run(
            plant.handle, plant.inputs, self.outputs, self.values, self.done, self.step, self.lock, v_bias, ramp, rate,
            samples, carriers,
        )  # fmt: skip
        if done < count:
            raise RuntimeError(f"the plant stopped at step {self.done + done}: {plant.complaint()}")
        self.done += count
        return samples, carriers


def record(point: FmuPoint, duration: float, seed: int) -> tuple[VoltageRecord, float]:
    """v_y of one run around the mean drive frequency [Hz], and that frequency.

    The step of the plant is the period of the record: its linear part is exact at any step, and so is its noise.
    """
    parameters = device(point, seed)
    f_x, f_y = point.truth
    step = 1 / float(np.clip(WIDTHS * f_y / point.q, LOWEST, HIGHEST))
    force = parameters["dxx"] * 2 * np.pi * f_x * AMPLITUDE
    with open_envelope(parameters, step, f_x) as plant:
        run = EnvelopeRun(plant, force, f_x, point.rate, 298.15, step)
        run.advance(SETTLING * point.q / (np.pi * f_x))
        samples, carriers = run.advance(duration)
    drive = float(carriers.mean())
    return VoltageRecord(samples, 1 / step, drive), drive


def measure(point: FmuPoint, seed: int) -> Outcome:
    """One record of T = 150 Q/(π f)."""
    f_y = point.truth[1]
    duration = 150 * point.q / (np.pi * f_y)
    voltage, drive = record(point, duration, seed)
    bound = frequency_bound(f_y, point.q, duration, 10 ** (point.hump_db / 10))
    span = abs(point.split) + BEYOND if point.q < WIDE else None
    return judge(voltage, Truth(drive, f_y, bound, 0.5 * f_y / point.q), span)


def point_of(q: float, hump_db: float, widths: float) -> FmuPoint:
    """A point of GRID."""
    return FmuPoint(q, hump_db, widths * F_X / q)


def envelope_rows(count: int, jobs: int) -> list[Row]:
    """Every point of GRID, ``count`` records each, no two with the same noise."""
    rows = []
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for place, (q, hump_db, widths) in enumerate(GRID):
            point = point_of(q, hump_db, widths)
            seeds = range(1000 * place + 1, 1000 * place + count + 1)
            outcomes = list(pool.map(partial(measure, point), seeds, chunksize=4))
            what = f"Q {q:g}, hump {hump_db:g} dB, split {widths:g} line widths = {point.split:g} Hz"
            note = f"quadrature {300 * point.nulled:.3g} °/s, turn {np.rad2deg(point.rate):.3g} °/s"
            rows.append(outcome_row(what, outcomes, True, note))
    return rows
