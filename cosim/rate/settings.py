"""What a device's [rate_mode] says, completed, and the blocks that follow from it and the nominal device."""

from dataclasses import replace
from math import hypot, pi, sqrt
from typing import Final, NamedTuple

from cosim.rate.drive_loop import AmplitudeLoop, PhaseLoop
from cosim.rate.filters import LowPass
from cosim.rate.loop import Blocks
from cosim.rate.sense_loop import Rebalance
from cosim.rate.steady_state import Calibration, calibrate, parameters_at
from gyro_model.device import Device
from gyro_model.errors import InputError


class Settings(NamedTuple):
    """[rate_mode] of a device, with defaults: drive_amplitude [m]; bandwidths [Hz]; full_scale [rad/s].

    The defaults of the loops fit modes of some kHz with a split of tens of Hz.
    """

    drive_amplitude: float
    full_scale: float = 5.235987755982989  # 300 deg/s
    phase_bandwidth: float = 20.0
    amplitude_bandwidth: float = 10.0
    sense_bandwidth: float = 30.0
    output_bandwidth: float = 40.0
    demodulator_bandwidth: float = 400.0


def settings_of(device: Device) -> Settings:
    """The settings of ``device``: as its file says, else the amplitude of its start (1 µm where it starts at rest)."""
    p = device.all_parameters
    default = {"drive_amplitude": hypot(p["x_start"], p["y_start"]) or 1e-6}
    return Settings(**{**default, **device.rate_mode})


NEEDED: Final = ("m", "kxx", "kyy", "dxx", "dyy")
"""What a design must say: without it the loops have no frequency, split or damping to be made for."""
CROSS: Final = ("kxy", "dxy")
"""Zero where a design says nothing: nobody designs a cross term."""
STATED: Final = ("sense_gain_x", "sense_gain_y", "x_start", "x_dot_start", "y_start", "y_dot_start")


SHOWING: Final = ("sense_gain_x", "sense_gain_y", "angular_gain")
"""Without these a rate does not show."""


def design_for(given: Device, device: Device) -> Device:
    """What the loops of ``device`` may know: ``given``, and where it says nothing, the gains and noise that the device
    file states and the [rate_mode] that the loops are set to; every other effect is neutral.

    Raises InputError where it leaves out what the loops are made from.
    """
    missing = [name for name in NEEDED if name not in given.parameters]
    if missing:
        raise InputError(f"design {given.name}: says nothing of {', '.join(missing)}: give values, SI")
    stated = [*STATED, *(q.name for e in device.model.effects if e.noise for q in e.parameters)]
    values = dict.fromkeys(CROSS, 0.0) | {name: device.parameters[name] for name in stated if name in device.parameters}
    return replace(given, parameters={**values, **given.parameters}, rate_mode={**device.rate_mode, **given.rate_mode})


def at_bias(device: Device, v_bias: float, amplitude: float) -> Device:
    """``device`` with the mean softening of its electrodes at ``v_bias`` [V] in its stiffness, x swinging by
    ``amplitude`` [m], and no electrodes: (docs/theory/matching.md, eq. 1)."""
    p = device.all_parameters
    pull = p["softening"] * v_bias**2
    if pull == 0.0:
        return device
    swing = (amplitude / p["electrode_gap"]) ** 2
    if swing >= 1:
        raise InputError(
            f"drive_amplitude {amplitude:g} m: the electrodes are {p['electrode_gap']:g} m away; give a smaller one, "
            "or electrode_gap"
        )
    softened = {"kxx": p["kxx"] - pull * (1 - swing) ** -1.5, "kyy": p["kyy"] - pull, "softening": 0.0}
    if min(softened["kxx"], softened["kyy"]) <= 0:
        raise InputError(f"v_bias {v_bias:g} V pulls the mass to its electrodes: give less, or a smaller softening")
    return device.with_parameters(softened)


class Nominal(NamedTuple):
    """What the designer of the loops knows of the plant at t_ref.

    calibration; decay: ω/2Q of the drive mode [1/s]; pole: of the sense mode in the frame of the drive [1/s]; p: all
    parameters, SI.
    """

    calibration: Calibration
    decay: float
    pole: complex
    p: dict[str, float]


def nominal(device: Device, settings: Settings, closed: bool) -> Nominal:
    """The nominal plant. Raises InputError where a rate or the drive would not show, or the drive has no damping."""
    p = parameters_at(device, device.all_parameters["t_ref"])
    blind = [name for name in SHOWING if p[name] == 0]
    if blind:
        raise InputError(f"{blind[0]} = 0: no rate would show; give a number other than 0")
    calibration = calibrate(device, settings.drive_amplitude, closed)
    omega = 2 * pi * calibration.frequency
    # From the force that the drive takes: damping of all kinds, a parasitic mode's included.
    decay = calibration.force / (2 * p["m"] * omega * settings.drive_amplitude)
    sense = p["dyy"] / (2 * p["m"])
    pole = complex(-sense, sqrt(max(p["kyy"] / p["m"] - sense**2, 0.0)) - omega)
    if calibration.force <= 0:
        raise InputError("drive axis has no damping: rate mode needs dxx > 0 for its amplitude loop")
    return Nominal(calibration, decay, pole, p)


def blocks_for(settings: Settings, known: Nominal, period: float, hold: float) -> Blocks:
    """All blocks of the loops at the sample period ``period`` [s]; a force is held over ``hold`` [s]."""
    calibration, p = known.calibration, known.p
    omega, drive = 2 * pi * calibration.frequency, calibration.drive
    rebalance = (
        Rebalance.design(p["sense_gain_y"], p["m"], omega, known.pole, settings.sense_bandwidth, period)
        if drive.closed
        else Rebalance.none()
    )
    return Blocks(
        demodulator=LowPass.design(settings.demodulator_bandwidth, period),
        correction=drive.correction,
        phase_loop=PhaseLoop.design(omega, known.decay, drive.voltage, settings.phase_bandwidth, period),
        amplitude_loop=AmplitudeLoop.design(
            drive.voltage, calibration.force, known.decay, settings.amplitude_bandwidth, period
        ),
        rebalance=rebalance,
        actuation_delay=0.5 * hold + p["actuator_delay"],
        scale=calibration.scale,
        closed=drive.closed,
        output=LowPass.design(settings.output_bandwidth, period),
    )
