"""Effects of a user's own in the envelope form: a curved force across the axes, and what can't be followed."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from envelope_device import W_X, Complexes, matrices, rate_device, settled
from gyro_runner import Runner
from scipy.optimize import fsolve
from sympy import Symbol

from gyro_model.anatomy import Force, Limit, Pair, State
from gyro_model.build import build
from gyro_model.effect_points import MODEL
from gyro_model.envelope import envelope_model
from gyro_model.generate_envelope import envelope
from gyro_model.model import Model
from gyro_model.quantities import size
from gyro_model.symbols import x, y

Residual = Callable[[str, float, float], None]
C = size("k_across", "N/m3", "stiffness across the axes")


def with_force(force: Pair, *states: State) -> Model:
    effect = Force(
        id="crossed",
        parameters=(C,),
        force=force,
        states=states,
        energy=None,
        signature="",
        host_experiment="",
        limits=(Limit(why="none", at={}, gives={}),),
        doc="A force of the tests.",
    )
    return Model((*MODEL.effects, effect))


def test_curved_force_across_the_axes(tmp_path: Path, residual: Residual) -> None:
    # Of the energy c x² y²/2.
    model = envelope_model(with_force((-C.symbol * x * y**2, -C.symbol * x**2 * y)))
    plant = Runner(build(model, tmp_path).fmi3, tmp_path / "extracted")
    p = rate_device(300.0) | {"k_across": 5e9}
    force = np.array([1j * p["dxx"] * W_X * 5e-6, 1e-6 + 2e-6j])
    mass, damping, stiffness = matrices(p)
    dynamic = stiffness - W_X**2 * mass + 1j * W_X * damping

    def balance(parts: Complexes) -> list[float]:
        # First harmonics of x y² and x² y.
        a, b = complex(*parts[:2]) * 1e-6, complex(*parts[2:]) * 1e-6
        pull = np.array(
            [0.5 * abs(b) ** 2 * a + 0.25 * b**2 * a.conjugate(), 0.5 * abs(a) ** 2 * b + 0.25 * a**2 * b.conjugate()]
        )
        rest = (dynamic @ [a, b] + p["k_across"] * pull - force) / abs(force[0])
        return [*rest.real, *rest.imag]

    straight = np.linalg.solve(dynamic, force) * 1e6
    parts = fsolve(balance, [straight[0].real, straight[0].imag, straight[1].real, straight[1].imag], xtol=1e-13)
    wanted = np.array([complex(*parts[:2]), complex(*parts[2:])]) * 1e-6
    assert np.max(np.abs(wanted / (straight * 1e-6) - 1)) > 0.01, "large enough to be seen"
    # What the balance leaves out: a third harmonic of c A²/(32 k) of y, which pulls by c A²/4 of that against w d.
    pull = p["k_across"] * 25e-12
    left_out = pull / (32 * p["kyy"]) * pull / 4 / (W_X * p["dxx"])
    residual("x and y", np.max(np.abs(settled(plant, p, force)[2:] / wanted - 1)), 2 * left_out)


def test_curved_force_with_states_is_refused() -> None:
    q = Symbol("own_state", real=True)
    model = with_force((-C.symbol * x * q, 0), State(q, "m", "follows x", rate=(x - q) * 1000))
    # By name, where it acts: the FMU builds all the same.
    assert 'refused = "crossed";' in envelope(envelope_model(model))
