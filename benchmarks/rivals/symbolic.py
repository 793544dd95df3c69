"""Symbolic regression by genetic programming (gplearn) on what the linear device leaves of the accelerations."""

import importlib
from pathlib import Path
from typing import Any, Final

import numpy as np
from sympy import Abs, Add, Expr, Mul, expand, lambdify, sympify

from benchmarks.rivals.naming import LINEAR, Term, answer
from benchmarks.rivals.record import SIGNALS, Run, read
from gyro_model.errors import InputError
from gyro_model.symbols import BY_NAME

POPULATION, GENERATIONS, SAMPLES = 1000, 20, 2000
STATES: Final = SIGNALS[:6]
FUNCTIONS: Final = {"add": Add, "sub": lambda a, b: a - b, "mul": Mul, "abs": Abs}
PARSIMONY: Final = 5e-3
"""Price of a node, of the fitness, which is a correlation."""
LINEAR_LEFT: Final = 1e-9
"""Norm a sample below which nothing but rounding is left of a program on signals of rms 1."""
NEAR: Final = 1.01
"""A formula has to bring the held-out run's error below that of the linear device by this factor."""
SMALL: Final = 0.05
"""A term whose rms is less than this share of the largest one's is no part of the answer."""


def diagnosis(data: Path) -> dict[str, Any]:
    """What the regression says of the trial in the folder ``data``. Raises InputError where gplearn is missing."""
    record = read(data)
    fitted, held_out = (_stacked(runs, record.units) for runs in (record.fitted, record.held_out))
    terms: dict[Term, float] = {}
    for axis in (0, 1):
        target, target_out = fitted.acceleration[:, axis], held_out.acceleration[:, axis]
        program = _evolved(fitted.z, target)
        with_program, alone = (
            np.linalg.lstsq(_columns(fitted.z, *own), target, rcond=None)[0] for own in ([program], [])
        )
        error = np.linalg.norm(target_out - _columns(held_out.z, program) @ with_program)
        if NEAR * error <= np.linalg.norm(target_out - _columns(held_out.z) @ alone):
            for product, coefficient in _terms(str(program), fitted.z, record.units).items():
                terms[product, axis] = float(with_program[-1]) * coefficient
    return answer(terms)


def _stacked(runs: tuple[Run, ...], units: np.ndarray) -> Run:
    """All runs as one, signals in ``units``."""
    t, z, acceleration = (np.concatenate(part) for part in zip(*runs, strict=True))
    return Run(t, z / units, acceleration)


def _columns(z: np.ndarray, *programs: Any) -> np.ndarray:
    """The columns of the linear device, and one more of each program."""
    linear = lambdify([BY_NAME[name] for name in SIGNALS], LINEAR, "numpy")(*z.T)
    more = [np.broadcast_to(program.execute(z[:, : len(STATES)]), len(z)) for program in programs]
    return np.column_stack([*linear, *more])


def _evolved(z: np.ndarray, acceleration: np.ndarray) -> Any:
    """The program that explains most of what the linear device leaves, from SAMPLES of the fitted runs.

    Its fitness is the correlation with what is left, after all that the linear device could imitate is taken from
    both: the size of a program and its linear part need not evolve.
    """
    chosen = np.random.default_rng(0).choice(len(z), min(SAMPLES, len(z)), replace=False)
    basis = np.linalg.qr(_columns(z[chosen]))[0]
    left = _without(acceleration[chosen], basis)

    def fitness(y: np.ndarray, guess: np.ndarray, _weight: np.ndarray) -> float:
        if len(guess) != len(basis):
            return 0.0  # gplearn first tries a fitness on two samples
        rest = _without(guess, basis)
        # A linear program leaves rounding alone.
        length = float(np.linalg.norm(rest))
        return abs(float(y @ rest)) / (length * float(np.linalg.norm(y))) if length > LINEAR_LEFT * len(y) else 0.0

    genetic = _gplearn("genetic")
    regressor = genetic.SymbolicRegressor(
        population_size=POPULATION, generations=GENERATIONS, function_set=tuple(FUNCTIONS),
        metric=_gplearn("fitness").make_fitness(function=fitness, greater_is_better=True, wrap=False),
        parsimony_coefficient=PARSIMONY, stopping_criteria=1.0, feature_names=list(STATES), random_state=0,
    )  # fmt: skip
    # The private name is the one by which gplearn's documentation prints the winner.
    return regressor.fit(z[chosen][:, : len(STATES)], left)._program


def _without(signal: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """The signal without its part in the span of an orthonormal basis."""
    rest: np.ndarray = signal - basis @ (basis.T @ signal)
    return rest


def _terms(program: str, z: np.ndarray, units: np.ndarray) -> dict[Expr, float]:
    """The products in a program's text that are not SMALL, with their coefficients in SI; linear ones are left out,
    since they are the linear device's."""
    names = {name: BY_NAME[name] for name in STATES}
    formula = expand(sympify(program, locals={**names, **FUNCTIONS}))
    scale = {BY_NAME[name]: float(unit) for name, unit in zip(SIGNALS, units, strict=True)}
    found: dict[Expr, tuple[float, float]] = {}
    for term in formula.as_ordered_terms():
        coefficient, product = term.as_coeff_Mul()
        values = np.broadcast_to(lambdify(list(names.values()), product, "numpy")(*z[:, : len(STATES)].T), len(z))
        rms = abs(float(coefficient)) * float(np.sqrt(np.mean(values**2)))
        if product not in LINEAR:
            found[product] = rms, float(coefficient) / float(product.subs(scale, simultaneous=True))
    largest = max((rms for rms, _ in found.values()), default=0.0)
    return {product: coefficient for product, (rms, coefficient) in found.items() if rms > SMALL * largest}


def _gplearn(module: str) -> Any:
    try:
        return importlib.import_module(f"gplearn.{module}")
    except ImportError:
        raise InputError("the rivals need gplearn: pip install 'gyrotwin[rivals]'") from None
