"""The compiled loop of rate mode: plant, demodulators, drive loop, sense loop, output filter, sample by sample.

At t_k: sample k is there, taken just before the force changes; the blocks take it and set u_k, held over
[t_k, t_{k+1}).
"""

from cmath import exp
from math import cos, pi, sin
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from cosim.exchange import exchange
from cosim.fmu import HANDLE_SIZE
from cosim.rate.dither import Dither, dither, without_tones
from cosim.rate.drive_loop import AmplitudeLoop, PhaseLoop, amplitude_loop, phase_loop
from cosim.rate.filters import LowPass, demodulate, low_pass
from cosim.rate.sense_loop import Rebalance, rebalance

FORCE_NAMES: Final = ("u_x", "u_y")
OUTPUT_NAMES: Final = ("v_x", "v_y", "temperature_structure", "temperature_circuit")
ENVELOPE_FORCE_NAMES: Final = ("u_x_i", "u_x_q", "u_y_i", "u_y_q", "carrier_frequency")
ENVELOPE_OUTPUT_NAMES: Final = ("v_x_i", "v_x_q", "v_y_i", "v_y_q", "temperature_structure", "temperature_circuit")


class Blocks(NamedTuple):
    """All blocks of a run, as the compiled loops take them.

    correction: complex factor that undoes the amplifier's nominal lag; actuation_delay: from a sample to the middle of
    what its force does [s]; scale: of the sense channel [V or N per rad/s]; closed: it is the force.
    """

    demodulator: LowPass
    correction: complex
    phase_loop: PhaseLoop
    amplitude_loop: AmplitudeLoop
    rebalance: Rebalance
    actuation_delay: float
    scale: complex
    closed: bool
    output: LowPass
    dither: Dither = Dither()


STATE: Final = np.dtype(
    [(name, np.float64) for name in ("phase", "omega", "error", "force", "frequency_integral", "force_integral")]
    + [
        (name, np.complex128)
        for name in ("x_first", "x_second", "y_first", "y_second", "sense_force", "sense_integral")
    ]
    + [("output_first", np.complex128), ("output", np.complex128)]
    + [("dither_phase", np.float64), ("tone_above", np.complex128), ("tone_below", np.complex128)]
)
"""What the blocks remember: phase [rad] and frequency [rad/s] of the oscillator, phase error [rad], drive force [N],
integrals of both loop filters, sections of the demodulators [V], sense force and its integral [N], sections of the
output filter [rad/s], phase of the dither [rad] and the answers to it above and below the drive [V]."""

RATE, QUADRATURE, FREQUENCY, AMPLITUDE, FORCE, STRUCTURE, CIRCUIT, LARGEST_ERROR, ROW_SIZE = range(9)
"""A row, the mean over an output interval: rate, quadrature [rad/s], drive frequency [Hz], amplitude of v_x [V], drive
force [N], temperatures [K] at its end; and the largest phase error in it [rad]."""


def start_state(blocks: Blocks) -> np.ndarray:
    """The state before the first sample, shape (1,): the oscillator runs at its nominal frequency."""
    state = np.zeros(1, STATE)
    state["omega"] = blocks.phase_loop.center
    return state


@njit(cache=True)
def control(blocks, state, z_x, z_y):  # type: ignore[no-untyped-def]
    """One step of the loops and of the output filter from the demodulated envelopes [V]; the force on y [N]."""
    z_y = without_tones(blocks.dither, state, z_y)
    phase_loop(blocks.phase_loop, state, z_x)
    amplitude_loop(blocks.amplitude_loop, state, z_x)
    rebalance(blocks.rebalance, state, z_y)
    channel = state.sense_force if blocks.closed else z_y
    state.output_first, state.output = low_pass(
        blocks.output, state.output_first, state.output, 1j * channel / blocks.scale
    )
    return state.sense_force + dither(blocks.dither, state)


@njit(cache=True)
def add_to_row(state, z_x, row, weight):  # type: ignore[no-untyped-def]
    """Adds the present values to the means in ``row``."""
    row[RATE] += weight * state.output.imag
    row[QUADRATURE] += weight * state.output.real
    row[FREQUENCY] += weight * state.omega / (2 * pi)
    row[AMPLITUDE] += weight * abs(z_x)
    row[FORCE] += weight * state.force
    row[LARGEST_ERROR] = max(row[LARGEST_ERROR], abs(state.error))


@njit(cache=True)
def run_rows(  # type: ignore[no-untyped-def]
    handle, inputs, outputs, blocks, states, first, period, held, output_values, rows, sensed
):
    """Runs ``len(held)`` samples from index ``first`` on into ``rows``, all of one length; gives the samples done.

    held, shape (n, 5): the scenario's inputs, SI, held over each sample; rows: shape (n_rows, ROW_SIZE); output_values:
    OUTPUT_NAMES as the last call left them; sensed, shape (3, n): set to v_y mixed with the oscillator, 2 v_y e^{-iφ}
    [V], the oscillator's frequency [rad/s], and the envelope of the force on y that follows the sample [N]. It ends
    early, at that sample, where the plant could not go on.

    With φ_k the oscillator's phase at t_k, the forces are advanced by half a hold and the known delay τ, and divided by
    the hold's sinc(ωT/2):

        u_x,k = -F sin(φ_k + ω_k (T/2 + τ))/sinc,  u_y,k = Re(U e^{i(φ_k + ω_k (T/2 + τ))})/sinc
    """
    state = states[0]
    input_values = np.empty(len(inputs))
    flags = np.zeros(HANDLE_SIZE)
    per_row = len(held) // len(rows)
    rows[:] = 0.0
    for k in range(len(held)):
        reference = exp(1j * state.phase)
        state.x_first, state.x_second = demodulate(
            blocks.demodulator, state.x_first, state.x_second, output_values[0], reference
        )
        state.y_first, state.y_second = demodulate(
            blocks.demodulator, state.y_first, state.y_second, output_values[1], reference
        )
        z_x, z_y = blocks.correction * state.x_second, blocks.correction * state.y_second
        force_y = control(blocks, state, z_x, z_y)
        sensed[0, k] = 2 * output_values[1] * reference.conjugate()
        sensed[1, k] = state.omega
        sensed[2, k] = force_y
        row = rows[k // per_row]
        add_to_row(state, z_x, row, 1 / per_row)

        half = 0.5 * state.omega * period
        ahead = state.phase + state.omega * blocks.actuation_delay
        hold = sin(half) / half
        c, s = cos(ahead) / hold, sin(ahead) / hold
        input_values[0] = -state.force * s
        input_values[1] = force_y.real * c - force_y.imag * s
        input_values[2:] = held[k]
        state.phase = (state.phase + state.omega * period) % (2 * pi)
        if exchange(handle, inputs, input_values, outputs, output_values, flags, (first + k) * period, period) > 0:
            return k
        row[STRUCTURE] = output_values[2]
        row[CIRCUIT] = output_values[3]
    return len(held)


@njit(cache=True)
def run_envelope_rows(  # type: ignore[no-untyped-def]
    handle, inputs, outputs, blocks, states, first, period, held, output_values, rows, sensed
):
    """As ``run_rows``, on the envelope form of the plant with ``period`` a step of the slow loops.

    The plant gives z_x and z_y itself and takes the envelopes of the forces, U_x = iF and U, advanced by the known
    delay: no demodulators, no hold.
    """
    state = states[0]
    input_values = np.empty(len(inputs))
    flags = np.zeros(HANDLE_SIZE)
    per_row = len(held) // len(rows)
    rows[:] = 0.0
    for k in range(len(held)):
        z_x = blocks.correction * complex(output_values[0], output_values[1])
        v_y = complex(output_values[2], output_values[3])
        force_y = control(blocks, state, z_x, blocks.correction * v_y)
        sensed[0, k] = v_y
        sensed[1, k] = state.omega
        sensed[2, k] = force_y
        row = rows[k // per_row]
        add_to_row(state, z_x, row, 1 / per_row)

        ahead = exp(1j * state.omega * blocks.actuation_delay)
        u_x, u_y = 1j * state.force * ahead, force_y * ahead
        input_values[0], input_values[1] = u_x.real, u_x.imag
        input_values[2], input_values[3] = u_y.real, u_y.imag
        input_values[4] = state.omega / (2 * pi)
        input_values[5:] = held[k]
        if exchange(handle, inputs, input_values, outputs, output_values, flags, (first + k) * period, period) > 0:
            return k
        row[STRUCTURE] = output_values[4]
        row[CIRCUIT] = output_values[5]
    return len(held)
