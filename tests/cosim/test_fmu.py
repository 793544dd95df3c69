"""The plant as the loop sees it: variables by name, compiled calls, refusals."""

import zipfile
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu
from numba import njit

from cosim.exchange import exchange
from cosim.fmu import FMI_ERROR, HANDLE_SIZE, INPUT_NAMES, OUTPUT_NAMES, Plant, open_plant
from gyro_model.build import build
from gyro_model.errors import InputError

PERIOD = 5e-6
START = {"x_start": 1e-6, "y_dot_start": 0.01, "sense_noise": 2e-5}


@njit
def steps(handle, inputs, outputs, values, n, period):  # type: ignore[no-untyped-def]
    got = np.zeros((n + 1, 6))
    flags = np.zeros(4)
    status = 0
    for k in range(n):
        status = max(status, exchange(handle, inputs, values, outputs, got[k + 1], flags, k * period, period))
    return status, got


def test_compiled_calls_give_what_fmpy_gives() -> None:
    inputs = np.array([1e-6, -2e-6, 3.0])
    with open_plant(START) as plant:
        status, got = steps(plant.handle, plant.inputs, plant.outputs, inputs, 100, PERIOD)
    start = {**START, **dict(zip(INPUT_NAMES, inputs, strict=True))}
    expected = simulate_fmu(
        str(build().fmi3), stop_time=100 * PERIOD, output_interval=PERIOD, start_values=start, output=list(OUTPUT_NAMES)
    )
    assert status == 0
    # The same binary with the same numbers: equal to the bit.
    for column, name in enumerate(OUTPUT_NAMES):
        np.testing.assert_array_equal(got[1:, column], expected[name][1:])


def test_outputs_are_valid_before_the_first_step() -> None:
    with open_plant({"x_start": 1e-6}) as plant:
        assert dict(zip(OUTPUT_NAMES, plant.get(OUTPUT_NAMES), strict=True))["v_x"] == 1.0


def test_handle_has_an_address_in_each_place() -> None:
    with open_plant({}) as plant:
        assert plant.handle.shape == (HANDLE_SIZE,)
        assert (plant.handle != 0).all()


def test_a_refused_step_is_a_status_and_a_complaint() -> None:
    with open_plant({}) as plant:
        status, _ = steps(plant.handle, plant.inputs, plant.outputs, np.zeros(3), 1, -1e-6)
        assert status == FMI_ERROR
        assert "-1e-06 s" in plant.complaint()


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({"k3_z": 1.0}, "did you mean 'k3_"),
        ({"m": -1.0}, "m = -1"),
        ({"kxy": 1e3}, "positive definite"),
        ({"sample_period": 0.0}, "sample_period"),
        ({"kxx": float("nan")}, "kxx"),
    ],
)
def test_wrong_parameters_are_refused_by_name(parameters: dict[str, float], expected: str) -> None:
    with pytest.raises(InputError, match=expected):
        open_plant(parameters)


def test_an_fmu_of_another_model_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "Gyroscope.fmu"
    with zipfile.ZipFile(build().fmi3) as source, zipfile.ZipFile(other, "w") as target:
        for name in source.namelist():
            data = source.read(name)
            if name == "modelDescription.xml":
                data = data.replace(b'instantiationToken="{', b'instantiationToken="{0')
            target.writestr(name, data)
    with pytest.raises(InputError, match="another model"):
        Plant(other, {})


def test_a_file_that_is_no_fmu_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "Gyroscope.fmu"
    path.write_bytes(b"not a zip")
    with pytest.raises(InputError, match="build it anew"):
        Plant(path, {})


def test_many_plants_side_by_side() -> None:
    plants = [open_plant({**START, "seed": seed}) for seed in range(8)]
    try:
        together = [steps(p.handle, p.inputs, p.outputs, np.zeros(3), 50, PERIOD)[1] for p in plants]
    finally:
        for plant in plants:
            plant.close()
    with open_plant({**START, "seed": 5}) as alone:
        np.testing.assert_array_equal(
            together[5], steps(alone.handle, alone.inputs, alone.outputs, np.zeros(3), 50, PERIOD)[1]
        )
    assert not np.array_equal(together[5], together[6])
