"""Work and precision of integrators: phase error after a free run of the reference device against cost.

Errors are those of the phase of either mode, the larger, against the matrix exponential at 100 digits, and, with cubic
springs, against a Taylor series of order 30 in extended precision, which is itself held against the former.
"""

import time
from collections.abc import Sequence
from typing import Final, NamedTuple

import mpmath
import numpy as np
from numpy.typing import NDArray

from benchmarks.diagram import Panel, Series, log_log
from benchmarks.integrators import METHODS, Integrators
from benchmarks.report import Options, Report, Row, Table, load, row
from cosim.exchange import exchange
from cosim.fmu import HANDLE_SIZE, INPUT_NAMES, OUTPUT_NAMES, Plant
from gyro_model.build import build
from gyro_model.device import load_device

Floats = NDArray[np.float64]

STEPS_US: Final = (0.5, 1.0, 2.0, 2.5, 4.0, 5.0, 8.0, 10.0)
"""Internal steps [us]; each divides a second and 40 us, the sample period of the FMU here."""
SAMPLE_PERIOD: Final = 40e-6
DURATION: Final = 1.0
START: Final = (1e-6, 0.0, 0.0, 0.0)
"""x alone [m]: the cross stiffness makes both modes of it."""
CUBIC: Final = 1e12
"""Cubic stiffness k3 [N/m3] of both axes in the second case: 1.6 % of kxx at 1 um."""
TAYLOR_STEP: Final = 10e-6
TARGET: Final = 1e-6
"""Phase error after 1 s [rad]."""
LINEAR, DUFFING, COST, COST_DUFFING, EVALUATIONS = (
    "linear, error [rad]",
    "Duffing, error [rad]",
    "linear, ns per simulated µs",
    "Duffing, ns per simulated µs",
    "rate evaluations per s",
)
FMU: Final = "the FMU itself"


class Truth(NamedTuple):
    """The state at the end of the two cases, and left eigenvectors of the linear one, as rows of ``modes``."""

    linear: Floats
    duffing: Floats
    modes: NDArray[np.complex128]

    def phase_error(self, state: Floats, true: Floats) -> float:
        """The larger of the two modes' phase errors [rad]."""
        return float(np.abs(np.angle((self.modes @ state) / (self.modes @ true))).max())


class Point(NamedTuple):
    """One method at one step: errors [rad] and costs [ns per us] of both cases, evaluations of the rate per simulated
    second; 0: it makes none."""

    linear: float
    duffing: float
    cost: float
    cost_duffing: float
    evaluations: float


def rates(cubic: float) -> Floats:
    """The rates of the reference device, see benchmarks.integrators.RATES_SIZE."""
    p = load_device("reference").all_parameters
    values = [p[name] for name in ("kxx", "kyy", "kxy", "dxx", "dyy", "dxy")]
    return np.array([*values, cubic, cubic]) / p["m"]


def _matrix() -> Floats:
    kxx, kyy, kxy, dxx, dyy, dxy = rates(0.0)[:6]
    return np.array([[0, 1, 0, 0], [-kxx, -dxx, -kxy, -dxy], [0, 0, 0, 1], [-kxy, -dxy, -kyy, -dyy]])


def find_truth(integrators: Integrators, duration: float) -> Truth:
    """The truth after ``duration`` [s]."""
    with mpmath.workdps(100):
        # Scaling and squaring loses as many digits as the 1e9 of the norm and its 30 squarings cost: far from 100.
        end = mpmath.expm(mpmath.matrix(_matrix().tolist()) * duration) * mpmath.matrix(START)
        linear = np.array([float(value) for value in end])
    values, vectors = np.linalg.eig(_matrix().T)
    steps = round(duration / TAYLOR_STEP)
    duffing = integrators.run("taylor", rates(CUBIC), np.array(START), TAYLOR_STEP, steps)
    return Truth(linear, duffing, vectors.T[values.imag > 0])


def truth_errors(integrators: Integrators, truth: Truth, duration: float) -> dict[str, float]:
    """Phase errors [rad] of the Taylor series: of the linear case against the matrix exponential, and of the Duffing
    case at half the step against itself."""
    steps = round(duration / TAYLOR_STEP)
    linear = integrators.run("taylor", rates(0.0), np.array(START), TAYLOR_STEP, steps)
    finer = integrators.run("taylor", rates(CUBIC), np.array(START), TAYLOR_STEP / 2, 2 * steps)
    return {
        LINEAR: truth.phase_error(linear, truth.linear),
        DUFFING: truth.phase_error(finer, truth.duffing),
    }


def measure_method(
    integrators: Integrators, name: str, step: float, truth: Truth, duration: float, repeats: int
) -> Point:
    """A method in the common frame; costs are the least of ``repeats``."""
    steps = round(duration / step)
    states, costs = [], []
    for cubic in (0.0, CUBIC):
        best = np.inf
        for _ in range(repeats):
            began = time.process_time()
            state = integrators.run(name, rates(cubic), np.array(START), step, steps)
            best = min(best, time.process_time() - began)
        states.append(state)
        costs.append(best)
    return _point(truth, states, costs, duration, len(METHODS[name].b) / step)


def measure_fmu(step: float, truth: Truth, duration: float, repeats: int) -> Point:
    """The FMU, one communication step for the whole run."""
    device = load_device("reference").with_parameters({"sense_noise": 0.0, "x_start": START[0]})
    own = {**device.parameters, "internal_step": step, "sample_period": SAMPLE_PERIOD}
    states, costs = [], []
    for cubic in (0.0, CUBIC):
        best = np.inf
        for _ in range(repeats):
            values = np.zeros(len(OUTPUT_NAMES))
            with Plant(build().fmi3, {**own, "k3_x": cubic, "k3_y": cubic}) as plant:
                inputs, flags = np.zeros(len(INPUT_NAMES)), np.zeros(HANDLE_SIZE)
                began = time.process_time()
                status = exchange(plant.handle, plant.inputs, inputs, plant.outputs, values, flags, 0.0, duration)
                best = min(best, time.process_time() - began)
            if status > 0:
                raise RuntimeError(f"the FMU refused the run: {plant.complaint()}")
        states.append(values[OUTPUT_NAMES.index("x") :])
        costs.append(best)
    return _point(truth, states, costs, duration, 0.0)


def _point(truth: Truth, states: list[Floats], costs: list[float], duration: float, evaluations: float) -> Point:
    linear, duffing = truth.phase_error(states[0], truth.linear), truth.phase_error(states[1], truth.duffing)
    return Point(linear, duffing, 1e3 * costs[0] / duration, 1e3 * costs[1] / duration, evaluations)


def measure(
    steps_us: Sequence[float], duration: float, repeats: int
) -> tuple[dict[str, dict[float, Point]], dict[str, float]]:
    """Points by title and step [us], and the errors of the truth."""
    integrators = Integrators()
    truth = find_truth(integrators, duration)
    points: dict[str, dict[float, Point]] = {}
    for name, method in METHODS.items():
        points[method.title] = {
            step: measure_method(integrators, name, 1e-6 * step, truth, duration, repeats) for step in steps_us
        }
    measure_fmu(1e-5, truth, SAMPLE_PERIOD, 1)  # compiles the call
    points[FMU] = {step: measure_fmu(1e-6 * step, truth, duration, repeats) for step in steps_us}
    return points, truth_errors(integrators, truth, duration)


def rows_of(points: dict[str, dict[float, Point]]) -> list[Row]:
    """A row a method and step; the target holds for the FMU at steps up to the 5 us that the loop uses."""
    rows = []
    for title, by_step in points.items():
        for step, point in by_step.items():
            values = dict(zip((LINEAR, DUFFING, COST, COST_DUFFING, EVALUATIONS), point, strict=True))
            limit = TARGET if title == FMU and step <= 5.0 else None
            rows.append(row(f"{title}, {step:g} µs", "", values, limit=limit, judged=(LINEAR, DUFFING)))
    return rows


def diagram(points: dict[str, dict[float, Point]]) -> str:
    """Error against cost, both cases, as SVG. Errors below the rounding of a second's phase are drawn at 1e-13 rad."""
    panels = []
    for title, field, cost in (("linear", "linear", "cost"), ("cubic springs (Duffing)", "duffing", "cost_duffing")):
        series = [
            Series(name, [getattr(p, cost) for p in by.values()], [max(getattr(p, field), 1e-13) for p in by.values()])
            for name, by in points.items()
        ]
        panels.append(Panel(title, series, TARGET))
    head = f"Phase error after {DURATION:g} s, internal steps of {STEPS_US[0]:g} to {STEPS_US[-1]:g} µs"
    return log_log(head, "cost [ns per simulated µs]", "phase error [rad]", panels)


def run(options: Options) -> Report:
    """All methods at all steps."""
    points, own = measure(STEPS_US, DURATION, repeats=3)
    table = Table(f"free run of {DURATION:g} s", rows_of(points))
    notes = [
        f"The Taylor series in extended precision differs by {own[LINEAR]:.1e} rad from the matrix exponential "
        f"(linear), and by {own[DUFFING]:.1e} rad from itself at half the step (Duffing).",
        "Rounding: a second is 2.4e4 rad of the faster mode, of which the last bit is 3.6e-12 rad.",
        f"Duffing: k3 = {CUBIC:g} N/m3 on both axes, 1.6 % of kxx at the start's 1 µm.",
        "All methods are the same generated C with unrolled stages and the compiler flags of the FMU; cost is "
        "processor time, the least of 3 repeats. The FMU evaluates no rates: a table moves it while it is linear, "
        "a Taylor series with cubic springs. It adds forces by effect and sampling every 40 µs. " + load(),
    ]
    return Report(
        "work_precision",
        "Work and precision of integrators",
        [table],
        notes,
        files={"work_precision.svg": diagram(points)},
    )
