"""The loop on random devices as built whose command goes out a sample period late or two, as a processor sends it."""

from collections.abc import Sequence
from functools import partial
from typing import Final

from benchmarks.loop_devices import (
    DEVICES,
    measure,
    random_device,
    run_rows,
    sample_rate,
    scaled_intervals,
    spread_rows,
    summary_rows,
)
from benchmarks.loop_runs import finite, in_processes
from benchmarks.report import Options, Report, Table
from gyro_model.device import Device

FIRST: Final = 1711
"""Number of the first device, of which nothing was chosen."""
MOST: Final = 2
"""Periods."""


def late_device(number: int) -> Device:
    """The device of that number with a delay of two periods, or of one where the design does not allow for two."""
    device = random_device(number)
    rate, longest = sample_rate(device), scaled_intervals(device)["actuator_delay"][1]
    return device.with_parameters({"actuator_delay": min(MOST, int(longest * rate)) / rate})


def make_report(devices: Sequence[int], seeds: Sequence[int], jobs: int) -> Report:
    """Runs all devices with all seeds."""
    what = [(device, seed) for device in devices for seed in seeds]
    outcomes = in_processes(partial(measure, made=late_device), what, jobs)
    tables = [
        Table("all runs", summary_rows(outcomes)),
        Table("spread", spread_rows(outcomes)),
        Table("runs", run_rows(outcomes)),
    ]
    notes = [
        "`--design lab`, `constant`, 1 s. Devices and measures are those of `loop_devices`, with an actuator delay of "
        "one or two sample periods.",
    ]
    data = {"runs": [o._asdict() | {"values": finite(o.values)} for o in outcomes]}
    title = f"Delays of whole sample periods on {len(devices)} random devices from {devices[0]}, {len(seeds)} seeds"
    return Report("loop_periods", title, tables, notes, data)


def run(options: Options) -> Report:
    """30 devices, one seed."""
    return make_report(range(FIRST, FIRST + DEVICES), range(1, options.seeds_or(1) + 1), options.jobs)
