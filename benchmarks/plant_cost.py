"""What the plant costs beside a plain C program: set inputs, step 5 us, get outputs, over RK4 in 1 us steps for the
same 5 us; with nothing on, with each effect alone and with all of them.

Rate and forces are new at every call, also for the yardstick (rk4_yardstick.c). Both are timed in processor time, in
turns, so that a busy moment meets both. And what the parts cost that no method spares, from which follows how often a
step could ask for the rates and still meet its target, beside how often it must (quadrature.py).
"""

import ctypes
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.c_driver import CPlants, at, compiled
from benchmarks.quadrature import values_needed
from benchmarks.report import Options, Report, Row, Table, load, row
from gyro_model.build import build, c_files, model_token, write_sources
from gyro_model.compiling import compile_library, write_whole
from gyro_model.device import load_device
from gyro_model.effect_points import MODEL, active_parameters

Floats = NDArray[np.float64]

STEP: Final = 5e-6
CALLS: Final = 4_000
"""In one repeat: 20 ms of the plant."""
REPEATS: Final = 41
ROWS: Final = 256
NOTHING, EVERY = "nothing on", "all effects and noises on"
LIMITS: Final = {NOTHING: 0.6, EVERY: 10.0}
ALONE: Final = 3.3
"""Of the dearest single effect."""
START: Final = {"x_start": 1e-6, "y_dot_start": 5e-3, "temperature": 310.0, "v_bias": 1.0, "a_x": 1.0}
"""Of motion and surroundings, so that every effect has something to act on [SI]."""


def inputs() -> dict[str, Floats]:
    """Rates within 300 deg/s and forces that move the device by some nm, in turns."""
    rng = np.random.default_rng(31)
    sizes = {"u_x": 2e-7, "u_y": 2e-7, "omega_z": np.radians(300.0)}
    return {name: size * rng.uniform(-1.0, 1.0, ROWS) for name, size in sizes.items()}


def cases() -> dict[str, dict[str, float]]:
    """Parameters beyond those of the reference device, by what is on."""
    rng = np.random.default_rng(32)
    alone = {e.id: active_parameters(e, rng) for e in MODEL.effects if not e.nominal}
    every = {name: value for parameters in alone.values() for name, value in parameters.items()}
    return {NOTHING: {}, **alone, EVERY: every}


def measure(
    chosen: Mapping[str, Mapping[str, float]], calls: int = CALLS, repeats: int = REPEATS
) -> dict[str, list[tuple[float, float]]]:
    """Processor time of a call of the plant and of the yardstick [ns], a pair a repeat, by case."""
    device = {**load_device("reference").parameters, "sense_noise": 0.0, **START}
    own = {**device, "internal_step": STEP, "sample_period": STEP}
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in chosen}
    table = inputs()
    with ExitStack() as stack:
        plants = stack.enter_context(CPlants(build().fmi3))
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="gyrotwin-")))
        yardstick = Yardstick(folder, device, table)
        for repeat in range(repeats + 1):
            for name, parameters in chosen.items():
                # Anew each time, so that every repeat is of the same motion.
                with plants.start({**own, **parameters}, table, STEP) as plant:
                    plant(100)
                    plain = _time(yardstick, calls)
                    spent = _time(plant, calls)
                if repeat > 0:
                    times[name].append((spent, plain))
    return times


class Yardstick:
    """RK4 in C on the same device under the same inputs; called as a plant is."""

    def __init__(self, folder: Path, device: Mapping[str, float], table: Mapping[str, Floats]) -> None:
        self._run = compiled("rk4_yardstick.c", folder).rk4_run
        m = device["m"]
        self._coefficients = np.array([device[name] / m for name in ("kxx", "kyy", "kxy", "dxx", "dyy", "dxy")])
        self._inputs = np.ascontiguousarray(np.array([table["omega_z"], table["u_x"] / m, table["u_y"] / m]).T)
        self.state = np.array([device.get(name, 0.0) for name in ("x_start", "x_dot_start", "y_start", "y_dot_start")])
        self._done = 0

    def __call__(self, count: int) -> int:
        first, rows = ctypes.c_int64(self._done), ctypes.c_int64(len(self._inputs))
        self._run(at(self._coefficients), at(self.state), at(self._inputs), rows, first, ctypes.c_int64(count))
        self._done += count
        return count


class Parts(NamedTuple):
    """Times [ns] of the rates of all states, of all laws, of the random numbers of a sample; each once."""

    rates: float
    laws: float
    numbers: float


def measure_parts(
    chosen: Mapping[str, Mapping[str, float]], calls: int = CALLS, repeats: int = REPEATS
) -> dict[str, Parts]:
    """The least of ``repeats``, each the mean of ``calls``, by case."""
    device = {**load_device("reference").parameters, "sense_noise": 0.0, **START}
    least = {}
    with ExitStack() as stack:
        plants = stack.enter_context(CPlants(build().fmi3))
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="gyrotwin-")))
        write_sources(MODEL, folder)
        write_whole(folder, c_files(folder, "fmi3"))
        shutil.copy(Path(__file__).with_name("parts_cost.c"), folder)
        compile_library(folder, ["parts_cost.c"], folder / "parts.bin")
        run = ctypes.CDLL(str(folder / "parts.bin")).parts_time
        token, spent = model_token(MODEL).encode(), np.zeros(3)
        for name, parameters in chosen.items():
            values = {**device, "internal_step": STEP, "sample_period": STEP, **parameters}
            references, reals = plants.of(list(values)), np.array(list(values.values()), dtype=float)
            times = []
            for _ in range(repeats):
                size, count = ctypes.c_size_t(len(reals)), ctypes.c_int64(calls)
                if not run(token, at(references), at(reals), size, count, at(spent)):
                    raise RuntimeError("the plant did not start")
                times.append(spent.copy())
            least[name] = Parts(*map(float, np.min(times, axis=0)))
    return least


def part_rows(
    times: Mapping[str, Sequence[tuple[float, float]]], parts: Mapping[str, Parts], asked: Mapping[str, int]
) -> list[Row]:
    """A row a case: the parts, how often its target leaves time for the rates, how often they are ``asked`` for by a
    quadrature of the forces, and what a call then costs at least over the yardstick."""
    rows = []
    call = min(spent for spent, _ in times[NOTHING])
    for name, part in parts.items():
        plain = min(plain for _, plain in times[name])
        once = call + part.numbers + part.laws
        values = {
            **part._asdict(),
            "rates in what the target leaves": (LIMITS.get(name, ALONE) * plain - once) / part.rates,
            "rates that quadrature asks for": asked[name],
            "least over the yardstick": (once + asked[name] * part.rates) / plain,
        }
        rows.append(row(name, "ns", values))
    return rows


def values_asked(chosen: Mapping[str, Mapping[str, float]]) -> dict[str, int]:
    """How often a quadrature asks for the forces in a step, by case."""
    device = {**load_device("reference").parameters, "sense_noise": 0.0, **START}
    own = {**device, "internal_step": STEP, "sample_period": STEP}
    needed = {name: values_needed({**own, **parameters}, inputs(), STEP) for name, parameters in chosen.items()}
    return {name: parts * values for name, (parts, values) in needed.items()}


def _time(run: Callable[[int], int], calls: int) -> float:
    began = time.process_time_ns()
    if run(calls) != calls:
        raise RuntimeError("the plant stopped")
    return (time.process_time_ns() - began) / calls


def cost_rows(times: Mapping[str, Sequence[tuple[float, float]]]) -> list[Row]:
    """A row a case, and the dearest effect, which is judged."""
    ratios = {}
    rows = []
    for name, pairs in times.items():
        spent, plain = np.array(pairs).T
        ratios[name] = {"of minima": spent.min() / plain.min(), "median of ratios": float(np.median(spent / plain))}
        values = {**ratios[name], "plant [ns]": spent.min(), "yardstick [ns]": plain.min()}
        rows.append(row(name, "1", values, limit=LIMITS.get(name), judged=tuple(ratios[name])))
    alone = {name: ratio for name, ratio in ratios.items() if name not in LIMITS}
    if alone:
        dearest = max(alone, key=lambda name: alone[name]["median of ratios"])
        spent, plain = np.array(times[dearest]).T
        values = {**alone[dearest], "plant [ns]": spent.min(), "yardstick [ns]": plain.min()}
        judged = tuple(alone[dearest])
        rows.append(row("the dearest single effect", "1", values, limit=ALONE, judged=judged, note=dearest))
    return rows


def run(options: Options) -> Report:
    """All cases, in this one process."""
    before = load()
    times = measure(cases())
    table = Table("set, step of 5 µs, get, over RK4 in 1 µs steps in C", cost_rows(times))
    # Of hysteresis a method may spare the rates: its force is read from a table.
    dear = {name: cases()[name] for name in ("dry_friction", EVERY)}
    parts = Table("what no method spares", part_rows(times, measure_parts(dear), values_asked(dear)))
    notes = [
        f"{REPEATS} repeats of {CALLS} calls each, in turns with as many of the yardstick, in processor time; each "
        "repeat begins a new instance in the same state.",
        "Sizes of effects are half way from neutral to the limit case that their file states, or a little more.",
        "What no method spares: the call of a plant with nothing on, all laws and the random numbers of a sample "
        "once, and the rates of all states as often as a quadrature of the forces asks for them. Whatever a one-step "
        "method of values does (Runge-Kutta, exponential, collocation), what bends the motion is an integral of "
        "which it knows some values, and the formula of Gauss makes the most of those: so many are counted, on the "
        "true motion as if that were known for nothing, until the phase is right to 1e-6 rad a second. With all "
        "effects on a delayed force cuts each step into two. Methods of several steps, which a new force at every "
        "call leaves nothing to go by, and Taylor series, which the plant takes and whose coefficients are no "
        "values, are not bound by it.",
        "Before: " + before,
        "After: " + load(),
    ]
    return Report("plant_cost", "Cost of the plant beside a plain C program", [table, parts], notes)
