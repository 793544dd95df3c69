"""Rate mode: the two plants against each other and against the harmonic balance, the drift of the packaged device and
what makes it, the beat at the split, hours of temperature, noise."""

import time
from math import pi, sqrt
from typing import Final, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.optimize import least_squares

from benchmarks.rate_device import BIAS_DRIFT, SCALE_DRIFT, SOAKS
from benchmarks.report import SEEDS, Options, Report, Row, Table, row
from cosim.rate.courses import ZERO_CELSIUS, Course, constant, constant_temperature, rate_step, temperature_ramp
from cosim.rate.master import simulate
from cosim.rate.metrics import PER_HOUR, PER_ROOT_HOUR, allan_of, plateaus
from cosim.rate.run import RateRun
from cosim.rate.settings import settings_of
from cosim.rate.steady_state import calibrate, output_at
from gyro_model.device import Device, load_device

Floats = NDArray[np.float64]

CELSIUS: Final = (-40.0, -20.0, 0.0, 20.0, 40.0, 60.0, 85.0)
RATES: Final = (20.0, 300.0)
"""[°/s]; the larger is the full scale."""
FULL_RANGE_LIMIT: Final = 0.01
NONLINEAR: Final = 0.3
HOURS: Final = 6.0
WALL_TIME: Final = 60.0
NOISE_TIME: Final = 600.0
FULL_NOISE_TIME: Final = 60.0
BEAT_STEP: Final = np.deg2rad(100.0)
BEAT_FROM: Final = 0.02
"""The swing is fitted from here on [s], when the output filter's own answer has died away."""
MAKERS: Final = (
    ("tck_split",),
    ("tcd",),
    ("tcg",),
    ("tcp",),
    ("tck",),
    ("parasitic_coupling",),
    ("actuator_misalignment",),
)


def run(options: Options) -> Report:
    """All tables."""
    device = load_device("rate-mode")
    quiet = device.with_parameters({"sense_noise": 0.0, "thermal_force": 0.0})
    found = {
        (closed, celsius, rate): _both(quiet, closed, celsius, rate)
        for closed in (False, True)
        for celsius in CELSIUS
        for rate in RATES
    }
    tables = [
        _agreement(quiet, found),
        _drift(quiet, found),
        _makers(quiet),
        _beat(quiet),
        _hours(device),
        _noise(device, options.seeds_or(SEEDS)),
    ]
    notes = [
        "Plants: one rest, +R, rest, -R round of 3 s at each temperature, noise off; 5 µs samples of the full FMU, "
        "1 ms steps of the envelope; full range ±300 °/s. The rows hold start-up, drive loop, sense loop "
        "and output filter of each.",
        "Drift: (max - min)/range over the five soaks; not linear: span of what is left after the least-squares line, "
        "over the span.",
        "Gain and lag of the amplifier are common to v_x and v_y. The drive loop holds amplitude and phase of v_x, so "
        "in the open loop tcg drops out of scale factor and bias, and tcp acts only by pulling the drive frequency; in "
        "the closed loop both act at first order on the force.",
        "Angle random walk: a reading of 600 s scatters by 3 to 4 %, so the rows hold several seeds, the same for both "
        "loops. The thermal peak of the open loop at the split has 73 times the density at rest; the output filter "
        "leaves 0.36 of it, the mean over a row of 20 ms (f/50 Hz)², and it folds back from both sides: 0.8 % of the "
        "density's root from 0.05 to 1.5 Hz, where 40 seeds show 1.0 ± 0.3 % too much and 0.2 ± 0.3 % in the closed "
        "loop, which has no peak.",
        "Beat: the envelope has no demodulators; those of the full plant delay and shrink a swing at 50 Hz.",
    ]
    return Report("rate_mode", "Rate mode", tables, notes)


class Settled(NamedTuple):
    """Scale factor, bias and quadrature [rad/s]."""

    scale_factor: float
    bias: float
    quadrature: float


def _settled(device: Device, closed: bool, celsius: float, rate: float, envelope: bool) -> Settled:
    course = rate_step(np.deg2rad(rate), 3.0)
    asked = RateRun(device, course, constant_temperature(celsius), closed, 3.0, envelope=envelope)
    record = simulate(asked).record
    parts = plateaus(record, asked)
    rest = record.filter(record["t"] < 0.75).tail(20)
    return Settled(
        float(parts.scale_factors()[1][0]), float(parts.biases()[1][0]), float(rest["quadrature"].to_numpy().mean())
    )


def _both(device: Device, closed: bool, celsius: float, rate: float) -> tuple[Settled, Settled]:
    full, slow = (_settled(device, closed, celsius, rate, envelope) for envelope in (False, True))
    return full, slow


def _agreement(device: Device, found: dict[tuple[bool, float, float], tuple[Settled, Settled]]) -> Table:
    scale = settings_of(device).full_scale
    rows = []
    for closed in (False, True):
        known = calibrate(device, settings_of(device).drive_amplitude, closed)
        pairs = {key: value for key, value in found.items() if key[0] == closed}
        balance = {key: output_at(device, known, key[1] + ZERO_CELSIUS) for key in pairs}
        for name, over in (("bias", scale), ("scale_factor", 1.0), ("quadrature", scale)):
            between = max(abs(getattr(f, name) - getattr(s, name)) for f, s in pairs.values()) / over
            small = max(
                abs(getattr(f, name) - getattr(balance[key], name))
                for key, (f, _) in pairs.items()
                if key[2] == RATES[0]
            )
            rows.append(
                row(
                    f"{name.replace('_', ' ')}, {'closed' if closed else 'open'} loop",
                    "of full range",
                    {"full to envelope": between, f"full to balance, {RATES[0]:g} °/s": small / over},
                    limit=FULL_RANGE_LIMIT,
                )
            )
    grid = f"{len(CELSIUS)} temperatures from {CELSIUS[0]:g} to {CELSIUS[-1]:g} °C, ±{RATES[0]:g} and ±{RATES[1]:g} °/s"
    return Table(f"largest difference in steady state over {grid}", rows)


class Drift(NamedTuple):
    """Coefficients [ppm/°C, °/h/°C] and the part of the bias that is not linear."""

    scale: float
    bias: float
    nonlinear: float


def _coefficients(bias: Floats, scale: Floats) -> Drift:
    straight = np.polyval(np.polyfit(SOAKS, bias, 1), SOAKS)
    span = float(np.ptp(SOAKS))
    return Drift(
        float(1e6 * np.ptp(scale) / span),
        float(PER_HOUR * np.ptp(bias) / span),
        float(np.ptp(bias - straight) / np.ptp(bias)),
    )


def _drift(device: Device, found: dict[tuple[bool, float, float], tuple[Settled, Settled]]) -> Table:
    columns: dict[str, Drift] = {}
    for closed, loop in ((False, "open"), (True, "closed")):
        for index, plant in enumerate(("full FMU", "envelope")):
            settled = [found[closed, float(celsius), RATES[0]][index] for celsius in SOAKS]
            bias, scale = (np.array([getattr(s, name) for s in settled]) for name in ("bias", "scale_factor"))
            columns[f"{loop}, {plant}"] = _coefficients(bias, scale)
        columns[f"{loop}, balance"] = _balance_drift(device, closed)
    judged = ("open, full FMU",)
    scales = {name: drift.scale for name, drift in columns.items()}
    biases = {name: drift.bias for name, drift in columns.items()}
    part = {name: drift.nonlinear for name, drift in columns.items()}
    return Table(
        "uncompensated drift over -20 … 60 °C, settled",
        [
            row("scale factor", "ppm/°C", scales, note=f"Liu et al. 2014: {1e6 * SCALE_DRIFT:g}"),
            row("bias", "°/h/°C", biases, note=f"Liu et al. 2014: {BIAS_DRIFT:g}"),
            row("bias that is not linear", "of its span", part, limit=NONLINEAR, at_least=True, judged=judged),
        ],
    )


def _balance_drift(device: Device, closed: bool) -> Drift:
    known = calibrate(device, settings_of(device).drive_amplitude, closed)
    settled = [output_at(device, known, float(celsius) + ZERO_CELSIUS) for celsius in SOAKS]
    return _coefficients(np.array([s.bias for s in settled]), np.array([s.scale_factor for s in settled]))


def _makers(device: Device) -> Table:
    rows: list[Row] = []
    for names in ((), *MAKERS):
        without = device.with_parameters(dict.fromkeys(names, 0.0))
        open_loop, closed = (_balance_drift(without, loop) for loop in (False, True))
        rows.append(
            row(
                f"without {', '.join(names)}" if names else "all",
                "ppm/°C, °/h/°C, 1",
                {
                    "open: scale": open_loop.scale,
                    "open: bias": open_loop.bias,
                    "open: not linear": open_loop.nonlinear,
                    "closed: scale": closed.scale,
                    "closed: bias": closed.bias,
                },
            )
        )
    return Table("what makes the drift: harmonic balance with one parameter at zero", rows)


def _free_sense_mode(device: Device) -> tuple[float, float]:
    """Frequency [Hz] and decay [1/s] of the free motion nearest to the y axis alone, from the eigenvalues of the
    undriven device with its parasitic mode at rest and t_ref."""
    p = device.all_parameters
    m, kappa, w_p = p["m"], p["parasitic_coupling"], 2 * pi * p["parasitic_frequency"]
    stiffness = np.array(
        [[p["kxx"] / m, p["kxy"] / m, kappa / m], [p["kxy"] / m, p["kyy"] / m, 0], [kappa / m, 0, w_p**2]]
    )
    damping = np.array([[p["dxx"], p["dxy"], 0], [p["dxy"], p["dyy"], 0], [0, 0, m * w_p / p["parasitic_q"]]]) / m
    poles = np.linalg.eigvals(np.block([[np.zeros((3, 3)), np.eye(3)], [-stiffness, -damping]]))
    pole = poles[np.argmin(np.abs(poles - 1j * sqrt(p["kyy"] / m)))]
    return float(pole.imag / 2 / pi), float(-pole.real)


def _beat(device: Device) -> Table:
    frequency, decay = _free_sense_mode(device)
    split = frequency - calibrate(device, settings_of(device).drive_amplitude, False).frequency
    fits = {plant: _fit_beat(device, plant == "envelope", split, decay) for plant in ("full", "envelope")}
    rows = [
        row(
            f"beat frequency, off {split:.4f} Hz", "mHz", {plant: 1e3 * (fit[0] - split) for plant, fit in fits.items()}
        ),
        row(f"decay rate, off {decay:.4f} /s", "1/s", {plant: fit[1] - decay for plant, fit in fits.items()}),
        row("swing after the step", "of the step", {plant: fit[2] for plant, fit in fits.items()}),
        row("phase of the swing", "°", {plant: np.rad2deg(fit[3]) for plant, fit in fits.items()}),
    ]
    title = (
        "beat of the open loop at the split after a step of the rate by 100 °/s, off the eigenvalues of the free device"
    )
    return Table(title, rows)


def _fit_beat(device: Device, envelope: bool, split: float, decay: float) -> tuple[float, float, float, float]:
    """Frequency [Hz], decay [1/s], size over the step and phase [rad] of the swing that follows a step of the rate."""
    at = 0.05
    course = Course(lambda t: np.where(t > at, BEAT_STEP, 0.0), np.inf, "step")
    asked = RateRun(device, course, constant_temperature(25), False, 0.4, output_rate=1000.0, envelope=envelope)
    record = simulate(asked).record.filter(pl.col("t") > at + BEAT_FROM)
    t, rate = record["t"].to_numpy() - at, record["rate"].to_numpy()

    def model(z: Floats) -> Floats:
        swing = np.exp(-z[1] * t) * (z[2] * np.cos(2 * pi * z[0] * t) + z[3] * np.sin(2 * pi * z[0] * t))
        return np.asarray(z[4] + swing - rate)

    z = least_squares(model, [split, decay, BEAT_STEP, 0.0, rate[-1]], xtol=1e-14).x
    return float(z[0]), float(z[1]), float(np.hypot(z[2], z[3]) / BEAT_STEP), float(np.arctan2(z[3], z[2]))


def _hours(device: Device) -> Table:
    length = HOURS * 3600
    course = temperature_ramp(-40 + ZERO_CELSIUS, 85 + ZERO_CELSIUS, 125 / (length / 60))
    rows = []
    for closed in (False, True):
        asked = RateRun(
            device, rate_step(np.deg2rad(100.0), 40.0), course, closed, length, output_rate=10.0, envelope=True
        )
        wall, cpu = time.perf_counter(), time.process_time()
        simulate(asked)
        rows.append(
            row(
                f"{'closed' if closed else 'open'} loop",
                "s",
                {"wall": time.perf_counter() - wall, "CPU": time.process_time() - cpu},
                limit=WALL_TIME,
            )
        )
    return Table("6 h from -40 to 85 °C, steps of 100 °/s, noise on, 10 rows a second, on the envelope", rows)


def _noise(device: Device, seeds: int) -> Table:
    rows = [
        _noise_row(device, closed, envelope, length, seeds)
        for closed, envelope, length in (
            (False, True, NOISE_TIME),
            (True, True, NOISE_TIME),
            (False, False, FULL_NOISE_TIME),
        )
    ]
    return Table("angle random walk at rest, 25 °C", rows)


def _noise_row(device: Device, closed: bool, envelope: bool, length: float, seeds: int) -> Row:
    """Root of the mean N² of the runs; standard error: by their scatter, or of the one reading."""
    found = []
    for seed in range(1, seeds + 1):
        rest = constant(0.0, "at rest"), constant_temperature(25)
        asked = RateRun(device, *rest, closed, length, seed, output_rate=50.0, envelope=envelope)
        noise = allan_of(simulate(asked).record, asked)
        assert noise is not None
        found.append(noise)
    limits = found[0][1]
    walks = PER_ROOT_HOUR * np.array([allan.angle_random_walk for allan, _ in found])
    one = PER_ROOT_HOUR * found[0][0].angle_random_walk_error
    walk = float(np.sqrt(np.mean(walks**2)))
    error = float(walks.std(ddof=1) / sqrt(seeds)) if seeds > 1 else one
    values = {
        "read off": walk,
        "standard error": error,
        "one reading's": one,
        "thermal limit": PER_ROOT_HOUR * limits.thermal,
        "thermal and electronics": PER_ROOT_HOUR * limits.total,
        "over that": walk / (PER_ROOT_HOUR * limits.total),
    }
    what = f"{'closed' if closed else 'open'} loop, {length:g} s on the {'envelope' if envelope else 'full FMU'}"
    return row(what, "°/√h", values, note=f"{seeds} seeds, {walks.min():.3f} to {walks.max():.3f}" if seeds > 1 else "")
