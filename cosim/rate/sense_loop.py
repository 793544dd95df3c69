"""The sense loop: open, or closed by a force that rebalances both channels.

z_y is the demodulated envelope of v_y in the phase of the drive displacement. The Coriolis force on y is
-2mλΩ x' = -i 2mλωΩA, the quadrature force -kxy A: a quarter period apart.

Open, z_y itself is the sense channel. Closed, the force u_y = Re(U e^{iφ}) holds z_y at zero and U is the channel.
Either is turned into  quadrature + i · rate = i · channel/scale  [rad/s] by the calibration (steady_state.Calibration).
"""

from math import pi
from typing import NamedTuple, Self

from numba import njit


class Rebalance(NamedTuple):
    """Complex PI controller of both channels at once, force in phase (quadrature) and a quarter period off (Coriolis):

        U_k = -(c z_k + W_k),   W_{k+1} = W_k - c p T z_k,   c = i 2mω ω_b/G,   p = -ω_y/2Q_y + i(ω_y - ω_d)

    The slow plant z' = p z + G (D + U)/(2imω) has the one pole p, turning at the split; the controller's zero stands
    on it, which leaves U = -D/(1 + s/ω_b). c [N/V], c p T [N/V]; zero gains leave the loop open.
    """

    proportional: complex
    integral: complex

    @classmethod
    def design(cls, gain: float, mass: float, omega: float, pole: complex, bandwidth: float, period: float) -> Self:
        """The loop of ``bandwidth`` ω_b/2π [Hz] for a pickoff ``gain`` [V/m] and the plant's ``pole`` [1/s].

        mass [kg]; omega: of the drive [rad/s].
        """
        c = 2j * mass * omega * 2 * pi * bandwidth / gain
        return cls(c, c * pole * period)

    @classmethod
    def none(cls) -> Self:
        """An open loop."""
        return cls(0j, 0j)


@njit(cache=True)
def rebalance(block, state, z_y):  # type: ignore[no-untyped-def]
    """Sets ``state.sense_force`` [N] from the envelope ``z_y`` [V]."""
    state.sense_force = -(block.proportional * z_y + state.sense_integral)
    state.sense_integral -= block.integral * z_y
