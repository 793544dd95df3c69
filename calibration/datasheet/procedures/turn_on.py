"""Turn-on time: until the drive loop is in lock, and until the output stays at its value."""

from math import degrees, log

import numpy as np

from calibration.datasheet.figure import Figure, Outcome, mean
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import Bench
from cosim.rate.drive_loop import LARGEST_FORCE
from cosim.rate.master import LOCKED_AMPLITUDE

BAND = 0.01
"""The output is there once it stays within this of full scale of its value, relative."""
LONG = 4.0
"""Power on is followed for this many settling times."""


def measure(bench: Bench) -> Outcome:
    """From power on at rest, on the full FMU where the device settles soon enough."""
    envelope = not bench.can_run_full
    rate = 100.0 if envelope else 1000.0
    locks = [
        bench.record(0.1, seed=seed, envelope=envelope, output_rate=rate).locked_at
        for seed in bench.seeds(bench.plan.repeats)
    ]
    times = []
    for seed, lock in zip(bench.seeds(bench.plan.repeats), locks, strict=True):
        t, output = bench.power_on(max(LONG * bench.settling, 0.2), seed, envelope=envelope, output_rate=rate)
        final = output[3 * len(output) // 4 :].mean()
        # Over a tenth of the settling time: noise beyond the band is not the way there.
        width = max(int(0.1 * bench.settling * rate), 1)
        smooth = np.convolve(output - final, np.ones(width) / width, mode="same")
        outside = np.flatnonzero(np.abs(smooth[: len(smooth) - width]) > BAND * bench.full_scale)
        # Before the drive swings the output is near zero, as a small bias is: that is no output yet.
        times.append(max(float(t[outside[-1] + 1]) if len(outside) else float(t[0]), lock))
    known = bench.typical.nominal
    # V' = -s (V - 20 V_set F/F_max): the amplitude comes up with all the force there is.
    least = log(LARGEST_FORCE / (LARGEST_FORCE - 1 + LOCKED_AMPLITUDE)) / known.decay
    lock, lock_error = mean(locks)
    ready, ready_error = mean(times)
    note = "on the envelope FMU: the device settles too slowly or swings too fast for the full one" if envelope else ""
    band = f"drive in lock, and output stays within {degrees(BAND * bench.full_scale):.3g} °/s, 1 % of full scale"
    return Outcome(
        [
            Figure(
                "turn_on_lock",
                "turn-on time of the drive",
                lock,
                "s",
                lock_error,
                len(locks),
                least,
                f"(2Q/ω) ln({LARGEST_FORCE:g}/{LARGEST_FORCE - 1 + LOCKED_AMPLITUDE:g}): all the drive force until "
                f"{100 * (1 - LOCKED_AMPLITUDE):g} % of the amplitude",
                "at least",
                note,
            ),
            Figure(
                "turn_on_output",
                "turn-on time of the output",
                ready,
                "s",
                ready_error,
                len(times),
                least,
                "not before the drive swings",
                "at least",
                band,
            ),
        ]
    )


PROCEDURE = Procedure("Turn-on time", "12.5", RATE, measure, 2)
