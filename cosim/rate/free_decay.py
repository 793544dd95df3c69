"""The device left to itself: both axes plucked, no force, no rate; and the modes that its linear plant has."""

from math import pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cosim.envelope import open_envelope
from cosim.exchange import exchange
from cosim.fmu import HANDLE_SIZE
from cosim.run import plant_parameters
from gyro_model.device import Device
from gyro_model.errors import InputError

Complexes = NDArray[np.complex128]

PLUCKED: Final = 0.1
"""Amplitude of either axis at the start over that of the drive: far above noise, below what bends a suspension."""
PER_SPLIT: Final = 8.0
"""Samples in a period of the split."""
LONGEST_STEP: Final = 1e-3
"""Step at most [s]: that of the loops."""
MOST_SAMPLES: Final = 20_000
FEWEST_SAMPLES: Final = 300
"""Five windows of the pencil: a mode that decays within milliseconds is sampled more often."""
OUTPUTS: Final = ("v_x_i", "v_x_q", "v_y_i", "v_y_q")


class Decay(NamedTuple):
    """records: envelopes of v_x and v_y around ``carrier`` [Hz], shape (2, n), one each ``interval`` [s]."""

    records: Complexes
    carrier: float
    interval: float


class LinearMode(NamedTuple):
    """frequency [Hz], quality factor ω/2σ, of a mode."""

    frequency: float
    q: float


def free_decay(device: Device, amplitude: float, seed: int, carrier: float, sample_rate: float) -> Decay:
    """Both axes are let go at ``amplitude`` [m], and followed for two time constants of the slower one, on the
    envelope FMU around ``carrier`` [Hz], at which it takes what a parasitic mode does; the noise of the pickoff is
    that of samples at ``sample_rate`` [Hz]. Raises InputError where the plant can't go on."""
    p = device.all_parameters
    low, high = device.frequencies
    taus = [q / (pi * f) for q, f in zip(device.quality_factors, (low, high), strict=True) if np.isfinite(q)]
    slowest = 2 * max(taus, default=1.0)
    longest = min(1 / (PER_SPLIT * max(high - low, 1e-9)), slowest / FEWEST_SAMPLES)
    interval = min(LONGEST_STEP, longest)
    rows = int(min(slowest / interval, MOST_SAMPLES))
    # Slow decays are sampled as seldom as the split allows.
    interval = min(max(interval, slowest / MOST_SAMPLES), longest)
    no_force = dict.fromkeys(("u_x_i", "u_x_q", "u_y_i", "u_y_q"), 0.0)
    start = dict.fromkeys(device.model.start_of.values(), 0.0) | {"x_start": amplitude, "y_start": amplitude}
    parameters = {
        **device.parameters,
        **plant_parameters(device, 1 / sample_rate, seed),
        "kxx": p["kxx"],
        "m": p["m"],
        **start,
        **no_force,
    }
    with open_envelope(parameters, interval, carrier, device.model) as plant:
        values = np.empty((rows, len(OUTPUTS)))
        done = _run(plant.handle, plant.value_references(OUTPUTS), interval, values)
        if done < rows:
            raise InputError(f"free decay {plant.complaint()}")
    records = np.stack([values[:, 0] + 1j * values[:, 1], values[:, 2] + 1j * values[:, 3]])
    return Decay(records, carrier, interval)


@njit(cache=True)
def _run(handle, outputs, period, rows):  # type: ignore[no-untyped-def]
    nothing = np.empty(0)
    no_inputs = np.empty(0, np.uint32)
    flags = np.zeros(HANDLE_SIZE)
    for k in range(len(rows)):
        if exchange(handle, no_inputs, nothing, outputs, rows[k], flags, k * period, period) > 0:
            return k
    return len(rows)


def linear_modes(p: dict[str, float]) -> tuple[LinearMode, LinearMode]:
    """The two modes of the linear plant with parameters ``p``, SI, the lower one first: eigenvalues of

        m q'' + D q' + K q = 0,   q = (x, y),   K_xx + iω D_xx = kxx + iω dxx - κ²/(m P(ω))

    A parasitic mode is there as what x feels of it at the mode's own frequency, P as in ``steady_state``.
    """
    start = sqrt(p["kxx"] / p["m"]), sqrt(p["kyy"] / p["m"])
    low, high = (_mode(p, guess, which) for which, guess in enumerate(sorted(start)))
    return low, high


def _mode(p: dict[str, float], w: float, which: int) -> LinearMode:
    parasite = 2 * pi * p["parasitic_frequency"]
    # The parasite's part depends on the frequency of the mode by 1e-4 of it: four rounds leave nothing.
    for _ in range(4):
        seen = p["parasitic_coupling"] ** 2 / (p["m"] * (parasite**2 - w**2 + 1j * w * parasite / p["parasitic_q"]))
        stiffness = np.array([[p["kxx"] - seen.real, p["kxy"]], [p["kxy"], p["kyy"]]])
        damping = np.array([[p["dxx"] - seen.imag / w, p["dxy"]], [p["dxy"], p["dyy"]]])
        state = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness / p["m"], -damping / p["m"]]])
        values = np.linalg.eigvals(state)
        value = sorted(values[values.imag > 0], key=lambda one: float(one.imag))[which]
        w = float(value.imag)
    return LinearMode(w / (2 * pi), w / (-2 * float(value.real)) if value.real < 0 else np.inf)
