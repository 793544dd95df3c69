"""Other importers than FMPy get the same bits. They come with `pip install -e ".[importers]"`."""

import ctypes
import sys
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import pytest
import test_envelope_fmu
import test_sensor_fmu
from fmu_importer import NOISY, OK, OUTPUTS, Exchange, Fmu, Instance

STEPS = 400


class Case(NamedTuple):
    """What an FMU starts with, what is read, how long a step is [s]. Inputs stay as they start: some importers connect
    inputs to other FMUs only."""

    start: dict[str, float]
    outputs: list[str]
    step: float


CASES = {
    "Gyroscope": Case({**NOISY, "u_x": 2e-6, "omega_z": 3.0, "temperature": 320.0}, list(OUTPUTS), 1e-5),
    "GyroscopeEnvelope": Case(
        {**test_envelope_fmu.BUSY, "u_x_i": 2e-6, "omega_z": 3.0, "temperature": 320.0},
        list(test_envelope_fmu.OUTPUTS),
        1e-3,
    ),
    "GyroscopeSensor": Case(
        {**test_sensor_fmu.BUSY, "omega_z": 0.3, "a_x": 9.8, "temperature": 320.0, "self_test": 1},
        list(test_sensor_fmu.OUTPUTS),
        1e-3,
    ),
}


CASES["GyroscopeClocked"] = CASES["Gyroscope"]


def case_of(fmu: Fmu) -> Case:
    return CASES[fmu.description.modelName]


def importer(name: str) -> ModuleType:
    """The package of that name; the test is skipped where it is missing, or a library that it needs."""
    threads = Path(sys.prefix) / "lib" / "libtbb.so.12"
    if threads.is_file():
        # Of the package tbb: ecos asks the system for it.
        ctypes.CDLL(str(threads), mode=ctypes.RTLD_GLOBAL)
    try:
        return pytest.importorskip(name, reason=f"needs {name}: pip install -e '.[importers]'")
    except OSError as error:
        pytest.skip(f"{name}: {error}")


def wanted(fmu: Fmu) -> list[list[float]]:
    start, outputs, step = case_of(fmu)
    with Instance(fmu) as gyro:
        gyro.start(**start)
        rows = [gyro.get(*outputs)]
        for k in range(STEPS):
            assert gyro.step(k * step, step) == OK
            rows.append(gyro.get(*outputs))
    return rows


def split(fmu: Fmu) -> tuple[list[int], list[float], list[int], list[int]]:
    """Start values as references and values: reals, then integers."""
    start = case_of(fmu).start
    reals = {n: v for n, v in start.items() if fmu.variables[n].type in ("Real", "Float64")}
    whole = {n: int(v) for n, v in start.items() if n not in reals}
    vr = {n: fmu.variables[n].valueReference for n in start}
    return [vr[n] for n in reals], list(map(float, reals.values())), [vr[n] for n in whole], list(whole.values())


def test_fmuloader(any_fmu: Fmu) -> None:
    importer("fmuloader")
    fmu, name = any_fmu, any_fmu.description.modelName
    _, names, step = case_of(fmu)
    from fmuloader.fmi2 import Fmi2Slave, Fmi2Type
    from fmuloader.fmi3 import Fmi3Slave

    reals, values, whole, numbers = split(fmu)
    outputs = [fmu.variables[n].valueReference for n in names]
    if fmu.version == 2:
        slave = Fmi2Slave(str(fmu.path), model_identifier=name)
        slave.instantiate("gyro", Fmi2Type.CO_SIMULATION, guid=fmu.token)
        slave.set_real(reals, values)
        slave.set_integer(whole, numbers)
        slave.setup_experiment(start_time=0.0)
        slave.enter_initialization_mode()
        get = slave.get_real
    else:
        slave = Fmi3Slave(str(fmu.path), model_identifier=name)
        slave.instantiate_co_simulation("gyro", instantiation_token=fmu.token)
        slave.set_float64(reals, values)
        slave.set_int32(whole, numbers)
        slave.enter_initialization_mode(start_time=0.0)
        get = slave.get_float64
    slave.exit_initialization_mode()
    rows = [list(get(outputs))]
    for k in range(STEPS):
        slave.do_step(k * step, step)
        rows.append(list(get(outputs)))
    slave.terminate()
    slave.free_instance()
    assert rows == wanted(fmu)


def test_fmuloader_exchanges_the_model(fmus: dict[int, Fmu]) -> None:
    importer("fmuloader")
    from fmuloader.fmi3 import Fmi3Slave

    fmu = fmus[3]
    reals, values, whole, numbers = split(fmu)
    slave = Fmi3Slave(str(fmu.path), model_identifier="Gyroscope")
    slave.instantiate_model_exchange("gyro", instantiation_token=fmu.token)
    slave.set_float64(reals, values)
    slave.set_int32(whole, numbers)
    slave.enter_initialization_mode(start_time=0.0)
    slave.exit_initialization_mode()
    event = slave.update_discrete_states().next_event_time
    slave.enter_continuous_time_mode()
    n = slave.get_number_of_continuous_states()
    with Exchange(fmu) as gyro:
        gyro.start(**case_of(fmu).start)
        assert gyro.update()[1] == event
        assert gyro.call("EnterContinuousTimeMode") == OK
        assert n == len(gyro.states)
        assert list(slave.get_continuous_state_derivatives(n)) == gyro.rates()
    slave.terminate()
    slave.free_instance()


@pytest.mark.parametrize("form", ["Gyroscope", "GyroscopeEnvelope", "GyroscopeSensor"])
def test_libcosimpy(form: str, loaded: dict[str, dict[int, Fmu]]) -> None:
    importer("libcosimpy")
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    fmu = loaded[form][2]
    start, names, step = case_of(fmu)
    execution = CosimExecution.from_step_size(step_size=int(step * 1e9))
    slave = CosimLocalSlave(fmu_path=str(fmu.path), instance_name="gyro")
    index = execution.add_local_slave(local_slave=slave)
    for name, value in start.items():
        vr = fmu.variables[name].valueReference
        if fmu.variables[name].type == "Real":
            execution.real_initial_value(slave_index=index, variable_reference=vr, value=float(value))
        else:
            execution.integer_initial_value(slave_index=index, variable_reference=vr, value=int(value))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer=observer)
    outputs = [fmu.variables[n].valueReference for n in names]
    rows = []
    for _ in range(STEPS):
        execution.step()
        rows.append(list(observer.last_real_values(slave_index=index, variable_references=outputs)))
    assert rows == wanted(fmu)[1:]


def test_ecos(any_fmu: Fmu) -> None:
    if any_fmu.description.modelName == "GyroscopeClocked":
        pytest.skip("ecos 0.7.2 frees the list of a variable's clocks twice, before it calls the FMU")
    fmu, (start, names, step) = any_fmu, case_of(any_fmu)
    ecospy = importer("ecospy")
    structure = ecospy.EcosSimulationStructure()
    structure.add_model("gyro", str(fmu.path))
    real = {n: fmu.variables[n].type in ("Real", "Float64") for n in start}
    structure.add_parameter_set("start", {f"gyro::{n}": float(v) if real[n] else int(v) for n, v in start.items()})
    rows = []
    with ecospy.EcosSimulation(structure=structure, step_size=step) as simulation:
        simulation.init(parameter_set="start")
        for _ in range(STEPS):
            simulation.step()
            rows.append([simulation.get_real(f"gyro::{n}") for n in names])
        simulation.terminate()
    assert rows == wanted(fmu)[1:]
