"""Designs: what a file says is what the loop gets, to the bit, and nothing else of the device."""

import ctypes
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plant import PERIOD, device_with
from runs import run_of

from cosim.controllers.foucault import CONTROLLER
from cosim.design import SIGMAS, load_design, packaged_designs
from cosim.layout import PARAMETER_NAMES
from cosim.monitor import Monitor
from cosim.observers.ekf import OBSERVER
from cosim.observers.lyapunov import OBSERVER as LYAPUNOV
from cosim.running import begin_controller, begin_observer, prior
from gyro_model.device import write_device
from gyro_model.errors import InputError

SEEDS = st.integers(0, 2**31 - 1)


def written(folder: Path, text: str) -> str:
    path = folder / "mine.toml"
    path.write_text('format = 1\nname = "mine"\n' + text)
    return str(path)


@settings(max_examples=30)
@given(SEEDS)
def test_first_estimates_are_10_to_50_percent_off_and_follow_the_seed(seed: int) -> None:
    device = device_with()
    design, again = load_design("plain", device, seed), load_design("plain", device, seed)
    off = np.array([design.values[name] / device.all_parameters[name] - 1 for name in PARAMETER_NAMES])
    # Rounding of a product and a quotient.
    assert ((np.abs(off) >= 0.1 - 1e-15) & (np.abs(off) <= 0.5 + 1e-15)).all()
    assert design.values == again.values
    other = seed - 1 if seed else 1
    assert design.values != load_design("plain", device, other).values


@pytest.mark.parametrize("name", sorted(packaged_designs()))
def test_a_written_design_reads_back(name: str, tmp_path: Path) -> None:
    device = device_with()
    design = load_design(name, device, 5)
    design.write(tmp_path / "design.toml")
    again = load_design(str(tmp_path / "design.toml"), device_with(m=2e-7, kxx=70.0), 6)
    assert again.name == design.name
    assert dict(again.values) == dict(design.values)
    assert dict(again.controller) == dict(design.controller)
    assert dict(again.monitor) == dict(design.monitor)
    assert again.known_model.acting == design.known_model.acting
    assert again.known_model.estimated == design.known_model.estimated
    for key, deviation in design.deviations.items():
        # An interval about a value rounds by 1e-16 of the larger of both.
        size = max(abs(design.values[key]), deviation)
        assert again.deviations[key] == pytest.approx(deviation, rel=1e-15, abs=4e-16 * size)


def test_lab_fits_its_intervals_to_the_start_and_the_stiffness() -> None:
    small, reference = (load_design("lab", device_with(x_start=x), 1) for x in (0.5e-6, 1e-6))
    # Halving the start doubles 1/g and quadruples k3; nothing else moves. Products round.
    ratio = {name: small.deviations[name] / reference.deviations[name] for name in reference.deviations}
    expected = {name: 1.0 for name in ratio} | {"pickoff_inverse_gap": 2.0, "k3_x": 4.0, "k3_y": 4.0}
    assert ratio == pytest.approx(expected, rel=1e-14)
    factor = reference.values["kxx"] / 63.955
    assert reference.deviations["k3_x"] == pytest.approx(2e10 * factor / SIGMAS, rel=1e-14)
    assert reference.deviations["actuator_delay"] == pytest.approx(5e-6 / SIGMAS, rel=1e-14)
    assert reference.values["actuator_delay"] == 2.5e-6


def test_known_uncertain_and_absent(tmp_path: Path) -> None:
    text = "[parameters]\nactuator_delay = 2e-6\nk3_x = 1e9\n[intervals]\nk3_x = [0.0, 3e9]\nkxx = [60.0, 70.0]\n"
    # What the device has besides is not the design's.
    design = load_design(written(tmp_path, text), device_with(feedthrough=8.0, angular_gain=0.8), 1)
    assert design.values["actuator_delay"] == 2e-6 and "actuator_delay" not in design.deviations
    assert design.values["k3_x"] == 1e9
    assert design.values["kxx"] == 65.0
    assert design.deviations["kxx"] == pytest.approx(10.0 / SIGMAS)
    assert design.all_values["feedthrough"] == 0.0
    assert design.all_values["angular_gain"] == 1.0
    assert set(design.known_model.acting) == {"actuator_delay", "cubic_stiffness", "sense_noise"}
    assert design.known_model.estimated == ("k3_x",)


WRONG = {
    "table": ("[parameter]\nkxx = 1\n", "'parameter'"),
    "name": ("[parameters]\nkx = 1.0\n", "did you mean 'kxy'"),
    "interval's name": ("[intervals]\nk3_z = [0.0, 1.0]\n", "did you mean 'k3_"),
    "no interval": ("[intervals]\nk3_x = 1.0\n", r"give \[low, high\]"),
    "turned round": ("[intervals]\nk3_x = [2.0, 1.0]\n", r"give \[low, high\]"),
    "not finite": ("[intervals]\nk3_x = [0.0, inf]\n", r"give \[low, high\]"),
    "out of bounds": ("[parameters]\nactuator_delay = -1e-6\n", "actuator_delay"),
    "gauge": ("[intervals]\nsense_gain_x = [0.9e6, 1.1e6]\n", "pickoff_gain_mismatch or a value"),
    "start": ("[intervals]\nx_start = [0.9e-6, 1.1e-6]\n", "or its start"),
    "start of an effect": ("[parameters]\nparasitic_start = 1e-7\n", "parasitic_start: no loop knows"),
    "and its interval": ("[intervals]\nparasitic_dot_start = [0.0, 1e-3]\n", "parasitic_dot_start: no loop knows"),
    "nothing that acts": ("[intervals]\nelectrode_gap = [1e-5, 2e-5]\n", "no acting effect has it"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_design_is_refused_by_name(case: str, tmp_path: Path) -> None:
    text, expected = WRONG[case]
    with pytest.raises(InputError, match=expected):
        load_design(written(tmp_path, text), device_with(), 1)


@pytest.mark.parametrize("name", ["angular_gain", "sense_noise", "adc_limit", "damping_step_time"])
def test_what_the_loop_cannot_find_it_takes_as_known(name: str, tmp_path: Path) -> None:
    design = load_design(written(tmp_path, f"[intervals]\n{name} = [0.7, 0.9]\n"), device_with(), 1)
    assert design.all_values[name] == pytest.approx(0.8)
    assert name not in design.deviations


def test_a_design_that_is_not_there_is_refused() -> None:
    with pytest.raises(InputError, match="'lab'"):
        load_design("labb", device_with(), 1)


def received(run) -> list[bytes]:
    """All that observer, controller, monitor and angle unit have before the first sample, as bytes."""
    got = []
    for observer in (OBSERVER, LYAPUNOV):
        lib, part = begin_observer(observer, run.design, PERIOD, {})
        controller = begin_controller(CONTROLLER, run.design, lib, PERIOD, run.controller_settings())
        monitor = Monitor(observer, run.design, lib, part, PERIOD, run.monitor_settings())
        got += [repr(monitor.settings).encode(), *(array.tobytes() for array in prior(run.design, lib))]
        # The wrapper of a part in numba holds its address, which says nothing of the device.
        memories = [part.memory] if observer is OBSERVER else [inner.memory for inner in part.kept]
        got += [memory.tobytes() for memory in (*memories, controller.memory)]
        got.append(lib.known.fingerprint().encode())
    return [*got, repr((run.design.all_values["angular_gain"], run.design.oscillation_hz)).encode()]


@pytest.mark.parametrize("name", ["plain", "lab"])
def test_nothing_but_the_design_reaches_the_loop(name: str, tmp_path: Path) -> None:
    first = load_design(name, device_with(), 3)
    first.write(tmp_path / "design.toml")
    expected = received(run_of(design=str(tmp_path / "design.toml"), seed=3))
    assert len(expected[0]) > 0
    model = device_with().model
    rng = np.random.default_rng(1)
    changeable = [
        q
        for q in model.quantities
        if q.role in ("parameter", "size", "shape", "start") and not q.integer and "step" not in q.name
    ]
    assert len(changeable) > 50
    for quantity in changeable:
        value = quantity.start * rng.uniform(1.01, 1.1) if quantity.start else 1e-9
        value = min(max(value, quantity.low), quantity.high)
        if quantity.name in ("sample_period",):
            continue
        device = device_with(**{quantity.name: value})
        write_device(device, tmp_path / "device.toml")
        run = run_of(design=str(tmp_path / "design.toml"), device=str(tmp_path / "device.toml"), seed=3)
        if quantity.name in PARAMETER_NAMES:
            assert received(run) == expected, quantity.name
        else:
            # The numbers that everything above is made of.
            assert dict(run.design.values) == dict(first.values), quantity.name
            assert run.design.stiffness == first.stiffness
    # All of them at once, through the whole of it.
    together = {q.name: q.start * 1.05 for q in changeable if q.start and 1.05 * q.start <= q.high}
    together.pop("sample_period", None)
    write_device(device_with(**{**together, "feedthrough": 3.0, "k3_x": 1e9}), tmp_path / "device.toml")
    run = run_of(design=str(tmp_path / "design.toml"), device=str(tmp_path / "device.toml"), seed=3)
    assert received(run) == expected


def test_a_filter_of_another_design_is_another() -> None:
    """The comparison above sees a change of any estimate: one part in 1e9 of kxx moves the memory."""
    lib, part = begin_observer(OBSERVER, load_design("plain", device_with(), 3), PERIOD, {})
    _, other = begin_observer(OBSERVER, load_design("plain", device_with(kxx=63.955 * (1 + 1e-9)), 3), PERIOD, {})
    assert part.memory.tobytes() != other.memory.tobytes()
    assert part.memory.nbytes >= ctypes.sizeof(ctypes.c_double) * lib.sizes["NP"] ** 2
