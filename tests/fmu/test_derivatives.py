"""Directional and adjoint derivatives against differences of the FMU's own rates and outputs."""

import ctypes as ct
from collections.abc import Sequence

import numpy as np
import pytest
from fmu_importer import ERROR, OK, Exchange, Fmu, Instance

START = {"x_start": 1e-6, "x_dot_start": 0.01, "y_start": -4e-7, "y_dot_start": -0.02}
INPUTS = {"u_x": 2e-6, "u_y": -1e-6, "omega_z": 40.0, "temperature": 320.0, "a_x": 5.0, "a_y": -3.0, "v_bias": 4.0}
# Everything that is smooth in states and inputs, at a size that shows.
BUSY = {
    **{"k3_x": 8e12, "k3_y": -3e12, "k2_x": 1e6, "d2_x": 8e5, "softening": 1e-3, "electrode_gap": 1e-5},
    **{"actuator_a2": 1e4, "actuator_a3": 1e10, "actuator_gain_mismatch": 0.1, "actuator_misalignment": 0.05},
    **{"angular_gain": 0.7, "frame_rotation": 1.0, "acceleration_gain_x": -1.0, "acceleration_gain_y": -0.5},
    **{"parasitic_coupling": 8.0, "feedthrough": 1e4, "pickoff_inverse_gap": 2e5, "pickoff_mismatch": 0.02},
    **{"pickoff_misalignment": 0.03, "pickoff_gain_mismatch": 0.1, "parasitic_ratio": 0.05, "charging_voltage": 2.0},
    **{
        "tck": 1e-3,
        "tcd": 1e-2,
        "tcg": 1e-3,
        "tcp": 1e-8,
        "tck_split": 1e-4,
        "thermal_force": 1.0,
        "sense_noise": 1e-4,
    },
    **{"amplifier_time_constant": 3e-6, "structure_lag": 3e-4, "circuit_lag": 1e-4},
    **{"damping_step_factor": 2.0, "damping_step_time": 0.0},
}
REMEMBERING = {"play": 3e-7, "thermal_hysteresis": 0.1, "relaxation": 1e-4, "relaxation_time": 1e-3, "turn_on": 0.01}
DEVICES = {"plain": {}, "busy": BUSY, "delay": BUSY | {"actuator_delay": 1e-5}, "no lag": BUSY | {"structure_lag": 0.0}}
DEVICES |= {"remembering": BUSY | REMEMBERING}
# Forces with corners, away from them: within the stops and beyond, soft ones and hard ones, slow and fast.
BENT = {
    **{"stop_stiffness": 30.0, "stop_gap": 6e-7, "stop_damping": 1e-5, "comb_fringe": 2e4, "k22": 5e12},
    **{"friction_x": 2e-7, "friction_y": 1e-7, "friction_speed": 0.02, "stribeck": 0.3, "stribeck_speed": 0.05},
    **{"hysteresis_x": 3e-7, "hysteresis_y": 2e-7, "hysteresis_n": 1.5, "hysteresis_length": 5e-7},
    **{"squeeze_x": 1e-6, "squeeze_y": 2e-6, "squeeze_gap": 8e-6, "ageing": 0.1, "ageing_time": 1e-5},
    **{"bias_walk": 0.1, "damping_step_factor": 2.0, "damping_step_time": 1.0, "k2_y": 1e6, "d2_y": 1e5},
}
HARD = {"stop_stiffness": 400.0, "stop_gap": 2e-7, "force_x": 1e-7, "tcp": 1e-3, "amplifier_time_constant": 1e-6}
REVERSED = {"x_start": -2e-6, "y_start": 3e-6, "x_dot_start": -0.08, "y_dot_start": 0.06, "circuit_lag": 0.0}
DEVICES |= {"bent and reversed": BENT | REVERSED, "hard and reversed": HARD | REVERSED | {"tcp": -1e-3}}
DEVICES |= {"bent": BENT, "bent and busy": BUSY | BENT, "hard": HARD | {"play": 5e-6, "thermal_hysteresis": 0.1}}
OUTPUTS = ("x", "y", "x_dot", "y_dot", "temperature_structure", "temperature_circuit")
SIZES = {"u_x": 1e-6, "u_y": 1e-6, "omega_z": 10.0, "temperature": 10.0, "a_x": 10.0, "a_y": 10.0, "v_bias": 3.0}
_UNIT_SIZES = {"1": 0.5, "m": 1e-6, "m/s": 0.02, "V": 1.0, "K": 10.0}


def derivative(
    gyro: Instance, name: str, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]
) -> list[float]:
    """What fmi2/3Get<name>Derivative gives; it must be allowed."""
    status, found = try_derivative(gyro, name, unknowns, knowns, seed)
    assert status == OK, gyro.log
    return found


def try_derivative(
    gyro: Instance, name: str, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]
) -> tuple[int, list[float]]:
    vr = {name: variable.valueReference for name, variable in gyro.fmu.variables.items()}
    lists = [(ct.c_uint32 * len(names))(*(vr[n] for n in names)) for names in (unknowns, knowns)]
    out = (ct.c_double * (len(unknowns) if name == "Directional" else len(knowns)))()
    seeds = (ct.c_double * len(seed))(*seed)
    sizes = (ct.c_size_t(len(unknowns)), ct.c_size_t(len(knowns)))
    heads = (lists[0], sizes[0], lists[1], sizes[1])
    if gyro.fmu.version == 2:
        status = gyro.call("GetDirectionalDerivative", *heads, seeds, out)
    else:
        tail = (seeds, ct.c_size_t(len(seed)), out, ct.c_size_t(len(out)))
        status = gyro.call(f"Get{name}Derivative", *heads, *tail)
    return status, list(out)


def exchange(fmu: Fmu, device: dict[str, float]) -> Exchange:
    """An instance in continuous-time mode, at states that all differ from rest."""
    gyro = Exchange(fmu)
    gyro.start(**{**START, **INPUTS, **device})
    gyro.update()
    assert gyro.call("EnterContinuousTimeMode") == OK
    states = gyro.array("GetContinuousStates")
    for i, (name, size) in enumerate(zip(gyro.states, sizes_of(gyro), strict=True)):
        states[i] += (0.3 + 0.1 * i) * size * (1.0 if not name.endswith("lagging") else -1.0)
    gyro.move(1.234e-6, states)
    return gyro


def sizes_of(gyro: Exchange) -> list[float]:
    return [_UNIT_SIZES[gyro.fmu.variables[name].unit or "1"] for name in gyro.states]


def shown(gyro: Exchange) -> np.ndarray:
    return np.array([*gyro.rates(), *gyro.get(*OUTPUTS)])


@pytest.mark.parametrize("device", DEVICES)
def test_directional_derivatives_are_those_of_differences(fmu: Fmu, device: str) -> None:
    # A turning frame and a delay let their inputs change in events only: differences can't be had there.
    own = dict(DEVICES[device])
    skipped = {"omega_z"} if "frame_rotation" in own else set()
    skipped |= {"u_x", "u_y"} if "actuator_delay" in own else set()
    with exchange(fmu, own) as gyro:
        knowns = [*INPUTS, *gyro.states]
        unknowns = [*(f"der({name})" for name in gyro.states), *OUTPUTS]
        columns = []
        for known in knowns:
            columns.append(derivative(gyro, "Directional", unknowns, [known], [1.0]))
        got = np.array(columns).T
        kept = [i for i, known in enumerate(knowns) if known not in skipped]
        wanted = np.zeros_like(got)
        wanted[:, kept] = differences(gyro, knowns, kept)
        sizes = np.array([*SIZES.values(), *sizes_of(gyro)])
        for row, name in enumerate(unknowns):
            scale = np.max(np.abs(got[row] * sizes)) or 1.0
            off = np.abs((got[row] - wanted[row]) * sizes)[kept]
            assert np.max(off) <= 1e-7 * scale, (name, [knowns[kept[i]] for i in np.argsort(-off)[:3]])
        # Along a direction, all at once.
        seed = np.cos(np.arange(len(knowns))) * sizes
        along = derivative(gyro, "Directional", unknowns, knowns, list(seed))
        assert along == pytest.approx(got @ seed, rel=1e-12, abs=1e-12 * np.max(np.abs(got @ seed)))


def differences(gyro: Exchange, knowns: list[str], kept: list[int]) -> np.ndarray:
    """Columns ``kept`` of the Jacobian of rates and outputs by ``knowns``: central differences of fourth order."""
    states, columns = gyro.array("GetContinuousStates"), []
    sizes = [*SIZES.values(), *sizes_of(gyro)]

    def moved(index: int, step: float) -> np.ndarray:
        name = knowns[index]
        if name in INPUTS:
            gyro.set(**{name: INPUTS[name] + step})
            result = shown(gyro)
            gyro.set(**{name: INPUTS[name]})
            return result
        own = list(states)
        own[index - len(INPUTS)] += step
        gyro.move(1.234e-6, own)
        result = shown(gyro)
        gyro.move(1.234e-6, states)
        return result

    for index in kept:
        h = 2e-3 * sizes[index]
        near, far = (moved(index, f * h) - moved(index, -f * h) for f in (1, 2))
        columns.append((8 * near - far) / (12 * h))
    return np.array(columns).T


def test_turning_rate_of_a_frame_by_hand(fmu: Fmu) -> None:
    device = {"frame_rotation": 1.0, "angular_gain": 0.7}
    with exchange(fmu, device) as gyro:
        state = dict(zip(gyro.states, gyro.array("GetContinuousStates"), strict=True))
        found = derivative(gyro, "Directional", ["der(x_dot)", "der(y_dot)"], ["omega_z"], [1.0])
        rate = INPUTS["omega_z"]
        wanted = [2 * 0.7 * state["y_dot"] + 2 * rate * state["x"], -2 * 0.7 * state["x_dot"] + 2 * rate * state["y"]]
        assert found == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("device", DEVICES)
def test_adjoint_derivatives_are_the_transpose(fmus: dict[int, Fmu], device: str) -> None:
    with exchange(fmus[3], DEVICES[device]) as gyro:
        knowns = [*INPUTS, *gyro.states]
        unknowns = [*(f"der({name})" for name in gyro.states), *OUTPUTS]
        jacobian = np.array([derivative(gyro, "Directional", unknowns, [known], [1.0]) for known in knowns]).T
        seed = np.sin(1 + np.arange(len(unknowns)))
        wanted = seed @ jacobian
        assert derivative(gyro, "Adjoint", unknowns, knowns, list(seed)) == pytest.approx(wanted, rel=1e-12)


def test_derivatives_in_co_simulation(fmu: Fmu) -> None:
    # At a communication point off the grid of integration and samples.
    with Instance(fmu) as gyro:
        gyro.start(**{**START, **INPUTS, "k3_x": 8e12})
        assert gyro.step(0.0, 1.23e-5) == OK
        [x] = gyro.get("x")
        [slope] = derivative(gyro, "Directional", ["der(x_dot)"], ["x"], [1.0])
        assert slope == pytest.approx(-(63.955 + 3 * 8e12 * x**2) / 1.8e-7, rel=1e-12)
        assert derivative(gyro, "Directional", ["der(x_dot)"], ["u_x"], [1.0]) == pytest.approx([1 / 1.8e-7], rel=1e-12)
        first = gyro.get("der(x_dot)", "x", "x_dot")
        assert gyro.step(1.23e-5, 1e-5) == OK
        with Instance(fmu) as other:
            other.start(**{**START, **INPUTS, "k3_x": 8e12})
            assert other.step(0.0, 1.23e-5) == OK and other.step(1.23e-5, 1e-5) == OK
            assert gyro.get("x", "v_x") == other.get("x", "v_x"), "a look leaves no trace"
        assert first[0] != gyro.get("der(x_dot)")[0]


@pytest.mark.parametrize("missing", range(4))
def test_derivatives_without_an_array_are_refused(fmu: Fmu, missing: int) -> None:
    with exchange(fmu, {}) as gyro:
        n = ct.c_size_t(1)
        rate, state = (ct.c_uint32(gyro.fmu.variables[name].valueReference) for name in ("der(x)", "x_dot"))
        arrays = [ct.byref(rate), ct.byref(state), (ct.c_double * 1)(1.0), (ct.c_double * 1)()]
        arrays[missing] = None
        counts = (n,) if fmu.version == 3 else ()
        arguments = (arrays[0], n, arrays[1], n, arrays[2], *counts, arrays[3], *counts)
        for name in ("Directional", "Adjoint")[: fmu.version - 1]:
            assert gyro.call(f"Get{name}Derivative", *arguments) == ERROR
            assert "1 seeds" in gyro.message


def test_what_has_no_derivative(fmu: Fmu) -> None:
    with exchange(fmu, {}) as gyro:
        assert try_derivative(gyro, "Directional", ["v_x"], ["x"], [1.0])[0] == ERROR
        assert "neither the rate of a state nor a continuous output" in gyro.message
        assert try_derivative(gyro, "Directional", ["der(x)"], ["k3_x"], [1.0])[0] == ERROR
        assert "neither an input nor a continuous state" in gyro.message
        if fmu.version == 3:
            assert try_derivative(gyro, "Directional", ["der(x)"], ["x_dot"], [1.0, 2.0])[0] == ERROR
            assert "1 seeds" in gyro.message
