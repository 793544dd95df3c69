"""The Taylor series of forces that bend the motion, against DOP853: where they converge badly, at their corners, for
every function that an effect may call, and where there is none."""

import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from gyro_runner import Floats, Runner

from gyro_model import symbols
from gyro_model.anatomy import State
from gyro_model.build import build
from gyro_model.compiling import find_compiler
from gyro_model.device import Device
from gyro_model.effect_series import has_series
from gyro_model.generate_series import expansions
from gyro_model.model import Model, load_model, read_model
from gyro_model.reference import simulate

Residual = Callable[[str, float, float], None]

PERIOD, N = 5e-6, 121
T = np.arange(N) * PERIOD
START = {"x_start": 1e-6, "y_start": -0.4e-6, "y_dot_start": 6e-3}

# A series ends where its last term is 3e-13 of a state, and leaves out a tenth of that; the run has up to a thousand
# parts. That of a state which an effect brings may be 300 times as large: its force is a hundredth of the spring's.
SERIES = 3e-11

CASES = {
    "friction over a speed that passes in a step": {"friction_x": 5e-6, "friction_y": 5e-6, "friction_speed": 1e-4},
    "friction saturated long before it turns": {"friction_x": 5e-6, "friction_speed": 2e-5},
    "friction, Stribeck": {"friction_x": 1e-6, "friction_y": 2e-6, "stribeck": 0.5, "stribeck_speed": 2e-3},
    "hysteresis, n = 1": {"hysteresis_x": 2e-6, "hysteresis_y": 2e-6, "hysteresis_length": 3e-7},
    "hysteresis, n = 2": {"hysteresis_x": 2e-6, "hysteresis_length": 3e-7, "hysteresis_n": 2.0},
    # A whole power of zero has a series, whose recurrence divides by zero.
    "hysteresis, n = 3": {"hysteresis_x": 2e-6, "hysteresis_y": 2e-6, "hysteresis_length": 3e-7, "hysteresis_n": 3.0},
    "hysteresis, n = 4": {"hysteresis_x": 2e-6, "hysteresis_y": 2e-6, "hysteresis_length": 3e-7, "hysteresis_n": 4.0},
    "hysteresis, n = 8": {"hysteresis_x": 2e-6, "hysteresis_y": 2e-6, "hysteresis_length": 3e-7, "hysteresis_n": 8.0},
    # The power begins below all rounding and counts within the same step.
    "hysteresis, n = 20": {"hysteresis_x": 2e-6, "hysteresis_length": 3e-8, "hysteresis_n": 20.0},
    "hysteresis, n = 1.3": {"hysteresis_x": 2e-6, "hysteresis_y": 2e-6, "hysteresis_n": 1.3},
    "hysteresis, n = 1.6, over a way of a few steps": {
        "hysteresis_x": 1e-7, "hysteresis_y": 2e-7, "hysteresis_length": 1e-7, "hysteresis_n": 1.6,
    },
    "hysteresis of the motion that it turns": {"hysteresis_x": 2e-5, "hysteresis_length": 3e-7, "hysteresis_n": 1.4},
    "hysteresis that weakens": {"hysteresis_x": 2e-6, "hysteresis_beta": 0.6, "hysteresis_gamma": -0.5},
    "hysteresis whose values are read, in parts that a delay cuts": {
        "hysteresis_x": 1e-6, "hysteresis_y": 2.4e-6, "hysteresis_beta": 0.7, "hysteresis_gamma": 0.4,
        "hysteresis_n": 1.6, "actuator_delay": 3.6e-6,
    },
    "hysteresis that stiffens, of one axis": {
        "hysteresis_y": 4e-6, "hysteresis_length": 5e-7, "hysteresis_beta": 0.9, "hysteresis_gamma": -0.3,
        "hysteresis_n": 2.3,
    },
    "a stop that is met softly": {"stop_stiffness": 500.0, "stop_gap": 7e-7},
    "a film at its gap": {"squeeze_x": 1e-6, "squeeze_y": 1e-6, "squeeze_gap": 1.2e-6},
    "a mode that is fast against a step": {"parasitic_coupling": 5.0, "parasitic_frequency": 1.5e5},
    "all of them beside a temperature that moves": {
        "friction_x": 1e-6, "hysteresis_y": 1e-6, "stop_stiffness": 500.0, "stop_gap": 9e-7, "squeeze_x": 1e-7,
        "structure_lag": 1e-3, "tck": -3e-4, "softening": 1e-3, "charging_voltage": 0.5, "charging_time": 1.0,
    },
}  # fmt: skip

SMOOTH = '''"""Every function that has a recurrence, in one force.

    F_x = -a sum of all of them
"""

from sympy import acos, asin, atan, cos, cosh, exp, log, sin, sinh, tan, tanh

from gyro_model.anatomy import Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import t, x, x_dot, y

A = size("many_size", "N", "size of all")
q = x * 4e5
every = exp(q) + log(2 + q) + sin(q) + cos(2 * q) + tan(q) + asin(q) + acos(q) + atan(3 * q)
every += sinh(q) + cosh(q) + tanh(4 * q) + (1 + q**2) ** 0.3 + (2 + q) ** -3 + q**5 + sin(2e4 * t) * q
EFFECT = Force(
    id="many",
    parameters=(A,),
    force=(-A.symbol * every, A.symbol * y * 1e5 * tanh(x_dot * 50)),
    energy=None,
    signature="none",
    host_experiment="none",
    limits=(Limit(why="zero size", at={"many_size": 0.0}, gives={"force_x": 0.0, "force_y": 0.0}),),
)
'''

CORNERED = '''"""Corners of every kind, some beyond what a step shows.

    F_x = -a (...)
"""

from sympy import Abs, Heaviside, Max, Min, sign

from gyro_model.anatomy import Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x, x_dot, y, y_dot

A = size("corner_size", "N", "size of all")
q, p, w = x * 1e6, y * 1e6, x_dot * 40
EFFECT = Force(
    id="corners",
    parameters=(A,),
    force=(
        -A.symbol * (Abs(q) * q + Max(q, p, 0.1) + Min(q * p, 0.3) + Heaviside(q - 0.5) * (q - 0.5) + sign(w) * w),
        -A.symbol * (Abs(y_dot * 40 + w) + Max(Abs(p) - 0.2, 0)),
    ),
    energy=None,
    signature="none",
    host_experiment="none",
    limits=(Limit(why="zero size", at={"corner_size": 0.0}, gives={"force_x": 0.0, "force_y": 0.0}),),
)
'''

WITHOUT = '''"""A function without a recurrence.

    F_x = -a atan2(y, 2e-6 + x)
"""

from sympy import atan2

from gyro_model.anatomy import Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x, y

A = size("angle_size", "N", "size")
EFFECT = Force(
    id="angle",
    parameters=(A,),
    force=(-A.symbol * atan2(y, 2e-6 + x), 0),
    energy=None,
    signature="none",
    host_experiment="none",
    limits=(Limit(why="zero size", at={"angle_size": 0.0}, gives={"force_x": 0.0, "force_y": 0.0}),),
)
'''


def driven() -> dict[str, Floats]:
    rng = np.random.default_rng(41)
    sizes = {"u_x": 1e-5, "u_y": 1e-5, "omega_z": 5.0}
    inputs = {name: size * rng.standard_normal(N) for name, size in sizes.items()}
    return inputs | {"temperature": np.full(N, 305.0) + (T > 1e-4) * 4.0, "v_bias": np.full(N, 6.0)}


def compare(runner: Runner, device: Device, limit: float, residual: Residual) -> None:
    inputs = driven()
    fmu = runner.run(device.parameters, T, inputs)
    reference = simulate(device, T, inputs)
    for name, values in fmu.items():
        residual(name, np.max(np.abs(values - reference[name])) / np.max(np.abs(reference[name])), limit)


# Steps that the reference tries and drops overflow where an exponent is large.
@pytest.mark.filterwarnings("ignore:(overflow|invalid value) encountered:RuntimeWarning")
@pytest.mark.parametrize("case", CASES)
def test_where_series_converge_badly(case: str, plant: Runner, residual: Residual) -> None:
    compare(plant, Device("test", START | CASES[case]), SERIES, residual)


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> Model:
    folder: Path = tmp_path_factory.mktemp("effects")
    for name, text in {"many": SMOOTH, "corners": CORNERED, "angle": WITHOUT}.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return read_model(folder)


@pytest.mark.parametrize("parameters", [{"many_size": 2e-6}, {"corner_size": 2e-6}, {"angle_size": 2e-6},
                                        {"many_size": 1e-6, "angle_size": 1e-6}], ids=str)  # fmt: skip
def test_any_function(
    parameters: dict[str, float], own: Model, tmp_path_factory: pytest.TempPathFactory, residual: Residual
) -> None:
    runner = Runner(build(own).fmi3, tmp_path_factory.mktemp("fmu"))
    compare(runner, Device("test", START | parameters, model=own), SERIES, residual)


TWO_WAYS = '''"""Two Bouc-Wen hystereses of y alone, of unlike sharpness.

    F_y = -a (p + q)
"""

from sympy import Abs, Rational, Symbol

from gyro_model.anatomy import BoucWen, Force, Limit, State
from gyro_model.quantities import shape, size
from gyro_model.symbols import y, y_dot

A = size("pair_size", "N", "size")
L = shape("pair_length", "m", 5e-7, "way", low=1e-12, search=None)
B = shape("pair_beta", "1", 0.6, "dissipates", search=None)
C = shape("pair_gamma", "1", 0.3, "bends", search=None)
N_P = shape("pair_n_p", "1", 1.2, "sharpness", low=1.0, search=None)
N_Q = shape("pair_n_q", "1", 1.7, "sharpness", low=1.0, search=None)
p, q = Symbol("pair_p", real=True), Symbol("pair_q", real=True)


def state(z, n):
    bend = (Abs(z) + Rational(1, 10**300)) ** (n - 1) * (B.symbol * Abs(y_dot) * z + C.symbol * y_dot * Abs(z))
    return State(z, "1", "part", rate=(y_dot - bend) / L.symbol, follows=BoucWen(y, L.symbol, B.symbol, C.symbol, n))


EFFECT = Force(
    id="two_ways",
    parameters=(A, L, B, C, N_P, N_Q),
    states=(state(p, N_P.symbol), state(q, N_Q.symbol)),
    force=(0, -A.symbol * (p + q)),
    energy=None,
    signature="none",
    host_experiment="none",
    limits=(Limit(why="zero size", at={"pair_size": 0.0}, gives={"force_x": 0.0, "force_y": 0.0}),),
)
'''


def test_a_hysteresis_of_ones_own(tmp_path: Path, residual: Residual) -> None:
    (tmp_path / "two_ways.py").write_text(TWO_WAYS, encoding="utf-8")
    model = read_model(tmp_path)
    runner = Runner(build(model).fmi3, tmp_path / "fmu")
    compare(runner, Device("test", START | {"pair_size": 1e-6}, model=model), SERIES, residual)


@pytest.mark.parametrize("state", [s for s in load_model().states if s.follows], ids=lambda state: state.symbol.name)
def test_a_state_follows_as_its_rate_says(state: State) -> None:
    assert state.follows is not None
    of, length, beta, gamma, n = state.follows
    speed = symbols.STATES[symbols.STATES.index(of) + 1]
    rng = np.random.default_rng(42)
    for _ in range(20):
        z, v = rng.uniform(-1.0, 1.0, 2)
        sizes = dict(zip((length, beta, gamma, n), rng.uniform(0.3, 2.0, 4), strict=True))
        c = sizes[beta] * np.sign(z * v) + sizes[gamma]
        wanted = v * (1 - c * abs(z) ** sizes[n]) / sizes[length]
        assert float(state.rate.subs({**sizes, state.symbol: z, speed: v})) == pytest.approx(wanted, rel=1e-12)


JUMPS = '''"""Coulomb friction without a passage.

    F_x = -a sign(x')
"""

from sympy import sign

from gyro_model.anatomy import Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x_dot

A = size("jump_size", "N", "size")
EFFECT = Force(
    id="jumps",
    parameters=(A,),
    force=(-A.symbol * sign(x_dot), 0),
    energy=None,
    signature="none",
    host_experiment="none",
    limits=(Limit(why="zero size", at={"jump_size": 0.0}, gives={"force_x": 0.0, "force_y": 0.0}),),
)
'''


def test_a_force_that_jumps(tmp_path: Path, residual: Residual) -> None:
    # Every half period is a cosine about another point of rest, by 2 F/k smaller than the one before.
    m, k, force, start = 1.8e-7, 64.0, 1.7e-6, 1e-6
    (tmp_path / "jumps.py").write_text(JUMPS, encoding="utf-8")
    runner = Runner(build(read_model(tmp_path)).fmi3, tmp_path / "fmu")
    still = {"kxy": 0.0, "dxx": 0.0, "dyy": 0.0, "dxy": 0.0, "x_start": start, "y_start": 0.0}
    fmu = runner.run(still | {"m": m, "kxx": k, "jump_size": force}, T)
    phase = np.sqrt(k / m) * T
    half = np.floor(phase / np.pi)
    amplitude = start - (2 * half + 1) * force / k
    x = (-1.0) ** half * (amplitude * np.cos(phase - half * np.pi) + force / k)
    residual("x", np.max(np.abs(fmu["x"] - x)) / start, SERIES)


def test_pairs_without_vectors_give_the_same_bits(
    plant: Runner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", shlex.join([*find_compiler(), "-DGYRO_NO_VECTORS"]))
    scalar = Runner(build(folder=tmp_path, force=True).fmi3, tmp_path / "fmu")
    parameters = START | {name: value for case in CASES.values() for name, value in case.items()}
    inputs = driven()
    fmu, other = plant.run(parameters, T, inputs), scalar.run(parameters, T, inputs)
    for name, values in fmu.items():
        assert values.tobytes() == other[name].tobytes(), name


def test_one_function_for_both_axes_where_they_are_alike() -> None:
    text = expansions(load_model())
    cubic, mode = (
        text[text.index(f"void series_effect_{name}(") :].split("\n}\n")[0]
        for name in ("cubic_stiffness", "parasitic_mode")
    )
    assert "pair_of(-k3_x, -k3_y)" in cubic and "on_axis" not in cubic
    assert "on_axis(0, " in mode


def test_what_has_a_series(own: Model) -> None:
    forces = {e.id: e for e in own.forces}
    assert has_series(forces["many"], own) and has_series(forces["corners"], own)
    assert not has_series(forces["angle"], own)
    text = expansions(own)
    assert "void series_effect_many(" in text and "series_effect_angle" not in text
    assert "{-1, 0, 0, 0, 0}, /* angle */" in text
