"""The sense loop: open, or closed by a force that rebalances both channels.

z_y is the demodulated envelope of v_y in the phase of the drive displacement. The Coriolis force on y is
-2mλΩ x' = -i 2mλωΩA, the quadrature force -kxy A: a quarter period apart.

Open, z_y itself is the sense channel. Closed, the force u_y = Re(U e^{iφ}) holds z_y at zero and U is the channel.
Either is turned into  quadrature + i · rate = i · channel/scale  [rad/s] by the calibration (steady_state.Calibration).
"""

from cmath import exp
from math import expm1, pi
from typing import NamedTuple, Self

from numba import njit


class Rebalance(NamedTuple):
    """Complex PI controller of both channels at once, force in phase (quadrature) and a quarter period off (Coriolis):

        U_k = -(c z_k + W_k),   W_{k+1} = W_k - c (a - 1) z_k
        a = e^{pT},   c = (1 - e^{-ω_b T})/b,   b = G (a - 1)/(2imω p),   p = -ω_y/2Q_y + i(ω_y - ω_d)

    The slow plant z' = p z + G (D + U)/(2imω), sampled: z_{k+1} = a z_k + b (D_k + U_k), has the one pole a, turning at
    the split; the controller's zero stands on it, which leaves U = -D behind one pole e^{-ω_b T}. c, c (a - 1) [N/V];
    zero gains leave the loop open.
    """

    proportional: complex
    integral: complex

    @classmethod
    def design(cls, gain: float, mass: float, omega: float, pole: complex, bandwidth: float, period: float) -> Self:
        """The loop of ``bandwidth`` ω_b/2π [Hz] for a pickoff ``gain`` [V/m] and the plant's ``pole`` p [1/s].

        mass [kg]; omega: of the drive [rad/s]; period T [s].
        """
        moved = exp(pole * period) - 1
        by_force = gain * moved / (2j * mass * omega * pole)
        c = -expm1(-2 * pi * bandwidth * period) / by_force
        return cls(c, c * moved)

    @classmethod
    def none(cls) -> Self:
        """An open loop."""
        return cls(0j, 0j)


@njit(cache=True)
def rebalance(block, state, z_y):  # type: ignore[no-untyped-def]
    """Sets ``state.sense_force`` [N] from the envelope ``z_y`` [V]."""
    state.sense_force = -(block.proportional * z_y + state.sense_integral)
    state.sense_integral -= block.integral * z_y
