"""The composed equations: Jacobians and sensitivities against central differences."""

from collections.abc import Callable

import numpy as np
import pytest
from sympy import Symbol

from gyro_model.anatomy import Force
from gyro_model.device import Device
from gyro_model.dynamics import Dynamics, normals_of
from gyro_model.effect_points import MODEL
from gyro_model.errors import InputError
from gyro_model.evaluate import compiled
from gyro_model.reference import sensitivities, simulate

Residual = Callable[[str, float, float], None]

FORCES = tuple(e.id for e in MODEL.effects if isinstance(e, Force) and not e.noise and not e.nominal)
OWN = {"k3_x": 5e12, "k3_y": -2e12, "d2_x": 5e5, "d2_y": 1e5, "parasitic_coupling": 5.0, "k2_x": 1e6, "softening": 0.02}
VALUES = {q.name: q.start for q in MODEL.quantities} | OWN | {
    "x": 1e-6, "x_dot": 2e-2, "y": -7e-7, "y_dot": -1e-2, "parasitic": 2e-7, "parasitic_dot": 3e-3,
    "hysteresis_z_x": 0.2, "hysteresis_z_y": -0.3,
    "u_x": 1e-5, "u_y": -2e-5, "omega_z": 5.0, "v_bias": 9.0, "a_x": 1.0, "a_y": 2.0, "angular_gain": 0.9, "t": 0.1,
}  # fmt: skip


def numbers(exprs, values: dict[str, float]) -> np.ndarray:
    names = sorted({symbol for expr in exprs for symbol in expr.free_symbols}, key=str)
    return np.array([float(compiled(expr, tuple(names))(*(values[s.name] for s in names))) for expr in exprs])


def differences(exprs, name: str, step: float) -> np.ndarray:
    above, below = (numbers(exprs, VALUES | {name: VALUES[name] + sign * step}) for sign in (1, -1))
    return (above - below) / (2 * step)


def test_state_jacobian(residual: Residual) -> None:
    dynamics = Dynamics(FORCES)
    jacobian = numbers(dynamics.state_jacobian(), VALUES).reshape(len(dynamics.states), -1)
    for column, state in enumerate(dynamics.states):
        step = 1e-3 * abs(VALUES[state.name])
        found = differences(dynamics.rates, state.name, step)
        # Central differences of a rate of 1e4 m/s² round 1e-16 of it over the step, 1e-9 m: 1e-3 1/s²,
        # beside 4e8 1/s².
        scale = np.max(np.abs(jacobian[:, column]))
        # Curvature: the cubic term's third derivative times step²/6, 1e-6 of its slope.
        residual(state.name, np.max(np.abs(found - jacobian[:, column])) / scale, 1e-7)


@pytest.mark.parametrize("name", ["kxx", "kxy", "dyy", "m", "k3_x", "parasitic_frequency", "softening", "angular_gain"])
def test_parameter_jacobian(name: str, residual: Residual) -> None:
    dynamics = Dynamics(FORCES)
    column = numbers(dynamics.parameter_jacobian([name]), VALUES)
    found = differences(dynamics.rates, name, 1e-4 * VALUES[name])
    # Rates are at most quadratic in a parameter, but for 1/m: a third derivative of 6/m⁴ times (1e-4 m)²/6, 1e-8.
    # Rounding: 1e-16 of the whole rate, up to 1e4 times what the parameter makes, over 1e-4.
    residual(name, np.max(np.abs(found - column)) / np.max(np.abs(column)), 1e-7)


def test_laws_reach_the_jacobian() -> None:
    plain, stepped = (Dynamics(acting).state_jacobian()[1, 1] for acting in ((), ("damping_step",)))
    after, factor, dxx = (
        Symbol("after_damping_step", real=True),
        Symbol("damping_step_factor", real=True),
        Symbol("dxx", real=True),
    )
    assert stepped.subs({after: 1}).equals(plain.subs({dxx: dxx * factor}))
    assert stepped.subs({after: 0}).equals(plain)


def test_two_noises_draw_from_two_streams() -> None:
    noisy = Dynamics(("thermal_force", "sense_noise"))
    assert set(normals_of("thermal_force")) <= set().union(*(rate.free_symbols for rate in noisy.rates))
    assert set(normals_of("sense_noise")) <= set().union(*(v.free_symbols for v in noisy.sample))
    assert not set(normals_of("thermal_force")) & set(normals_of("sense_noise"))


def test_sensitivities(residual: Residual) -> None:
    names = ("m", "kxx", "kxy", "dxx", "dxy", "k3_x", "parasitic_coupling")
    device = Device("d", {"x_start": 1e-6, "k3_x": 5e12, "parasitic_coupling": 5.0, "parasitic_frequency": 4100.0})
    t = np.arange(41) * 5e-6
    inputs = {"u_y": 2e-5 * np.sin(2 * np.pi * 3000 * t), "omega_z": np.full(41, 10.0)}
    found = sensitivities(device, names, t, inputs)
    states = ("x", "x_dot", "y", "y_dot", "parasitic", "parasitic_dot")
    for index, name in enumerate(names):
        step = 1e-4 * device.all_parameters[name]
        above, below = (
            simulate(device.with_parameters({name: device.all_parameters[name] + sign * step}), t, inputs)
            for sign in (1, -1)
        )
        for row, state in enumerate(states):
            wanted = (above[state] - below[state]) / (2 * step)
            # A change of 1e-4 turns the phase by 2e-4 rad in a period of 4 rad: differences are good to its
            # square, 4e-8. The dampings move the state by 1e-4 · 2e-3 of it, against which the 1e-12 of the
            # reference is 5e-6.
            residual(f"{state} by {name}", np.max(np.abs(found[:, row, index] - wanted)) / np.max(np.abs(wanted)), 1e-5)


def test_sensitivities_refuse_what_they_leave_out() -> None:
    t = np.arange(3) * 5e-6
    left_out = {"actuator_delay": "actuator_delay", "tcp": "amplifier_bandwidth", "frame_rotation": "frame_rotation"}
    for name, effect in left_out.items():
        with pytest.raises(InputError, match=f"sensitivities: {effect} not covered; switch off first"):
            sensitivities(Device("d", {name: 1e-6}), ("m",), t, {})


@pytest.mark.parametrize("inputs", [{"force": np.zeros(3)}, {"u_x": np.zeros(2)}])
def test_reference_refuses_inputs_that_do_not_fit(inputs: dict[str, np.ndarray]) -> None:
    with pytest.raises(InputError, match="give a known input with one value a sample"):
        simulate(Device("d", {}), np.arange(3) * 5e-6, inputs)


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match="effect 'cubic_stifness' is unknown; did you mean 'cubic_stiffness'"):
        Dynamics(("cubic_stifness",))
    with pytest.raises(InputError, match="parameter 'kxxx' is unknown"):
        Dynamics().parameter_jacobian(["kxxx"])
