"""The drive loop: phase-locked loop, numerically controlled oscillator and amplitude loop.

The phase φ of the oscillator is that of the drive displacement: x = A cos φ. The demodulated envelope of v_x, corrected
for what is known of the circuit, is then V e^{iε} with the phase error ε > 0 where x is ahead of the oscillator. The
force u_x = -F sin φ pushes along the velocity. In slow time (s = ω/2Q of the drive mode, F = s·2mωA when settled)

    ε' = (ω_x - ω) - s ε,   V' = -s V + G F/(2mω)

so that both loops are first-order plants under a PI controller and its gains follow from a bandwidth.
"""

from cmath import phase
from math import pi
from typing import Final, NamedTuple, Self

from numba import njit

DAMPING: Final = 0.7071067811865476
"""Damping ratio of both loops: the fastest step response without ringing to speak of (4 % overshoot)."""
SEEN: Final = 0.1
"""The phase detector is believed from this share of the set amplitude on."""


class PhaseLoop(NamedTuple):
    """Phase detector, PI loop filter and numerically controlled oscillator:

        ε_k = arg z_x,k,   ω_k = ω_0 + I_k + K_p ε_k,   I_{k+1} = I_k + K_i T ε_k,   φ_{k+1} = φ_k + ω_k T

    Where |z_x| is below ``threshold`` [V] there is no phase yet: ε_k = 0. ω_0 [rad/s], K_p [1/s], K_i T [1/s]; I is
    held within ``reach`` [rad/s].
    """

    center: float
    proportional: float
    integral: float
    reach: float
    threshold: float

    @classmethod
    def design(cls, center: float, decay: float, voltage: float, bandwidth: float, period: float) -> Self:
        """The loop around ``center`` [rad/s] of a drive mode that decays with ``decay`` = ω/2Q [1/s].

        bandwidth: natural frequency of the closed loop [Hz]; voltage: amplitude of v_x [V].
        """
        natural = 2 * pi * bandwidth
        proportional, integral = _pi_gains(natural, decay)
        # 5 %: far beyond what any temperature does to a resonance, short of the next mode of a usual device.
        return cls(center, proportional, integral * period, 0.05 * center, SEEN * voltage)


class AmplitudeLoop(NamedTuple):
    """PI controller of the drive amplitude:

        e_k = V_set - |z_x,k|,   F_k = min(max(J_k + K_p e_k, 0), F_max),   J_{k+1} = J_k + K_i T e_k

    J stands still while F_k is at a limit. V_set [V], K_p [N/V], K_i T [N/V], F_max [N].
    """

    voltage: float
    proportional: float
    integral: float
    largest: float

    @classmethod
    def design(cls, voltage: float, force: float, decay: float, bandwidth: float, period: float) -> Self:
        """The loop for ``voltage`` [V], which takes ``force`` [N] when settled.

        decay: ω/2Q of the drive mode [1/s]; bandwidth: natural frequency of the closed loop [Hz].
        """
        proportional, integral = _pi_gains(2 * pi * bandwidth, decay)
        # V' = -s V + (s V_set/F_settled) F.
        by_force = force / (decay * voltage)
        return cls(voltage, proportional * by_force, integral * by_force * period, LARGEST_FORCE * force)


LARGEST_FORCE: Final = 20.0
"""The drive force at most, over the settled one: start-up takes a twentieth of the mode's time constant."""


def _pi_gains(natural: float, decay: float) -> tuple[float, float]:
    """K_p, K_i for s² + (decay + K_p) s + K_i = s² + 2ζω_n s + ω_n²; a mode that decays faster needs no K_p."""
    return max(2 * DAMPING * natural - decay, 0.0), natural**2


@njit(cache=True)
def phase_loop(block, state, z_x):  # type: ignore[no-untyped-def]
    """Sets ``state.omega`` and ``state.error`` from the envelope ``z_x`` [V]."""
    error = phase(z_x) if abs(z_x) > block.threshold else 0.0
    state.omega = block.center + state.frequency_integral + block.proportional * error
    integral = state.frequency_integral + block.integral * error
    state.frequency_integral = min(max(integral, -block.reach), block.reach)
    state.error = error


@njit(cache=True)
def amplitude_loop(block, state, z_x):  # type: ignore[no-untyped-def]
    """Sets ``state.force`` [N] from the envelope ``z_x`` [V]."""
    error = block.voltage - abs(z_x)
    wanted = state.force_integral + block.proportional * error
    state.force = min(max(wanted, 0.0), block.largest)
    if wanted == state.force:
        state.force_integral += block.integral * error
