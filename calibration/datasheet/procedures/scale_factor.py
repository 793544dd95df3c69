"""Scale factor: nonlinearity, asymmetry, repeatability, from plateaus of the rate up and down through full scale."""

from math import sqrt

import numpy as np

from calibration.analysis.staircase import PPM, Plateaus, asymmetry_errors, plateaus, staircase
from calibration.datasheet.figure import Curve, Figure, Outcome, balanced, mean, spread
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import Bench, Record, steps
from cosim.rate.steady_state import settle


def measure(bench: Bench) -> Outcome:
    """One staircase a turn-on."""
    up = np.linspace(0, bench.full_scale, bench.plan.steps + 1)
    rates = np.concatenate([up, up[-2::-1], -up[1:], -up[-2::-1]])
    stays = bench.stays(bench.plan.plateau)
    course = steps(rates.tolist(), stays, "staircase")
    found = []
    for seed in bench.seeds(bench.plan.repeats):
        one = bench.record(stays * len(rates), rate=course, seed=seed, output_rate=50.0)
        found.append(staircase(plateaus_of(one, bench.settling)))
    walk = bench.angle_random_walk
    within, within_lopsided = asymmetry_errors(rates, PPM * walk / sqrt(bench.plan.plateau))
    scale, scale_error = mean([1 + one.scale_factor_ppm / PPM for one in found], within / PPM)
    repeats, repeats_error = spread([one.scale_factor_ppm for one in found])
    repeats_error = max(repeats_error, within / sqrt(2 * (len(found) - 1)))
    ideal = staircase(_settled(bench, rates))
    calibration = bench.typical.nominal.calibration
    # The mean over the turn-ons: the largest of a residual that is noise would grow with the noise.
    residual = np.mean([one.residual_ppm for one in found], axis=0)
    noise = float(np.mean([one.plateaus.error.mean() for one in found])) / len(found) ** 0.5 / bench.full_scale * PPM
    lopsided, lopsided_error = mean([one.asymmetry_ppm or 0.0 for one in found], within_lopsided)
    balance = "harmonic balance at the same rates"
    figures = [
        Figure(
            "scale_factor",
            "scale factor over nominal",
            scale,
            "1",
            scale_error,
            len(found),
            1 + ideal.scale_factor_ppm / PPM,
            balance,
        ),
        Figure(
            "scale_factor_channel",
            "nominal scale factor of the sense channel",
            abs(calibration.scale) * np.pi / 180,
            "N/(°/s)" if bench.closed else "V/(°/s)",
            None,
            1,
            note="what the calibration divides by",
        ),
        Figure(
            "scale_factor_nonlinearity",
            "nonlinearity",
            float(np.abs(residual).max()),
            "ppm of full scale",
            noise,
            len(found),
            ideal.nonlinearity_ppm,
            balance,
            "at least",
            "largest departure from the line; noise adds to it",
        ),
        Figure(
            "scale_factor_asymmetry",
            "asymmetry",
            lopsided,
            "ppm",
            lopsided_error,
            len(found),
            ideal.asymmetry_ppm,
            balance,
            note="scale factor of positive rates less that of negative ones",
        ),
        Figure(
            "scale_factor_repeatability",
            "turn-on repeatability",
            repeats,
            "ppm",
            repeats_error,
            len(found),
            within,
            "N/√(T Σ Ω²): angle random walk alone",
            "at least",
        ),
    ]
    line = found[0].plateaus
    curve = Curve(
        "scale_factor",
        "Departure from the scale factor's line",
        {"rate [°/s]": np.degrees(line.rate), "residual [ppm of full scale]": residual},
    )
    return Outcome(balanced(figures, bench.left_out, [balance]), [curve])


def plateaus_of(one: Record, settling: float) -> Plateaus:
    """The plateaus of a record; the output integrates to an angle, whose slope is the mean."""
    t = np.concatenate([[0.0], one.t])
    angle = np.concatenate([[0.0], np.cumsum(one.rate) * one.interval])
    return plateaus(t, angle, np.append(one.true, one.true[-1]), settling)


def _settled(bench: Bench, rates: np.ndarray) -> Plateaus:
    calibration = bench.typical.nominal.calibration
    at, drive = bench.reference_temperature, calibration.drive
    output = [calibration.rate(settle(bench.device, drive, at, rate).sense).imag for rate in rates.tolist()]
    return Plateaus(np.arange(len(rates), dtype=float), rates, np.array(output), np.full(len(rates), 1e-12))


PROCEDURE = Procedure("Scale factor", "12.9", RATE, measure, 4)
