"""What works on records alone: the split of the modes, compensation over temperature."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from gyro_model.progress import Progress

if TYPE_CHECKING:
    from gyrotwin.results import CompensationResult, SplitResult


def split(
    record: str | Path,
    *,
    q: float | None = None,
    drive_frequency: float | None = None,
    sample_rate: float | None = None,
    columns: Sequence[str] = (),
    carrier: float | None = None,
    span: float | None = None,
    guard: float = 0.0,
    clean_line: bool = False,
    resolution: float | None = None,
    track: float | None = None,
    unfold: bool = False,
    mass: float | None = None,
    sense_gain: float | None = None,
    temperature: float = 298.15,
) -> "SplitResult":
    """Find the frequency split of the two modes in a record of normal operation, from thermal noise.

    Parameters
    ----------
    record : str or Path
        Table of one voltage: .csv, .csv.gz or .parquet.
    q : float
        Quality factor of the sense mode; None: found.
    drive_frequency : float
        Hz; None: the strongest line.
    sample_rate : float
        Samples a second [Hz], where no column is the time.
    columns : sequence of str
        Column of the voltage; two with ``carrier``, I and Q.
    carrier : float
        The columns are I and Q around this frequency [Hz]: v = I cos - Q sin.
    span, guard : float
        Search so far, leave out so much either side of the drive [Hz].
    clean_line : bool
        The drive line has no phase noise.
    resolution : float
        Refuse an answer with a 95 % interval wider than plus or minus this [Hz].
    track : float
        Follow the split through time, by blocks of so many seconds.
    unfold : bool
        The record was sampled below twice the drive frequency, which is given.
    mass, sense_gain, temperature : float
        With the first two [kg, V/m] the power of the hump is held against kT at the temperature [K].

    Returns
    -------
    SplitResult
        With ``summary``, ``trace`` of a track, ``save(folder)``.

    Raises
    ------
    InputError
        If an argument or the record is wrong, or the noise does not tell.

    Examples
    --------
    White noise through a resonance at 3050 Hz, beside the line of a drive at 3000 Hz:

    >>> import math, tempfile
    >>> import numpy as np, polars as pl, gyrotwin as gt
    >>> from scipy.signal import lfilter
    >>> rate, q, t = 20e3, 2000, np.arange(800_000) / 20e3
    >>> r, turn = math.exp(-math.pi * 3050 / (q * rate)), 2 * math.pi * 3050 / rate
    >>> noise = np.random.default_rng(1).standard_normal(len(t))
    >>> v = lfilter([1.0], [1.0, -2 * r * math.cos(turn), r * r], noise) + 1e3 * np.cos(2 * math.pi * 3000 * t)
    >>> record = tempfile.mkdtemp() + "/sense.parquet"
    >>> pl.DataFrame({"t": t, "v_y": v}).write_parquet(record)
    >>> found = gt.split(record, q=q, drive_frequency=3000.0, clean_line=True)
    >>> split = found.summary["split"]
    >>> split["low"] < 50 < split["high"] < split["low"] + 0.5
    True

    """
    from gyrotwin.tasks.split import Request, find

    return find(
        Request(
            Path(record), q, drive_frequency, sample_rate, tuple(columns), carrier, span, guard, clean_line, resolution,
            track, unfold, mass, sense_gain, temperature,
        )
    )  # fmt: skip


def compensate(
    records: str | Path | Sequence[str | Path],
    *,
    test: str | Path | None = None,
    method: str = "best",
    sensor: str | None = None,
    segments: int | None = None,
    hidden: int | None = None,
    sampling_time: float = 10.0,
    settling: float = 1.0,
    settled: bool = False,
    outside: str = "refuse",
    maps: Mapping[str, str] | None = None,
    scales: Mapping[str, str] | None = None,
    seed: int = 1,
    progress: Progress | None = None,
) -> "CompensationResult":
    """Fit a temperature compensation of scale factor and bias.

    Parameters
    ----------
    records : str or Path, or several
        Temperature tests: trace.parquet of `rate`, or tables.
    test : str or Path
        Another record to test on; None: the last whole cycle is held out, of a single one contiguous parts.
    method : {"best", "piecewise", "network", "spline", "history"}
        Best: by inner validation on the fitting cycles alone.
    sensor : {"structure", "circuit"}
        Temperature of the piecewise lines; None: structure where given.
    segments : int
        Of the piecewise lines; None: by inner validation.
    hidden : int
        Neurons of the network; None: by inner validation.
    sampling_time, settling : float
        Means over so many seconds; left out after a step of the rate [s].
    settled : bool
        Only where the temperatures rest, below 0.05 °C/min.
    outside : {"refuse", "clamp"}
        Beyond the fitted range.
    maps, scales : mapping of str to str
        Headings and units of the columns of a lab's own table.
    seed : int
        Of the network's starts.
    progress : callable
        Called with the shapes tried and all that will be.

    Returns
    -------
    CompensationResult
        With ``summary``, ``save(folder)``: TOML and C header of the coefficients, report.

    Raises
    ------
    InputError
        If an argument or the record is wrong.

    """
    from gyrotwin.tasks.compensate import Request, find

    paths = [records] if isinstance(records, str | Path) else records
    return find(
        Request(
            tuple(map(Path, paths)), None if test is None else Path(test), method, sensor, segments, hidden,
            sampling_time, settling, settled, outside, _pairs(maps), _pairs(scales), seed,
        ),
        progress,
    )  # fmt: skip


def _pairs(pairs: Mapping[str, str] | None) -> tuple[str, ...]:
    return tuple(f"{name}={value}" for name, value in (pairs or {}).items())
