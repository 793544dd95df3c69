"""Data sets of the reference device with an effect hidden in them, by the FMU itself."""

import re
from pathlib import Path

import numpy as np

from discrepancy.data.dataset import Dataset
from discrepancy.data.record import Record, make_record
from discrepancy.fit.simulate import Simulator
from discrepancy.tell.answer import Diagnosis
from gyro_model.device import load_device
from gyro_model.model import EFFECTS_FOLDER, Model, load_model

RATE = 200_000.0
SAMPLES = 8000
MODEL = load_model()
TRUE = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
        "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip


def made(hidden: dict[str, float], seed: int = 1, model: Model = MODEL, samples: int = SAMPLES) -> Dataset:
    """Two fitted runs and one held out of the reference device, noise-like drive of 30 µN rms over the modes."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) / RATE
    records = []
    with Simulator(model, jobs=1) as simulator:
        for number in range(3):
            f = rng.uniform(200, 6000, (40, 2))
            u = 5e-6 * np.sin(2 * np.pi * f * t[:, None, None] + rng.uniform(0, 6.28, (40, 2))).sum(axis=1)
            blank = _record(number, t, u, np.ones_like(u), number)
            v = simulator.run(blank, {**load_device("reference").parameters, **TRUE, **hidden, "sense_noise": 2e-5,
                                      "seed": 10 * seed + number})  # fmt: skip
            records.append(_record(number, t, u, v, number))
    off = {name: value * (1 + 0.02 * rng.uniform(-1, 1)) for name, value in TRUE.items() if "gain" not in name}
    return Dataset(Path(), {**TRUE, **off}, tuple(records))


def _record(number: int, t: np.ndarray, u: np.ndarray, v: np.ndarray, rate: float) -> Record:
    role = "held-out" if number == 2 else "fit"
    return make_record(
        f"run-{number}", t, u, v, sample_rate=RATE, role=role, conditions={"omega_z": np.full(len(t), rate)}
    )


def names(found: Diagnosis) -> set[str]:
    """Ids of the effects that are named."""
    return {finding.id for finding in found.effects}


QUINTIC, SHORT = {"c_x": 2e18, "c_y": 2e18}, 2500
"""What ``quintic`` reads, and samples a run that show it a hundred times over."""


def quintic(folder: Path, effect: str = "discovered_1") -> Path:
    """The file of an effect with x⁵ and y⁵."""
    cubic = (EFFECTS_FOLDER / "cubic_stiffness.py").read_text(encoding="utf-8")
    own = cubic.replace("cubic_stiffness", effect).replace("k3_", "c_").replace("x**3", "x**5")
    own = own.replace("y**3", "y**5").replace("N/m3", "N/m5").replace("x**4", "x**6").replace("y**4", "y**6")
    path = folder / f"{effect}.py"
    path.write_text(re.sub(r"energy=.*", "energy=None,", own), encoding="utf-8")
    return path
