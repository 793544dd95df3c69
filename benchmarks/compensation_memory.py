"""Compensation of devices that remember: what each method reaches of what any function of the inputs' history could.

The records are made by ``cycle_records.py``, which shares no code with what is measured: hysteresis by a play, a slow
lag that no sensor sees, a random walk and a turn-on offset, all drawn by the device's seed.
"""

from multiprocessing import get_context
from typing import Final

import numpy as np

from benchmarks.compensation_records import lot_shares
from benchmarks.cycle_records import Cycle, course, cycle
from benchmarks.report import Options, Report, Row, Table, row
from calibration.compensation.measures import change, spread_over_temperature
from calibration.compensation.methods.method import Asked
from calibration.compensation.record import Floats, TemperatureTest, joined, make_blocks
from calibration.compensation.trial import trial

METHODS: Final = ("history", "spline", "piecewise")
OTHER: Final = ((55.0, 2.0), (-15.0, 5.0), (55.0, 5.0), (-15.0, 2.0))
"""Ramps that none of the fitted cycles has: those go at 1 and 3 °C/min."""
FITTED: Final = 3
DEVICES: Final = 20


def run(options: Options) -> Report:
    """A row a method: the factor, what was possible, their ratio; median and worst of the devices."""
    devices = options.seeds_or(DEVICES)
    with get_context("spawn").Pool(options.jobs) as pool:
        found = np.array(pool.map(_device, range(1, devices + 1), chunksize=1))
    rows: list[Row] = []
    for k, method in enumerate(METHODS):
        factor, possible, rms, rms_possible = found[:, k].T
        for what, reached, could in (("per °C", factor, possible), ("rms, offset included", rms, rms_possible)):
            values = lot_shares(reached, could)
            limit = 0.8 if method == "history" and what == "per °C" else None
            rows.append(row(f"{method}, bias {what}", "×", values, limit=limit, at_least=True, judged=("share",)))
    table = Table(f"{devices} devices: held out is another record, with other ramps", rows)
    notes = [
        "Play of 5 °C, lag of 2500 s, random walk and turn-on drawn by seed; fitted on three records at ±1 and ±3 "
        "°C/min, tested on one at ±2 and ±5. Possible: down to what walk, turn-on and noise leave, which no "
        "function of the inputs' history tells; by simulation. Share: factor over possible, a device at a time.",
    ]
    return Report("compensation_memory", "Compensation of devices that remember", [table], notes)


def _device(seed: int) -> list[list[float]]:
    """Of each method: factor and possible factor of (max - min)/range, and of rms."""
    rng = np.random.default_rng(seed)
    play, slow, walk = rng.uniform(1e-5, 4e-5), rng.uniform(5e-6, 2e-5), rng.uniform(2e-7, 1e-6)

    def make(chamber: Floats, number: int) -> Cycle:
        turn_on = 3e-5 * rng.standard_normal()
        return cycle(chamber, 100 * seed + number, play=play, slow=slow, walk=walk, turn_on=turn_on)

    fitted = [make(course(), k) for k in range(FITTED)]
    test = make(course(OTHER), 50)
    blocks = joined([make_blocks(one.test, 10.0, 0.0) for one in fitted])
    tested = make_blocks(test.test, 10.0, 0.0)
    untold = make_blocks(TemperatureTest(test.test.t, test.untold, 0 * test.untold, test.test.signals), 10.0, 0.0)
    offset = float(np.mean([one.untold.mean() for one in fitted]))
    possible = spread_over_temperature(tested, tested.rate) / spread_over_temperature(tested, untold.rate)
    rms_possible = float(tested.rate.std() / np.sqrt(np.mean((untold.rate - offset) ** 2)))
    found = []
    for method in METHODS:
        of = trial(blocks, tested, Asked(method), "clamp")
        left = of.judged[0].held_out
        found.append([change(left.bias).factor, possible, left.rms_before / left.rms, rms_possible])
    return found
