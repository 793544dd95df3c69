"""A small data set with a cubic spring hidden in it, which the tests of `gyrotwin diagnose` share."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from discrepancy.data.record import make_record
from discrepancy.fit.simulate import Simulator
from gyro_model.model import load_model
from gyrotwin.cli import main

MODEL = load_model()
RATE = 200_000.0
SAMPLES = 4000
TRUE = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
        "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip
HIDDEN = {"k3_x": 2e10, "k3_y": 2e10}

QUINTIC = '''"""Quintic stiffness. F_x = -k5 x^5 (a test)."""

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x

K5 = size("k5", "N/m5", "quintic stiffness")

EFFECT = Force(
    id="quintic",
    parameters=(K5,),
    force=(-K5.symbol * x**5, 0),
    energy=Energy(stored=K5.symbol * x**6 / 6),
    signature="resonance moves with the fourth power of the amplitude",
    host_experiment="drive level ramp",
    limits=(Limit(why="1e24 at 1 um", at={"k5": 1e24, "x": 1e-6}, gives={"force_x": -1e-6, "force_y": 0.0}),),
)
'''

Tables = dict[str, pl.DataFrame]


def tables() -> Tables:
    """Three runs of 20 ms of the reference device with a cubic spring, driven like noise over the modes."""
    rng = np.random.default_rng(4)
    t = np.arange(SAMPLES) / RATE
    made = {}
    with Simulator(MODEL, jobs=1) as simulator:
        for number in range(3):
            f = rng.uniform(200, 6000, (40, 2))
            u = 5e-6 * np.sin(2 * np.pi * f * t[:, None, None] + rng.uniform(0, 6.28, (40, 2))).sum(axis=1)
            blank = make_record("blank", t, u, np.ones_like(u), sample_rate=RATE)
            v = simulator.run(blank, {**TRUE, **HIDDEN, "sense_noise": 2e-5, "seed": 40 + number})
            columns = {"t": t, "u_x": u[:, 0], "u_y": u[:, 1], "v_x": v[:, 0], "v_y": v[:, 1]}
            made[f"run-{number}.parquet"] = pl.DataFrame(columns)
    return made


def written(folder: Path, runs: Tables, nominal: dict[str, float] | None = None, head: str = "format = 1") -> Path:
    """A data set folder; [nominal] is 1 % off."""
    folder.mkdir(parents=True)
    believed = {n: v * (1.01 if n in ("m", "kxx") else 1.0) for n, v in TRUE.items()} if nominal is None else nominal
    lines = [head, "[nominal]", *(f"{name} = {value!r}" for name, value in believed.items())]
    for name, table in runs.items():
        lines += ["[[run]]", f'file = "{name}"', f"sample_rate = {RATE}"]
        table.write_parquet(folder / name)
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n")
    return folder


def exit_code(*arguments: str) -> int:
    with pytest.raises(SystemExit) as ending:
        main(list(arguments))
    return int(ending.value.code or 0)


def kept(function: Callable[..., Any], results: list[Any]) -> Callable[..., Any]:
    def call(*arguments: Any, **options: Any) -> Any:
        results.append(function(*arguments, **options))
        return results[-1]

    return call
