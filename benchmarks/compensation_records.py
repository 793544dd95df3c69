"""Temperature tests for the compensation: from the envelope FMU, and quasi-static ones in milliseconds.

Quasi-static: settled output by harmonic balance (cosim/rate/steady_state.py) at the temperature of the structure,
which lags the chamber; open sense loop, where the circuit does not act; sensors and noise as in the FMU's records.
"""

from functools import lru_cache
from itertools import accumulate
from typing import Final, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from calibration.compensation.record import CIRCUIT, FREQUENCY, STRUCTURE, Blocks, TemperatureTest, make_blocks
from cosim.rate.courses import ZERO_CELSIUS, Course, rate_step
from cosim.rate.master import simulate
from cosim.rate.run import ENVELOPE_PERIOD, RateRun
from cosim.rate.steady_state import calibrate, output_at
from cosim.rate.temperature_sensor import BoardSensor, Bridge
from gyro_model.device import Device, load_device

Floats = NDArray[np.float64]

TURN: Final = np.deg2rad(100.0)
TURN_PERIOD: Final = 40.0
"""Rate steps: rest, +100, rest, -100 °/s, 10 s each."""
SAMPLING_TIME: Final = 10.0
SETTLING: Final = 1.0
ROWS_A_SECOND: Final = 10.0
RATE_NOISE: Final = 8.7e-5
"""Of a row of 0.1 s [rad/s rms]: blocks then scatter by 1.9 °/h, as those of the envelope FMU do."""
FREQUENCY_NOISE: Final = 1e-4
"""Of the drive frequency in a row [Hz rms], by second differences of the FMU's rows: 0.7 mK. The FMU's frequency also
moves by 1 mHz with the rate, which is left out here."""
AMPLITUDE: Final = 4e-6
GRID: Final = np.arange(-45.0, 91.0, 1.0)
"""Structure temperatures of the harmonic balance [°C]: a sixteenth of the width of the bias bump."""


class Profile(NamedTuple):
    """Chamber temperature: corners t [s], celsius."""

    t: Floats
    celsius: Floats

    def course(self, name: str) -> Course:
        """As the runs take it."""
        kelvin = self.celsius + ZERO_CELSIUS
        return Course(lambda s: np.interp(s, self.t, kelvin), float(self.t[-1]), name)


def profile(start: float, *legs: tuple[float, float, float]) -> Profile:
    """From ``start`` [°C] by legs (to [°C], at [°C/min], then held [min])."""
    steps = [(0.0, start)]
    now = start
    for to, at, held in legs:
        steps += [(float(abs(to - now) / at * 60), float(to)), (held * 60, float(to))]
        now = to
    kept = [steps[0], *(s for s in steps[1:] if s[0] > 0)]
    return Profile(np.array(list(accumulate(s[0] for s in kept))), np.array([s[1] for s in kept]))


def soaks(temperatures: Floats, held: float = 20.0) -> Profile:
    """Held [min] at each of ``temperatures`` [°C], the first a little longer; 1 °C/min between them."""
    first, *rest = (float(t) for t in temperatures)
    return profile(first, (first, 1.0, held + 5), *((t, 1.0, held) for t in rest))


SOAK_FIT: Final = soaks(np.arange(-20, 61, 5, dtype=np.float64))
SOAK_TEST: Final = soaks(np.array([60.0, *np.arange(57.5, -18.0, -5.0), -20.0]))
"""The other way, at temperatures between those fitted."""
RAMP_FIT: Final = profile(-22, (-22, 1, 10), (62, 1, 20), (-22, 3, 20), (62, 3, 20), (-22, 1, 10))
RAMP_TEST: Final = profile(-20, (-20, 5, 10), (60, 5, 20), (-20, 5, 20))
"""±5 °C/min, faster than any in RAMP_FIT."""


def fmu_record(
    course: Profile, seed: int, closed: bool = False, device: Device | None = None, period: float = ENVELOPE_PERIOD
) -> pl.DataFrame:
    """A record of ``device``, by default the packaged rate-mode, on the envelope FMU in steps of ``period`` [s], under
    rate steps."""
    run = RateRun(
        device or load_device("rate-mode"), rate_step(TURN, TURN_PERIOD), course.course("profile"), closed,
        float(np.floor(course.t[-1])), seed=seed, envelope=True, output_rate=ROWS_A_SECOND, envelope_period=period,
    )  # fmt: skip
    return simulate(run).record


def quasi_static(
    course: Profile, seed: int, lags: tuple[float, float] = (240.0, 120.0), heating: float = 0.0
) -> pl.DataFrame:
    """A record of the same device without dynamics but the two lags of structure and circuit [s].

    heating: the structure's surroundings are so much warmer than the board's [K], by the circuit's power.
    """
    rng = np.random.default_rng(seed)
    step = 1 / ROWS_A_SECOND
    t = step * np.arange(1.0, int(course.t[-1] / step) + 1)
    chamber = np.asarray(np.interp(t, course.t, course.celsius), dtype=np.float64)
    structure, circuit = (_lagged(chamber, lag, step) for lag in lags)
    structure += heating
    bias, scale, frequency = _settled()
    true = rate_step(TURN, TURN_PERIOD).values(t - 0.5 * step)
    noise = RATE_NOISE * rng.standard_normal(len(t))
    return pl.DataFrame(
        {
            "t": t,
            "rate": scale(structure) * true + bias(structure) + noise,
            "rate_true": true,
            "drive_frequency": frequency(structure) + FREQUENCY_NOISE * rng.standard_normal(len(t)),
            "sensor_structure": Bridge().read(structure + ZERO_CELSIUS, rng),
            "sensor_circuit": BoardSensor().read(circuit + ZERO_CELSIUS, rng),
        }
    )


def _lagged(values: Floats, lag: float, step: float) -> Floats:
    """First-order lag [s], from rest at the first value."""
    keep = np.exp(-step / lag)
    return lfilter([1 - keep], [1, -keep], values, zi=[keep * values[0]])[0]


@lru_cache(maxsize=1)
def _settled() -> tuple[CubicSpline, CubicSpline, CubicSpline]:
    """Bias [rad/s], scale factor and drive frequency [Hz] against the structure's temperature [°C]."""
    device = load_device("rate-mode")
    calibration = calibrate(device, AMPLITUDE, False)
    outputs = [output_at(device, calibration, float(t) + ZERO_CELSIUS) for t in GRID]
    columns = ([o.bias for o in outputs], [o.scale_factor for o in outputs], [o.drive_frequency for o in outputs])
    bias, scale, frequency = (CubicSpline(GRID, column) for column in columns)
    return bias, scale, frequency


def blocks_of(record: pl.DataFrame, name: str = "record", sampling_time: float = SAMPLING_TIME) -> Blocks:
    """The blocks of a record."""
    sensors = {STRUCTURE: "sensor_structure", CIRCUIT: "sensor_circuit"}
    signals = {name: record[column].to_numpy() - ZERO_CELSIUS for name, column in sensors.items()}
    signals[FREQUENCY] = record["drive_frequency"].to_numpy()
    t, rate, true = (record[column].to_numpy() for column in ("t", "rate", "rate_true"))
    return make_blocks(TemperatureTest(t, rate, true, signals, name=name), sampling_time, SETTLING)


def lot_shares(factor: Floats, possible: Floats) -> dict[str, float]:
    """Of a lot: factors reached and possible, (devices,), and their ratio, a device at a time, with its worst."""
    share = factor / possible
    return {
        "factor": float(np.median(factor)),
        "possible": float(np.median(possible)),
        "share": float(np.median(share)),
        "worst share": float(share.min()),
    }
