"""A sensor in the formats of other programs: read back, each with its own conventions."""

import ast
import json
import re
from math import degrees, radians
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from calibration.sensor.format import chosen, files_of, format_names
from calibration.sensor.numbers import Sensor, sensor_of
from gyro_model.errors import InputError

SENSOR = Sensor(
    device="mine", noise_density=2e-5, random_walk=3e-7, random_walk_error=1e-8, instability=1e-6, bias=0.01,
    turn_on=1e-5, scale_factor=1.002, full_scale=5.0, bias_slope=-1e-4, scale_factor_slope=3e-4, acceleration=2e-6,
    bandwidth=50.0,
)  # fmt: skip
RATE = 400.0


@pytest.fixture(scope="module")
def files() -> dict[str, str]:
    return files_of(SENSOR, RATE)


def summary(**more: Any) -> dict[str, Any]:
    """A datasheet as written: 0.1 °/√h, 2 °/h/√h of rate random walk ± 0.1, and what else a sensor needs."""
    values = {
        "angle_random_walk": (0.1, 0.001), "rate_random_walk": (2.0, 0.1), "flicker": (1.0, 0.9), "bias": (2.0, 0.01),
        "bias_repeatability": (5.0, 1.0), "scale_factor": (0.99, 1e-4), "full_scale": (300.0, None),
        "bias_slope": (-10.0, 0.1), "scale_factor_slope": (300.0, 1.0), "bandwidth": (60.0, 0.1), **more,
    }  # fmt: skip
    figures = [{"id": name, "value": value, "error": error} for name, (value, error) in values.items()]
    return {"format": 1, "mode": "rate-open", "device": "mine", "tests": [{"figures": figures}]}


def test_numbers_are_in_si() -> None:
    found = sensor_of(json.loads(json.dumps(summary())))
    assert found.noise_density == pytest.approx(radians(0.1) / 60)  # 1 °/√h is 1/60 °/s/√Hz
    assert found.random_walk == pytest.approx(radians(2.0) / 3600 / 60)
    assert found.instability == 0.0  # 1.0 ± 0.9 is not seen
    assert found.bias == pytest.approx(radians(2.0))
    assert found.bias_slope == pytest.approx(radians(-10.0) / 3600)
    assert found.scale_factor_slope == pytest.approx(3e-4)
    assert found.bandwidth == 60.0
    g_sensitive = sensor_of(summary(acceleration_x=(0.1, 0.01), acceleration_y=(-0.3, 0.01)))
    assert g_sensitive.acceleration == pytest.approx(radians(0.3) / 9.80665)


def test_what_was_not_done_is_named_where_a_figure_is_missing() -> None:
    without = summary(full_scale=(None, None))
    without["tests"].append({"figures": [], "title": "Input rate limits", "not_done": "drive loop lost its lock"})
    with pytest.raises(InputError, match=r"full_scale has no value.*not done were: Input rate limits: drive loop lost"):
        sensor_of(without)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "not the content of a datasheet"),
        ({"format": 2, "tests": []}, "not the content of a datasheet"),
        ({"format": 1, "tests": 5}, "hold no figures"),
        ({**summary(), "mode": "whole-angle"}, "whole-angle"),
        (summary(bias=(None, 0.1)), "bias has no value"),
        (summary(full_scale=(True, None)), "full_scale has no value"),
        (summary(rate_random_walk=(1.0, None)), "rate_random_walk has no error"),
    ],
)
def test_what_is_no_datasheet_of_a_sensor_is_refused(content: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        sensor_of(content)


def test_a_name_can_not_leave_its_comment() -> None:
    nasty = sensor_of({**summary(), "device": "a -->\n<plugin/>\nimport os"})
    for text in files_of(nasty, RATE).values():
        assert "<plugin/>" not in text
        assert "\nimport os" not in text


def test_every_format_gives_a_file(files: dict[str, str]) -> None:
    assert [name.partition("_")[2].rpartition(".")[0] for name in files] == format_names()
    with pytest.raises(InputError, match="kalibr"):
        chosen(["calibr"])
    assert chosen([]) == (format_names(), True)
    assert chosen(["px4"]) == (["px4"], False)
    assert chosen(["fmu"]) == ([], True)
    with pytest.raises(InputError, match="sample rate"):
        files_of(SENSOR, float("nan"))


def test_kalibr_has_its_keys_and_never_a_walk_of_zero(files: dict[str, str]) -> None:
    # One mapping of plain scalars: a line "key: value  # comment" each.
    loaded = dict(re.findall(r"^(\w+): ([^ #\n]+)", files["sensor_kalibr.yaml"], re.M))
    assert list(loaded) == ["gyroscope_noise_density", "gyroscope_random_walk", "rostopic", "update_rate"]
    assert float(loaded["gyroscope_noise_density"]) == pytest.approx(2e-5)
    assert float(loaded["gyroscope_random_walk"]) == pytest.approx(3e-7)
    assert float(loaded["update_rate"]) == RATE
    unseen = files_of(SENSOR._replace(random_walk=0.0), RATE, ["kalibr"])["sensor_kalibr.yaml"]
    assert "gyroscope_random_walk: 1.000000e-08" in unseen


def test_kalibr_loads_as_yaml(files: dict[str, str]) -> None:
    yaml = pytest.importorskip("yaml")
    loaded = yaml.safe_load(files["sensor_kalibr.yaml"])
    assert loaded["gyroscope_noise_density"] == pytest.approx(2e-5)
    assert loaded["rostopic"] == "/imu0"


def test_gnss_ins_sim_is_a_dictionary_of_three_axes(files: dict[str, str]) -> None:
    tree = ast.parse(files["sensor_gnss_ins_sim.py"])
    assert isinstance(tree.body[0], ast.Assign)
    loaded = ast.literal_eval(tree.body[0].value)
    assert loaded["gyro_arw"] == pytest.approx([degrees(2e-5) * 60] * 3)
    assert loaded["gyro_b"] == pytest.approx([degrees(0.01) * 3600] * 3)
    assert loaded["gyro_b_stability"] == pytest.approx([degrees(1e-6) * 3600] * 3)
    assert set(loaded) == {"gyro_b", "gyro_arw", "gyro_b_stability", "gyro_b_corr"}


def test_the_matlab_call_has_the_names_of_gyroparams(files: dict[str, str]) -> None:
    text = files["sensor_matlab.m"]
    pairs = dict(re.findall(r'^ +"(\w+)", (\[[^]]*\]|"[^"]*"|[^ ,]+)', text, re.M))
    assert set(pairs) == {
        "MeasurementRange", "ConstantBias", "NoiseDensity", "NoiseType", "BiasInstability", "RandomWalk",
        "TemperatureBias", "TemperatureScaleFactor", "AccelerationBias",
    }  # fmt: skip
    assert pairs["NoiseType"] == '"double-sided"'
    assert [float(v) for v in pairs["TemperatureScaleFactor"].strip("[]").split()] == pytest.approx([0.03] * 3)
    # Every line but the last of the call goes on; brackets close.
    call = text[text.index("gyroparams(") : text.index("imu = ")].strip().splitlines()
    assert all("..." in line for line in call[:-1])
    assert ");" in call[-1]
    code = "\n".join(line.partition("%")[0] for line in text.splitlines())
    assert code.count("(") == code.count(")") == 2


def test_gazebo_and_px4_are_xml_with_their_units(files: dict[str, str]) -> None:
    gazebo = ElementTree.fromstring(files["sensor_gazebo.sdf"])
    for axis in "xyz":
        noise = gazebo.find(f"{axis}/noise")
        assert noise is not None
        assert noise.get("type") == "gaussian"
        # Of a sample: N √rate.
        assert float(noise.findtext("stddev", "")) == pytest.approx(2e-5 * np.sqrt(RATE))
        assert float(noise.findtext("dynamic_bias_stddev", "")) == pytest.approx(3e-7)
    px4 = ElementTree.fromstring(files["sensor_px4.sdf"])
    assert float(px4.findtext("gyroscopeNoiseDensity", "")) == pytest.approx(2e-5)
    assert float(px4.findtext("gyroscopeTurnOnBiasSigma", "")) == pytest.approx(1e-5)


def test_gazebo_noise_has_the_angle_random_walk_again(files: dict[str, str]) -> None:
    noise = ElementTree.fromstring(files["sensor_gazebo.sdf"]).find("z/noise")
    assert noise is not None
    samples = float(noise.findtext("stddev", "")) * np.random.default_rng(1).standard_normal((200, 400))
    # Means over a second of a rate with N scatter by N; 200 of them know it to 5 %, three times that.
    assert samples.mean(axis=1).std() == pytest.approx(2e-5, rel=0.15)
