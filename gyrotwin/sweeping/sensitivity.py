"""Which parameter costs most: Sobol' indices (Saltelli 2010) and Morris' elementary effects, by SALib."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gyro_model.errors import InputError

Floats = NDArray[np.float64]


class Index(NamedTuple):
    """Of a parameter: share of the output's variance by itself (``first``) and with all it acts together with
    (``total``), each with the half-width of its 95 % interval; for Morris mean absolute effect and its half-width, and
    the spread of the effects."""

    parameter: str
    first: float
    first_reach: float
    total: float
    total_reach: float


def _library() -> Any:
    try:
        import SALib
    except ImportError:
        raise InputError('sensitivity: needs SALib; install it by `pip install "gyrotwin[sweep]"`') from None
    return SALib


def _problem(names: Sequence[str]) -> dict[str, Any]:
    return {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}


def design(method: str, names: Sequence[str], count: int, seed: int) -> Floats:
    """Points in the unit cube, (rows, names): Saltelli's with base ``count``, or ``count`` Morris trajectories."""
    _library()
    from SALib.sample import morris, sobol

    problem = _problem(names)
    if method == "saltelli":
        return np.asarray(sobol.sample(problem, count, calc_second_order=False, seed=seed))
    return np.asarray(morris.sample(problem, count, num_levels=4, seed=seed))


def indices(method: str, names: Sequence[str], unit: Floats, output: Floats, seed: int) -> list[Index]:
    """The indices of ``output``, (rows,), at the points ``unit`` of ``design``."""
    _library()
    from SALib.analyze import morris, sobol

    problem = _problem(names)
    if method == "saltelli":
        found = sobol.analyze(problem, output, calc_second_order=False, seed=seed, print_to_console=False)
        columns = [found[key] for key in ("S1", "S1_conf", "ST", "ST_conf")]
    else:
        found = morris.analyze(problem, unit, output, num_levels=4, seed=seed, print_to_console=False)
        columns = [found[key] for key in ("mu_star", "mu_star_conf", "sigma")]
        columns.append(np.zeros(len(names)))
    return [Index(name, *map(float, row)) for name, *row in zip(names, *columns, strict=True)]
