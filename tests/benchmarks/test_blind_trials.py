"""The generator of the blind trials against scipy and hand formulas, and a small run."""

import ast
import json
import subprocess
import sys
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.signal import welch

from benchmarks import blind_trials
from benchmarks.blind.detect import Projector
from benchmarks.blind.effects import BY_ID, EFFECTS
from benchmarks.blind.experiment import TOLERANCE, Device, Plan, draw_runs
from benchmarks.blind.grade import grade
from benchmarks.blind.inseparable import ALIKE, SITUATIONS, TOLD, make_inseparable
from benchmarks.blind.noise import Noise, flicker, measured, thermal_force
from benchmarks.blind.physics import RADIANS, Plant, Run, simulate
from benchmarks.blind.plan import KINDS, Entry, entries
from benchmarks.blind.runner import ROOT, Ask, imported, result_file, run_all, run_one
from benchmarks.blind.summary import summarise
from benchmarks.blind.terms import TERMS, extra_force
from benchmarks.blind.trial import make_effects, make_null, make_unknown, rng_of, scale_of

pytestmark = pytest.mark.minutes(3)

FOLDER = Path(__file__).parents[2] / "benchmarks" / "blind"
GENERATOR = ("terms", "physics", "effects", "experiment", "noise", "detect", "trial", "inseparable", "store",
             "difficulties")  # fmt: skip
"""What makes data; the tool, its caller and the tables may know the project."""
RATE = 200_000.0


def drawn_run(samples: int, seed: int = 0) -> Run:
    """Random held inputs of every kind, large enough for every effect to act."""
    rng = np.random.default_rng(seed)
    jumps = np.repeat(rng.normal(size=(samples, 6)), 7, axis=0)[:samples]
    return Run(RATE, 5e-5 * rng.normal(size=(samples, 2)), 20 * jumps[:, 0], 310 + 5 * jumps[:, 1],
               100 * jumps[:, 2:4], 10 + jumps[:, 4], np.array([4e-7, -3e-7, 5e-3, 2e-3]))  # fmt: skip


# ---- imports


@pytest.mark.parametrize("module", GENERATOR)
def test_generator_imports_nothing_of_the_model(module: str) -> None:
    tree = ast.parse((FOLDER / f"{module}.py").read_text(encoding="utf-8"))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "." for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    own = {f"benchmarks.blind.{name}" for name in GENERATOR}
    allowed = {"numpy", "scipy", "numba", "polars", *sys.stdlib_module_names}
    assert {name for name in names if name not in own and name.partition(".")[0] not in allowed} == set()


def test_nothing_of_the_model_is_loaded_by_the_generator() -> None:
    code = "import sys, benchmarks.blind.store, benchmarks.blind.inseparable; print(sorted(sys.modules))"
    root = Path(__file__).parents[2]
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root)
    loaded = {name.partition(".")[0] for name in ast.literal_eval(done.stdout)}
    assert "benchmarks" in loaded
    assert not loaded & {"gyro_model", "cosim", "discrepancy", "calibration", "gyrotwin", "fmpy"}


# ---- the motion


def slope(t: float, s: np.ndarray, p: Plant, run: Run, k: int) -> np.ndarray:
    """The device and its effects once more, as matrices: x, y, x', y', parasitic q, q', structure temperature,
    hysteretic z_x, z_y."""
    q, dq, T = s[:2], s[2:4], s[6] - p.t_ref
    factor = p.damping_step_factor if t >= p.damping_step_time else 1.0
    D = np.array([[p.dxx, p.dxy], [p.dxy, p.dyy]]) * factor * (1 + p.tcd * T)
    K = np.array([[p.kxx, p.kxy], [p.kxy, p.kyy]]) * (1 + p.tck * T) + np.diag([0, p.kyy * p.tck_split * T])
    J = np.array([[0, 1], [-1, 0]])
    k2, k3, d2 = np.array([[p.k2_x, p.k2_y], [p.k3_x, p.k3_y], [p.d2_x, p.d2_y]])
    c = np.array([p.acceleration_gain_x, p.acceleration_gain_y])
    volt = run.v_bias[k] + p.charging_voltage * (1 - np.exp(-t / p.charging_time))
    force = run.u[k] - D @ dq - K @ q + 2 * p.angular_gain * p.m * run.omega[k] * (J @ dq)
    force = force + p.m * (p.frame_rotation * run.omega[k] ** 2 * q + c * run.acceleration[k])
    force = force - k2 * q**2 - k3 * q**3 - d2 * q**2 * dq
    force = force + p.softening * volt**2 * q / (1 - (q / p.electrode_gap) ** 2) ** 2
    force = force - np.array([p.parasitic_coupling * s[4], 0])
    w = 2 * np.pi * p.parasitic_frequency
    mode = -w / p.parasitic_q * s[5] - w**2 * s[4] - p.parasitic_coupling / p.m * s[0]
    heating = (run.temperature[k] - s[6]) / p.structure_lag if p.structure_lag else 0.0
    z, size = s[7:9], abs(s[7:9])
    force = force - np.array([p.hysteresis_x, p.hysteresis_y]) * z
    bend = p.hysteresis_beta * abs(dq) * z * size ** (p.hysteresis_n - 1)
    bend = (dq - bend - p.hysteresis_gamma * dq * size**p.hysteresis_n) / p.hysteresis_length
    return np.array([*dq, *(force / p.m), s[5], mode, heating, *bend])


CASES = {
    "cubic_and_quadratic": {"k3_x": 2e12, "k3_y": -1e12, "k2_x": 3e6, "k2_y": -2e6},
    "nonlinear_damping": {"d2_x": 1e7, "d2_y": 3e7},
    "rates": {"angular_gain": 0.7, "frame_rotation": 1.0},
    "acceleration": {"acceleration_gain_x": -1.0, "acceleration_gain_y": 0.6},
    "charged_softening": {"softening": 0.02, "electrode_gap": 6e-6, "charging_voltage": 2.0, "charging_time": 3e-4},
    "heated": {"tck": -3e-3, "tck_split": 1e-3, "tcd": 2e-2, "structure_lag": 2e-4},
    "parasitic_mode": {"parasitic_coupling": 10.0, "parasitic_frequency": 4100.0, "parasitic_q": 30.0},
    "hysteresis": {
        "hysteresis_x": 1e-5,
        "hysteresis_y": 6e-6,
        "hysteresis_length": 4e-7,
        "hysteresis_beta": 0.7,
        "hysteresis_gamma": 0.3,
        "hysteresis_n": 1.5,
    },
    "damping_step": {"damping_step_factor": 30.0, "damping_step_time": 3.33e-4},
}


@pytest.mark.parametrize("hidden", CASES.values(), ids=CASES.keys())
def test_motion_is_that_of_dop853(hidden: dict[str, float]) -> None:
    p, run, h = Plant(**hidden), drawn_run(150), 1 / RATE  # type: ignore[arg-type]
    s = np.concatenate([run.start, [0, 0, run.temperature[0], 0, 0]])
    expected = []
    for k in range(len(run.u)):
        expected.append(s[:4].copy())
        if k:
            s[2:4] += p.frame_rotation * (run.omega[k] - run.omega[k - 1]) * np.array([s[1], -s[0]])
        if not p.structure_lag:
            s[6] = run.temperature[k]
        ends = sorted({k * h, (k + 1) * h, float(np.clip(p.damping_step_time, k * h, (k + 1) * h))})
        for begin, end in pairwise(ends):
            # The slope at the very end of a piece belongs to the next one: stay short of it by rounding.
            inside = partial(_inside, end=end)
            s = solve_ivp(lambda t, z, k=k, inside=inside: slope(inside(t), z, p, run, k), (begin, end), s,
                          method="DOP853", rtol=1e-11, atol=1e-18).y[:, -1]  # fmt: skip
    size = np.abs(expected).max(axis=0)
    # 150 intervals at rtol 1e-11; steps of 0.12 rad at 8th order leave less. A step over a corner of the hysteresis, at
    # every turn, leaves 1e-7: a hundredth of the noise of these trials.
    allowed = 1e-6 if p.hysteresis_x else 1e-9
    assert np.abs(simulate(p, run).state - expected).max(axis=0) / size == pytest.approx(0, abs=allowed)


def test_play_by_hand() -> None:
    u = 1e-6 * np.column_stack([[0.5, 2.0, 1.0, -1.0, 0.0], [-3.0, -2.0, -1.0, 1.0, 3.0]])
    through = 1e-6 * np.column_stack([[0.0, 1.0, 1.0, 0.0, 0.0], [-2.0, -2.0, -2.0, 0.0, 2.0]])
    run = drawn_run(5)
    moved, given = (
        simulate(Plant(play=play), run._replace(u=force)).state for play, force in ((1e-6, u), (0.0, through))
    )
    # The same force, but for the rounding of 2 µN less 1 µN.
    assert np.abs(moved - given).max(axis=0) == pytest.approx(0, abs=1e-12 * np.abs(given).max())


def _inside(t: float, end: float) -> float:
    return min(t, end * (1 - 1e-15))


def test_linear_chain_is_the_matrix_exponential() -> None:
    """Delay of 2.3 samples, misalignments, gain mismatch, feedthrough and lag: all linear, so exact."""
    p = Plant(actuator_delay=2.3 / RATE, actuator_misalignment=0.02, actuator_gain_mismatch=0.1, feedthrough=8.0,
              pickoff_misalignment=0.03, pickoff_gain_mismatch=-0.2, amplifier_time_constant=1.7e-5)  # fmt: skip
    run = drawn_run(300)._replace(omega=np.full(300, 15.0))
    J, tau = np.array([[0, 1], [-1, 0]]), p.amplifier_time_constant
    D, K = np.array([[p.dxx, p.dxy], [p.dxy, p.dyy]]), np.array([[p.kxx, p.kxy], [p.kxy, p.kyy]])
    S = np.diag([p.sense_gain_x, p.sense_gain_y * 0.8]) @ np.array([[1, 0.03], [0.03, 1]])
    drive = np.array([[1, 0.02 * 1.1], [0.02, 1.1]])
    # States q, q', v; inputs: delayed force, then the force as commanded, both held.
    F = np.zeros((10, 10))
    F[0:2, 2:4] = np.eye(2)
    F[2:4, 0:2], F[2:4, 2:4], F[2:4, 6:8] = -K / p.m, (2 * p.m * 15.0 * J - D) / p.m, drive / p.m
    F[4:6, 0:2], F[4:6, 4:6], F[4:6, 8:10] = S / tau, -np.eye(2) / tau, p.feedthrough * np.eye(2) / tau
    early, late = expm(0.3 * F / RATE), expm(0.7 * F / RATE)
    z, expected = np.zeros(10), []
    z[:4] = run.start
    z[4:6] = S @ run.start[:2] + p.feedthrough * run.u[0]
    for k in range(300):
        expected.append(z[4:6].copy())
        z[8:10] = run.u[k]
        z[6:8] = run.u[max(k - 3, 0)]
        z = early @ z
        z[6:8] = run.u[max(k - 2, 0)]
        z = late @ z
    # The lag's input runs as a cubic over each piece: (w h)^4/384 = 4e-7 of what oscillates with w h = 0.12, and less
    # of what the jumps of the force add to it.
    assert np.abs(simulate(p, run).v - expected).max() / np.abs(expected).max() < 1e-6


def test_halving_the_substep_changes_nothing() -> None:
    p, run = Plant(k3_x=2e10, pickoff_inverse_gap=4e4, parasitic_coupling=2.0), drawn_run(2000)
    fine, usual = simulate(p, run, RADIANS / 2).v, simulate(p, run).v
    # 8th order: (0.15)^9/9! = 1e-13 a step at most, 2000 steps.
    assert np.abs(fine - usual).max() / np.abs(usual).max() < 1e-9


def test_statics_of_the_pickoff_by_hand() -> None:
    """At rest and held there by the right force, v is the chain applied to one number: 1 µm, g = 5 µm, e = 0.4."""
    p = Plant(kxy=0.0, dxy=0.0, pickoff_inverse_gap=2e5, pickoff_mismatch=0.4, tcg=1e-3, offset_x=0.01,
              offset_drift=2.0)  # fmt: skip
    still = np.tile([p.kxx * 1e-6, 0.0], (3, 1))
    zero = np.zeros(3)
    run = Run(RATE, still, zero, zero + p.t_ref + 20, np.zeros((3, 2)), zero, np.array([1e-6, 0, 0, 0]))
    # (1 + 0.4·0.2)/(1 − 0.2²) = 1.125; gain 1.02; drift 2 V/s after 2 samples 2e-5 V.
    assert simulate(p, run).v[2, 0] == pytest.approx(1.125 * 1.02 + 0.01 + 2e-5, rel=1e-12)


@pytest.mark.parametrize("number", range(1, len(TERMS) + 1))
def test_terms_are_what_their_text_says(number: int) -> None:
    term, values = TERMS[number - 1], (3e-7, -2e-7, 4e-3, -7e-3, 2e-5, -3e-5)
    names = dict(zip(("x", "y", "x_dot", "y_dot", "u_x", "u_y"), values, strict=True)) | {"c": 2.0}
    expected = [float(sympy.sympify(text).subs(names)) for text in (term.force_x, term.force_y)]
    assert extra_force(number, 2.0, *values) == pytest.approx(expected, rel=1e-12)


# ---- noise


def test_flicker_has_its_density() -> None:
    samples = flicker(np.random.default_rng(1), 2_000_000, RATE, 1e-4)
    f, density = welch(samples, RATE, nperseg=200_000)
    band = (f > 20) & (f < 2e4)
    # 19 half-overlapping pieces and 20,000 lines: the mean of the ratio scatters by less than 1 %.
    assert np.mean(density[band] * f[band]) == pytest.approx(1e-8, rel=0.03)


def test_thermal_force_by_equipartition() -> None:
    """Its two-sided density 2 k_B T D as a held force: variance 2 k_B T D rate, correlated as D."""
    run = drawn_run(100_000)._replace(temperature=np.full(100_000, 300.0))
    force = thermal_force(np.random.default_rng(2), Plant(), run)
    expected = 2 * 1.380649e-23 * 300 * RATE * np.array([[1.8e-6, 3.6e-7], [3.6e-7, 1.8e-6]])
    # A variance from 1e5 numbers scatters by 0.45 %; four deviations.
    assert np.cov(force.T) == pytest.approx(expected, rel=0.02, abs=0.02 * expected[0, 1])


def test_converter_clips_then_rounds() -> None:
    p, run = Plant(adc_limit=0.05), drawn_run(500)
    v = measured(np.random.default_rng(0), p, run, Noise(lsb=1e-3))
    assert np.abs(v).max() == pytest.approx(0.05)
    assert np.allclose(v / 1e-3, np.round(v / 1e-3), atol=1e-9)


# ---- sizes


def reference_set() -> tuple[Device, list[Run]]:
    device = Device(Plant(), {}, 2893.0, 3759.0)
    return device, draw_runs(np.random.default_rng(5), device, Plan(("omega_z",), samples=3000))


def test_detectable_size_is_five_deviations_of_the_cramer_rao_bound() -> None:
    """The information matrix of all parameters and initial states, inverted: a second way to the same number."""
    device, runs = reference_set()
    p, sigma = device.true, 2e-5
    effect, scale = BY_ID["angular_gain"], scale_of(device, runs)
    found = Projector(p, runs, sigma).detectable(lambda s: effect.placed(p, s, (1.0,), scale), 0.5)

    def voltages(plant: Plant, moved: tuple[int, np.ndarray] | None = None) -> np.ndarray:
        own = [r._replace(start=r.start + moved[1]) if moved and moved[0] == i else r for i, r in enumerate(runs)]
        return np.concatenate([simulate(plant, r).v.ravel() for r in own]) / sigma

    base = voltages(p)
    columns = [(voltages(p._replace(angular_gain=1 + 1e-3)) - base) / 1e-3]
    columns += [voltages(p._replace(**{name: getattr(p, name) * (1 + 1e-5)})) - base for name in TOLERANCE]
    columns += [voltages(p, (i, step)) - base for i in range(len(runs)) for step in np.diag([1e-12, 1e-12, 1e-8, 1e-8])]
    scaled = np.stack(columns, axis=1)
    scaled[:, 1:] /= np.linalg.norm(scaled[:, 1:], axis=0)
    bound = np.sqrt(np.linalg.inv(scaled.T @ scaled)[0, 0])
    # One-sided differences of 1e-5 in k over some 300 rad are linear to 2e-3; the search ends within 1 %.
    assert found == pytest.approx(5 * bound, rel=0.02)


def test_size_of_a_quadratic_effect() -> None:
    """1/g acts by its square: ten times the size is a hundred times the length."""
    device, runs = reference_set()
    scale = scale_of(device, runs)
    projector = Projector(device.true, runs, 2e-5)
    size = projector.detectable(lambda s: Plant(pickoff_inverse_gap=s), 0.5 / scale.q)
    assert projector.length(Plant(pickoff_inverse_gap=size)) == pytest.approx(5, rel=0.01)
    assert projector.length(Plant(pickoff_inverse_gap=10 * size)) == pytest.approx(500, rel=0.05)


@pytest.mark.parametrize("effect", [effect.id for effect in EFFECTS if effect.id in ("adc_clipping", "thermal_lag")])
def test_label_says_what_is_hidden(effect: str) -> None:
    trial = make_effects("label", [effect], 10.0, partner_known=False)
    assert effect in trial.label["effects"]
    assert trial.label["multiple"][effect] <= 10.0 * 1.0001
    assert 0 < trial.label["floor"] < 0.01
    if effect == "thermal_lag":
        assert "thermal_stiffness" in trial.label["effects"]
        assert trial.label["parameters"]["tck"] != 0
    else:
        peak = max(np.abs(v).max() for v in trial.measured[:-1])
        assert peak == pytest.approx(trial.label["parameters"]["adc_limit"], rel=1e-12)


def test_inseparable_before_and_after() -> None:
    number = next(i for i, case in enumerate(SITUATIONS) if case.truth == "amplifier_drift")
    made = make_inseparable("inseparable-4", number, "after")
    before, after = made.label["left"]
    assert before < ALIKE
    assert after > TOLD
    assert len(made.runs) == 6


def test_unknown_term_is_large_enough_to_be_refused() -> None:
    label = make_unknown("unknown-x", 8).label
    assert label["multiple"]["velocity_coupling"] >= 10
    assert len(label["points"]) >= 250


def test_the_same_name_gives_the_same_data_and_blocks_differ() -> None:
    first, again, other = (make_null("null-0", "clean", block) for block in ("tune", "tune", "report"))
    assert all(np.array_equal(a, b) for a, b in zip(first.measured, again.measured, strict=True))
    assert first.nominal != other.nominal
    assert rng_of("tune", "a").random() != rng_of("tune", "b").random()


# ---- plan, run, grade


def test_plan_has_what_was_promised() -> None:
    chosen = list(entries(KINDS, "report"))
    count = {kind: sum(entry.kind == kind for entry in chosen) for kind in KINDS}
    assert count == {"null": 752, "single": 33 * len(BY_ID), "pair": 60, "triple": 30, "unknown": 108,
                     "inseparable": 20, "difficulty": 200}  # fmt: skip
    assert len({entry.name for entry in chosen}) == len(chosen)


def answered(folder: Path) -> dict[str, object]:
    """A tool that sees a folder and notes what lies in it."""
    (folder.parent / "asked").open("a").write("x")
    return {"verdict": "nothing missing", "effects": [], "saw": sorted(p.name for p in folder.iterdir()), "x": np.nan}


def failing(folder: Path) -> dict[str, object]:
    raise ValueError(folder.name)


def test_a_run_resumes_and_seals(tmp_path: Path) -> None:
    entry = Entry("null", "null-short-00", partial(make_null, "null-short-00", "short"))
    ask = Ask(tmp_path, f"{__name__}:answered")
    first, second = (next(run_all([entry], ask, 1)) for _ in range(2))
    assert first == second
    assert (tmp_path / "data" / "asked").read_text() == "x"
    assert first["answer"]["saw"] == ["dataset.toml", *(f"run-0{i}.parquet" for i in range(1, 5))]
    assert first["answer"]["x"] is None
    assert len(first["answer_sha256"]) == 64
    found = grade(first)
    assert found is not None
    assert found.right


def test_a_tool_that_fails_is_a_result(tmp_path: Path) -> None:
    entry = Entry("null", "null-short-00", partial(make_null, "null-short-00", "short"))
    result = run_one(entry, Ask(tmp_path, f"{__name__}:failing", keep=False))
    found = grade(result)
    assert found is not None
    assert (found.verdict, found.right) == ("error", False)
    assert not list(tmp_path.rglob("*.parquet"))


def test_only_what_this_code_has_answered_counts(tmp_path: Path) -> None:
    entry = Entry("null", "null-short-00", partial(make_null, "null-short-00", "short"))
    ask = Ask(tmp_path, f"{__name__}:failing", keep=False)
    first = run_one(entry, ask)
    assert list(run_all([entry], ask, 1)) == [first]
    file = result_file(tmp_path, entry.name)
    file.write_text(json.dumps({**first, "code": "another", "answer": {"error": "of another code"}}), encoding="utf-8")
    [again] = run_all([entry], ask, 1)
    assert (again["code"], again["answer"]["error"]) == (first["code"], first["answer"]["error"])


def test_small_blind_trial(tmp_path: Path) -> None:
    """Four effects at ten times their detectable sizes and three nulls, on seeds of the tune block."""
    wanted = {"null-clean-00", "null-quantised-00", "null-badly-00"} | {
        f"single-{effect}-10x-0"
        for effect in ("electrostatic_softening", "nonlinear_damping", "quadratic_stiffness", "cubic_stiffness")
    }
    chosen = [entry for entry in entries(("null", "single"), "tune") if entry.name in wanted]
    results = list(run_all(chosen, Ask(tmp_path, keep=False), 2))
    grades = [found for found in map(grade, results) if found]
    assert {found.id for found in grades} == wanted
    assert [(found.id, found.named, found.verdict) for found in grades if not found.right] == []
    # The report's rows stand, and it can be written as JSON.
    report = summarise("blind_trials", results)
    alarms, singles = report.tables[0].rows[:2]
    assert (alarms.values["rate"], singles.values["rate"]) == (0, 1)
    probable = report.tables[-1].rows
    assert sum(row.values["of"] or 0 for row in probable[:-1]) == probable[-1].values["of"] == 4
    assert json.dumps(report.data)


def test_the_code_of_an_answer_is_also_what_it_imports_of_the_loop():
    found = {path.name for path in imported("cosim", [ROOT / "discrepancy"])}
    assert {"__init__.py", "fmu.py", "exchange.py"} <= found
    # The observer takes no part in a diagnosis.
    assert "bound.py" not in found
    # All that the loop's master needs is reached by way of others, too.
    assert "design.py" in {path.name for path in imported("cosim", [ROOT / "gyrotwin" / "tasks"])}


def test_trials_beyond_a_share_are_those_that_it_does_not_draw() -> None:
    def names(*shares: int | None) -> set[str]:
        return {entry.name for entry in blind_trials._drawn("single", "report", "", shares, None)}  # type: ignore[arg-type]

    assert names(10, 6) == names(None, 6) - names(None, 10)
    assert len(names(10, 6)) + len(names(None, 10)) == len(names(None, 6))
