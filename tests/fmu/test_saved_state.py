"""States saved, restored and written as bytes continue bit for bit; anything else is refused."""

import ctypes as ct
import struct
from collections.abc import Iterator

import numpy as np
import pytest
from fmu_importer import ERROR, NOISY, OK, OUTPUTS, Fmu, Instance

from gyro_model.build import build
from gyro_model.envelope import envelope_model

# Layout of the bytes, from the comments at the top of fmi_saved.c and of snapshot.c.
AT_CHECKSUM, AT_STATE, AT_STOP, AT_CORE, CORE_HEADER = 16, 24, 40, 48, 40


def test_run_continues_from_a_saved_state(gyro: Instance) -> None:
    gyro.start(**NOISY)
    gyro.run(0, 10)
    handle = gyro.save()
    first = gyro.run(10, 40)
    assert gyro.restore(handle) == OK
    assert gyro.run(10, 40) == first
    gyro.free_saved(handle)


def test_run_continues_in_another_instance_from_bytes(fmu: Fmu) -> None:
    with Instance(fmu) as one, Instance(fmu) as other:
        one.start(**NOISY)
        one.run(0, 10)
        saved = one.save()
        data = one.serialize(saved)
        one.free_saved(saved)
        other.start(seed=99, sense_noise=1.0)
        other.run(0, 3)
        status, handle = other.deserialize(data)
        assert status == OK and other.restore(handle) == OK
        assert other.get(*OUTPUTS) == one.get(*OUTPUTS)
        assert other.run(10, 40) == one.run(10, 40)
        again = other.save()
        other.restore(handle)
        other.save(again)
        assert other.serialize(again) == data
        other.free_saved(again)
        other.free_saved(handle)


def test_of_two_forces_at_one_instant_the_last_is_on_its_way(fmu: Fmu) -> None:
    # Steps shorter than half a tick do not move the clock.
    with Instance(fmu) as one, Instance(fmu) as plain:
        for gyro in (one, plain):
            gyro.start(actuator_delay=2e-5)
            assert gyro.step(0.0, 1e-5) == OK
        for u in (1e-6, 2e-6, 3e-6):
            one.set(u_x=u)
            assert one.step(1e-5, 1e-13) == OK
        plain.set(u_x=3e-6)
        saved = one.save()
        assert one.restore(saved) == OK, one.log
        one.free_saved(saved)
        for k in range(1, 6):
            assert one.step(k * 1e-5, 1e-5) == plain.step(k * 1e-5, 1e-5) == OK
            assert one.get(*OUTPUTS) == plain.get(*OUTPUTS)


@pytest.mark.parametrize("step", [3.3e-6, 1e-6 / 3, 7.77e-6])
def test_a_state_between_two_points_of_the_grid(fmu: Fmu, step: float) -> None:
    # With an input that has been set and does not act yet, and forces that are on their way.
    with Instance(fmu) as one, Instance(fmu) as other:
        one.start(**NOISY)
        for k in range(0, 60, 20):
            one.run(k, k + 20, step)
            one.set(temperature=300.0 + k, u_x=5e-6)
            saved = one.save()
            assert other.restore(saved) == OK, other.log
            assert other.get(*OUTPUTS) == one.get(*OUTPUTS)
            again = other.save()
            assert other.serialize(again) == one.serialize(saved)
            one.free_saved(saved)
            other.free_saved(again)
            assert other.run(k + 20, k + 40, step) == one.run(k + 20, k + 40, step)
            assert one.call("Reset") == OK
            one.start(**NOISY)
            one.run(0, k + 20, step)


def test_inputs_of_the_step_before_are_part_of_the_state(gyro: Instance) -> None:
    # The next change of the rate is counted from that of the saved state.
    gyro.start(frame_rotation=1.0, x_start=1e-6)
    gyro.set(omega_z=100.0)
    gyro.run(0, 5)
    saved = gyro.save()
    gyro.set(omega_z=300.0)
    first = gyro.run(5, 10)
    gyro.set(omega_z=-700.0)
    gyro.run(10, 15)
    assert gyro.restore(saved) == OK
    gyro.set(omega_z=300.0)
    assert gyro.run(5, 10) == first
    gyro.free_saved(saved)


@pytest.mark.parametrize("state", ["instantiated", "initialization", "step", "terminated"])
def test_life_cycle_is_part_of_the_state(fmu: Fmu, state: str) -> None:
    with Instance(fmu) as gyro, Instance(fmu) as other:
        gyro.set(x_start=3e-6)
        if state != "instantiated":
            gyro.set_up(start=0.5, stop=0.6)
        if state in ("step", "terminated"):
            gyro.call("ExitInitializationMode")
        if state == "terminated":
            gyro.call("Terminate")
        saved = gyro.save()
        other.start()
        other.run(0, 5)
        assert other.restore(saved) == OK
        assert other.get("x_start") == [3e-6]
        assert other.call("Terminate") == (OK if state == "step" else ERROR)
        assert other.restore(saved) == OK
        if state == "instantiated":
            other.start(start=0.5, stop=0.6)
        elif state == "initialization":
            assert other.get("x") == [3e-6]
            assert other.call("ExitInitializationMode") == OK
        if state != "terminated":
            assert other.step(0.5, 0.2) == ERROR and "stop time 0.6" in other.message
            assert other.step(0.5, 1e-5) == OK, other.log
        other.free_saved(saved)


def test_damaged_bytes_are_refused_and_leave_the_instance_alone(gyro: Instance) -> None:
    gyro.start(**NOISY)
    gyro.run(0, 10)
    saved = gyro.save()
    data = gyro.serialize(saved)
    damaged = {
        "nothing": b"",
        "header cut": data[:20],
        "last byte missing": data[:-1],
        "a byte too many": data + b"\0",
        "other magic": b"X" + data[1:],
        "zeros": bytes(len(data)),
    }
    for i in range(len(data)):
        damaged[f"byte {i} flipped"] = data[:i] + bytes([data[i] ^ 0x40]) + data[i + 1 :]
    for name, garbage in damaged.items():
        status, handle = gyro.deserialize(garbage)
        assert status == ERROR and handle.value is None, name
    assert "checksum" in gyro.message
    expected = gyro.run(10, 20)
    gyro.restore(saved)
    assert gyro.run(10, 20) == expected
    gyro.free_saved(saved)


def test_null_arguments_are_refused(gyro: Instance) -> None:
    gyro.start()
    state = "FMUstate" if gyro.fmu.version == 2 else "FMUState"
    assert gyro.call(f"Get{state}", None) == ERROR
    assert gyro.restore(ct.c_void_p()) == ERROR
    assert gyro.call(f"Serialized{state}Size", None, None) == ERROR
    assert gyro.call(f"Serialize{state}", None, None, ct.c_size_t(0)) == ERROR
    assert "NULL" in gyro.message
    gyro.free_saved(ct.c_void_p())
    assert gyro.call(f"Free{state}", None) == OK


def test_array_of_another_size_is_refused(gyro: Instance) -> None:
    saved = gyro.save()
    size = len(gyro.serialize(saved))
    state = "FMUstate" if gyro.fmu.version == 2 else "FMUState"
    for wrong in (size - 1, size + 1):
        assert gyro.call(f"Serialize{state}", saved, (ct.c_ubyte * (size + 1))(), ct.c_size_t(wrong)) == ERROR
        assert str(wrong) in gyro.message and str(size) in gyro.message
    gyro.free_saved(saved)


def fnv(data: bytes, begin: int = 0xCBF29CE484222325) -> int:
    """FNV-1a, 64 bits."""
    for byte in data:
        begin = (begin ^ byte) * 0x100000001B3 % 2**64
    return begin


def mended(fmu: Fmu, data: bytes) -> bytes:
    """``data`` with lengths and checksums that fit it, as an attacker or an unlucky editor would leave it."""
    core = bytearray(data[AT_CORE:])
    if len(core) >= CORE_HEADER:
        struct.pack_into("<QQ", core, 24, len(core), fnv(bytes(core[CORE_HEADER:])))
    rest = data[AT_STATE:AT_CORE] + bytes(core)
    return data[:8] + struct.pack("<QQ", len(data), fnv(rest, fnv(fmu.token.encode()))) + rest


@pytest.fixture(scope="module", params=[2, 3], ids=["fmi2", "fmi3"])
def either(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Fmu]]:
    """Gyroscope and GyroscopeEnvelope of each standard in turn."""
    name = f"fmi{request.param}"
    paths = [getattr(build(model), name) for model in (None, envelope_model())]
    yield [Fmu(path, tmp_path_factory.mktemp(name)) for path in paths]


@pytest.mark.parametrize("internal_step", [1e-9, 1e-6])
@pytest.mark.parametrize("delays", [(0.0, 1e-3), (1e-3, 0.0), (2e-6, 3e-6)])
def test_a_delay_changed_after_an_output_was_read(fmu: Fmu, internal_step: float, delays: tuple[float, float]) -> None:
    with Instance(fmu) as gyro, Instance(fmu) as other:
        gyro.set(internal_step=internal_step, actuator_delay=delays[0], x_start=1e-6)
        assert gyro.set_up() == OK
        gyro.get("x")
        gyro.set(actuator_delay=delays[1])
        saved = gyro.save()
        for instance in (gyro, other):
            assert instance.restore(saved) == OK, instance.log
            assert instance.get("actuator_delay", "x") == [delays[1], 1e-6]
            assert instance.call("ExitInitializationMode") == OK
        assert gyro.run(0, 5) == other.run(0, 5)
        gyro.free_saved(saved)


def test_a_state_with_a_wrong_parameter_is_restored_and_can_be_mended(fmu: Fmu) -> None:
    with Instance(fmu) as gyro, Instance(fmu) as other:
        assert gyro.set_up() == OK
        gyro.get("x")
        gyro.set(m=-1.0)
        saved = gyro.save()
        assert other.restore(saved) == OK, other.log
        assert other.call("ExitInitializationMode") == ERROR and "m = -1" in other.message
        other.set(m=1.8e-7)
        assert other.call("ExitInitializationMode") == OK
        gyro.free_saved(saved)


def test_bytes_go_into_a_handle_that_holds_anything(gyro: Instance) -> None:
    gyro.start()
    saved = gyro.save()
    data = gyro.serialize(saved)
    gyro.free_saved(saved)
    name = "DeSerializeFMUstate" if gyro.fmu.version == 2 else "DeserializeFMUState"
    handle = ct.c_void_p(0xDEAD)
    array = (ct.c_ubyte * len(data)).from_buffer_copy(data)
    assert gyro.call(name, array, ct.c_size_t(len(data)), ct.byref(handle)) == OK
    assert gyro.restore(handle) == OK
    gyro.free_saved(handle)


@pytest.mark.parametrize("state", [0, 3, 5, 16, 255, 256 + 4, 2**63])
def test_a_life_cycle_state_that_is_none_is_refused(gyro: Instance, state: int) -> None:
    gyro.start(**NOISY)
    saved = gyro.save()
    data = gyro.serialize(saved)
    status, handle = gyro.deserialize(
        mended(gyro.fmu, data[:AT_STATE] + struct.pack("<Q", state) + data[AT_STATE + 8 :])
    )
    assert status == ERROR and handle.value is None
    assert "life-cycle" in gyro.message
    gyro.free_saved(saved)


def test_times_that_are_none_are_refused(gyro: Instance) -> None:
    gyro.start()
    saved = gyro.save()
    data = gyro.serialize(saved)
    for at, value in ((AT_STOP, float("nan")), (AT_STOP, -1.0), (AT_STOP - 8, float("inf"))):
        wrong = mended(gyro.fmu, data[:at] + struct.pack("<d", value) + data[at + 8 :])
        assert gyro.deserialize(wrong)[0] == ERROR
    gyro.free_saved(saved)


def test_a_state_that_steps_without_having_started_is_refused(gyro: Instance) -> None:
    saved = gyro.save()
    data = gyro.serialize(saved)
    gyro.free_saved(saved)
    status, handle = gyro.deserialize(mended(gyro.fmu, data[:AT_STATE] + struct.pack("<Q", 4) + data[AT_STATE + 8 :]))
    assert status == OK
    assert gyro.restore(handle) == ERROR and "has not started" in gyro.message
    gyro.free_saved(handle)
    gyro.start()


def alive(gyro: Instance) -> None:
    """Calls that must come back, with whatever status."""
    outputs = [name for name, variable in gyro.fmu.variables.items() if variable.causality == "output"]
    for time in (0.0, 1e-4, 1.1e-4):
        gyro.step(time, 1e-5)
        gyro.try_get(*outputs)
    gyro.free_saved(gyro.save())


def test_mended_bytes_never_break_anything(either: list[Fmu]) -> None:
    rng = np.random.default_rng(12)
    odd = [struct.pack("<d", v) for v in (float("nan"), float("inf"), -1.0, 1e300, 0.0)]
    odd += [struct.pack("<q", v) for v in (-1, 1, 2**31, 2**40, 2**62, 2**63 - 1, -(2**63))]
    for fmu in either:
        with Instance(fmu) as gyro:
            step = gyro.get("internal_step")[0]
            delay = {"actuator_delay": 2.5e-5} if fmu.version == 3 else {}
            gyro.start(seed=3, sense_noise=1e-3, flicker_noise=1e-4, **delay)
            for k in range(10):
                assert gyro.step(k * step, step) == OK
            saved = gyro.save()
            data = gyro.serialize(saved)
            cuts = [data[:n] for n in (AT_CORE, AT_CORE + 8, AT_CORE + CORE_HEADER, len(data) // 2, len(data) - 8)]
            longer = [data + bytes(8), data + bytes(100_000)]
            # Every word of eight bytes once, and some at random: numbers that no run can have.
            words = [*range(AT_STATE, len(data) - 7, 8), *(int(i) for i in rng.integers(AT_STATE, len(data) - 8, 300))]
            swapped = [data[:i] + odd[int(rng.integers(len(odd)))] + data[i + 8 :] for i in words]
            for wrong in (*cuts, *longer, *swapped):
                status, handle = gyro.deserialize(mended(fmu, wrong))
                if status == OK:
                    if gyro.restore(handle) == OK:
                        alive(gyro)
                    gyro.free_saved(handle)
            for wrong in (*cuts, *longer):
                status, handle = gyro.deserialize(mended(fmu, wrong))
                assert status == ERROR or gyro.restore(handle) == ERROR
                gyro.free_saved(handle)
            assert gyro.restore(saved) == OK
            assert gyro.step(10 * step, step) == OK
            gyro.free_saved(saved)
