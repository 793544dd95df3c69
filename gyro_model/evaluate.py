"""Numbers from the expressions of an effect, without the FMU: for the reference simulation, the tests and true values
in reports."""

from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np
from sympy import Expr, Symbol, lambdify

from gyro_model.anatomy import Effect

_NUMPY: list[Any] = [{"nearest_integer": np.rint}, "numpy"]


@cache
def compiled(expr: Expr, arguments: tuple[Symbol, ...]) -> Callable[..., Any]:
    """``expr`` as a numpy function of ``arguments``, in their order."""
    return lambdify(arguments, expr, modules=_NUMPY)


def evaluate(effect: Effect, values: Mapping[str, Any], terms: Mapping[str, Expr] | None = None) -> dict[str, Any]:
    """The terms of ``effect``, or those given, at ``values`` by symbol name, SI, numbers or arrays that broadcast.
    Raises KeyError for a missing value."""
    result = {}
    for name, expr in (effect.terms() if terms is None else terms).items():
        arguments = tuple(sorted(expr.free_symbols, key=lambda symbol: symbol.name))
        result[name] = compiled(expr, arguments)(*(values[symbol.name] for symbol in arguments))
    return result
