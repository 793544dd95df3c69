"""Runs that a device would give, as a data set: to try a diagnosis, or to see what planned measurements would show."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import polars as pl

from discrepancy.data.linear_fit import mode_frequencies
from discrepancy.data.record import CONDITIONS, Floats, Record, make_record
from discrepancy.data.table import numbers, read_table
from discrepancy.fit.simulate import Simulator
from gyro_model.device import Device
from gyro_model.errors import InputError

RUNS: Final = 3
"""The last one held out."""
TONES: Final = 40
REACH: Final = 0.5e-6
"""Amplitude of the motion [m] that the drive aims at, rms: half that of the reference run."""
LARGEST_SEED: Final = 2**31 - 1
"""Of the FMU; each run has a seed of its own."""
SPREAD: Final = 0.02
"""What the lab believes is off by up to this share, as manufacturing leaves it."""


class Tones(NamedTuple):
    """The force of a run: on each axis a sum of sines of one ``size`` [N]. frequency [Hz], phase [rad]: (TONES, 2)."""

    frequency: Floats
    phase: Floats
    size: float

    def force(self, t: Floats) -> Floats:
        """The force [N] at the times ``t`` [s], (n, 2)."""
        angle = 2 * np.pi * self.frequency * t[:, None, None] + self.phase
        return np.asarray(self.size * np.sin(angle).sum(axis=1))


def draw_run(true: Mapping[str, float], rng: np.random.Generator) -> tuple[Tones, float]:
    """The tones of the next run, from below the lower mode to above the upper one, and its rate [rad/s]."""
    low, high = mode_frequencies(true, 2)
    frequency = rng.uniform(0.3 * low, 1.5 * high, (TONES, 2))
    phase = rng.uniform(0, 2 * np.pi, (TONES, 2))
    # Off resonance a force of k REACH moves the mass by about REACH; near it by more.
    return Tones(frequency, phase, 0.3 * np.sqrt(2 / TONES) * REACH * true["kxx"]), rng.uniform(-5, 5)


def write_trial(
    device: Device,
    hidden: Mapping[str, float],
    out: Path,
    *,
    runs: int = RUNS,
    samples: int = 8000,
    rate: float = 200e3,
    seed: int = 1,
    play: Sequence[Path] = (),
) -> Path:
    """Writes ``runs`` runs of ``device`` with the parameters ``hidden`` to the folder ``out``, each driven by tones
    over both modes, at a rate of its own, and before the last one a run for each table to ``play``; gives the path of
    dataset.toml.

    Raises InputError for an unknown parameter, a table that is no run, fewer than 1000 samples or two runs, and where
    ``out`` holds a data set already.
    """
    if samples < 1000:
        raise InputError(f"samples = {samples}: give at least 1000 a run")
    if runs < 2:
        raise InputError(f"runs = {runs}: give at least 2, the last one is held out")
    target = out / "dataset.toml"
    if target.exists():
        raise InputError(f"{target} exists: name another folder")
    total = runs + len(play)
    if not 0 <= seed * total + total - 1 <= LARGEST_SEED:
        raise InputError(f"seed = {seed}: give 0 to {LARGEST_SEED // total - 1}")
    rng = np.random.default_rng(seed)
    true = device.with_parameters(hidden).all_parameters
    starts = dict.fromkeys(device.model.start_of.values(), 0.0)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"folder {out}: {error.strerror}; name another") from None
    t = np.arange(samples) / rate
    blanks = [blank_run(t, *draw_run(true, rng), rate) for _ in range(runs)]
    blanks[-1:-1] = [played(table) for table in play]
    tables = {}
    with Simulator(device.model, jobs=1) as simulator:
        for number, blank in enumerate(blanks):
            v = simulator.run(blank, {**true, **starts, "seed": seed * len(blanks) + number})
            tables[f"run-{number + 1:02d}.parquet"] = _table(replace(blank, v=v))
    names = ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy")
    nominal = {name: true[name] * (1 + SPREAD * rng.uniform(-1, 1)) for name in names}
    nominal |= {name: true[name] for name in ("sense_gain_x", "sense_gain_y")}
    lines = ["format = 1", "", "[nominal]", *(f"{name} = {value!r}" for name, value in nominal.items())]
    for number, blank in enumerate(blanks):
        lines += ["", "[[run]]", f'file = "run-{number + 1:02d}.parquet"', f"sample_rate = {blank.sample_rate!r}"]
    _write(out, tables, "\n".join([*lines, 'role = "held-out"', ""]))
    return target


def _write(out: Path, tables: Mapping[str, pl.DataFrame], description: str) -> None:
    """Writes all of a data set or, with an InputError, nothing."""
    try:
        for name, table in tables.items():
            table.write_parquet(out / name)
        (out / "dataset.toml").write_text(description, encoding="utf-8")
    except (OSError, pl.exceptions.PolarsError) as error:
        for name in (*tables, "dataset.toml"):
            (out / name).unlink(missing_ok=True)
        said = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise InputError(f"folder {out}: {said}; nothing written; name another") from None


def blank_run(t: Floats, tones: Tones, omega_z: float, rate: float) -> Record:
    """A run at the times ``t`` [s], ``rate`` of them a second, whose voltage is not simulated yet."""
    u = tones.force(t)
    return make_record(
        "trial", t, u, np.ones_like(u), sample_rate=rate, conditions={"omega_z": np.full(len(t), omega_z)}
    )


def played(path: Path) -> Record:
    """The run that the table of a designed experiment asks for, whose voltage is not simulated yet. Raises InputError
    where the table is none."""
    table = read_table(path)
    wanted = ("t", "u_x", "u_y")
    missing = [name for name in wanted if name not in table.columns]
    if missing:
        raise InputError(f"--play {path}: column {missing[0]} is missing: give t, u_x, u_y and conditions")
    t, *u = (numbers(table, name) for name in wanted)
    held: dict[str, Floats] = {name: numbers(table, name) for name in CONDITIONS if name in table.columns}
    force = np.stack(u, axis=1)
    return make_record(path.stem, t, force, np.ones_like(force), conditions=held)


def _table(record: Record) -> pl.DataFrame:
    return pl.DataFrame({"t": record.t, **record.channels})
