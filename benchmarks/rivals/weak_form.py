"""Sparse regression in weak form with the diagnosis' own library: pysindy's ``WeakPDELibrary`` (Messenger and Bortz,
Multiscale Modeling & Simulation 19, 2021) and its forward selection FROLS.

Of pysindy's optimizers FROLS does best here: STLSQ, which cuts small coefficients of a fit of all columns at once,
keeps tens of the 170 nearly parallel products or none.
"""

import importlib
from pathlib import Path
from typing import Any, Final

import numpy as np
from sympy import lambdify

from benchmarks.rivals.naming import LINEAR, Term, answer, products
from benchmarks.rivals.record import SIGNALS, Run, read
from gyro_model.errors import InputError
from gyro_model.symbols import BY_NAME

HALF_WIDTH: Final = 2.4e-4
"""Of the test functions [s]: over longer ones the motion integrates to nothing, over shorter ones noise is left."""
DOMAINS: Final = 1000
"""Test functions a run, at random places."""
TERMS: Final = 20
"""At most so many in an equation, those of the linear device among them."""
NEAR: Final = 1.01
"""Of all models within this of the least error on the held-out run the one with the fewest terms is taken."""


def diagnosis(data: Path) -> dict[str, Any]:
    """What the regression says of the trial in the folder ``data``. Raises InputError where pysindy is missing."""
    record = read(data)
    (columns, target), (columns_out, target_out) = (
        [np.concatenate(part) for part in zip(*(_weak(run, record.units) for run in runs), strict=True)]
        for runs in (record.fitted, record.held_out)
    )
    length = np.sqrt(np.mean(columns**2, axis=0))
    # Where the frame does not turn, the columns with its rate are nothing.
    use = np.flatnonzero(length > 0)
    size = np.sqrt(np.mean(target**2, axis=0))
    paths = _paths(columns[:, use] / length[use], target / size)
    errors = np.linalg.norm(paths @ (columns_out[:, use] / length[use]).T - (target_out / size).T, axis=2)
    everything = (*LINEAR, *products())
    units = {BY_NAME[name]: unit for name, unit in zip(SIGNALS, record.units, strict=True)}
    terms: dict[Term, float] = {}
    for axis in (0, 1):
        fewest = int(np.argmax(errors[:, axis] <= NEAR * errors[:, axis].min()))
        for place in np.flatnonzero(paths[fewest, axis]):
            product, column = everything[use[place]], use[place]
            if column >= len(LINEAR):
                unit = float(product.subs(units, simultaneous=True))
                terms[product, axis] = float(paths[fewest, axis, place] * size[axis] / length[column] / unit)
    return answer(terms)


def _paths(columns: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Coefficients (models, 2, columns) with one term more in each model."""
    optimizer = _pysindy().FROLS(max_iter=TERMS, alpha=1e-12, normalize_columns=False)
    optimizer.fit(columns, target)
    return np.array(optimizer.history_)


def _weak(run: Run, units: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """All columns (DOMAINS, columns), signals in ``units``, and the accelerations (DOMAINS, 2), integrated over the
    test functions."""
    pysindy = _pysindy()
    np.random.seed(0)  # pysindy places its test functions by numpy's global generator
    signals = [BY_NAME[name] for name in SIGNALS]
    everything = (*LINEAR, *products())
    library = pysindy.WeakPDELibrary(
        function_library=pysindy.CustomLibrary(
            library_functions=[lambdify(signals, expression, "numpy") for expression in everything],
            function_names=[lambda *_, text=str(expression): text for expression in everything],
        ),
        spatiotemporal_grid=run.t, K=DOMAINS, H_xt=[HALF_WIDTH], derivative_order=0, include_bias=False,
    )  # fmt: skip
    z = run.z / units
    library.fit([z])
    velocities = [SIGNALS.index(name) for name in ("x_dot", "y_dot")]
    integrals = np.asarray(library.convert_u_dot_integral(z))[:, velocities] * units[velocities]
    return np.asarray(library.transform([z])[0]), integrals


def _pysindy() -> Any:
    try:
        return importlib.import_module("pysindy")
    except ImportError:
        raise InputError("the rivals need pysindy: pip install 'gyrotwin[rivals]'") from None
