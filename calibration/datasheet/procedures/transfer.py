"""Transfer function from rate to output: bandwidth, phase, group delay, from a sum of sines."""

from math import degrees, hypot, log

import numpy as np

from calibration.analysis.frequency_response import (
    Complexes,
    Response,
    bandwidth,
    between,
    frequency_response,
    group_delay,
)
from calibration.datasheet.figure import Curve, Figure, Outcome
from calibration.datasheet.procedure import RATE, Procedure
from cosim.rate.bench import FULL_AT_MOST, Bench, multisine
from cosim.rate.run import RateRun
from cosim.rate.transfer import expected_transfer

PERIODS = 4
LINES = 80
SLOWEST = 1 / 40
FASTEST = 4.0
"""Frequencies from and to, over the bandwidth that the formula gives."""
LOOKED_AT = (1e-4, 20.0)
"""Where that is looked for, over the bandwidth of the output filter."""
ROWS_A_PERIOD = 8
"""Rows in a period of the fastest sine."""
SHARE = 0.5
"""Largest rate over full scale."""
LINEAR = 0.02
"""And, of an open loop, over the pole of its sense axis: the split moves by half of its square. At 0.08 the group delay
of a split of 5 Hz is 7 % off, at 0.02 below 0.1 %."""
BETWEEN_LINES = 2001
"""Frequencies at which the highest gain is looked for around the highest line: it is then within 1 % of it down to a
width of a hundredth of the lines' distance."""
NOT_THE_TOP = 0.1
"""By which the highest line may be below the highest gain [dB]."""
ALIKE = 3
"""Errors of so many lines together, either side, are those of one: four periods give 6 degrees of freedom each."""


def measure(bench: Bench) -> Outcome:
    """On the full FMU where device and bandwidth are fast enough for it."""
    run, top = _chosen(bench)
    found = _response(bench, run, top)
    size, fine = np.abs(found.gain), np.geomspace(found.frequency[0], found.frequency[-1], 2000)
    expected = expected_transfer(bench.device, run, fine)
    at = expected_transfer(bench.device, run, found.frequency)
    edge, edge_expected = bandwidth(found.frequency, size), bandwidth(fine, np.abs(expected))
    slow = found.frequency[0] * 8
    delay, delay_error = group_delay(found, slow)
    lag, _ = group_delay(found._replace(gain=at), slow)
    top = int(size.argmax())
    beside = found.frequency[max(top - 1, 0) : top + 2]
    around = expected_transfer(bench.device, run, np.linspace(beside[0], beside[-1], BETWEEN_LINES))
    rule = "loops and filters as designed around the mode's pole: expected_transfer, docs/datasheet.md"
    figures = [
        Figure(
            "bandwidth",
            "bandwidth, -3 dB",
            edge,
            "Hz",
            _edge_error(found, edge),
            1,
            edge_expected,
            rule,
            note="" if edge else f"the gain does not fall by 3 dB up to {found.frequency[-1]:.4g} Hz",
        ),
        Figure(
            "phase_at_bandwidth",
            "phase at the bandwidth",
            _phase(found, edge),
            "°",
            _phase_error(found, edge),
            1,
            _phase(Response(fine, expected, 0 * fine), edge_expected),
            rule,
        ),
        Figure(
            "group_delay",
            "group delay of slow rates",
            1e3 * delay,
            "ms",
            1e3 * delay_error,
            1,
            1e3 * lag,
            rule,
            note=f"up to {slow:.3g} Hz",
        ),
        _peak(found, at, around, rule),
    ]
    return Outcome(
        figures,
        [
            Curve(
                "transfer",
                "Transfer function",
                {
                    "frequency [Hz]": found.frequency,
                    "gain [1]": size,
                    "phase [°]": np.degrees(np.unwrap(np.angle(found.gain))),
                    "gain error [1]": found.error,
                    "expected gain [1]": np.abs(at),
                    "expected phase [°]": np.degrees(np.unwrap(np.angle(at))),
                },
            )
        ],
    )


def _chosen(bench: Bench) -> tuple[RateRun, float]:
    """A run on the FMU that is taken, and the bandwidth that the formula gives [Hz]."""
    filtered = bench.typical.settings.output_bandwidth
    wide = np.geomspace(LOOKED_AT[0] * filtered, LOOKED_AT[1] * filtered, 5000)
    top = bandwidth(wide, np.abs(expected_transfer(bench.device, bench.typical, wide))) or filtered
    envelope = not bench.can_run_full or PERIODS / (SLOWEST * top) > FULL_AT_MOST
    return bench.asked(0.1, envelope=envelope), top


def _response(bench: Bench, run: RateRun, top: float) -> Response:
    # A tenth of the rate of its steps is the fastest that the envelope shows well.
    fastest = min(FASTEST * top, 0.1 / run.period) if run.envelope else FASTEST * top
    step = run.period
    interval = step * max(int(1 / (ROWS_A_PERIOD * fastest * step)), 1)
    rows = round(1 / (SLOWEST * top * interval))
    period = rows * interval
    lines = np.unique(np.rint(np.geomspace(1, fastest * period, LINES)))
    lead = int(np.ceil(bench.settling / period))
    largest = SHARE * bench.full_scale
    if not bench.closed:
        largest = min(largest, LINEAR * abs(run.nominal.pole))
    course = multisine(lines / period, largest, bench.seed)
    one = bench.record((lead + PERIODS) * period, rate=course, output_rate=1 / interval, envelope=run.envelope)
    # The same means over rows of the rate and of the output: their filter drops out.
    true, rate = (values[lead * rows :] for values in (one.true, one.rate))
    return frequency_response(true, rate, interval, lines / period, 1 / period)


def _phase(found: Response, at: float | None) -> float | None:
    if at is None:
        return None
    return degrees(between(found.frequency, np.unwrap(np.angle(found.gain)), at))


def _error_at(found: Response, i: int) -> float:
    """Standard error of the gain at line ``i``, by those around it."""
    return float(np.sqrt(np.mean(found.error[max(i - ALIKE, 0) : i + ALIKE + 1] ** 2)))


def _edge_error(found: Response, edge: float | None) -> float | None:
    if edge is None:
        return None
    slope = np.gradient(np.abs(found.gain), found.frequency)
    i = int(np.argmin(np.abs(found.frequency - edge)))
    return _error_at(found, i) / max(abs(float(slope[i])), 1e-300)


def _phase_error(found: Response, edge: float | None) -> float | None:
    """Of the phase at the bandwidth [°]: its own, and the bandwidth's times its slope."""
    error = _edge_error(found, edge)
    if edge is None or error is None:
        return None
    slope = np.gradient(np.unwrap(np.angle(found.gain)), found.frequency)
    i = int(np.argmin(np.abs(found.frequency - edge)))
    return degrees(hypot(_error_at(found, i) / abs(found.gain[i]), float(slope[i]) * error))


def _peak(found: Response, at: Complexes, around: Complexes, rule: str) -> Figure:
    """Of the lines, expected ``at`` each and ``around`` the highest, shapes (n,) and (m,): a bound from below where the
    resonance is narrower than they are apart."""
    size = np.abs(found.gain)
    rest = float(np.abs(at[0]))
    lines, whole = (float(20 * np.log10(np.abs(gain).max() / rest)) for gain in (at, around))
    missed = whole > lines + NOT_THE_TOP
    top = int(size.argmax())
    return Figure(
        "peak",
        "peak of the gain",
        float(20 * np.log10(size.max() / size[0])),
        "dB",
        _peak_error(found),
        1,
        whole if missed else lines,
        rule,
        how="at most" if missed else "equals",
        note=f"at least: the top is narrower than the lines about {found.frequency[top]:.4g} Hz are apart"
        if missed
        else "",
    )


def _peak_error(found: Response) -> float:
    """Of the largest gain over that of the slowest line [dB]."""
    size = np.abs(found.gain)
    top = int(size.argmax())
    return 20 / log(10) * hypot(_error_at(found, top) / size[top], _error_at(found, 0) / size[0])


PROCEDURE = Procedure("Transfer function", "12.15", RATE, measure, 4)
