"""Coefficients of a compensation as TOML, and as a C99 header: what goes into the FPGA of Liu et al. 2014."""

from collections.abc import Iterable, Sequence
from typing import Final

import numpy as np

from calibration.compensation.field_form import field_form
from calibration.compensation.model import Additive, Compensation, Constant, Function, Network, Piecewise, Varying
from calibration.compensation.record import Floats
from gyro_model.errors import InputError

FORMAT: Final = 1


def to_toml(compensation: Compensation) -> str:
    """The coefficients as a TOML file; numbers with all their digits."""
    lines = [
        "# Temperature compensation: compensated rate = rate / scale(X) - bias(X). Inputs X, and the rate, are means",
        "# over the sampling time; NAME_rate is the difference of two such means over that time, NAME_lag_TAU a",
        "# first-order lag of TAU s less NAME, NAME_play_WIDTH a play of that half width less NAME.",
        f"format = {FORMAT}",
        f"method = {_text(compensation.method)}",
        f"note = {_text(compensation.note)}",
        f"unit = {_text(compensation.unit)}",
        f"sampling_time = {compensation.sampling_time!r}  # s",
    ]
    for i in compensation.inputs:
        lines += ["", "[[input]]", f"name = {_text(i.name)}", f"unit = {_text(i.unit)}"]
        lines += [f"low = {i.low!r}", f"high = {i.high!r}"]
    for name, function in (("scale", compensation.scale), ("bias", compensation.bias)):
        lines += _toml(name, function, [i.name for i in compensation.inputs])
    return "\n".join(lines) + "\n"


def _toml(name: str, function: Function, inputs: Sequence[str]) -> list[str]:
    if isinstance(function, Constant):
        return ["", f"[{name}]", f"constant = {function.value!r}"]
    if isinstance(function, Additive):
        lines = ["", "# A sum of terms; within segment k a term is c[k][0] + c[k][1] u + ..., u = x - edges[k]."]
        for i, term in zip(inputs, function.terms, strict=True):
            lines += [
                "",
                f"[[{name}.term]]",
                f"input = {_text(i)}",
                f"edges = {_array(term.edges)}",
                "coefficients = [",
            ]
            lines += [f"  {_array(row)}," for row in term.coefficients] + ["]"]
        return lines
    if isinstance(function, Varying):
        lines = ["", "# f_0(x_0) + sum of f_j(x_0) (x_j - centre_j); within segment k, f is c[k][0] + c[k][1] u + ..,"]
        lines += ["# u = x_0 - edges[k]."]
        for i, term, centre in zip(inputs, function.terms, function.centres.tolist(), strict=True):
            lines += ["", f"[[{name}.weight]]", f"input = {_text(i)}", f"centre = {centre!r}"]
            lines += [f"edges = {_array(term.edges)}", "coefficients = ["]
            lines += [f"  {_array(row)}," for row in term.coefficients] + ["]"]
        return lines
    if isinstance(function, Network):
        lines = ["", "# shift + gain (a2 tanh(a1 u + b1) + b2), u = 2 (x - low)/(high - low) - 1.", f"[{name}]"]
        lines += [f"shift = {function.shift!r}", f"gain = {function.gain!r}", "a1 = ["]
        lines += [f"  {_array(row)}," for row in function.a1] + ["]", f"b1 = {_array(function.b1)}"]
        return [*lines, f"a2 = {_array(function.a2)}", f"b2 = {function.b2!r}"]
    raise InputError(f"{type(function).__name__}: no such function can be written")


def to_c_header(compensation: Compensation, outside: str) -> str:
    """A header of C99 with gyro_compensate(), which returns how many inputs were beyond the fitted range.

    outside: "refuse" leaves the result alone there, "clamp" uses the nearest inputs inside.
    """
    count = len(compensation.inputs)
    listing = [f" *   x[{k}] {i.name} [{i.unit}]" for k, i in enumerate(compensation.inputs)]
    beyond = "    if (beyond)\n        return beyond;\n" if outside == "refuse" else ""
    says = "left alone" if outside == "refuse" else "that of the nearest inputs within"
    return "\n".join(
        [
            f"/* Temperature compensation by gyrotwin: {compensation.method}. {_comment(compensation.note)}",
            f" * Rates in {compensation.unit}. Inputs and rate are means over {compensation.sampling_time:g} s;",
            " * NAME_rate is the difference of two such means over that time, NAME_lag_TAU a first-order lag of TAU s",
            " * less NAME, NAME_play_WIDTH a play of that half width less NAME. gyro_compensation_sample() makes them",
            " * all from what the sensors say.",
            *listing,
            " */",
            "#ifndef GYRO_COMPENSATION_H",
            "#define GYRO_COMPENSATION_H",
            "",
            "#include <math.h>",
            "",
            f"#define GYRO_COMPENSATION_INPUTS {count}",
            f"#define GYRO_COMPENSATION_SAMPLING_TIME {compensation.sampling_time!r} /* s */",
            "",
            "/* The range that was fitted. */",
            _c_array("gyro_compensation_low", (i.low for i in compensation.inputs)),
            _c_array("gyro_compensation_high", (i.high for i in compensation.inputs)),
            "",
            *_c_functions(compensation),
            "/* Compensates the mean rate at inputs x. Returns how many inputs lie beyond the fitted range; where any",
            f" * does, *compensated is {says}. */",
            "static inline int gyro_compensate(const double x[], double rate, double *compensated)",
            "{",
            "    double inside[GYRO_COMPENSATION_INPUTS];",
            "    int beyond = 0;",
            "    for (int i = 0; i < GYRO_COMPENSATION_INPUTS; i++) {",
            "        inside[i] = fmin(fmax(x[i], gyro_compensation_low[i]), gyro_compensation_high[i]);",
            "        /* Written so that a NaN counts as beyond. */",
            "        beyond += !(x[i] >= gyro_compensation_low[i] && x[i] <= gyro_compensation_high[i]);",
            "    }",
            f"{beyond}    *compensated = rate / gyro_scale_factor(inside) - gyro_bias(inside);",
            "    return beyond;",
            "}",
            "",
            field_form(compensation),
            "#endif",
            "",
        ]
    )


def _c_functions(compensation: Compensation) -> list[str]:
    both = (("gyro_scale_factor", compensation.scale), ("gyro_bias", compensation.bias))
    lines: list[str] = []
    if any(isinstance(f, Additive | Varying) for _, f in both):
        lines.append(PIECEWISE)
    for name, function in both:
        lines += _c_function(name, function, len(compensation.inputs))
    return lines


PIECEWISE: Final = """\
/* A piecewise polynomial: coefficients of (x - edge)^0 .. degree, a row a segment. */
static inline double gyro_piecewise(const double edges[], const double c[], int segments, int degree, double x)
{
    int k = 0;
    while (k < segments - 1 && x >= edges[k + 1])
        k++;
    const double *row = c + k * (degree + 1);
    double value = row[degree];
    for (int power = degree - 1; power >= 0; power--)
        value = value * (x - edges[k]) + row[power];
    return value;
}
"""


def _c_function(name: str, function: Function, inputs: int) -> list[str]:
    head = [f"static inline double {name}(const double x[])", "{"]
    if isinstance(function, Constant):
        return [*head, "    (void)x;", f"    return {function.value!r};", "}", ""]
    if isinstance(function, Additive):
        tables = [line for k, term in enumerate(function.terms) for line in _c_term(f"{name}_{k}", term)]
        calls = [
            f"gyro_piecewise({name}_{k}_edges, {name}_{k}, {segments}, {width - 1}, x[{k}])"
            for k, (segments, width) in enumerate(term.coefficients.shape for term in function.terms)
        ]
        return [*tables, *head, "    return " + "\n        + ".join(calls) + ";", "}", ""]
    if isinstance(function, Varying):
        return _c_varying(name, function, head)
    if isinstance(function, Network):
        return _c_network(name, function, inputs, head)
    raise InputError(f"{type(function).__name__}: no such function can be written")


def _c_varying(name: str, function: Varying, head: list[str]) -> list[str]:
    tables = [line for k, term in enumerate(function.terms) for line in _c_term(f"{name}_{k}", term)]
    calls = []
    for k, (term, centre) in enumerate(zip(function.terms, function.centres.tolist(), strict=True)):
        segments, width = term.coefficients.shape
        call = f"gyro_piecewise({name}_{k}_edges, {name}_{k}, {segments}, {width - 1}, x[0])"
        calls.append(call if k == 0 else f"{call} * (x[{k}] - ({centre!r}))")
    return [*tables, *head, "    return " + "\n        + ".join(calls) + ";", "}", ""]


def _c_term(name: str, term: Piecewise) -> list[str]:
    return [_c_array(f"{name}_edges", term.edges), _c_array(name, term.coefficients.ravel())]


def _c_network(name: str, function: Network, inputs: int, head: list[str]) -> list[str]:
    hidden = len(function.b1)
    return [
        _c_array(f"{name}_a1", function.a1.ravel()),
        _c_array(f"{name}_b1", function.b1),
        _c_array(f"{name}_a2", function.a2),
        _c_array(f"{name}_low", function.low),
        _c_array(f"{name}_high", function.high),
        *head,
        f"    double sum = {function.b2!r};",
        f"    for (int j = 0; j < {hidden}; j++) {{",
        f"        double net = {name}_b1[j];",
        f"        for (int i = 0; i < {inputs}; i++)",
        f"            net += {name}_a1[j * {inputs} + i]",
        f"                * (2 * (x[i] - {name}_low[i]) / ({name}_high[i] - {name}_low[i]) - 1);",
        f"        sum += {name}_a2[j] * tanh(net);",
        "    }",
        f"    return {function.shift!r} + {function.gain!r} * sum;",
        "}",
        "",
    ]


def _c_array(name: str, values: Iterable[float]) -> str:
    numbers = [repr(float(v)) for v in values]
    rows = [", ".join(numbers[k : k + 4]) for k in range(0, len(numbers), 4)]
    return f"static const double {name}[] = {{\n    " + ",\n    ".join(rows) + "};"


def _array(values: Floats) -> str:
    return "[" + ", ".join(repr(float(v)) for v in np.asarray(values)) + "]"


def _text(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _comment(text: str) -> str:
    return text.replace("*/", "* /")
