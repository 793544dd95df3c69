"""The envelope form: what a step costs, six hours of temperature, and how it agrees with the full plant."""

import time
from collections.abc import Mapping
from math import pi
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from benchmarks.report import Options, Report, Row, Table, load, row
from cosim.envelope import INPUT_NAMES, OUTPUT_NAMES, open_envelope
from cosim.exchange import exchange
from cosim.fmu import open_plant

Complexes = NDArray[np.complex128]

MASS, F_X, SPLIT, AMPLITUDE, GAIN = 1.8e-7, 3000.0, 50.0, 5e-6, 1e6
W_X, W_Y = 2 * pi * F_X, 2 * pi * (F_X + SPLIT)
RANGE: Final = np.radians(300.0)
"""Full range [rad/s], and the quadrature of the device."""
STEP: Final = 1e-3
PERIOD: Final = 5e-6
"""Of the samples of the full plant [s]."""
SIX_HOURS: Final = 6 * 3600.0
COLD, HOT, NORMAL = 233.15, 358.15, 298.15
THERMAL: Final = {
    **{"tck": -6e-5, "tck_split": 4e-5, "tcd": 3e-3, "tcg": 2e-4, "tcp": 2e-8, "amplifier_time_constant": 3e-6},
    **{"dxy": 1e-9, "angular_gain": 0.8},
}
LAGS: Final = {"structure_lag": 300.0, "circuit_lag": 120.0}
NOISE: Final = {"thermal_force": 1.0, "sense_noise": 2e-5}


def device(q: float, **changes: float) -> dict[str, float]:
    """A tuning fork of quality factor ``q`` with ``changes``."""
    own = {"m": MASS, "kxx": MASS * W_X**2, "kyy": MASS * W_Y**2, "kxy": 2 * MASS * W_X * RANGE, "dxy": 0.0}
    return own | {"dxx": MASS * W_X / q, "dyy": MASS * W_Y / q} | changes


def drive_of(p: Mapping[str, float]) -> float:
    """u_x_q [N] that holds x at AMPLITUDE on resonance."""
    return p["dxx"] * W_X * AMPLITUDE


@njit(cache=True)
def _steps(handle, inputs, u, outputs, v, flags, first, count, step, carrier_swing, warming):  # type: ignore[no-untyped-def]
    for k in range(count):
        u[4] += carrier_swing if k % 2 else -carrier_swing
        u[6] += warming * step
        if exchange(handle, inputs, u, outputs, v, flags, (first + k) * step, step) > 0:
            return k
    return count


@njit(cache=True)
def _full(handle, inputs, outputs, flags, drive, w, rate, first, count, period, samples):  # type: ignore[no-untyped-def]
    u, v = np.array([0.0, 0.0, rate]), np.zeros(6)
    for k in range(count):
        u[0] = (drive * np.exp(1j * w * (first + k) * period)).real
        if exchange(handle, inputs, u, outputs, v, flags, (first + k) * period, period) > 0:
            return k
        samples[k, 0], samples[k, 1] = v[0], v[1]
    return count


def _inputs(u_x_q: float, rate: float = 0.0, temperature: float = NORMAL) -> NDArray[np.float64]:
    return np.array([0.0, u_x_q, 0.0, 0.0, F_X, rate, temperature, 0.0, 0.0, 0.0])


def cost(p: Mapping[str, float], count: int, swing: float, warming: float) -> float:
    """CPU time of a step [s], the least of 5; ``swing`` of the carrier [Hz] and ``warming`` [K/s] move parameters."""
    with open_envelope(p, STEP, F_X) as plant:
        u, v, flags = _inputs(drive_of(p)), np.zeros(len(OUTPUT_NAMES)), np.zeros(4)
        least, done = np.inf, 0
        for _ in range(5):
            began = time.process_time()
            done += _steps(plant.handle, plant.inputs, u, plant.outputs, v, flags, done, count, STEP, swing, warming)
            least = min(least, (time.process_time() - began) / count)
    return float(least)


def cost_rows(count: int = 100_000) -> list[Row]:
    """Time of a call of the envelope plant from the compiled loop."""
    plain = device(1e4)
    laws = plain | THERMAL | LAGS
    cases = {
        "inputs held": (plain, 0.0, 0.0),
        "carrier moves at every step": (plain, 1e-3, 0.0),
        "and temperature, through four laws and two lags": (laws, 1e-3, 0.01),
        "and thermal force and noise of the sample": (laws | NOISE, 1e-3, 0.01),
        "and cubic stiffness": (laws | NOISE | {"k3_x": 1e9}, 1e-3, 0.01),
        "and all other curved effects": (laws | NOISE | _CURVED, 1e-3, 0.01),
    }
    return [
        row(name, "µs", {"CPU": 1e6 * cost(*case[:1], count, *case[1:])}, limit=10.0) for name, case in cases.items()
    ]


_CURVED: Final[dict[str, float]] = {
    **{"k3_x": 1e9, "k2_x": 1e5, "d2_x": 1e5, "actuator_a3": 1e10, "pickoff_inverse_gap": 1e4, "adc_limit": 10.0},
    **{"sampling_jitter": 1e-10, "flicker_noise": 1e-6, "adc_lsb": 1e-4, "parasitic_coupling": 0.1},
}


def hours_row() -> Row:
    """Six hours from cold to hot at 1 ms, with everything that a temperature test of a rate gyroscope has."""
    count = round(SIX_HOURS / STEP)
    p = device(1e4, **THERMAL, **LAGS, **NOISE)
    with open_envelope(p | {"temperature": COLD}, STEP, F_X) as plant:
        u, v, flags = _inputs(drive_of(p), 0.0, COLD), np.zeros(len(OUTPUT_NAMES)), np.zeros(4)
        began = time.process_time()
        warming = (HOT - COLD) / SIX_HOURS
        done = _steps(plant.handle, plant.inputs, u, plant.outputs, v, flags, 0, count, STEP, 1e-3, warming)
        took = time.process_time() - began
    return row(
        "6 h at 1 ms, -40 to 85 °C, the plant alone", "s", {"CPU": took if done == count else np.inf}, limit=60.0
    )


def settled(p: Mapping[str, float], rate: float, temperature: float) -> Complexes:
    """Amplitudes of v_x, v_y [V], x, y [m] in steady state, by the envelope form."""
    with open_envelope({**p, "temperature": temperature}, STEP, F_X) as plant:
        u, v, flags = _inputs(drive_of(p), rate, temperature), np.zeros(len(OUTPUT_NAMES)), np.zeros(4)
        count = round(40 * 2 * MASS / p["dxx"] / STEP)
        _steps(plant.handle, plant.inputs, u, plant.outputs, v, flags, 0, count, STEP, 0.0, 0.0)
    return v[0:8:2] + 1j * v[1:8:2]


def demodulated(p: Mapping[str, float], start: Complexes, rate: float, temperature: float, seconds: float) -> Complexes:
    """Amplitudes of v_x, v_y [V] of the full plant over its last 0.1 s, set off at ``start`` [m]."""
    speed, half = 1j * W_X * start, 0.5 * W_X * PERIOD
    begin = {"x_start": start[0].real, "y_start": start[1].real, "temperature": temperature, "omega_z": rate}
    begin |= {"x_dot_start": speed[0].real, "y_dot_start": speed[1].real, "sample_period": PERIOD}
    # A hold shrinks a sine and delays it by half a period.
    force = 1j * drive_of(p) / (np.sin(half) / half * np.exp(-1j * half))
    count = round(seconds / PERIOD)
    samples = np.zeros((count, 2))
    with open_plant({**p, **begin}) as plant:
        done = _full(
            plant.handle, plant.inputs, plant.outputs, np.zeros(4), force, W_X, rate, 0, count, PERIOD, samples
        )
    last = np.arange(count - round(0.1 / PERIOD), done)
    return 2 * np.mean(samples[last] * np.exp(-1j * W_X * (last + 1) * PERIOD)[:, None], axis=0)


def reading(v: Complexes, p: Mapping[str, float]) -> complex:
    """Quadrature + i rate [rad/s], open loop, by the nominal response of y."""
    response = 2 * MASS * W_X / (p["kyy"] - MASS * W_X**2 + 1j * W_X * p["dyy"])
    return complex(-v[1] / v[0] / response)


def agreement_rows(q: float = 1000.0, seconds: float = 0.6) -> list[Row]:
    """Largest differences of the two forms over temperature, of full range."""
    p = device(q, **THERMAL)
    worst = dict.fromkeys(("bias", "scale factor", "quadrature"), 0.0)
    for temperature in (COLD, NORMAL, HOT):
        pairs = []
        for rate in (0.0, RANGE, -RANGE):
            slow = settled(p, rate, temperature)
            fast = demodulated(p, slow[2:], rate, temperature, seconds)
            pairs.append(reading(slow, p) - reading(fast, p))
        found = {"bias": pairs[0].imag, "scale factor": 0.5 * (pairs[1] - pairs[2]).imag, "quadrature": pairs[0].real}
        worst = {name: max(worst[name], abs(found[name]) / RANGE) for name in worst}
    return [row(name, "of range", {"largest": value}, limit=0.01) for name, value in worst.items()]


def beat_rows() -> list[Row]:
    """The free motion of the sense axis, 50 Hz beside the carrier: its frequency in both reductions."""
    p, count = device(1e4, kxy=0.0), 2000
    exact = np.sqrt(W_Y**2 - (p["dyy"] / 2 / MASS) ** 2) - W_X
    turns = []
    with open_envelope(p | {"y_start": 1e-6}, STEP, F_X) as plant:
        u, v, flags = _inputs(0.0), np.zeros(len(OUTPUT_NAMES)), np.zeros(4)
        for k in range(count):
            _steps(plant.handle, plant.inputs, u, plant.outputs, v, flags, k, 1, STEP, 0.0, 0.0)
            turns.append(complex(v[6], v[7]))
    found = np.angle(turns[-1] / turns[0] * np.exp(-1j * exact * (count - 1) * STEP)) / ((count - 1) * STEP) + exact
    reduced = (p["kyy"] - MASS * W_X**2) / (2 * MASS * W_X)
    return [
        row("this form, against the roots of the full plant", "Hz", {"off by": abs(found - exact) / (2 * pi)}),
        row("first-order reduction, (k - m w²)/(2 m w)", "Hz", {"off by": abs(reduced - exact) / (2 * pi)}),
    ]


def run(options: Options) -> Report:
    """Times of the envelope form, and its agreement with the full one."""
    before = load()
    tables = [
        Table("a call: set, step, get", cost_rows()),
        Table("hours", [hours_row()]),
        Table("steady state beside the full plant, open loop", agreement_rows()),
        Table(f"free beat at a split of {SPLIT:g} Hz", beat_rows()),
    ]
    notes = [
        f"{len(INPUT_NAMES)} inputs, {len(OUTPUT_NAMES)} outputs, steps of {STEP:g} s; CPU time, least of 5 (6 h: 1).",
        "Steady state: -40, 25, 85 °C, 0 and ±300 deg/s, Q 1000, quadrature 300 deg/s, four temperature laws; the full "
        "plant at 1 µs, demodulated over 0.1 s.",
        "Before: " + before,
        "After: " + load(),
    ]
    data: dict[str, Any] = {"range_rad_s": RANGE}
    return Report("envelope", "The envelope form", tables, notes, data)
