"""The settled rate mode by harmonic balance: drive frequency, scale factor, bias and quadrature, without a simulation.

The drive loop holds the amplitude of v_x and its phase; with x = Re(X e^{iωt}), y = Re(Y e^{iωt}), the equations
of motion (TW 201137310, eq. 1) become

    (kxx + 3/4 k3_x |X|² - mω² + iω dxx - κ²/(m P)) X + C_xy Y = U_x,   P = w² - ω² + iω w/Q of the parasitic mode
    C_yx X + (kyy - mω² + iω dyy) Y = U_y
    C_xy = kxy + iω dxy - 2iλmωΩ,   C_yx = kxy + iω dxy + 2iλmωΩ
    |v_x| = G_x |X| 2(1/√(1 - r²) - 1)/r²,   r = |X|/g of the gap-closing pickoff; |v_y| likewise

Signs and phases are those of x: a positive real envelope is in phase with x, the velocity leads it by 90 degrees, and
so does the drive force at resonance. ``covers`` says of which effects this knows; whatever else acts is left
out. x swings, y is small: of a cubic spring only k3_x.
"""

from functools import cache
from math import inf, isfinite, pi, sqrt
from typing import Final, NamedTuple

from scipy.optimize import brentq

from gyro_model.anatomy import Effect, Follow, Law
from gyro_model.device import Device
from gyro_model.errors import InputError
from gyro_model.evaluate import evaluate
from gyro_model.symbols import after, since, t

SEARCH: Final = 0.02
"""The drive frequency is looked for within this of the x mode, relative; a parasitic mode pulls it by less."""
RATE_STEP: Final = 1e-3
"""The scale factor is the difference quotient at ± this [rad/s]; the response is linear in the rate but for Ω²."""


class Drive(NamedTuple):
    """What the drive loop holds.

    voltage: amplitude of v_x where the amplifier lags as ``correction`` says [V]; correction: complex factor that
    undoes the amplifier's lag, 1 + iω₀τ at its nominal values; closed: the sense loop holds v_y at zero.
    """

    voltage: float
    correction: complex
    closed: bool


class Settled(NamedTuple):
    """A settled state at one temperature and rate.

    frequency [Hz]; force: amplitude of the drive force [N]; amplitude of x [m]; sense: complex envelope of the sense
    channel in the phase of the drive loop's reference, v_y [V] in the open loop, u_y [N] in the closed one.
    """

    frequency: float
    force: float
    amplitude: float
    sense: complex


class _Watched(dict[str, float]):
    """Parameters that note which of them are read."""

    def __init__(self) -> None:
        super().__init__()
        self.read: set[str] = set()

    def __missing__(self, name: str) -> float:
        self.read.add(name)
        return 0.5


@cache
def parameters_read() -> frozenset[str]:
    """Names of the parameters that the equations have in them."""
    watched = _Watched()
    for closed in (False, True):
        _force(watched, Drive(1.0, 1.0 + 0.0j, closed), 0.0, 1.0)
    return frozenset(watched.read)


def covers(effect: Effect) -> bool:
    """Whether the equations know an effect: of a law, that it is settled where its temperatures are and changes only
    what they read; of any other, that they read a parameter of its own."""
    if effect.noise:
        return False
    if not isinstance(effect, Law):
        return any(parameter.name in parameters_read() for parameter in effect.parameters)
    moving = {t, after, since} & {symbol for expr in effect.terms().values() for symbol in expr.free_symbols}
    return not (moving or effect.memories) and {target.name for target in effect.changes} <= parameters_read()


def left_out(device: Device, *, delay_known: bool) -> tuple[str, ...]:
    """Ids of the effects that act on the settled output of ``device`` and are not in the equations. delay_known: the
    loops undo the delay of the actuator."""
    known = {"actuator_delay"} if delay_known else set()
    return tuple(
        effect.id
        for effect in device.model.effects
        if not (effect.nominal or effect.noise or isinstance(effect, Follow) or covers(effect) or effect.id in known)
        and device.acts(effect)
    )


def parameters_at(device: Device, temperature: float) -> dict[str, float]:
    """The FMU parameters that hold once structure and circuit are at ``temperature`` [K]."""
    values = device.all_parameters
    values |= {"temperature_structure": temperature, "temperature_circuit": temperature}
    for law in device.model.laws:
        if device.acts(law) and covers(law):
            values |= {name: float(value) for name, value in evaluate(law, values).items()}
    return values


def settle(p: dict[str, float], drive: Drive, omega_z: float) -> Settled:
    """The settled state of a plant with parameters ``p`` at the rate ``omega_z`` [rad/s].

    Raises InputError where the drive loop finds no frequency at which the force is in phase with the velocity, and
    where y reaches its pickoff.
    """
    low, high = (sqrt(p["kxx"] / p["m"]) * (1 + s * SEARCH) for s in (-1, 1))
    try:
        w = brentq(lambda w: _force(p, drive, omega_z, w)[1].real, low, high, xtol=1e-12 * low, rtol=1e-14)
    except ValueError:
        raise InputError(
            f"no drive frequency within {100 * SEARCH:g} % of {sqrt(p['kxx'] / p['m']) / 2 / pi:.6g} Hz: "
            "make the coupling of the axes or of the parasitic mode smaller"
        ) from None
    x, force, sense = _force(p, drive, omega_z, w)
    if not isfinite(abs(sense)):
        raise InputError(
            "the sense mass swings up to the plates of its pickoff: make kxy or pickoff_inverse_gap smaller"
        )
    return Settled(w / (2 * pi), force.imag, abs(x), sense)


def _force(p: dict[str, float], drive: Drive, omega_z: float, w: float) -> tuple[complex, complex, complex]:
    """X [m], drive force U_x [N] and sense channel, at the drive frequency ``w`` [rad/s].

    The phase of the reference is that of v_x, corrected: the loops make U_x imaginary.
    """
    m, coriolis = p["m"], 2j * p["angular_gain"] * p["m"] * w * omega_z
    lag = drive.correction / (1 + 1j * w * p["amplifier_time_constant"])
    x = drive.voltage / (p["sense_gain_x"] * lag)
    x *= swing_shown_as(abs(x), p["pickoff_inverse_gap"]) / abs(x)
    w_p = 2 * pi * p["parasitic_frequency"]
    parasitic = p["parasitic_coupling"] ** 2 / (m * (w_p**2 - w**2 + 1j * w * w_p / p["parasitic_q"]))
    cross = p["kxy"] + 1j * w * p["dxy"]
    z_x = p["kxx"] + 0.75 * p["k3_x"] * abs(x) ** 2 - m * w**2 + 1j * w * p["dxx"] - parasitic
    z_y = p["kyy"] - m * w**2 + 1j * w * p["dyy"]
    leak, gain_y = p["actuator_misalignment"], 1 + p["actuator_gain_mismatch"]
    # Forces on the masses from the commands: f_x = u_x + leak u_y', f_y = u_y' + leak u_x, u_y' = gain_y u_y.
    if drive.closed:
        f_x, f_y = z_x * x, (cross + coriolis) * x
        u_y = (f_y - leak * f_x) / (1 - leak**2)
        return x, f_x - leak * u_y, u_y / gain_y
    y = (leak * z_x * x - (cross + coriolis) * x) / (z_y - leak * (cross - coriolis))
    u_x = z_x * x + (cross - coriolis) * y
    y *= shown_over_swing(abs(y) * p["pickoff_inverse_gap"])
    return x, u_x, p["sense_gain_y"] * (1 + p["pickoff_gain_mismatch"]) * y * lag


def shown_over_swing(r: float) -> float:
    """The first harmonic that a gap-closing pickoff shows of a swing of ``r`` gaps, over that of a straight one; inf
    where the swing reaches the plates."""
    if r >= 1:
        return inf
    # With r = sin α: 2 (1/√(1 - r²) - 1)/r² = 1/(cos α cos²(α/2)), which does not cancel for a small r.
    cosine = sqrt(1 - r**2)
    return 2 / (cosine * (1 + cosine))


def shown_swing(amplitude: float, inverse_gap: float) -> float:
    """What a gap-closing pickoff shows of a swing of ``amplitude`` [m], as the swing of a straight one [m]. Raises
    InputError where it reaches the plates."""
    shown = amplitude * shown_over_swing(amplitude * inverse_gap)
    if shown == inf:
        raise InputError(
            f"drive_amplitude {amplitude:g} m: the plates of the pickoff are {1 / inverse_gap:g} m away; give a "
            "smaller one, or a smaller pickoff_inverse_gap"
        )
    return shown


def swing_shown_as(shown: float, inverse_gap: float) -> float:
    """The inverse of ``shown_swing``."""
    if inverse_gap == 0.0:
        return shown
    # With h = tan(α/2): 2h (1 + h²)/(1 - h²) = shown/g, which rises from 0 without end as h goes to 1.
    u = shown * inverse_gap
    h = brentq(lambda h: 2 * h * (1 + h**2) - u * (1 - h**2), 0.0, 1.0, xtol=1e-16, rtol=1e-14)
    return 2 * h / (1 + h**2) / inverse_gap


class Calibration(NamedTuple):
    """What turns the sense channel into a rate, from the nominal device at t_ref.

    scale: complex envelope of the sense channel for 1 rad/s [V or N per rad/s]; frequency: of the drive [Hz];
    force: amplitude of the drive force [N]; amplitude: of x [m]; drive: what the drive loop holds.
    """

    scale: complex
    frequency: float
    force: float
    amplitude: float
    drive: Drive

    def rate(self, sense: complex) -> complex:
        """Quadrature + i · rate [rad/s] of a sense channel [V or N]."""
        return 1j * sense / self.scale


class Output(NamedTuple):
    """The settled output rate = scale_factor · Ω + bias; bias, quadrature [rad/s], drive frequency [Hz], drive force
    [N]."""

    scale_factor: float
    bias: float
    quadrature: float
    drive_frequency: float
    drive_force: float


def calibrate(device: Device, amplitude: float, closed: bool) -> Calibration:
    """The calibration of a device whose drive swings with ``amplitude`` [m] at t_ref."""
    p = parameters_at(device, device.all_parameters["t_ref"])
    w = sqrt(p["kxx"] / p["m"])
    # The correction belongs to the drive frequency, which depends on it in turn by 1e-9: two rounds do.
    for _ in range(2):
        correction = 1 + 1j * w * p["amplifier_time_constant"]
        drive = Drive(p["sense_gain_x"] * shown_swing(amplitude, p["pickoff_inverse_gap"]), correction, closed)
        rest = settle(p, drive, 0.0)
        w = 2 * pi * rest.frequency
    return Calibration(_slope(p, drive), rest.frequency, rest.force, rest.amplitude, drive)


def _slope(p: dict[str, float], drive: Drive) -> complex:
    return (settle(p, drive, RATE_STEP).sense - settle(p, drive, -RATE_STEP).sense) / (2 * RATE_STEP)


def output_at(device: Device, calibration: Calibration, temperature: float) -> Output:
    """The settled output of a device at ``temperature`` [K]."""
    p = parameters_at(device, temperature)
    rest = settle(p, calibration.drive, 0.0)
    zero = calibration.rate(rest.sense)
    slope = calibration.rate(_slope(p, calibration.drive))
    return Output(slope.imag, zero.imag, zero.real, rest.frequency, rest.force)
