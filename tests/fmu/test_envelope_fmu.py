"""The FMU GyroscopeEnvelope as an importer sees it: the layers are those of the full FMU, tested there; here what its
own plant must keep."""

import ctypes as ct
from collections.abc import Iterator

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmu_importer import ERROR, OK, Fmu, Instance

from gyro_model.build import build
from gyro_model.envelope import envelope_model

# Every part that keeps something between steps: noises, an event, lags, curved forces, a mode of its own.
BUSY = {
    "seed": 7,
    "sense_noise": 1e-3,
    "sampling_jitter": 1e-9,
    "adc_lsb": 1e-4,
    "thermal_force": 1.0,
    "k3_x": 1e9,
    "k2_y": 1e5,
    "damping_step_time": 0.0123,
    "damping_step_factor": 2.0,
    "parasitic_coupling": 0.5,
    "structure_lag": 0.03,
    "circuit_lag": 0.01,
    "tck": 1e-4,
    "tcp": 1e-8,
    "frame_rotation": 1.0,
    "x_start_i": 1e-6,
}
OUTPUTS = ("v_x_i", "v_x_q", "v_y_i", "v_y_q", "x_i", "y_q", "x_mean", "temperature_circuit")
STEP = 1e-3


@pytest.fixture(scope="module")
def envelopes(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Fmu]:
    paths = build(envelope_model())._asdict()
    loaded = [Fmu(path, tmp_path_factory.mktemp(name)) for name, path in paths.items()]
    return {fmu.version: fmu for fmu in loaded}


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def plant(request: pytest.FixtureRequest, envelopes: dict[int, Fmu]) -> Iterator[Instance]:
    with Instance(envelopes[request.param]) as instance:
        yield instance


def run(plant: Instance, first: int, last: int) -> list[list[float]]:
    trace = []
    for k in range(first, last):
        plant.set(u_x_i=1e-6 * (k % 7), omega_z=0.1 * (k % 3), temperature=300.0 + k, carrier_frequency=2900.0 + k % 5)
        assert plant.step(k * STEP, STEP) == OK, plant.log
        trace.append(plant.get(*OUTPUTS))
    return trace


@pytest.mark.parametrize("version", [2, 3])
def test_fmpy_finds_no_fault(envelopes: dict[int, Fmu], version: int) -> None:
    assert validate_fmu(str(envelopes[version].path)) == []


def test_fmpy_simulates_it(envelopes: dict[int, Fmu]) -> None:
    result = fmpy.simulate_fmu(str(envelopes[3].path), stop_time=0.01, output_interval=STEP, start_values=BUSY)
    assert len(result) == 11


def test_both_standards_give_equal_bits(envelopes: dict[int, Fmu]) -> None:
    with Instance(envelopes[2]) as old, Instance(envelopes[3]) as new:
        old.start(**BUSY)
        new.start(**BUSY)
        assert run(old, 0, 50) == run(new, 0, 50)


def test_one_long_step_equals_many_short_ones(envelopes: dict[int, Fmu]) -> None:
    with Instance(envelopes[3]) as long, Instance(envelopes[3]) as short:
        for plant in (long, short):
            plant.start(**BUSY, u_y_q=1e-6, temperature=310.0)
        assert long.step(0.0, 40 * STEP) == OK
        for k in range(40):
            assert short.step(k * STEP, STEP) == OK
        assert long.get(*OUTPUTS) == short.get(*OUTPUTS)


@pytest.mark.parametrize("parts", [3, 7, 300])
def test_no_bit_depends_on_the_steps(envelopes: dict[int, Fmu], parts: int) -> None:
    # Inputs change every 2.5 ms, between two points of the grid.
    mark = 2.5 * STEP
    with Instance(envelopes[3]) as long, Instance(envelopes[3]) as short:
        for plant in (long, short):
            plant.start(**BUSY)
        for k in range(6):
            for plant in (long, short):
                plant.set(u_x_i=1e-6 * (k % 7), omega_z=0.1 * (k % 3), temperature=300.0 + k)
            assert long.step(k * mark, mark) == OK
            for i in range(parts):
                assert short.step(k * mark + i * mark / parts, mark / parts) == OK, short.log
            assert long.get(*OUTPUTS) == short.get(*OUTPUTS)


def test_thermal_noise_of_a_divided_step_is_that_of_a_whole_one(envelopes: dict[int, Fmu]) -> None:
    # From rest, over 4000 steps of the grid, each cut once by an input that changes nothing else.
    spread = []
    for cut in (False, True):
        with Instance(envelopes[3]) as plant:
            plant.start(seed=5, thermal_force=1.0, dxx=1e-4, dyy=1e-4, dxy=0.0)
            squares = 0.0
            for k in range(4000):
                if cut:
                    assert plant.step(k * STEP, 0.4 * STEP) == OK
                    plant.set(v_bias=float(k % 2))
                    assert plant.step((k + 0.4) * STEP, 0.6 * STEP) == OK
                else:
                    assert plant.step(k * STEP, STEP) == OK
                i, q = plant.get("x_i", "y_q")
                squares += i * i + q * q
            spread.append(squares)
    # Two sums of 8000 squares, correlated over 2m/d = 4 steps: each good to √(2·4/8000) = 3 %; five times √2 of it.
    assert abs(spread[1] / spread[0] - 1.0) < 0.22


@pytest.mark.parametrize("version", [2, 3])
def test_it_is_for_co_simulation_without_events_alone(envelopes: dict[int, Fmu], version: int) -> None:
    log: list[tuple[int, str, str]] = []
    fmu = envelopes[version]
    assert fmu.description.modelExchange is None
    assert fmu.instantiate(fmu.log_callback(log), fmu.token, co_simulation=False) is None
    assert "co-simulation only" in log[-1][2]
    if version == 3:
        assert fmu.instantiate(fmu.log_callback(log), fmu.token, events=True) is None
        assert "eventModeUsed" in log[-1][2]
    with Instance(fmu) as plant:
        plant.start()
        sizes = [ct.c_size_t(0)] * (2 if version == 3 else 0)
        assert (
            plant.call(
                "GetDirectionalDerivative",
                None,
                ct.c_size_t(0),
                None,
                ct.c_size_t(0),
                None,
                *sizes[:1],
                None,
                *sizes[:1],
            )
            == ERROR
        )
        assert "co-simulation only" in plant.message


def test_run_continues_from_a_saved_state(plant: Instance) -> None:
    plant.start(**BUSY)
    run(plant, 0, 10)
    saved = plant.save()
    first = run(plant, 10, 30)
    assert plant.restore(saved) == OK
    assert run(plant, 10, 30) == first
    plant.free_saved(saved)


def test_run_continues_in_another_instance_from_bytes(envelopes: dict[int, Fmu]) -> None:
    with Instance(envelopes[3]) as one, Instance(envelopes[3]) as other:
        one.start(**BUSY)
        run(one, 0, 10)
        data = one.serialize(one.save())
        other.start()
        status, handle = other.deserialize(data)
        assert status == OK and other.restore(handle) == OK
        assert run(other, 10, 30) == run(one, 10, 30)


def test_reset_gives_a_new_instance(plant: Instance) -> None:
    plant.start(**BUSY)
    first = run(plant, 0, 10)
    assert plant.call("Reset") == OK
    plant.start(**BUSY)
    assert run(plant, 0, 10) == first


def test_a_device_that_does_not_oscillate_is_refused_where_it_shows(plant: Instance) -> None:
    plant.start(x_start_i=1e-9, softening=100.0, v_bias=1.0)
    assert plant.step(0.0, STEP) == ERROR
    assert "diverged at 0.001 s: the amplitude of x is not finite" in plant.message


@pytest.mark.parametrize("name", ["play", "hysteresis_x"])
def test_an_effect_that_it_cannot_follow_is_refused_while_it_runs_too(plant: Instance, name: str) -> None:
    plant.start(x_start_i=1e-6)
    assert plant.step(0.0, STEP) == OK
    assert plant.try_set(name, 1e-7) == ERROR
    assert f"{name} is 1e-07, with which the effect {name.split('_')[0]} would act" in plant.message
    assert plant.get(name) == [0.0]
    assert plant.try_set(name, 0.0) == OK
    # The state is one that can be restored.
    saved = plant.save()
    assert plant.restore(saved) == OK, plant.log
    plant.free_saved(saved)
    assert plant.step(STEP, STEP) == OK


def test_an_effect_that_it_cannot_follow_is_refused_at_the_start(plant: Instance) -> None:
    plant.set(play=1e-7)
    assert plant.set_up() == OK
    assert plant.call("ExitInitializationMode") == ERROR
    assert "effect play" in plant.message


def driven(fmu: Fmu, internal_step: float) -> np.ndarray:
    """Amplitudes of x and y every 2 ms, driven to 46 µm where k22 y² is a fifth of the suspension's stiffness."""
    with Instance(fmu) as plant:
        plant.start(k22=2e9, internal_step=internal_step, u_x_i=3e-7, u_x_q=1e-6, u_y_i=5e-7, u_y_q=-4e-7, omega_z=3.0)
        rows = []
        for k in range(30):
            assert plant.step(k * 2e-3, 2e-3) == OK, plant.log
            rows.append(plant.get("x_i", "x_q", "y_i", "y_q"))
    return np.array(rows)


def test_strong_forces_that_join_the_axes_are_followed_in_long_steps(envelopes: dict[int, Fmu]) -> None:
    long, short = driven(envelopes[3], 1e-3), driven(envelopes[3], 1e-5)
    assert np.max(np.abs(short)) > 4e-5
    # The midpoint rule in parts that turn the amplitude by 0.1: 8e-5 of the peak, as much in x as in y.
    assert np.max(np.abs(long - short)) <= 2e-4 * np.max(np.abs(short))
