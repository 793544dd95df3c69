"""The settled rate mode by harmonic balance: drive frequency, scale factor, bias and quadrature, without a simulation.

The drive loop holds the amplitude of v_x and its phase, the sense loop v_y where it is closed; what the device does
under them is the periodic solution of its equations with every effect that is deterministic and does not change with
time (``harmonic_balance``). Inputs are held: temperature, rate of turn, acceleration, bias voltage.

Signs and phases are those of the drive loop's reference, the corrected v_x: a positive real envelope is in phase with
it, and the drive force is a quarter period ahead. ``left_out`` names the effects that have no place in a settled state.
"""

from collections.abc import Mapping
from math import pi
from typing import NamedTuple

from cosim.rate.harmonic_balance import Periodic, Unsettled, Wanted, balanced, equations
from gyro_model.anatomy import Effect, Follow, Law
from gyro_model.device import Device
from gyro_model.dynamics import Dynamics
from gyro_model.errors import InputError
from gyro_model.evaluate import evaluate
from gyro_model.quantities import INPUTS
from gyro_model.symbols import after, t


class Drive(NamedTuple):
    """What the drive loop holds.

    voltage: amplitude of v_x where the amplifier lags as ``correction`` says [V]; correction: complex factor that
    undoes the amplifier's lag, 1 + iω₀τ at its nominal values; closed: the sense loop holds v_y at zero; amplitude of
    x that is meant [m]; advance: the delay of the actuators that the loops undo [s].
    """

    voltage: float
    correction: complex
    closed: bool
    amplitude: float
    advance: float


class Settled(NamedTuple):
    """A settled state at one temperature and rate.

    frequency [Hz]; force: amplitude of the drive force [N]; amplitude: first harmonic of x [m]; sense: complex envelope
    of the sense channel in the phase of the drive loop's reference, v_y [V] in the open loop, u_y [N] in the closed
    one; slope: its derivative by the rate [V or N per rad/s]; moved: by how much the last refinement moved the first
    harmonics of the motion, over the amplitude: 1e-10 but for effects with corners.
    """

    frequency: float
    force: float
    amplitude: float
    sense: complex
    slope: complex
    moved: float


def unsettled(effect: Effect) -> str | None:
    """Why an effect has no place in a settled state; None for one that has. What a temperature does is in it, the
    temperature being given."""
    if effect.noise:
        return "draws random numbers"
    if isinstance(effect, Follow):
        return None
    if effect.symbols & {t, after}:
        return "changes with time"
    if any(memory.flows or memory.sample is not None for memory in effect.memories) or effect.drawn_at_start:
        return "changes with time"
    if effect.memories and isinstance(effect, Law):
        return "depends on how the temperature came to where it is"
    return None


def left_out(device: Device) -> dict[str, str]:
    """Why the harmonic balance leaves effects out that act on ``device``, by id. Noise is not among them: a settled
    state is the mean."""
    acting = (effect for effect in device.model.effects if not effect.noise and device.acts(effect))
    return {effect.id: why for effect in acting if (why := unsettled(effect)) is not None}


def in_words(missing: Mapping[str, str]) -> str:
    """What is ``left_out`` as text."""
    return ", ".join(f"{name} ({why})" for name, why in missing.items())


def parameters_at(device: Device, temperature: float, held: Mapping[str, float] | None = None) -> dict[str, float]:
    """The FMU parameters that hold once structure and circuit are at ``temperature`` [K], and the inputs, those of
    ``held`` by name, SI."""
    values = {q.name: q.start for q in INPUTS} | device.all_parameters | dict(held or {})
    values |= dict.fromkeys(("temperature", "temperature_structure", "temperature_circuit"), temperature)
    for law in device.model.laws:
        if device.acts(law) and unsettled(law) is None:
            values |= {name: float(value) for name, value in evaluate(law, values).items()}
    return values


def settle(
    device: Device, drive: Drive, temperature: float, omega_z: float = 0.0, held: Mapping[str, float] | None = None
) -> Settled:
    """The settled state of ``device`` at ``temperature`` [K] and the rate ``omega_z`` [rad/s].

    held: further inputs by name, SI. Raises InputError where there is none that the loops would find.
    """
    wanted = Wanted(drive.amplitude, drive.voltage, drive.correction, drive.advance, drive.closed)
    found = _periodic(device, wanted, temperature, {**(held or {}), "omega_z": omega_z})
    sense = found.u_y if drive.closed else found.v_y
    return Settled(found.omega / (2 * pi), found.force, abs(found.x), sense, found.slope, found.moved)


def _periodic(device: Device, wanted: Wanted, temperature: float, held: Mapping[str, float]) -> Periodic:
    """The periodic motion of the device where the loops hold ``wanted``."""
    acting = [
        effect
        for effect in device.model.effects
        if device.acts(effect) and not isinstance(effect, (Law, Follow)) and unsettled(effect) is None
    ]
    p = parameters_at(device, temperature, held)
    neutral = {size.name: size.start for effect in acting for size in effect.sizes}
    absent = tuple((name, value) for name, value in neutral.items() if p[name] == value)
    of = equations(Dynamics(tuple(effect.id for effect in acting), device.model), absent)
    try:
        return balanced(of, p, neutral, wanted)
    except Unsettled as reached:
        ids = ", ".join(effect.id for effect in acting if not effect.nominal) or "none"
        at = f"drive_amplitude {wanted.amplitude:g} m, {temperature:g} K"
        if reached.walls:
            raise InputError(
                f"the mass swings up to the plates at {at}: change {', '.join(reached.walls)}, or make drive_amplitude "
                "or the coupling kxy smaller"
            ) from None
        raise InputError(
            f"the drive loop finds no settled state at {at}: make drive_amplitude or an effect smaller; acting: {ids}"
        ) from None


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


def calibrate(device: Device, amplitude: float, closed: bool, held: Mapping[str, float] | None = None) -> Calibration:
    """The calibration of a device whose drive swings with ``amplitude`` [m] at t_ref; held: inputs by name, SI."""
    p = parameters_at(device, device.all_parameters["t_ref"], held)
    wanted = Wanted(amplitude, None, 1.0 + 0.0j, p["actuator_delay"], closed)
    omega = (p["kxx"] / p["m"]) ** 0.5
    # The correction belongs to the drive frequency, which depends on it in turn by 1e-9: two rounds do.
    for _ in range(2):
        wanted = wanted._replace(correction=1 + 1j * omega * p["amplifier_time_constant"])
        rest = _periodic(device, wanted, p["t_ref"], held or {})
        omega = rest.omega
    drive = Drive(rest.v_x.real, wanted.correction, closed, amplitude, wanted.advance)
    # With the amplitude held instead of the voltage the slope would be another one by what a rate does to the pickoff.
    settled = settle(device, drive, p["t_ref"], held=held)
    return Calibration(settled.slope, settled.frequency, settled.force, settled.amplitude, drive)


def output_at(
    device: Device, calibration: Calibration, temperature: float, held: Mapping[str, float] | None = None
) -> Output:
    """The settled output of a device at ``temperature`` [K]; held: inputs by name, SI."""
    rest = settle(device, calibration.drive, temperature, held=held)
    zero, slope = calibration.rate(rest.sense), calibration.rate(rest.slope)
    return Output(slope.imag, zero.imag, zero.real, rest.frequency, rest.force)
