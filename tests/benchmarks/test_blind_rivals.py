"""What others say of the blind trials: names from terms, and the table that puts all side by side."""

from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from sympy import Abs

from benchmarks import blind_rivals
from benchmarks.rivals import symbolic, weak_form
from benchmarks.rivals.naming import LINEAR, ONE, answer, products
from gyro_model.errors import InputError
from gyro_model.symbols import u_x, x, x_dot, y, y_dot


def ids(told: dict[str, Any]) -> list[str]:
    return [finding["id"] for finding in told["effects"]]


def test_terms_of_effect_files_get_their_names() -> None:
    told = answer({(x**3, 0): -1.0, (y**2 * y_dot, 1): -1.0})
    assert ids(told) == ["cubic_stiffness", "nonlinear_damping"]
    assert told["verdict"] == "missing effects"


def test_terms_of_one_effect_are_one_finding() -> None:
    assert ids(answer({(x**3, 0): -1.0, (y**3, 1): -2.0})) == ["cubic_stiffness"]


def test_other_terms_are_one_discovered_force() -> None:
    told = answer({(Abs(x_dot) * x_dot, 0): -2.0, (u_x * y, 1): 3.0})
    (finding,) = told["effects"]
    assert (finding["id"], finding["force_x"], finding["force_y"]) == (
        "discovered_1",
        "-2.0*x_dot*Abs(x_dot)",
        "3.0*u_x*y",
    )


def test_no_terms_are_nothing_missing() -> None:
    assert answer({})["verdict"] == "nothing missing"


def test_the_library_holds_the_constant_and_nothing_linear() -> None:
    assert ONE in products()
    assert not {*products()} & {*LINEAR}


def test_programs_become_products_in_si() -> None:
    z = np.random.default_rng(0).standard_normal((100, 7))
    units = np.array([1e-6, 1e-6, 2e-2, 1e-2, 1e-6, 1e-6, 1.0])
    found = symbolic._terms("add(mul(mul(x, x), 0.5), sub(x, mul(abs(x_dot), x_dot)))", z, units)
    assert found == pytest.approx({x**2: 0.5e12, Abs(x_dot) * x_dot: -2500.0})


def result(kind: str, effects: list[str]) -> dict[str, Any]:
    label = {"kind": kind, "level": "10", "effects": effects, "floor": 1.0, "parameters": {}}
    return {"id": kind, "kind": kind, "label": label, "cpu_s": 0.0}


def test_answers_stand_side_by_side() -> None:
    results = {"a": result("null", []), "b": result("single", ["cubic_stiffness"])}
    right = {"a": answer({}), "b": answer({(x**3, 0): -1.0})}
    wrong = {"a": answer({(y**3, 1): -1.0}), "b": {"error": "ValueError: none"}}
    who, other = (blind_rivals.OWN, *blind_rivals.RIVALS)[:2], list(blind_rivals.RIVALS)[1]
    answers = {(n, who[0]): right[n] for n in right} | {(n, who[1]): wrong[n] for n in wrong}
    answers |= {(n, other): answer({}) for n in right}
    shares, false, *_ = blind_rivals.tables(results, answers)
    assert [row.values[name] for row in shares.rows for name in (*who, other)] == [1, 0, 0.5, 1, 0, 1, 1, 0, 0]
    assert false.rows[0].values[who[1]] == 0.5


def test_a_folder_without_data_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no trial with its data"):
        blind_rivals.compare(tmp_path / "report", 1, 1, 1)


M, K, D, CUBIC = 1e-7, 35.0, 2e-6, 4e12


def run(seed: int, samples: int = 3000, step: float = 5e-6) -> pl.DataFrame:
    """Two uncoupled oscillators near 3 kHz under twenty sines of 1 to 5 kHz, a cubic spring on x; held force, RK4,
    noise of the voltage 1e-5 of it."""
    rng = np.random.default_rng(seed)
    phases = 2 * np.pi * (np.outer(np.arange(samples) * step, np.linspace(1e3, 5e3, 20)) + rng.random((2, 1, 20)))
    u = 4e-7 * np.sin(phases).sum(axis=2).T
    z, found = np.zeros(4), np.empty((samples, 2))

    def rate(z: np.ndarray, u: np.ndarray) -> np.ndarray:
        force = u - D * z[2:] - K * np.array([1.0, 1.1]) * z[:2] - np.array([CUBIC * z[0] ** 3, 0.0])
        return np.concatenate([z[2:], force / M])

    for n in range(samples):
        found[n] = z[:2]
        a = rate(z, u[n])
        b = rate(z + 0.5 * step * a, u[n])
        c = rate(z + 0.5 * step * b, u[n])
        z = z + step / 6 * (a + 2 * b + 2 * c + rate(z + step * c, u[n]))
    v = 1e6 * found
    v += 1e-5 * v.std() * rng.standard_normal(v.shape)
    return pl.DataFrame({"u_x": u[:, 0], "u_y": u[:, 1], "v_x": v[:, 0], "v_y": v[:, 1]})


@pytest.mark.parametrize(("rival", "package"), [(weak_form, "pysindy"), (symbolic, "gplearn")])
def test_a_strong_cubic_spring_is_found(rival: Any, package: str, tmp_path: Path) -> None:
    """The spring bears a tenth of the force of x, which both regressions see."""
    pytest.importorskip(package, reason="needs the extra rivals")
    lines = ["[nominal]", "sense_gain_x = 1e6", "sense_gain_y = 1e6"]
    for seed in range(3):
        run(seed).write_parquet(tmp_path / f"{seed}.parquet")
        lines += ["[[run]]", f'file = "{seed}.parquet"', "sample_rate = 2e5"]
    (tmp_path / "dataset.toml").write_text("\n".join([*lines, 'role = "held-out"']), encoding="utf-8")
    assert ids(rival.diagnosis(tmp_path)) == ["cubic_stiffness"]
