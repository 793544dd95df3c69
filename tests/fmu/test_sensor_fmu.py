"""The FMU GyroscopeSensor as an importer sees it: the layers are those of the full FMU, tested there; here what its own
part must keep, and the start values that an export brings."""

import ctypes as ct
import struct
from collections.abc import Iterator
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmu_importer import ERROR, OK, Fmu, Instance
from test_saved_state import AT_CORE, CORE_HEADER, mended

from gyro_model.build import Fmus, build, forms
from gyro_model.errors import InputError
from gyro_model.experiments import verify
from gyro_model.model import load_model
from gyro_model.sensor import SensorModel
from gyro_model.sensor_fmu import hash_of, starts_file, write_sensor

# Every part that keeps something between steps.
BUSY = {
    "seed": 7,
    "scale_factor": 0.97,
    **{f"scale_factor_temperature_{k}": 1e-2 * (k % 3) for k in range(17)},
    "nonlinearity_2": 1e-3,
    "nonlinearity_3": -1e-3,
    "misalignment_x": 0.02,
    "misalignment_y": -0.01,
    "bias": 0.1,
    **{f"bias_temperature_{k}": 1e-2 * k for k in range(17)},
    "bias_supply": 1e-3,
    "acceleration_sensitivity_x": 1e-4,
    "acceleration_sensitivity_z": -2e-4,
    "thermal_hysteresis": 1e-2,
    "scale_factor_hysteresis": 1e-2,
    "structure_lag": 0.05,
    "supply_low": 2.0,
    "start_up_time": 3.3e-3,
    "filter_lead_1": 1e-3,
    "noise_lead": -2e-3,
    "angle_random_walk": 1e-3,
    "bias_instability": 1e-3,
    "rate_random_walk": 1e-3,
    "turn_on": 0.01,
    "full_scale": 0.35,
    "lsb": 1e-3,
    "sample_period": 2.3e-3,
}
OUTPUTS = ("rate", "rate_sampled", "temperature_structure")
STEP = 1e-3


@pytest.fixture(scope="module")
def sensors(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Fmu]:
    """The package's FMUs by version."""
    loaded = [Fmu(path, tmp_path_factory.mktemp(name)) for name, path in build(SensorModel())._asdict().items()]
    return {fmu.version: fmu for fmu in loaded}


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Fmus:
    """FMUs of a gyroscope of its own, in a folder whose name a URI must encode."""
    return write_sensor(BUSY, tmp_path_factory.mktemp("a gyro's % ü"))


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def sensor(request: pytest.FixtureRequest, sensors: dict[int, Fmu]) -> Iterator[Instance]:
    with Instance(sensors[request.param]) as instance:
        yield instance


def inputs(k: int) -> dict[str, float]:
    return {
        "omega_z": 0.1 * (k % 5) - 0.2,
        "omega_x": 0.3 * (k % 3),
        "a_x": 9.8 * (k % 2),
        "temperature": 290.0 + 2.0 * (k % 7),
        "supply": 1.0 if k % 31 == 20 else 3.3 + 0.1 * (k % 2),
        "self_test": k % 4 == 3,
    }


def run(sensor: Instance, first: int, last: int) -> list[list[float]]:
    trace = []
    for k in range(first, last):
        sensor.set(**inputs(k))
        assert sensor.step(k * STEP, STEP) == OK, sensor.log
        trace.append([*sensor.get(*OUTPUTS), *sensor.get("data_ready")])
    return trace


def everything(sensor: Instance) -> list[float]:
    return [*sensor.get(*OUTPUTS), *sensor.get("data_ready")]


def test_it_is_one_of_the_forms_and_has_no_effects() -> None:
    assert SensorModel.NAME in [form.NAME for form in forms(load_model())]
    assert SensorModel().effects == ()


@pytest.mark.parametrize("version", [2, 3])
def test_fmpy_finds_no_fault(sensors: dict[int, Fmu], exported: Fmus, version: int) -> None:
    assert validate_fmu(str(sensors[version].path)) == []
    assert validate_fmu(str(exported[version - 2])) == []


def test_both_standards_give_equal_bits(sensors: dict[int, Fmu]) -> None:
    with Instance(sensors[2]) as old, Instance(sensors[3]) as new:
        old.start(**BUSY)
        new.start(**BUSY)
        assert run(old, 0, 60) == run(new, 0, 60)


@pytest.mark.parametrize("seed", range(6))
def test_no_bit_depends_on_the_steps(sensors: dict[int, Fmu], seed: int) -> None:
    # Inputs change every 2.7 ms, between points of the grid and samples; steps from some µs on are random.
    rng, mark = np.random.default_rng(seed), 2.7e-3
    with Instance(sensors[3]) as long, Instance(sensors[3]) as short:
        for plant in (long, short):
            plant.start(**BUSY)
        now = 0.0
        for k in range(30):
            for plant in (long, short):
                plant.set(**inputs(k))
            assert long.step(k * mark, mark) == OK, long.log
            cuts = np.sort(rng.uniform(0, mark, rng.integers(1, 9)))
            for end in (*(k * mark + cuts), (k + 1) * mark):
                if end - now > 1e-9:
                    assert short.step(now, end - now) == OK, short.log
                    now = end
            assert everything(long) == everything(short)


def test_run_continues_from_a_saved_state(sensor: Instance) -> None:
    sensor.start(**BUSY)
    run(sensor, 0, 13)
    saved = sensor.save()
    first = run(sensor, 13, 60)
    assert sensor.restore(saved) == OK
    assert run(sensor, 13, 60) == first
    sensor.free_saved(saved)


def test_run_continues_in_another_instance_from_bytes(sensors: dict[int, Fmu]) -> None:
    with Instance(sensors[3]) as one, Instance(sensors[3]) as other:
        one.start(**BUSY)
        run(one, 0, 13)
        data = one.serialize(one.save())
        other.start()
        status, handle = other.deserialize(data)
        assert status == OK and other.restore(handle) == OK
        assert run(other, 13, 60) == run(one, 13, 60)


def test_a_saved_state_with_any_wrong_number_is_refused_or_survived(sensor: Instance) -> None:
    sensor.start(**BUSY)
    run(sensor, 0, 13)
    data = sensor.serialize(sensor.save())
    begin = AT_CORE + CORE_HEADER
    refused = 0
    for at in range(begin, len(data) - 7, 8):
        for wrong in (struct.pack("<d", float("nan")), struct.pack("<q", -(2**62))):
            status, handle = sensor.deserialize(mended(sensor.fmu, data[:at] + wrong + data[at + 8 :]))
            if status != OK or sensor.restore(handle) != OK:
                refused += 1
            # Whatever came in, it steps or says why not, and outputs are numbers.
            elif sensor.step(13 * STEP, STEP) == OK:
                assert np.isfinite(everything(sensor)).all()
            status, handle = sensor.deserialize(data)
            assert status == OK and sensor.restore(handle) == OK, sensor.log
    # NaN is refused everywhere but in outputs and in the few numbers that are counts.
    assert refused > len(range(begin, len(data) - 7, 8))
    for cut in (0, 40, len(data) // 2, len(data) - 1):
        status, handle = sensor.deserialize(mended(sensor.fmu, data[:cut]) if cut > AT_CORE else data[:cut])
        assert status != OK or sensor.restore(handle) == ERROR


def test_reset_gives_a_new_instance(exported: Fmus, tmp_path: Path) -> None:
    with Instance(Fmu(exported.fmi3, tmp_path)) as one:
        one.start()
        first = run(one, 0, 20)
        assert one.call("Reset") == OK
        assert one.get("bias") == [BUSY["bias"]]
        one.start()
        assert run(one, 0, 20) == first


@pytest.mark.parametrize("version", [2, 3])
def test_an_export_starts_as_its_gyroscope(
    sensors: dict[int, Fmu], exported: Fmus, version: int, tmp_path: Path
) -> None:
    fmu = Fmu(exported[version - 2], tmp_path)
    assert {name: float(fmu.variables[name].start) for name in BUSY} == BUSY
    with Instance(fmu) as own, Instance(sensors[version]) as told:
        assert {name: own.get(name)[0] for name in BUSY} == BUSY
        own.start()
        told.start(**BUSY)
        assert run(own, 0, 60) == run(told, 0, 60)


def test_an_export_meets_the_reference_traces(exported: Fmus) -> None:
    for path in exported:
        residuals = verify(path)
        assert len({r.experiment for r in residuals}) == 3
        assert [r for r in residuals if not r.met] == []


def test_fmpy_runs_an_export_with_nothing_set(exported: Fmus) -> None:
    for path in exported:
        result = fmpy.simulate_fmu(str(path), stop_time=0.1, output_interval=1e-2)
        assert len(result) == 11
        assert result["temperature_structure"][-1] == 298.15
        assert result["rate"][-1] == pytest.approx(0.1 + 0.08, abs=0.3)
        assert result["rate"][0] == 0.0  # it still starts


class Attempts:
    """An export whose file of start values is another one."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.fmu = Fmu(path, folder)
        self.file = self.fmu.folder / "resources" / "starts.txt"
        self.good = self.file.read_bytes()
        self.token = self.fmu.token.partition("+")[0]

    def refused(self, text: bytes | None, message: str, hashed: int | None = None, place: str | None = None) -> None:
        """With ``text`` in the file (None: no file) and a hash in the token, its own by default."""
        self.file.unlink(missing_ok=True)
        if text is not None:
            self.file.write_bytes(text)
        announced = hash_of(text or b"") if hashed is None else hashed
        self.refused_token(f"{self.token}+{announced:016x}", message, place)

    def refused_token(self, token: str, message: str, place: str | None = None) -> None:
        log: list[tuple[int, str, str]] = []
        assert self.fmu.instantiate(self.fmu.log_callback(log), token, resources=place) is None
        assert message in log[-1][2], log


@pytest.mark.parametrize("version", [2, 3])
def test_start_values_of_another_file_are_refused(exported: Fmus, version: int, tmp_path: Path) -> None:
    export = Attempts(exported[version - 2], tmp_path / "fmu")
    good, own = export.good, hash_of(export.good)
    export.refused(good, "is not the file", own ^ 1)
    export.refused(good.replace(b"bias", b"bia5", 1), "is not the file", own)
    export.refused(None, "can't be read", own)
    export.refused(good, "can't be read", place=str(tmp_path / "elsewhere"))
    export.refused(good, "say where", place="/" + 5000 * "x")
    for text, message in (
        (40000 * b"x", "longer than"),
        (b"bias\n", "hexadecimal"),
        (b"bias 3ff\n", "hexadecimal"),
        (b"bias 3ff000000000000g\n", "hexadecimal"),
        (b"bias 7ff8000000000000\n", "bias = nan"),
        (b"lsb bff0000000000000\n", "lsb = -1"),
        (b"seed 3fe0000000000000\n", "seed = 0.5"),
        (b"rate 3ff0000000000000\n", "no input or parameter"),
        (b"\n", "no input or parameter"),
        (500 * b"x" + b" 3ff0000000000000", "no input or parameter"),
        (b"bias 3ff0000000000000\0", "is not the file"),
    ):
        export.refused(text, message)
    export.file.write_bytes(good)
    for wrong in ("+", "+12", f"-{own:016x}", f"+{'g' * 16}"):
        export.refused_token(export.token + wrong, "the token is")
    export.refused_token("", "the token is")


def test_resources_are_found_however_they_are_named(exported: Fmus, tmp_path: Path) -> None:
    # As paths, and as the URIs of RFC 8089, with what is no encoding taken as it stands.
    for path, places in (
        (exported.fmi3, ["{path}", "{path}/"]),
        (exported.fmi2, ["file:{path}", "file://{path}/", "file://localhost{path}", "FILE_AS_PATH", "{encoded}"]),
    ):
        fmu = Fmu(path, tmp_path / f"100%zz {path.parent.name}")
        folder = (fmu.folder / "resources").as_posix()
        upper = "".join(c if c in "/:" or c.isalnum() else "".join(f"%{b:02X}" for b in c.encode()) for c in folder)
        for place in places:
            text = place.format(path=folder, encoded=f"file://{upper}").replace("FILE_AS_PATH", folder)
            log: list[tuple[int, str, str]] = []
            address = fmu.instantiate(fmu.log_callback(log), fmu.token, resources=text)
            assert address is not None, (text, log)
            fmu.function("FreeInstance")(ct.c_void_p(address))


def test_an_export_without_its_resources_is_refused(exported: Fmus, tmp_path: Path) -> None:
    fmu, log = Fmu(exported.fmi3, tmp_path), list[tuple[int, str, str]]()
    make = fmu.function("InstantiateCoSimulation")
    make.restype = ct.c_void_p
    options = (False, False, ct.c_bool(False), ct.c_bool(False), None, ct.c_size_t(0), None)
    assert make(b"gyro", fmu.token.encode(), None, *options, fmu.log_callback(log), None) is None
    assert "resources" in log[-1][2]


def test_a_device_brings_no_start_values(fmus: dict[int, Fmu]) -> None:
    log: list[tuple[int, str, str]] = []
    fmu = fmus[3]
    assert fmu.instantiate(fmu.log_callback(log), f"{fmu.token}+{0:016x}") is None
    assert "the token is" in log[-1][2]


def test_the_file_of_starts_says_the_bits() -> None:
    text = starts_file(SensorModel().starting_at({"bias": 0.1, "seed": 3})).decode()
    rows = [line.split() for line in text.splitlines()]
    assert [(name, struct.unpack(">d", bytes.fromhex(bits))[0]) for name, bits, _ in rows] == [
        ("bias", 0.1),
        ("seed", 3),
    ]


def test_an_export_refuses_what_is_no_parameter(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean 'bias'"):
        write_sensor({"bia": 1.0}, tmp_path)
    with pytest.raises(InputError, match="lsb = -1"):
        write_sensor({"lsb": -1.0}, tmp_path)


@pytest.mark.parametrize("version", [2, 3])
def test_it_is_for_co_simulation_without_events_alone(sensors: dict[int, Fmu], version: int) -> None:
    log: list[tuple[int, str, str]] = []
    fmu = sensors[version]
    assert fmu.description.modelExchange is None
    assert fmu.instantiate(fmu.log_callback(log), fmu.token, co_simulation=False) is None
    assert "co-simulation only" in log[-1][2]


def test_parameters_that_do_not_fit_are_refused(sensor: Instance) -> None:
    sensor.set(temperature_low=300.0, temperature_high=290.0)
    assert sensor.set_up() == OK
    assert sensor.call("ExitInitializationMode") == ERROR
    assert "temperature_low" in sensor.message


def test_times_beyond_the_count_are_refused(sensor: Instance) -> None:
    sensor.start(internal_step=1.0, sample_period=10.0, structure_lag=1.0)
    assert sensor.step(0.0, 1000.0) == OK
    assert sensor.call("DoStep", ct.c_double(1000.0), ct.c_double(1e9), 1, *(
        () if sensor.fmu.version == 2 else [ct.byref(r) for r in sensor._step_results]
    )) == ERROR  # fmt: skip


def test_a_sensor_that_overflows_has_no_number_and_can_be_saved(sensor: Instance) -> None:
    sensor.start(omega_z=1e308, scale_factor=1e300)
    assert sensor.step(0.0, 1e-2) == ERROR
    assert "diverged" in sensor.message
    # An integer has no NaN.
    (rate,), (ready,) = sensor.get("rate"), sensor.get("data_ready")
    assert rate != rate and ready == 0
    saved = sensor.save()
    assert sensor.restore(saved) == OK, sensor.log
    sensor.free_saved(saved)
    assert sensor.step(1e-2, 1e-2) == ERROR
