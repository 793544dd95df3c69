"""The figures of a rate-mode run as plain data."""

from typing import Final

import numpy as np
import polars as pl
from numpy.typing import NDArray

from cosim.rate.allan import Allan, NoiseLimits
from cosim.rate.courses import ZERO_CELSIUS
from cosim.rate.metrics import PER_HOUR, plateaus
from cosim.rate.run import RateRun
from cosim.rate.steady_state import output_at
from gyrotwin.figures import Figure, Panel, envelope, line

Floats = NDArray[np.float64]

SPAN: Final = 1.0
"""A figure over temperature is drawn where the structure moves by more than this [K]."""
CURVE_POINTS: Final = 60
"""Points of a settled curve: each takes three harmonic balances."""
HOUR: Final = 3600.0
LONG: Final = 2 * HOUR
"""Longer records are drawn in hours [s]."""


def _time(record: pl.DataFrame) -> tuple[Floats, str]:
    t = record["t"].to_numpy()
    return (t / HOUR, "t [h]") if t[-1] > LONG else (t, "t [s]")


def _degrees(record: pl.DataFrame, column: str) -> Floats:
    return np.rad2deg(record[column].to_numpy())


def _panel(record: pl.DataFrame, label: str, *curves: tuple[str, str, Floats], wide: bool = False) -> Panel:
    """A panel of (name, role, values) against time."""
    t, title = _time(record)
    return Panel(title, label, [line(name, role, *envelope(t, values)) for name, role, values in curves], wide=wide)


def rate_figure(record: pl.DataFrame) -> Figure:
    """Output and truth, their difference, quadrature."""
    rate, true = _degrees(record, "rate"), _degrees(record, "rate_true")
    return Figure(
        "rate",
        "Rate of turn",
        "uncompensated",
        "Output in units of the nominal scale factor, and the rate of the package. Their difference holds bias, scale "
        "factor error, the lag of the filters and noise. Quadrature is what the sense axis feels in phase with the "
        "drive displacement, a quarter period from the Coriolis force.",
        [("truth", "truth"), ("estimate", "output"), ("error", "output less truth")],
        [
            _panel(record, "rate [°/s]", ("truth", "truth", true), ("output", "estimate", rate), wide=True),
            _panel(record, "output less truth [°/s]", ("error", "error", rate - true)),
            _panel(record, "quadrature [°/s]", ("quadrature", "estimate", _degrees(record, "quadrature"))),
        ],
    )


def drive_figure(record: pl.DataFrame) -> Figure:
    """What the drive loop holds and finds; as differences from the mean, which six digits would hide."""
    frequency, amplitude = record["drive_frequency"].to_numpy(), record["drive_amplitude"].to_numpy()
    middle = round(float(frequency.mean()), 3)
    relative = 1e6 * (amplitude / amplitude.mean() - 1)
    return Figure(
        "drive",
        "Drive loop",
        "beyond Liu et al. 2014",
        "The phase-locked loop follows the resonance, which tells the temperature of the structure; the amplitude loop "
        "holds the voltage, and its force tells the damping.",
        [("estimate", "drive loop")],
        [
            _panel(record, f"frequency less {middle:.3f} Hz [Hz]", ("f", "estimate", frequency - middle), wide=True),
            _panel(record, f"amplitude less {amplitude.mean():.6g} V [ppm]", ("amplitude", "estimate", relative)),
            _panel(record, "drive force [nN]", ("force", "estimate", 1e9 * record["drive_force"].to_numpy())),
        ],
    )


def temperature_figure(record: pl.DataFrame) -> Figure:
    """Temperatures, true and as the sensors read them."""

    def celsius(column: str) -> Floats:
        return record[column].to_numpy() - ZERO_CELSIUS

    ambient = ("ambient", "reference", celsius("temperature"))
    panels = []
    for place in ("structure", "circuit"):
        true = (place, "truth", celsius(f"temperature_{place}"))
        panels.append(
            _panel(record, f"{place} [°C]", true, ("sensor", "estimate", celsius(f"sensor_{place}")), ambient)
        )
    return Figure(
        "temperature",
        "Temperatures",
        "sensor circuit of Liu et al. 2014, fig. 3",
        "Structure and circuit follow the ambient temperature, each with its lag. The platinum resistor sits on the "
        "structure, the digital sensor on the board.",
        [("truth", "true"), ("estimate", "sensor"), ("reference", "ambient")],
        panels,
    )


def over_temperature_figure(record: pl.DataFrame, run: RateRun) -> Figure:
    """Bias and scale factor against the temperature of the structure: settled, and what this run shows."""
    celsius = record["temperature_structure"].to_numpy() - ZERO_CELSIUS
    grid = np.linspace(celsius.min(), celsius.max(), CURVE_POINTS)
    settled = [output_at(run.device, run.nominal.calibration, float(t) + ZERO_CELSIUS, run.held) for t in grid]
    bias = [line("settled", "truth", grid, np.rad2deg([s.bias for s in settled]))]
    scale = [line("settled", "truth", grid, np.array([s.scale_factor for s in settled]))]
    if np.isfinite(run.rate.stays):
        found = plateaus(record, run)
        t, rate = found.biases()
        bias.append(line("this run at rest", "estimate", t - ZERO_CELSIUS, np.rad2deg(rate)))
        t, slope = found.scale_factors()
        scale.append(line("this run, +R and -R", "estimate", t - ZERO_CELSIUS, slope))
    elif not record["rate_true"].to_numpy().any():
        order = np.argsort(celsius, kind="stable")
        bias.append(line("this run", "estimate", *_binned(celsius[order], _degrees(record, "rate")[order])))
    return Figure(
        "over-temperature",
        "Bias and scale factor over temperature",
        "Liu et al. 2014, fig. 6, before compensation",
        "Settled values by harmonic balance, and the output of this run while the package rests, both against the "
        "temperature of the structure.",
        [("truth", "settled"), ("estimate", "this run")],
        [Panel("structure [°C]", "bias [°/s]", bias), Panel("structure [°C]", "scale factor [1]", scale)],
    )


def _binned(x: Floats, y: Floats, bins: int = 300) -> tuple[Floats, Floats]:
    """Means of ``x`` and ``y`` in groups of neighbours, at most ``bins``."""
    groups = [g for g in np.array_split(np.arange(len(x)), min(bins, max(len(x), 1))) if len(g)]
    return np.array([x[g].mean() for g in groups]), np.array([y[g].mean() for g in groups])


def allan_figure(allan: Allan, limits: NoiseLimits) -> Figure:
    """Allan deviation with the angle random walk read off and the limits of the device."""

    def walk(value: float) -> Floats:
        return PER_HOUR * value / np.sqrt(allan.tau)

    curves = [
        line("measured", "estimate", allan.tau, PER_HOUR * allan.deviation),
        line("angle random walk", "error", allan.tau, walk(allan.angle_random_walk)),
        line("thermal limit", "limit", allan.tau, walk(limits.thermal)),
        line("thermal and electronics", "reference", allan.tau, walk(limits.total)),
    ]
    return Figure(
        "allan",
        "Allan deviation at rest",
        "beyond Liu et al. 2014",
        "Overlapping estimator. At averaging times of the output filter and below the deviation shows the filter; "
        "beyond, the slope of -1/2 is the angle random walk. The limits come from the device: the thermal force on the "
        "sense axis, and with it the white noise of the converters.",
        [
            ("estimate", "record"),
            ("error", "angle random walk"),
            ("limit", "thermal limit"),
            ("reference", "with electronics"),
        ],
        [Panel("averaging time [s]", "Allan deviation [°/h]", curves, x_log=True, y_log=True, wide=True)],
    )
