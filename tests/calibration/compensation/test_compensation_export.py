"""Coefficients as TOML and as C: both give the numbers of the fit."""

import math
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calibration.compensation.export import to_c_header, to_toml
from calibration.compensation.model import (
    Additive,
    Compensation,
    Constant,
    Function,
    Input,
    Network,
    Piecewise,
    Varying,
)
from gyro_model.compiling import find_compiler
from gyro_model.errors import InputError

RNG = np.random.default_rng(5)
LINES = Piecewise(np.array([-20.0, 0.0, 60.0]), RNG.standard_normal((2, 2)))
CUBICS = Piecewise(np.array([-20.0, 10.0, 30.0, 60.0]), 1e-3 * RNG.standard_normal((3, 4)))
LOW, HIGH = np.array([-20.0, -0.1]), np.array([60.0, 0.1])
NETWORK = Network(
    RNG.standard_normal((5, 2)), RNG.standard_normal(5), RNG.standard_normal(5), 0.25, LOW, HIGH, 1.0, 0.1
)
INPUTS = (Input("structure", -20.0, 60.0), Input("circuit_rate", -0.1, 0.1))
FUNCTIONS: dict[str, tuple[Function, Function]] = {
    "additive": (Additive((CUBICS, LINES)), Additive((LINES, CUBICS))),
    "network": (NETWORK, NETWORK._replace(shift=0.01, b2=-0.5)),
    "varying": (Varying((CUBICS, LINES), np.array([0.0, 0.02])), Varying((LINES, CUBICS), np.array([0.0, -0.01]))),
    "rest": (Constant(1.0), Additive((LINES, CUBICS))),
}
X = np.stack([RNG.uniform(-20, 60, 50), RNG.uniform(-0.1, 0.1, 50)], axis=1)
X[:3, 0] = (-20.0, 10.0, 60.0)


def compensation(kind: str) -> Compensation:
    scale, bias = FUNCTIONS[kind]
    return Compensation(kind, INPUTS, scale, bias, 10.0, "rad/s", 'a "note" */')


def run_c(folder: Path, header: str, x: np.ndarray, rate: float) -> np.ndarray:
    """Result and count for each row of x, shape (n, 2)."""
    try:
        compiler = find_compiler()
    except InputError as error:
        pytest.skip(str(error))
    (folder / "compensation.h").write_text(header)
    (folder / "main.c").write_text(
        """#include <stdio.h>
#include "compensation.h"
int main(void)
{
    double x[GYRO_COMPENSATION_INPUTS], rate;
    while (scanf("%lf %lf %lf", &x[0], &x[1], &rate) == 3) {
        double out = -99.0;
        int beyond = gyro_compensate(x, rate, &out);
        printf("%.17g %d\\n", out, beyond);
    }
    return 0;
}
"""
    )
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run([*compiler, *strict, "-o", str(folder / "a"), str(folder / "main.c"), "-lm"], check=True)
    text = "\n".join(f"{a!r} {b!r} {rate!r}" for a, b in x.tolist())
    shown = subprocess.run([str(folder / "a")], input=text, capture_output=True, text=True, check=True).stdout
    return np.array([[float(word) for word in row.split()] for row in shown.splitlines()])


@pytest.mark.parametrize("kind", FUNCTIONS)
def test_the_header_gives_the_same_numbers(kind: str, tmp_path: Path) -> None:
    model = compensation(kind)
    found = run_c(tmp_path, to_c_header(model, "refuse"), X, 0.7)
    expected = 0.7 / model.scale(X) - model.bias(X)
    # Sums of some ten terms of order one in another order, tanh of another library.
    assert found[:, 0] == pytest.approx(expected, rel=1e-13, abs=1e-13)
    assert (found[:, 1] == 0).all()


def test_the_header_never_goes_beyond_the_range_silently(tmp_path: Path) -> None:
    model = compensation("additive")
    outside = np.array([[70.0, 0.0], [70.0, 0.2], [math.nan, 0.0]])
    refused = run_c(tmp_path, to_c_header(model, "refuse"), outside, 0.7)
    assert refused.tolist() == [[-99.0, 1.0], [-99.0, 2.0], [-99.0, 1.0]]
    clamped = run_c(tmp_path, to_c_header(model, "clamp"), outside[:2], 0.7)
    edge = np.array([[60.0, 0.0], [60.0, 0.1]])
    assert clamped[:, 0] == pytest.approx(0.7 / model.scale(edge) - model.bias(edge), rel=1e-13)
    assert clamped[:, 1].tolist() == [1.0, 2.0]


def by_hand(table: dict[str, Any], inputs: list[dict[str, Any]], x: np.ndarray) -> float:
    """The value of a function in compensation.toml at one x, as its comments say."""
    if "constant" in table:
        return float(table["constant"])
    values = dict(zip((i["name"] for i in inputs), x, strict=True))
    if "term" in table:
        total = 0.0
        for term in table["term"]:
            k = max(j for j in range(len(term["coefficients"])) if j == 0 or values[term["input"]] >= term["edges"][j])
            u = values[term["input"]] - term["edges"][k]
            total += sum(c * u**power for power, c in enumerate(term["coefficients"][k]))
        return total
    if "weight" in table:
        total = 0.0
        for j, term in enumerate(table["weight"]):
            k = max(j for j in range(len(term["coefficients"])) if j == 0 or x[0] >= term["edges"][j])
            f = sum(c * (x[0] - term["edges"][k]) ** power for power, c in enumerate(term["coefficients"][k]))
            total += f * (1.0 if j == 0 else values[term["input"]] - term["centre"])
        return total
    u = np.array([2 * (values[i["name"]] - i["low"]) / (i["high"] - i["low"]) - 1 for i in inputs])
    hidden = np.tanh(np.array(table["a1"]) @ u + np.array(table["b1"]))
    return float(table["shift"] + table["gain"] * (np.array(table["a2"]) @ hidden + table["b2"]))


@pytest.mark.parametrize("kind", FUNCTIONS)
def test_toml_gives_the_same_numbers(kind: str) -> None:
    model = compensation(kind)
    table = tomllib.loads(to_toml(model))
    assert table["note"] == 'a "note" */'
    for name, function in (("scale", model.scale), ("bias", model.bias)):
        expected = function(X)
        found = [by_hand(table[name], table["input"], x) for x in X]
        # The same doubles, summed in another order.
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)
