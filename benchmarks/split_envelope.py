"""The envelope FMU in normal operation: records for the estimator, and the mode-matching loop through a ramp."""

from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.report import Row, row
from benchmarks.split_fmu import AMPLITUDE, RATE, SETTLING, FmuPoint, device, true_frequencies
from cosim.envelope import INPUT_NAMES, EnvelopePlant, open_envelope
from cosim.fmu import FMI_ERROR, HANDLE_SIZE, exchange
from cosim.mode_split import (
    BiasTuner,
    Envelope,
    NothingFoundError,
    Question,
    VoltageRecord,
    estimate,
    find_split,
    frequency_bound,
    line_spectrum,
    split_slope,
)

POINTS: Final = (FmuPoint(500, 20, 30), FmuPoint(5000, 6, 50), FmuPoint(5000, 40, 50), FmuPoint(50000, 20, 50))
WIDTHS: Final = 1600.0
"""Rate of a record in line widths; from 0.25 to 2 kHz."""

# Inputs and outputs by place.
U_X_Q, CARRIER, OMEGA, TEMPERATURE, V_BIAS = (
    INPUT_NAMES.index(name) for name in ("u_x_q", "carrier_frequency", "omega_z", "temperature", "v_bias")
)
OUTPUTS: Final = ("v_x_i", "v_x_q", "v_y_i", "v_y_q")

LOOP_RATE: Final = 500.0
"""Samples a second of the matching loop [Hz]."""
SPAN: Final = 100.0
BLOCK: Final = 10.0
RAMPING: Final = 1.0
"""How long a change of the bias takes [s]: at once it would throw the drive off its resonance by many line widths."""
PROPORTIONAL, INTEGRAL = 5.0, 40.0
"""Of the phase-locked loop [Hz/rad, Hz/(rad s)]: 31 /s, six times the drive's own decay rate."""
MATCHED: Final = FmuPoint(1885, 20, -4.0)
"""f_y lies 4 Hz below f_x at the first bias."""
SWING: Final = 3e-6
"""Drive amplitude of the matching loop [m]: 0.3 of the gap."""
GAP, SOFTENING, FIRST_BIAS, HIGHEST_BIAS = 1e-5, 0.02, 10.0, 40.0
NULLED: Final = np.deg2rad(3.0)
"""Quadrature that a nulling electrode leaves, as a rate [rad/s]."""
TCK, TCK_SPLIT = -60e-6, 30e-6
COLD, HOT, PER_SECOND = 253.15, 333.15, 1.0 / 60.0


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


def measure(point: FmuPoint, seed: int) -> tuple[float, bool]:
    """Error of f_y over its bound, and whether the 95 % interval held the truth; T = 150 Q/(π f)."""
    parameters = device(point, seed)
    f_x, f_y = true_frequencies(parameters)
    duration = 150 * point.q / (np.pi * f_y)
    step = 1 / np.clip(WIDTHS * f_y / point.q, 250.0, 2000.0)
    force = parameters["dxx"] * 2 * np.pi * f_x * AMPLITUDE
    with open_envelope(parameters, step, f_x) as plant:
        run = EnvelopeRun(plant, force, f_x, RATE, 298.15, step)
        run.advance(SETTLING * point.q / (np.pi * f_x))
        samples, carriers = run.advance(duration)
    drive = float(carriers.mean())
    try:
        split = find_split(VoltageRecord(samples, 1 / step, drive), Question(drive_frequency=drive)).split
    except NothingFoundError:
        return np.nan, True
    bound = frequency_bound(f_y, point.q, duration, 10 ** (point.hump_db / 10))
    return (split.f_y - f_y) / bound, split.interval[0] <= f_y <= split.interval[1]


def envelope_rows(count: int, jobs: int) -> list[Row]:
    """The points, ``count`` records each."""
    rows = []
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for point in POINTS:
            outcomes = list(pool.map(partial(measure, point), range(1, count + 1)))
            errors = np.array([error for error, _ in outcomes])
            values = {
                "likelihood": float(np.sqrt(np.nanmean(errors**2))),
                "found": float(np.isfinite(errors).mean()),
                "in 95 %": float(np.mean([held for _, held in outcomes])),
                "mean error": float(np.nanmean(errors)),
            }
            what = f"Q {point.q:g}, hump {point.hump_db:g} dB, split {point.split:g} Hz, {count} records"
            rows.append(row(what, "σ/bound", values, limit=1.2, judged=("likelihood",)))
    return rows


def matching_device(seed: int) -> dict[str, float]:
    """FMU parameters: at the first bias and temperature f_y lies 4 Hz below the drive."""
    parameters = device(MATCHED, seed)
    mass = parameters["m"]
    slope = split_slope(SOFTENING, GAP, SWING, mass, np.sqrt(parameters["kxx"] / mass) / (2 * np.pi))
    ratio = 1 + 2 * (MATCHED.split - slope * FIRST_BIAS**2) / (np.sqrt(parameters["kxx"] / mass) / (2 * np.pi))
    own = {"kyy": parameters["kxx"] * ratio, "kxy": parameters["kxy"] * NULLED / np.deg2rad(300.0), "dxy": 0.0}
    own |= {"softening": SOFTENING, "electrode_gap": GAP, "x_start": SWING}
    return parameters | own | {"tck": TCK, "tck_split": TCK_SPLIT, "t_ref": COLD}


def match(seed: int, minutes: float = (HOT - COLD) / PER_SECOND / 60) -> tuple[NDArray[np.float64], int]:
    """Split at the end of every block [Hz], its own truth, with the loop closed; blocks without an answer."""
    parameters = matching_device(seed)
    mass, f_x = parameters["m"], np.sqrt(parameters["kxx"] / parameters["m"]) / (2 * np.pi)
    tuner = BiasTuner(split_slope(SOFTENING, GAP, SWING, mass, f_x), 0.5, HIGHEST_BIAS)
    force = parameters["dxx"] * 2 * np.pi * f_x * SWING
    bias, splits, missed = FIRST_BIAS, [], 0
    settle = RAMPING + 12 * MATCHED.q / (np.pi * f_x)
    with open_envelope(parameters, 1 / LOOP_RATE, f_x) as plant:
        run = EnvelopeRun(plant, force, f_x, 0.0, COLD, 1 / LOOP_RATE)
        run.advance(BLOCK, bias)
        for _ in range(round(60 * minutes / BLOCK)):
            samples, carriers = run.advance(BLOCK, bias, PER_SECOND)
            drive = float(carriers[round(settle * LOOP_RATE) :].mean())
            warm = 1 + (TCK + TCK_SPLIT) * (float(run.values[TEMPERATURE]) - 0.5 * BLOCK * PER_SECOND - COLD)
            f_y = np.sqrt((parameters["kyy"] * warm - SOFTENING * bias**2) / mass) / (2 * np.pi)
            splits.append(f_y - drive)
            found = _answer(Envelope(samples, LOOP_RATE, drive, SPAN).part(settle, BLOCK))
            missed += found is None
            bias = tuner.next_bias(bias, found)
    return np.array(splits), missed


def matching_rows(seeds: int) -> list[Row]:
    """Split held at zero by the bias through the ramp, the first minute left out."""
    runs = [match(seed) for seed in range(1, seeds + 1)]
    split = np.concatenate([splits[6:] for splits, _ in runs])
    values = {"rms": float(np.sqrt(np.mean(split**2))), "worst": float(np.abs(split).max())}
    note = f"{sum(missed for _, missed in runs)} of {len(split) + 6 * len(runs)} blocks without an answer"
    what = f"Δf, envelope FMU, Q {MATCHED.q:g}, 10 s estimates, -20..60 °C at 1 °C/min"
    return [row(what, "Hz", values, limit=0.5, judged=("rms",), note=note)]


def _answer(part: Envelope) -> float | None:
    try:
        return estimate(line_spectrum(part, part.centre), Question(q=MATCHED.q, clean_line=True)).split
    except NothingFoundError:
        return None
