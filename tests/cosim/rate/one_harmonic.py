"""The settled rate mode by hand, one harmonic of each axis: what the harmonic balance of the effect files must give
where that is exact.

With x = Re(X e^{iωt}), y = Re(Y e^{iωt}) the equations of motion (TW 201137310, eq. 1) become

    (kxx + 3/4 k3_x |X|² - mω² + iω dxx - κ²/(m P)) X + C_xy Y = U_x,   P = w² - ω² + iω w/Q of the parasitic mode
    C_yx X + (kyy - mω² + iω dyy) Y = U_y
    C_xy = kxy + iω dxy - 2iλmωΩ,   C_yx = kxy + iω dxy + 2iλmωΩ
    |v_x| = G_x |X| 2(1/√(1 - r²) - 1)/r²,   r = |X|/g of the gap-closing pickoff; |v_y| likewise

The drive loop finds the frequency at which the force is a quarter period ahead of the corrected v_x.
"""

from math import pi, sqrt
from typing import NamedTuple

from scipy.optimize import brentq

SEARCH = 0.02
"""The drive frequency is looked for within this of the x mode, relative."""


class Held(NamedTuple):
    """Amplitude of v_x [V] where the amplifier lags as ``correction`` says; whether v_y is held at zero."""

    voltage: float
    correction: complex
    closed: bool


def settled(p: dict[str, float], held: Held, omega_z: float) -> tuple[float, float, float, complex]:
    """Drive frequency [Hz], force [N], amplitude of x [m] and sense channel [V or N] of a plant with parameters ``p``
    at the rate ``omega_z`` [rad/s]."""
    low, high = (sqrt(p["kxx"] / p["m"]) * (1 + s * SEARCH) for s in (-1, 1))
    w = brentq(lambda w: _force(p, held, omega_z, w)[1].real, low, high, xtol=1e-12 * low, rtol=1e-14)
    x, force, sense = _force(p, held, omega_z, w)
    return w / (2 * pi), force.imag, abs(x), sense


def _force(p: dict[str, float], held: Held, omega_z: float, w: float) -> tuple[complex, complex, complex]:
    m, coriolis = p["m"], 2j * p["angular_gain"] * p["m"] * w * omega_z
    lag = held.correction / (1 + 1j * w * p["amplifier_time_constant"])
    x = held.voltage / (p["sense_gain_x"] * lag)
    x *= swing_shown_as(abs(x), p["pickoff_inverse_gap"]) / abs(x)
    w_p = 2 * pi * p["parasitic_frequency"]
    parasitic = p["parasitic_coupling"] ** 2 / (m * (w_p**2 - w**2 + 1j * w * w_p / p["parasitic_q"]))
    cross = p["kxy"] + 1j * w * p["dxy"]
    z_x = p["kxx"] + 0.75 * p["k3_x"] * abs(x) ** 2 - m * w**2 + 1j * w * p["dxx"] - parasitic
    z_y = p["kyy"] - m * w**2 + 1j * w * p["dyy"]
    leak, gain_y = p["actuator_misalignment"], 1 + p["actuator_gain_mismatch"]
    # Forces on the masses from the commands: f_x = u_x + leak u_y', f_y = u_y' + leak u_x, u_y' = gain_y u_y.
    if held.closed:
        f_x, f_y = z_x * x, (cross + coriolis) * x
        u_y = (f_y - leak * f_x) / (1 - leak**2)
        return x, f_x - leak * u_y, u_y / gain_y
    y = (leak * z_x * x - (cross + coriolis) * x) / (z_y - leak * (cross - coriolis))
    u_x = z_x * x + (cross - coriolis) * y
    y *= shown_over_swing(abs(y) * p["pickoff_inverse_gap"])
    return x, u_x, p["sense_gain_y"] * (1 + p["pickoff_gain_mismatch"]) * y * lag


def shown_over_swing(r: float) -> float:
    """The first harmonic that a gap-closing pickoff shows of a swing of ``r`` gaps, over that of a straight one."""
    # With r = sin α: 2 (1/√(1 - r²) - 1)/r² = 1/(cos α cos²(α/2)), which does not cancel for a small r.
    cosine = sqrt(1 - r**2)
    return 2 / (cosine * (1 + cosine))


def swing_shown_as(shown: float, inverse_gap: float) -> float:
    """The swing [m] that a gap-closing pickoff shows as that of a straight one of ``shown`` [m]."""
    if inverse_gap == 0.0:
        return shown
    # With h = tan(α/2): 2h (1 + h²)/(1 - h²) = shown/g, which rises from 0 without end as h goes to 1.
    u = shown * inverse_gap
    h = brentq(lambda h: 2 * h * (1 + h**2) - u * (1 - h**2), 0.0, 1.0, xtol=1e-16, rtol=1e-14)
    return 2 * h / (1 + h**2) / inverse_gap
