"""Device files: what is written is read back, what is wrong is refused, what is packaged is right."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gyro_model.device import (
    CONTROLLER_UNITS,
    FORMAT,
    RATE_MODE_UNITS,
    Device,
    check_passive,
    controller_for,
    design_device,
    load_device,
    packaged_devices,
    write_device,
)
from gyro_model.effect_points import MODEL
from gyro_model.errors import InputError

GOOD = 'format = 1\nname = "mine"\n[parameters]\nm = 2e-7\nkxx = 64.0\n'

positive = st.floats(1e-300, 1e100)
# The matrices stay as they are: that they are passive is a property of three numbers together.
free = [
    q
    for q in MODEL.quantities
    if q.role in ("parameter", "size", "shape", "start") and q.name not in ("kxx", "kyy", "kxy")
]
free = [q for q in free if q.name not in ("dxx", "dyy", "dxy")]


# With the reference device's stiffness the modes stay between 1 Hz and 1 MHz, the gains what a device may have.
LIMITED = {"m": (1e-9, 0.1), "sense_gain_x": (1e-6, 1e15), "sense_gain_y": (1e-6, 1e15)}


def within(quantity) -> st.SearchStrategy[float]:
    if quantity.name in LIMITED:
        return st.floats(*LIMITED[quantity.name])
    if quantity.integer:
        return st.integers(int(quantity.low), int(quantity.high))
    return st.floats(max(quantity.low, -1e300), min(quantity.high, 1e300))


parameters = st.lists(st.sampled_from(free), unique_by=lambda q: q.name).flatmap(
    lambda chosen: st.fixed_dictionaries({q.name: within(q) for q in chosen})
)
interval = st.tuples(st.floats(-1e300, 1e300), st.floats(0, 1e300)).map(lambda pair: (pair[0], pair[0] + pair[1]))
intervals = st.dictionaries(st.sampled_from([q.name for q in free]), interval, max_size=3)
controllers = st.dictionaries(st.sampled_from(sorted(CONTROLLER_UNITS)), positive)
names = st.text(st.characters(codec="utf-8"), max_size=20)
notes = st.text(st.characters(codec="utf-8", exclude_categories=["C"]), max_size=20)


@given(name=names, parameters=parameters, intervals=intervals, controller=controllers, note=notes)
def test_round_trip_to_the_last_bit(tmp_path_factory, name, parameters, intervals, controller, note) -> None:
    path = tmp_path_factory.mktemp("device") / "device.toml"
    device = Device(name, parameters, intervals, controller)
    write_device(device, path, note)
    again = load_device(str(path))
    assert again == device
    for key, value in again.parameters.items():
        assert math.copysign(1, value) == math.copysign(1, device.parameters[key]), "the sign of zero"


def test_numpy_numbers_are_written_as_numbers(tmp_path: Path) -> None:
    own = {"m": np.float64(2e-7), "k3_x": np.float64(1.25)}
    write_device(Device("numpy", own, {"m": (np.float64(1e-7), np.float64(3e-7))}), tmp_path / "d.toml")
    again = load_device(str(tmp_path / "d.toml"))
    assert again.parameters == {"m": 2e-7, "k3_x": 1.25}
    assert again.intervals == {"m": (1e-7, 3e-7)}


def test_writing_replaces_whole_and_leaves_nothing_beside(tmp_path: Path) -> None:
    path = tmp_path / "d.toml"
    path.write_text("x" * 100_000)
    write_device(Device("a", {}), path)
    assert load_device(str(path)).name == "a"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("kxx", "kxxx"), "parameter 'kxxx' is unknown; did you mean 'kxx'"),
        (("m = 2e-7", "m = 0.0"), "m = 0: give a number from 1e-18"),
        (("m = 2e-7", "m = -1.0"), "m = -1: give a number from 1e-18"),
        (("m = 2e-7", 'm = "2e-7 kg"'), "m = '2e-7 kg': give a finite number in kg"),
        (("m = 2e-7", "m = true"), "m = True: give a finite number in kg"),
        (("m = 2e-7", "m = nan"), "m = nan: give a finite number in kg"),
        (("m = 2e-7", "m = inf"), "m = inf: give a finite number in kg"),
        (("m = 2e-7", "m = [2e-7]"), r"m = \[2e-07\]: give a finite number in kg"),
        (("kxx = 64.0", "kxx = 1.0"), r"not positive definite: make kxx\*kyy > kxy\^2"),
        (("kxx = 64.0", "kxx = 0.0"), "not positive definite"),
        (("kxx = 64.0", "dxx = 0.0"), r"feeds energy: make dxx\*dyy >= dxy\^2"),
        (("kxx = 64.0", "seed = 1.5"), "seed = 1.5: give a whole number"),
        (("kxx = 64.0", "seed = -1"), "seed = -1: give a number from 0"),
        (("kxx = 64.0", "u_x = 1.0"), "parameter 'u_x' is unknown"),
        (("format = 1", "format = 2"), f"format = 2: this program reads format = {FORMAT}"),
        (("format = 1\n", ""), "format = None"),
        (('name = "mine"\n', ""), 'name is missing: add name = "..."'),
        (('name = "mine"', "name = 3"), "name is missing"),
        (("[parameters]", "[parameter]"), "key 'parameter' is unknown; did you mean 'parameters'"),
        (("[parameters]\nm = 2e-7\nkxx = 64.0\n", "parameters = 3"), r"parameters = 3: make it a table \[parameters\]"),
        (
            ("kxx = 64.0", "kxx = 64.0\n[intervals]\nkxx = [2.0, 1.0]"),
            r"interval kxx = \[2.0, 1.0\]: give \[low, high\]",
        ),
        (("kxx = 64.0", "kxx = 64.0\n[intervals]\nkxx = 2.0"), "interval kxx = 2.0"),
        (("kxx = 64.0", "kxx = 64.0\n[intervals]\nkzz = [1.0, 2.0]"), "parameter 'kzz' is unknown"),
        (
            ("kxx = 64.0", "kxx = 64.0\n[controller]\ntonex = 1.0"),
            "controller 'tonex' is unknown; did you mean 'tone_x'",
        ),
        (
            ("kxx = 64.0", "kxx = 64.0\n[controller]\ntone_x = -1.0"),
            "controller tone_x = -1.0: give a positive number in Hz",
        ),
        (("kxx = 64.0", "kxx = 64.0\n[controller]\ntone_x = true"), "controller tone_x = True"),
        (("kxx = 64.0", "kxx = "), "not TOML"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    assert change[0] in GOOD
    path = tmp_path / "bad.toml"
    path.write_text(GOOD.replace(*change), encoding="utf-8")
    with pytest.raises(InputError, match=message) as caught:
        load_device(str(path))
    assert str(caught.value).startswith(f"device file {path}: ")
    assert "\n" not in str(caught.value)


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(b"name = \xff\xfe")
    with pytest.raises(InputError, match="not TOML"):
        load_device(str(path))


def test_unknown_devices_are_refused_with_the_nearest() -> None:
    with pytest.raises(
        InputError, match="device 'referense': neither a packaged device nor a file; did you mean 'reference'"
    ):
        load_device("referense")
    with pytest.raises(InputError, match="neither a packaged device nor a file"):
        load_device("nowhere/device.toml")


@pytest.mark.parametrize("name", packaged_devices())
def test_packaged_devices_load(name: str) -> None:
    device = load_device(name)
    assert device.name == name
    assert set(device.all_controller) == set(CONTROLLER_UNITS)
    # Every number stands beside its unit.
    for line in packaged_devices()[name].read_text(encoding="utf-8").partition("[parameters]")[2].splitlines():
        key, equals, comment = line.partition("=")
        if equals:
            tables = CONTROLLER_UNITS | RATE_MODE_UNITS
            unit = tables.get(key.strip()) or MODEL.parameter(key.strip()).unit
            assert comment.partition("#")[2].split()[0].rstrip(",:") == unit, line


def test_reference_device_is_the_start_of_the_fmu() -> None:
    device = load_device("reference")
    for name, value in device.parameters.items():
        if MODEL.parameter(name).role == "parameter":
            assert value == MODEL.parameter(name).start, name
    # Its one size: 20 pm rms at 1e6 V/m (docs/theory/plant.md).
    sizes = {name: value for name, value in device.parameters.items() if MODEL.parameter(name).role == "size"}
    assert sizes == {"sense_noise": 2e-5}
    # Its controller is the one that is printed there, and close to what would be scaled from it.
    assert device.controller == {"k": 63.955, "tone_amplitude": 32e-6, "tone_x": 450.0, "tone_y": 500.0}
    for key, value in controller_for(63.955, 1.8e-7).items():
        # 3000 Hz and 0.5 µm are themselves rounded to 1e-4 and 1e-3.
        assert value == pytest.approx(device.controller[key], rel=2e-3)


def test_acts_only_where_a_size_differs() -> None:
    device = Device("d", {"k3_x": 0.0, "pickoff_inverse_gap": 1e4, "parasitic_frequency": 7e3})
    acting = {effect.id for effect in MODEL.effects if device.acts(effect) and not effect.nominal}
    assert acting == {"pickoff_nonlinearity"}
    assert device.with_parameters({"k3_x": 1.0}).acts(MODEL.effect("cubic_stiffness"))
    assert device.parameters["k3_x"] == 0.0


@given(
    frequency=st.floats(100, 1e5),
    split=st.floats(0, 1e4),
    q=st.floats(1, 1e6),
    angle=st.floats(-180, 180),
    mass=st.floats(1e-10, 1e-4),
)
def test_a_designed_device_has_the_modes_asked_for(frequency, split, q, angle, mass) -> None:
    device = design_device("d", frequency=frequency, split=split, q=q, axis_angle=angle, mass=mass)
    p = device.all_parameters
    stiffness = np.array([[p["kxx"], p["kxy"]], [p["kxy"], p["kyy"]]])
    damping = np.array([[p["dxx"], p["dxy"]], [p["dxy"], p["dyy"]]])
    values, modes = np.linalg.eigh(stiffness / p["m"])
    # Eigenvalues to a few roundings of the largest, so frequencies to that over their ratio squared.
    ratio = (frequency + split) / frequency
    assert np.sqrt(values) / (2 * np.pi) == pytest.approx([frequency, frequency + split], rel=1e-14 * ratio**2)
    axis = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    # The axis is as sharp as the rounding of K (1e-15) over the distance of its eigenvalues.
    assert abs(axis @ modes[:, 1]) <= 1e-15 * ratio**2 / max(ratio**2 - 1, 1e-15) + 1e-15
    across = np.array([-axis[1], axis[0]])
    for mode, w in ((axis, 2 * np.pi * frequency), (across, 2 * np.pi * (frequency + split))):
        assert mode @ damping @ mode == pytest.approx(mass * w / q, rel=1e-13 * ratio)


@pytest.mark.parametrize(
    "wrong", [{"frequency": 0.0}, {"split": -1.0}, {"q": 0.0}, {"mass": math.nan}, {"axis_angle": math.inf}]
)
def test_bad_designs_are_refused(wrong: dict[str, float]) -> None:
    good = {"frequency": 3000.0, "split": 30.0, "q": 2000.0, "axis_angle": 12.0, "mass": 1e-7}
    [name] = wrong
    with pytest.raises(InputError, match=f"{name} = "):
        design_device("d", **(good | wrong))


def test_passive_border_is_allowed() -> None:
    check_passive({"kxx": 1.0, "kyy": 1.0, "kxy": 0.0, "dxx": 1.0, "dyy": 4.0, "dxy": -2.0})
    check_passive({"kxx": 1.0, "kyy": 1.0, "kxy": 0.0, "dxx": 0.0, "dyy": 0.0, "dxy": 0.0})


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"q": 0.1}, "1 to 1e+10"),
        ({"frequency": 3e9}, "1 to 1e+07 Hz"),
        ({"split": 3e9}, "1 to 1e+07 Hz"),
        ({"mass": 1e30}, "1e-18 to 1000 kg"),
        ({"gain": 1e300}, "1e-06 to 1e+15 V/m"),
        ({"gap": 1.0}, "1e-09 to 0.01 m"),
        ({"q_upper": float("nan")}, "1 to 1e+10"),
    ],
)
def test_what_no_gyroscope_is_is_refused_with_the_range(changes, said) -> None:
    designer = {"frequency": 3000.0, "split": 30.0, "q": 2000.0, "mass": 1e-7}
    with pytest.raises(InputError, match="this model describes no other") as error:
        Device.from_designer(**{**designer, **changes})
    assert said in str(error.value)


def test_absurd_values_in_a_file_are_refused_like_a_designer_s() -> None:
    for changes in ({"kxx": 1e12, "kyy": 1e12}, {"sense_gain_x": 1e300}, {"dxx": 1.0, "dyy": 1.0}):
        with pytest.raises(InputError, match="this model describes no other"):
            Device("absurd", changes)


@given(
    frequency=st.floats(100, 1e5), split=st.floats(1, 1e4), q=st.floats(10, 1e6), q_upper=st.floats(10, 1e6),
    angle=st.floats(-180, 180),
)  # fmt: skip
def test_modes_and_quality_factors_come_back(frequency, split, q, q_upper, angle) -> None:
    device = Device.from_designer(
        frequency=frequency, split=split, q=q, q_upper=q_upper, axis_angle=angle, mass=1e-7, gain=2e6, gap=2e-6
    )
    # Rounding of K (1e-15) over the distance of its eigenvalues turns the axes, and mixes the Qs by the square.
    ratio = (frequency + split) / frequency
    assert device.frequencies == pytest.approx((frequency, frequency + split), rel=1e-13 * ratio**2)
    turned = 1e-14 * ratio**2 / (ratio**2 - 1)
    # The larger damping leaves its own rounding in the smaller one.
    mixed = 1e-13 + (turned**2 + 1e-15) * max(q / q_upper, q_upper / q) * ratio
    assert device.quality_factors == pytest.approx((q, q_upper), rel=10 * mixed)
    assert device.parameters["pickoff_inverse_gap"] == 5e5
