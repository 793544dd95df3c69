"""A wafer of 60 simulated gyroscopes, diagnosed one by one and together: `gyrotwin diagnose --each`.

    python -m benchmarks.fleet [FOLDER]

The dies lie in eight columns, 1 mm apart. Every die has its own stiffness, damping and gain; its cubic stiffness falls
along x. Three dies are bad: one has lost its vacuum, one carries a particle that rubs, one has a cubic stiffness of its
own. Written are how well the shares, the population and the gradient are found, and which dies are called bad.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

import gyrotwin as gt
from gyro_model.errors import InputError

DIES: Final = 60
ACROSS: Final = 8
MEAN: Final = 3e9
"""N/m³ of cubic stiffness at the middle."""
GRADIENT: Final = -1.5e8
"""N/m³ per mm along x: from one side to the other a third of the mean."""
SPREAD: Final = 1e8
BAD: Final = {"die-14": "vacuum lost", "die-33": "particle", "die-51": "cubic stiffness"}
SAMPLES: Final = 3000
RESULT: Final = Path(__file__).parent / "results" / "fleet.json"


class Wafer(NamedTuple):
    """What the dies are: place [mm] and cubic stiffness [N/m³] of each, by name."""

    places: dict[str, tuple[float, float]]
    k3: dict[str, float]


def write_wafer(folder: Path, dies: int = DIES, seed: int = 1, samples: int = SAMPLES) -> Wafer:
    """Writes a data set of each die, and devices.csv with its place."""
    rng = np.random.default_rng(seed)
    names = [f"die-{number:02d}" for number in range(1, dies + 1)]
    places = {name: (float(k % ACROSS), float(k // ACROSS)) for k, name in enumerate(names)}
    middle = float(np.mean([x for x, _ in places.values()]))
    k3 = {}
    folder.mkdir(parents=True, exist_ok=True)
    text = ["die,x [mm],y [mm]", *(f"{name},{x:g},{y:g}" for name, (x, y) in places.items())]
    (folder / "devices.csv").write_text("\n".join(text) + "\n")
    reference = gt.load_device("reference")
    for number, name in enumerate(names):
        k3[name] = MEAN + GRADIENT * (places[name][0] - middle) + SPREAD * rng.standard_normal()
        own = {n: reference.all_parameters[n] * (1 + 0.01 * rng.standard_normal()) for n in ("kxx", "kyy", "kxy", "m")}
        own |= {n: reference.all_parameters[n] * (1 + 0.05 * rng.standard_normal()) for n in ("dxx", "dyy")}
        fault = BAD.get(name, "")
        if fault == "vacuum lost":
            own |= {n: 4 * own[n] for n in ("dxx", "dyy")}
        if fault == "particle":
            own["friction_x"] = 2e-9
        if fault == "cubic stiffness":
            k3[name] *= 1.6
        own |= {"k3_x": k3[name], "k3_y": k3[name]}
        place = folder / name
        if not (place / "dataset.toml").is_file():
            gt.simulate_dataset(place, hidden=own, samples=samples, seed=1000 * seed + number)
    return Wafer(places, k3)


def measure(folder: Path, dies: int = DIES, seed: int = 1) -> dict[str, Any]:
    """Writes, diagnoses and grades a wafer."""
    wafer = write_wafer(folder / "wafer", dies, seed)
    started = time.perf_counter()
    found = gt.diagnose_each(folder / "wafer", folder / "results", progress=print)
    seconds = time.perf_counter() - started
    return grade(found.summary, wafer) | {"seconds": round(seconds, 1), "dies": dies, "seed": seed}


def grade(report: Any, wafer: Wafer) -> dict[str, Any]:
    """What was found beside what is true; of good dies alone where a population is meant."""
    good = [name for name in wafer.k3 if name not in BAD]
    x = np.array([wafer.places[name] for name in good])
    design = np.column_stack([np.ones(len(good)), x - x.mean(axis=0)])
    true = np.array([wafer.k3[name] for name in good])
    slopes, spread = np.linalg.lstsq(design, true, rcond=None)[0], 0.0
    spread = float(np.std(true - design @ slopes, ddof=3))
    own = report["parameters"]["k3_x"]
    inside = {name: own["devices"][name]["among_others"] for name in good}
    return {
        "bad dies": sorted(set(BAD) & set(wafer.k3)),
        "called bad": report["outliers"],
        "effects": report["effects"],
        "cubic stiffness, mean": own["mean"] | {"drawn from": MEAN},
        "gradient along x": own["slopes"]["x [mm]"]
        | {"drawn from": GRADIENT, "of the dies as drawn": float(slopes[1])},
        "gradient along y": own["slopes"]["y [mm]"] | {"drawn from": 0.0, "of the dies as drawn": float(slopes[2])},
        "spread": own["spread"] | {"drawn from": SPREAD, "of the dies as drawn": spread},
        "good dies within their interval": sum(v["low"] <= wafer.k3[n] <= v["high"] for n, v in inside.items()),
        "good dies": len(good),
    }


def main(folder: Path) -> None:
    """Writes results/fleet.json."""
    result = measure(folder)
    RESULT.write_text(json.dumps(result, indent=2) + "\n")
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    if len(sys.argv) > 2:
        raise InputError("benchmarks.fleet takes one folder")
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/fleet"))
