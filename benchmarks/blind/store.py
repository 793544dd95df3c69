"""Trials on disk: the data set as a user would have it, and the label in a folder of its own."""

import hashlib
import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from benchmarks.blind.trial import Trial, columns_of

DATA: Final = "data"
SEALED: Final = "sealed"


def save(trial: Trial, folder: Path) -> Path:
    """Writes the data set to folder/data/ID, which is returned, and the label to folder/sealed/ID.json."""
    data = folder / DATA / trial.id
    data.mkdir(parents=True, exist_ok=True)
    lines = ["format = 1", "", "[nominal]", *(f"{name} = {value!r}" for name, value in trial.nominal.items())]
    hosts = {host for host in ("omega_z", "temperature", "acceleration", "v_bias")
             if any(columns_of(run, host) for run in trial.runs)}  # fmt: skip
    for number, (run, v) in enumerate(zip(trial.runs, trial.measured, strict=True), 1):
        file = f"run-{number:02}.parquet"
        table = {"t": run.t, "u_x": run.u[:, 0], "u_y": run.u[:, 1], "v_x": v[:, 0], "v_y": v[:, 1]}
        given = {"omega_z": {"omega_z": run.omega}, "temperature": {"temperature": run.temperature},
                 "acceleration": {"a_x": run.acceleration[:, 0], "a_y": run.acceleration[:, 1]},
                 "v_bias": {"v_bias": run.v_bias}}  # fmt: skip
        for host in sorted(hosts):
            table |= given[host]
        pl.DataFrame({name: np.ascontiguousarray(column) for name, column in table.items()}).write_parquet(data / file)
        lines += ["", "[[run]]", f'file = "{file}"', f"sample_rate = {run.rate!r}"]
        lines += ['role = "held-out"'] * (number == len(trial.runs))
    (data / "dataset.toml").write_text("\n".join([*lines, ""]), encoding="utf-8")
    seal = folder / SEALED / f"{trial.id}.json"
    seal.parent.mkdir(parents=True, exist_ok=True)
    seal.write_text(json.dumps(trial.label, indent=1), encoding="utf-8")
    return data


def opened(folder: Path, name: str) -> dict[str, Any]:
    """The sealed label of a trial."""
    label: dict[str, Any] = json.loads((folder / SEALED / f"{name}.json").read_text(encoding="utf-8"))
    return label


def digest(value: Any) -> str:
    """SHA-256 of a JSON value, its keys sorted."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
