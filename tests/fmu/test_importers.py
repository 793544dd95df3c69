"""Other importers than FMPy get the same bits. They come with `pip install -e ".[importers]"`; ecos needs libtbb.so.12
of the system besides."""

from types import ModuleType

import pytest
from fmu_importer import NOISY, OK, Exchange, Fmu, Instance

STEPS, STEP = 400, 1e-5
# Inputs stay as they start: some importers connect inputs to other FMUs only.
START = {**NOISY, "u_x": 2e-6, "omega_z": 3.0, "temperature": 320.0}
OUTPUTS = ["v_x", "v_y", "x", "y", "x_dot", "y_dot"]


def importer(name: str) -> ModuleType:
    """The package of that name; the test is skipped where it is missing, or a library that it needs."""
    try:
        return pytest.importorskip(name, reason=f"needs {name}: pip install -e '.[importers]'")
    except OSError as error:
        pytest.skip(f"{name}: {error}")


def wanted(fmu: Fmu) -> list[list[float]]:
    with Instance(fmu) as gyro:
        gyro.start(**START)
        rows = [gyro.get(*OUTPUTS)]
        for k in range(STEPS):
            assert gyro.step(k * STEP, STEP) == OK
            rows.append(gyro.get(*OUTPUTS))
    return rows


def split(fmu: Fmu) -> tuple[list[int], list[float], list[int], list[int]]:
    """Start values as references and values: reals, then integers."""
    reals = {n: v for n, v in START.items() if fmu.variables[n].type in ("Real", "Float64")}
    whole = {n: int(v) for n, v in START.items() if n not in reals}
    vr = {n: fmu.variables[n].valueReference for n in START}
    return [vr[n] for n in reals], list(map(float, reals.values())), [vr[n] for n in whole], list(whole.values())


def test_fmuloader(fmu: Fmu) -> None:
    importer("fmuloader")
    from fmuloader.fmi2 import Fmi2Slave, Fmi2Type
    from fmuloader.fmi3 import Fmi3Slave

    reals, values, whole, numbers = split(fmu)
    outputs = [fmu.variables[n].valueReference for n in OUTPUTS]
    if fmu.version == 2:
        slave = Fmi2Slave(str(fmu.path), model_identifier="Gyroscope")
        slave.instantiate("gyro", Fmi2Type.CO_SIMULATION, guid=fmu.token)
        slave.set_real(reals, values)
        slave.set_integer(whole, numbers)
        slave.setup_experiment(start_time=0.0)
        slave.enter_initialization_mode()
        get = slave.get_real
    else:
        slave = Fmi3Slave(str(fmu.path), model_identifier="Gyroscope")
        slave.instantiate_co_simulation("gyro", instantiation_token=fmu.token)
        slave.set_float64(reals, values)
        slave.set_int32(whole, numbers)
        slave.enter_initialization_mode(start_time=0.0)
        get = slave.get_float64
    slave.exit_initialization_mode()
    rows = [list(get(outputs))]
    for k in range(STEPS):
        slave.do_step(k * STEP, STEP)
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
        gyro.start(**START)
        assert gyro.update()[1] == event
        assert gyro.call("EnterContinuousTimeMode") == OK
        assert n == len(gyro.states)
        assert list(slave.get_continuous_state_derivatives(n)) == gyro.rates()
    slave.terminate()
    slave.free_instance()


def test_libcosimpy(fmus: dict[int, Fmu]) -> None:
    importer("libcosimpy")
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    fmu = fmus[2]
    execution = CosimExecution.from_step_size(step_size=int(STEP * 1e9))
    slave = CosimLocalSlave(fmu_path=str(fmu.path), instance_name="gyro")
    index = execution.add_local_slave(local_slave=slave)
    for name, value in START.items():
        vr = fmu.variables[name].valueReference
        if fmu.variables[name].type == "Real":
            execution.real_initial_value(slave_index=index, variable_reference=vr, value=float(value))
        else:
            execution.integer_initial_value(slave_index=index, variable_reference=vr, value=int(value))
    observer = CosimObserver.create_last_value()
    execution.add_observer(observer=observer)
    outputs = [fmu.variables[n].valueReference for n in OUTPUTS]
    rows = []
    for _ in range(STEPS):
        execution.step()
        rows.append(list(observer.last_real_values(slave_index=index, variable_references=outputs)))
    assert rows == wanted(fmu)[1:]


def test_ecos(fmu: Fmu) -> None:
    ecospy = importer("ecospy")
    structure = ecospy.EcosSimulationStructure()
    structure.add_model("gyro", str(fmu.path))
    real = {n: fmu.variables[n].type in ("Real", "Float64") for n in START}
    structure.add_parameter_set("start", {f"gyro::{n}": float(v) if real[n] else int(v) for n, v in START.items()})
    rows = []
    with ecospy.EcosSimulation(structure=structure, step_size=STEP) as simulation:
        simulation.init(parameter_set="start")
        for _ in range(STEPS):
            simulation.step()
            rows.append([simulation.get_real(f"gyro::{n}") for n in OUTPUTS])
        simulation.terminate()
    assert rows == wanted(fmu)[1:]
