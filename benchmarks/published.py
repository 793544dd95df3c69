"""Packaged devices that were made from published data, beside what was published of them and is no input."""

from collections.abc import Callable, Mapping
from math import pi
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.report import Options, Report, Row, Table, load, row
from calibration.datasheet.figure import Curve, Figure
from calibration.datasheet.procedure import procedures
from cosim.rate.bench import WHOLE, Bench
from gyro_model.device import Device, load_device
from gyrotwin.api.datasheets import datasheet

WITHIN: Final = 0.3
"""A published figure should come out within this, relative."""


class Sheet(NamedTuple):
    """What was measured of one device: figures and curves by id."""

    figures: Mapping[str, Figure]
    curves: Mapping[str, Curve]

    def value(self, name: str) -> float:
        """Of a figure."""
        value = self.figures[name].value
        return np.nan if value is None else float(value)


class State(NamedTuple):
    """A device as it was published: ``changes`` of parameters of the packaged ``device``, SI; tests: of the datasheet,
    None: all."""

    device: str
    mode: str
    changes: Mapping[str, float] = {}
    tests: tuple[str, ...] | None = None


class Claim(NamedTuple):
    """A published figure. used: it made the device file, and so is no check; how: equals, at most; of: from the sheets
    of the states that are named; why: it is off, or what to know."""

    state: str
    what: str
    unit: str
    value: float
    used: bool
    of: Callable[[Mapping[str, Sheet]], float]
    how: str = "equals"
    why: str = ""


def _stiff(device: str, frequency: float) -> dict[str, float]:
    return {"kyy": load_device(device).parameters["m"] * (2 * pi * frequency) ** 2}


def _lossy(device: str, q: float) -> dict[str, float]:
    p = load_device(device).parameters
    loss = (p["m"] * p["kxx"]) ** 0.5 / q
    return {"dxx": loss, "dyy": loss}


DISK, LARGE, QUAD, DUAL = "disk_serrano_2016", "disk_parajuli_2021", "quad_mass_trusov_2014", "dual_mass_jia_2018"
QUIET: Final = {"sense_noise": 0.0}
STATES: Final = {
    DISK: State(DISK, "rate-open"),
    f"{DISK}, no noise of the circuit": State(DISK, "rate-open", QUIET, ("noise",)),
    LARGE: State(LARGE, "rate-open"),
    f"{LARGE}, split of 4 Hz": State(LARGE, "rate-open", _stiff(LARGE, 976004.0), ("noise", "scale_factor")),
    QUAD: State(QUAD, "rate-closed"),
    f"{QUAD}, Q of 1e6": State(QUAD, "rate-closed", _lossy(QUAD, 1e6), ("noise",)),
    f"{QUAD}, Q of 2e6, split of 60 mHz": State(
        QUAD, "rate-closed", {**_lossy(QUAD, 2e6), **_stiff(QUAD, 2000.06)}, ("noise",)
    ),
    DUAL: State(DUAL, "rate-open"),
    f"{DUAL}, modes matched": State(DUAL, "rate-open", _stiff(DUAL, 3925.29), ("transfer",)),
}


def _figure(state: str, name: str, factor: float = 1.0) -> Callable[[Mapping[str, Sheet]], float]:
    return lambda sheets: factor * sheets[state].value(name)


def left_of(celsius: NDArray[np.float64], scale: NDArray[np.float64], order: int) -> float:
    """Half the range [%] that a scale factor is left with times a polynomial of ``order`` in the temperature."""
    celsius = celsius - celsius.mean()
    compensated = scale * np.polyval(np.polyfit(celsius, 1 / scale, order), celsius)
    return 50 * float(np.ptp(compensated))


def _left(order: int) -> Callable[[Mapping[str, Sheet]], float]:
    def of(sheets: Mapping[str, Sheet]) -> float:
        columns = sheets[DISK].curves["temperature"].columns
        return left_of(columns["temperature [°C]"], columns["scale factor [1]"], order)

    return of


def _gain(sheets: Mapping[str, Sheet]) -> float:
    name = "scale_factor_channel"
    return sheets[LARGE].value(name) / sheets[f"{LARGE}, split of 4 Hz"].value(name)


LAW: Final = (
    "Q falls as T^-1.65 there, damping rises linearly here, which a line times the output takes out altogether; the "
    "printed power law would leave 1.60 % and 0.025 %, so that part of the printed rest is not of Q"
)
ASKARI: Final = (
    "another quad mass, of which no amplitude was read: thermal noise alone, at the amplitude of 2014. What "
    "is printed is 13 times as much; as noise of the pickoff it would be 10 pm/√Hz, hundreds of times the class. What "
    "is left is noise of the forces, which the model has not, and of the drive's phase with quadrature, of no printed "
    "size"
)
CLAIMS: Final = (
    Claim(DISK, "drive frequency", "MHz", 4.3, True, _figure(DISK, "drive_frequency", 1e-6)),
    Claim(DISK, "quality factor", "1", 62000.0, True, _figure(DISK, "quality_factor_lower")),
    Claim(DISK, "scale factor of the channel", "µV/(°/s)", 800.0, True, _figure(DISK, "scale_factor_channel", 1e6)),
    Claim(DISK, "angle random walk", "°/√h", 0.39, True, _figure(DISK, "angle_random_walk")),
    Claim(DISK, "theoretical limit of the angle random walk", "°/√h", 0.074, True,
          _figure(f"{DISK}, no noise of the circuit", "angle_random_walk")),
    Claim(LARGE, "drive frequency", "kHz", 976.0, True, _figure(LARGE, "drive_frequency", 1e-3)),
    Claim(LARGE, "quality factor", "1e6", 1.0, True, _figure(LARGE, "quality_factor_lower", 1e-6)),
    Claim(LARGE, "angle random walk, split of 0.4 Hz", "°/√h", 0.037, True, _figure(LARGE, "angle_random_walk")),
    Claim(LARGE, "angle random walk, split of 4 Hz", "°/√h", 0.042, True,
          _figure(f"{LARGE}, split of 4 Hz", "angle_random_walk")),
    Claim(QUAD, "quality factor", "1", 1000.0, True, _figure(QUAD, "quality_factor_lower")),
    Claim(QUAD, "angle random walk", "°/√h", 0.02, True, _figure(QUAD, "angle_random_walk")),
    Claim(DUAL, "drive frequency", "Hz", 3925.29, True, _figure(DUAL, "drive_frequency")),
    Claim(DUAL, "split of the modes", "Hz", 53.16, True, _figure(DUAL, "mode_split")),
    Claim(DUAL, "quality factor of the drive mode", "1", 4673.0, True, _figure(DUAL, "quality_factor_lower")),
    Claim(DUAL, "quality factor of the sense mode", "1", 449.0, True, _figure(DUAL, "quality_factor_upper")),
    Claim(DISK, "nonlinearity up to 1250 °/s", "%", 0.07, False, _figure(DISK, "scale_factor_nonlinearity", 1e-4),
          "at most", "printed as limited by the range of the output buffer, which is not in the model"),
    Claim(DISK, "scale factor from -40 to 85 °C after a line, ±", "%", 2.9, False, _left(1), why=LAW),
    Claim(DISK, "scale factor from -40 to 85 °C after a parabola, ±", "%", 0.25, False, _left(2), "at most", LAW),
    Claim(DISK, "bias instability", "°/h", 10.5, False, _figure(DISK, "bias_instability"),
          why="printed as 1/f noise of the circuit. White noise alone is simulated, and the value is the bottom that "
          "records of 2000 s reach; the model's flicker noise is one of the voltage: as good as white at 4.3 MHz"),
    Claim(LARGE, "sensitivity at 0.4 Hz over that at 4 Hz", "1", 7.76, False, _gain,
          why="with Q of 1 million, which is printed as exceeded; 7.76 needs 1.48 million"),
    Claim(QUAD, "angle random walk, Q of 1e6", "°/√h", 0.001, False,
          _figure(f"{QUAD}, Q of 1e6", "angle_random_walk"), "at most",
          "printed as better than that, by a noise model of its authors"),
    Claim(QUAD, "angle random walk, Q of 2e6 (Askari et al. 2021)", "°/√h", 0.0058, False,
          _figure(f"{QUAD}, Q of 2e6, split of 60 mHz", "angle_random_walk"), why=ASKARI),
    Claim(DUAL, "bandwidth, modes matched, below the test tone", "Hz", 80.0, False,
          _figure(f"{DUAL}, modes matched", "bandwidth"), "at most", "a weak one: matched modes are far below"),
)  # fmt: skip
PREDICTED: Final = ((DISK, "bandwidth"), (LARGE, "bandwidth"), (DUAL, "bandwidth"), (DUAL, "angle_random_walk"))
"""Figures by device that stand beside none that was read."""


def sheet_of(state: State) -> Sheet:
    """The datasheet of a state, or the tests of it that are asked for."""
    device: Device = load_device(state.device).with_parameters(state.changes)
    if state.tests is None:
        tests = datasheet(device, mode=state.mode).tests
        outcomes = [test.outcome for test in tests]
    else:
        bench = Bench(device, closed=state.mode == "rate-closed", plan=WHOLE)
        outcomes = [procedures(state.mode)[name].measure(bench) for name in state.tests]
    return Sheet(
        {figure.id: figure for outcome in outcomes for figure in outcome.figures},
        {curve.id: curve for outcome in outcomes for curve in outcome.curves},
    )


def line_of(claim: Claim, simulated: float) -> Row:
    """Published and simulated beside each other; off: by how much of the published, beyond it for a bound."""
    ratio = simulated / claim.value
    off = max(ratio - 1, 0.0) if claim.how == "at most" else abs(ratio - 1)
    bound = "" if claim.how == "equals" else " (at most)"
    values = {"published": claim.value, "simulated": simulated, "ratio": ratio, "off": off}
    limit: Any = {} if claim.used else {"limit": WITHIN, "judged": ("off",)}
    return row(f"{claim.state}: {claim.what}{bound}", claim.unit, values, note=claim.why, **limit)


def run(options: Options) -> Report:
    """All claims; the seed is the datasheet's."""
    sheets = {name: sheet_of(state) for name, state in STATES.items()}
    lines = [(claim, line_of(claim, claim.of(sheets))) for claim in CLAIMS]
    predicted = [
        row(f"{name}: {figure.name}", figure.unit, {"simulated": sheets[name].value(figure.id)})
        for name, figure in ((name, sheets[name].figures[figure]) for name, figure in PREDICTED)
    ]
    notes = [
        "Sources, and what in a device file is published, derived or assumed: the comments of gyro_model/devices; "
        "docs/published.md.",
        "Not in the table, since nothing in the model makes it: the offset over -40 to 85 °C of "
        f"{DISK}, ±4 °/s in its text and ±26 °/s in its abstract, which is printed as feed-through from the drive.",
        load(),
    ]
    tables = [
        Table("Published figures that are no input", [line for claim, line in lines if not claim.used]),
        Table("Published figures that made the device files: no check", [line for claim, line in lines if claim.used]),
        Table("What no published figure that was read stands beside", predicted),
    ]
    return Report("published", "Published gyroscopes", tables, notes)
