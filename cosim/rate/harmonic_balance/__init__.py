"""Periodic motion of a device under its drive loop, from the effect files, by alternating frequency and time.

Every state is a Fourier series of H harmonics of the drive frequency; the equations of motion hold for their first H
harmonics. What the effects do is evaluated at N instants of a period and taken apart into harmonics again, so that
any expression will do (T. M. Cameron, J. H. Griffin, Journal of Applied Mechanics 56, 1989; M. Krack, J. Gross,
Harmonic Balance for Nonlinear Vibration Problems, Springer 2019, chapter 2). Newton's method solves for the
coefficients, the frequency and the forces at once, with derivatives from the expressions:

    ω² a'' - harmonics of (force/m) = 0,  a state of first order: ω a' - harmonics of its rate = 0
    u_x = Re(iF e^{iψ} e^{iθ}),  u_y = Re(U e^{iψ} e^{iθ}),  ψ = ω (advance - delay)
    first harmonic of v_x as the drive loop holds it; of v_y zero where the sense loop is closed

The delay and the amplifier's lag are exact. An actuator with play remembers: its loop is closed by going round twice.
"""

from cosim.rate.harmonic_balance.equations import equations
from cosim.rate.harmonic_balance.residual import Unsettled, Wanted
from cosim.rate.harmonic_balance.solve import Periodic, balanced

__all__ = ["Periodic", "Unsettled", "Wanted", "balanced", "equations"]
