"""States saved, restored and written as bytes continue bit for bit; anything else is refused."""

import ctypes as ct

import pytest
from fmu_importer import ERROR, NOISY, OK, OUTPUTS, Fmu, Instance


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
