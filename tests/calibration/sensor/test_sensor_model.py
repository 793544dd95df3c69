"""GyroscopeSensor.fmu against independent computations of what it should be, and its parameters from a datasheet."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from scipy.signal import cont2discrete

from calibration.analysis.thermal_course import basis, curve_through, followed, pushed, thermal_course
from calibration.sensor.bandwidth import Section, fit_noise_lead, fit_sections, transfer_of
from calibration.sensor.model import sensor_parameters
from gyro_model.build import build
from gyro_model.errors import InputError
from gyro_model.sensor import KNOTS, WIDTHS, SensorModel

Floats = np.ndarray[Any, np.dtype[np.float64]]

SECTIONS = (Section(20.0, 0.1, 1e-3), Section(35.0, 0.9, -2e-4))
FILTER = {f"filter_{name}_{k}": v for k, one in enumerate(SECTIONS, 1) for name, v in one._asdict().items()}
FAST = {f"filter_{name}_{k}": v for k in (1, 2) for name, v in (("frequency", 1e4), ("damping", 0.7))}
"""A bandwidth beyond what is looked at."""


@pytest.fixture(scope="module")
def simulated() -> Callable[..., Mapping[str, Floats]]:
    """Runs the FMU under ``inputs`` by name against ``t``, held from row to row; the outputs at the rows."""
    path = str(build(SensorModel()).fmi3)

    def run(t: Floats, parameters: Mapping[str, float], **inputs: Floats) -> Mapping[str, Floats]:
        table = np.zeros(len(t), dtype=[("time", float), *((name, float) for name in inputs)])
        table["time"] = t
        for name, values in inputs.items():
            table[name] = values
        outputs = ["rate", "rate_sampled", "data_ready", "temperature_structure"]
        result = fmpy.simulate_fmu(
            path, stop_time=float(t[-1]), output_interval=float(t[1] - t[0]), start_values=dict(parameters),
            input=table if inputs else None, output=outputs,
        )  # fmt: skip
        return {name: result[name] for name in outputs}

    return run


def exact(t: Floats, u: Floats) -> Floats:
    """The filter's output for an input held from row to row, by scipy's zero-order hold of each section."""
    for one in SECTIONS:
        w = 2 * np.pi * one.frequency
        a = np.array([[0.0, 1.0], [-(w**2), -2 * one.damping * w]])
        b, c = np.array([[0.0], [w**2]]), np.array([[1.0, one.lead]])
        if one is SECTIONS[0]:
            states, inputs, out = a, b, c
        else:
            # In a row: what leaves the first section enters the second.
            states = np.block([[states, np.zeros((2, 2))], [b @ out, a]])
            inputs, out = np.vstack([inputs, np.zeros((2, 1))]), np.hstack([np.zeros((1, 2)), c])
    moved, driven, *_ = cont2discrete((states, inputs, out, np.zeros((1, 1))), t[1] - t[0])
    x, y = np.zeros(4), []
    for value in u:
        y.append(float((out @ x)[0]))
        x = moved @ x + driven[:, 0] * value
    return np.array(y)


def test_the_filter_is_exact_for_held_inputs(simulated: Callable[..., Any]) -> None:
    t = np.arange(200) * 1.7e-3
    rate = np.random.default_rng(1).uniform(-1, 1, len(t))
    rate[0] = 0.0  # at rest before
    found = simulated(t, FILTER, omega_z=rate)["rate"]
    # Roundings of two matrix exponentials, some 1e-13.
    assert np.abs(found - exact(t, rate)).max() < 1e-11


def test_temperature_lag_curve_and_hysteresis(simulated: Callable[..., Any]) -> None:
    rng = np.random.default_rng(2)
    knots = np.linspace(250.0, 350.0, KNOTS)
    curve = rng.uniform(-0.1, 0.1, KNOTS)
    parameters = {
        **FAST, "temperature_low": knots[0], "temperature_high": knots[-1], "thermal_hysteresis": 0.05, "bias": 0.2,
        "structure_lag": 40.0, "internal_step": 0.1, "scale_factor_hysteresis": 0.1,
        **{f"bias_temperature_{k}": v for k, v in enumerate(curve)},
    }  # fmt: skip
    t = np.arange(0.0, 400.0)
    ambient = 300 + 60 * np.sin(t / 30) + 10 * np.sin(t / 7)
    found = simulated(t, parameters, temperature=ambient, omega_z=np.full(len(t), 0.3))
    # The FMU holds the ambient temperature over a row.
    structure = np.concatenate([ambient[:1], np.zeros(len(t) - 1)])
    for k in range(1, len(t)):
        structure[k] = structure[k - 1] + (ambient[k - 1] - structure[k - 1]) * (1 - np.exp(-1 / 40.0))
    assert found["temperature_structure"] == pytest.approx(structure, abs=1e-9)
    side = pushed(structure, [w.start for w in WIDTHS])
    expected = 0.3 * (1 + 0.1 * side) + 0.2 + basis(structure, knots) @ curve + 0.05 * side
    # The output is of the temperature one internal step ago: 0.1 s of some K/s and 0.1 rad/s a knot of 6 K.
    assert np.abs(found["rate"] - expected).max() < 0.01
    assert np.std(found["rate"] - expected) < 0.02 * np.std(expected)


def test_rate_errors_and_supply(simulated: Callable[..., Any]) -> None:
    t = np.arange(6) * 0.1
    one = np.ones(6)
    parameters = {
        **FAST, "scale_factor": 0.9, "nonlinearity_2": 0.01, "nonlinearity_3": -0.02, "misalignment_x": 0.03,
        "acceleration_sensitivity_y": 1e-3, "bias_supply": 0.1, "scale_factor_supply": 0.5, "self_test_rate": 0.25,
    }  # fmt: skip
    found = simulated(t, parameters, omega_z=2 * one, omega_x=-one, a_y=9.8 * one, supply=3.5 * one, self_test=one)
    rate = 2 - 0.03
    wanted = (0.9 + 0.1 + 0.01 * rate - 0.02 * rate**2) * rate + 9.8e-3 + 0.02 + 0.25
    assert found["rate"][-1] == pytest.approx(wanted, rel=1e-9)


def test_samples_are_limited_rounded_and_announced(simulated: Callable[..., Any]) -> None:
    t = np.arange(400) * 1e-3
    rate = 1.5 * np.sin(2 * np.pi * t / 0.4)
    parameters = {**FAST, "full_scale": 0.99, "lsb": 0.03, "sample_period": 10e-3}
    found = simulated(t, parameters, omega_z=rate)
    sampled = np.repeat(found["rate_sampled"][::10], 10)
    assert found["rate_sampled"] == pytest.approx(sampled, abs=0)
    assert np.abs(sampled).max() == pytest.approx(0.99)
    inside = np.abs(sampled) < 0.98
    steps = sampled[inside] / 0.03
    assert steps == pytest.approx(np.rint(steps), abs=1e-9)
    # Half a step, and what the rate moves by in the millisecond before the sample: 1.5 · 2π/0.4 · 1e-3.
    ideal = np.repeat(rate[::10], 10)
    assert np.abs(sampled - ideal)[inside].max() < 0.015 + 0.024
    assert (found["data_ready"].reshape(-1, 10)[1:] == [1] * 5 + [0] * 5).all()


def test_turn_ons_come_from_seed_and_supply(simulated: Callable[..., Any]) -> None:
    t = np.arange(300) * 1e-2
    supply = np.where((t > 0.995) & (t < 1.495), 1.0, 3.3)
    parameters = {**FAST, "turn_on": 0.1, "supply_low": 2.0, "start_up_time": 0.25}
    found = simulated(t, parameters, supply=supply)["rate"]
    first, second = found[90], found[290]
    assert first != second
    assert (found[:25] == 0).all() and (found[26:100] == first).all()
    assert (found[102:174] == 0).all() and (found[177:] == second).all()
    draws = np.array([simulated(t[:60], {**parameters, "seed": seed})["rate"][-1] for seed in range(40)])
    # 40 of them know their deviation to 11 %, their mean to 16 % of it; three times that.
    assert np.std(draws) == pytest.approx(0.1, rel=0.34)
    assert abs(np.mean(draws)) < 0.048


def allan_variance(rate: Floats, counts: Floats) -> Floats:
    """Allan variance of means over ``counts`` rows, overlapping."""
    total = np.concatenate([[0.0], np.cumsum(rate)])
    second = [total[2 * m :] - 2 * total[m:-m] + total[: -2 * m] for m in counts.tolist()]
    return np.array([np.mean(d**2) / (2 * m**2) for d, m in zip(second, counts.tolist(), strict=True)])


@pytest.mark.parametrize(
    "terms",
    [
        {"angle_random_walk": 1e-3},
        {"bias_instability": 1e-3},
        {"rate_random_walk": 1e-3},
        {"angle_random_walk": 1e-4, "bias_instability": 1e-3, "rate_random_walk": 2e-4},
    ],
)
def test_allan_deviation_is_the_design(simulated: Callable[..., Any], terms: dict[str, float]) -> None:
    n, b, k = (terms.get(name, 0.0) for name in ("angle_random_walk", "bias_instability", "rate_random_walk"))
    interval, seeds = 1e-2, 8
    t = np.arange(4001) * interval
    counts = np.unique(np.rint(np.geomspace(2, 400, 8)).astype(int))
    # A value a draw of the noise: finer draws would be folded back, with no filter before the samples.
    parameters = {**FAST, **terms, "internal_step": interval}
    records = [simulated(t, {**parameters, "seed": seed})["rate"][1:] for seed in range(seeds)]
    variances = np.array([allan_variance(rate, counts) for rate in records])
    found = np.sqrt(variances.mean(axis=0))
    error = variances.std(axis=0, ddof=1) / np.sqrt(seeds) / (2 * found)
    tau = interval * counts
    # A walk that is held from point to point has τ/3 (1 + 1/2m²) (sum of squares of a staircase).
    design = np.sqrt(n**2 / tau + 2 * np.log(2) / np.pi * b**2 + k**2 * tau / 3 * (1 + 0.5 / counts**2))
    # As promised 10 % or two standard errors; three here, since one in 20 of eight is beyond two.
    assert (np.abs(found - design) < np.maximum(0.1 * design, 3 * error)).all(), (found / design, error / design)


def test_sections_of_a_known_filter_come_back() -> None:
    frequency = np.geomspace(1.0, 150.0, 60)
    found, off = fit_sections(frequency, 0.98 * transfer_of(SECTIONS, frequency))
    # Two zeros and four poles have more than one nearest point; none that it ends in is further off.
    assert off < 5e-3
    wide = np.geomspace(0.5, 100.0, 100)
    assert np.abs(transfer_of(found, wide) - transfer_of(SECTIONS, wide)).max() < 0.01


@pytest.mark.parametrize("damping", [0.02, 0.7, 5.0])
def test_one_section_is_fitted_by_two(damping: float) -> None:
    frequency = np.geomspace(1.0, 150.0, 60)
    gain = transfer_of((Section(30.0, damping, 0.0),), frequency)
    # The other's poles would have to go to infinity; they may be 50 times as fast.
    assert fit_sections(frequency, gain)[1] < 2e-3


@pytest.mark.parametrize("damping", [2e-3, 2e-2])
def test_a_resonance_between_two_lines_is_as_high_as_it_is(damping: float) -> None:
    # As the datasheet's lines are spaced, multiples of a fortieth of the bandwidth, and with the poles of rate mode's
    # filters where nothing else is said: four poles for six.
    frequency = np.unique(np.rint(np.geomspace(1, 160, 80))) * 1.3
    mode, outputs = Section(40.3 * 1.3, damping, 0.0), (Section(62.0, 1.0, 0.0), Section(620.0, 1.0, 0.0))
    gain = 0.97 * transfer_of((mode, *outputs), frequency)
    found, off = fit_sections(frequency, gain)
    assert off < 5e-3
    # One begin beside the resonance left the gain half a decibel off at the bandwidth, some percent at 5 Hz.
    there = np.array([0.01, 5.0, 63.0, 70.0, mode.frequency])
    ratio = np.abs(transfer_of(found, there) / transfer_of((mode, *outputs), there))
    assert ratio[:4] == pytest.approx(1.0, abs=5e-3)
    assert ratio[4] == pytest.approx(1.0, abs=0.05)


def test_lag_and_hysteresis_of_a_known_course_come_back() -> None:
    rng = np.random.default_rng(4)
    t = np.arange(0.0, 2500.0, 5.0)
    ambient = np.interp(t, (100, 280, 580, 955, 1255, 1450), (298.0, 358.0, 358.0, 233.0, 233.0, 298.0))
    widths = [w.start for w in WIDTHS]
    temperature = followed(ambient, 5.0, 150.0)
    bias = 0.3 * np.sin(temperature / 15) + 0.02 * pushed(temperature, widths) + 0.1
    bias += 1e-3 * rng.standard_normal(len(t))
    still = np.linspace(233.0, 358.0, 7)
    knots = np.linspace(233.0, 358.0, KNOTS)
    found = thermal_course(ambient, bias, 5.0, (still, 0.3 * np.sin(still / 15)), knots, widths)
    assert found.lag == pytest.approx(150.0, rel=0.02)
    assert found.hysteresis == pytest.approx(0.02, abs=1e-3)
    assert basis(temperature, knots) @ found.curve == pytest.approx(0.3 * np.sin(temperature / 15), abs=0.01)


def test_a_curve_goes_through_its_points() -> None:
    knots = np.linspace(0.0, 16.0, KNOTS)
    points = np.array([0.0, 3.0, 7.5, 11.0, 16.0])
    curve = curve_through(knots, points, points**2)
    assert basis(points, knots) @ curve == pytest.approx(points**2, abs=0.1)
    assert basis(np.array([-5.0, 30.0]), knots) @ curve == pytest.approx(curve[[0, -1]])
    straight = curve_through(knots, points, 2 * points)
    assert basis(np.linspace(0, 16, 50), knots) @ straight == pytest.approx(2 * np.linspace(0, 16, 50), abs=1e-6)


def datasheet() -> dict[str, Any]:
    """The content of a datasheet.json with what a sensor needs."""
    frequency = np.geomspace(1.0, 150.0, 60)
    gain = transfer_of(SECTIONS, frequency)
    celsius = np.array([-40.0, 0.0, 25.0, 85.0])
    rate = np.linspace(-300.0, 300.0, 21)
    values = {
        "angle_random_walk": (0.1, 0.001), "rate_random_walk": (2.0, 0.1), "flicker": (1.0, 0.01), "bias": (2.0, 0.01),
        "bias_repeatability": (5.0, 1.0), "scale_factor": (0.99, 1e-4), "full_scale": (300.0, None),
        "bias_slope": (-10.0, 0.1), "scale_factor_slope": (300.0, 1.0), "bandwidth": (30.0, 0.1),
        "turn_on_output": (0.05, 0.001), "acceleration_x": (0.1, 0.01), "scale_factor_hysteresis": (-3000.0, 2.0),
    }  # fmt: skip
    figures = [{"id": name, "value": v, "error": e, "expected": None} for name, (v, e) in values.items()]
    next(f for f in figures if f["id"] == "bias_repeatability")["expected"] = 3.0
    columns: dict[str, dict[str, Floats]] = {
        "transfer": {
            "frequency [Hz]": frequency, "gain [1]": np.abs(gain), "phase [°]": np.degrees(np.unwrap(np.angle(gain)))
        },
        "scale_factor": {"rate [°/s]": rate, "residual [ppm of full scale]": 100 * (rate / 300.0) ** 3},
        "temperature": {
            "temperature [°C]": celsius, "bias [°/s]": 2 + 0.01 * (celsius - 25), "scale factor [1]": 1 + 1e-4 * celsius
        },
    }  # fmt: skip
    curves = {name: {"columns": {k: v.tolist() for k, v in own.items()}} for name, own in columns.items()}
    return {"format": 1, "mode": "rate-open", "device": "mine", "tests": [{"figures": figures}], "curves": curves}


def test_parameters_are_those_of_the_datasheet() -> None:
    found = sensor_parameters(datasheet(), 200.0)
    SensorModel().starting_at(found)
    assert found["sample_period"] == 1 / 200
    assert found["start_up_time"] == 0.05
    assert found["scale_factor_hysteresis"] == pytest.approx(-1.5e-3)  # half of it
    assert found["turn_on"] == pytest.approx(np.radians(4.0) / 3600)  # √(5² - 3²)
    assert found["acceleration_sensitivity_x"] == pytest.approx(np.radians(0.1) / 9.80665)
    # 100 ppm of full scale at full scale, by the cube.
    assert found["nonlinearity_3"] * np.radians(300) ** 2 == pytest.approx(1e-4)
    assert found["nonlinearity_2"] == pytest.approx(0.0, abs=1e-9)
    knots = np.linspace(-40.0, 85.0, KNOTS)
    bias = np.array([found["bias"] + found[f"bias_temperature_{k}"] for k in range(KNOTS)])
    assert np.degrees(bias) == pytest.approx(2 + 0.01 * (knots - 25), abs=1e-4)
    scale = np.array([found["scale_factor"] + found[f"scale_factor_temperature_{k}"] for k in range(KNOTS)])
    # Measured at half of full scale, where the cube adds a quarter of 100 ppm.
    assert scale == pytest.approx(1 + 1e-4 * knots - 2.5e-5, abs=1e-7)
    assert found["internal_step"] == 1e-3
    assert "structure_lag" not in found  # no cycle was measured


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda c: c.pop("curves"), "curve 'transfer'"),
        (lambda c: c["curves"]["transfer"]["columns"].pop("phase [°]"), "column 'phase"),
        (lambda c: c["curves"]["temperature"]["columns"].update({"bias [°/s]": [1.0, None, 2.0]}), "list of numbers"),
        (lambda c: c["curves"]["temperature"].update(columns=[1]), "curve 'temperature'"),
        (lambda c: c["curves"]["scale_factor"]["columns"].update({"rate [°/s]": "much"}), "curve 'scale_factor'"),
        (lambda c: c.update(curves=None), "curve 'transfer'"),
    ],
)
def test_a_datasheet_without_its_curves_is_refused(spoil: Callable[[Any], Any], message: str) -> None:
    content = datasheet()
    spoil(content)
    with pytest.raises(InputError, match=message):
        sensor_parameters(content, 100.0)


def test_a_rate_of_samples_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="sample_period"):
        SensorModel().starting_at(sensor_parameters(datasheet(), 1e6))


def test_noise_of_both_sides_of_a_resonance_adds_by_its_power() -> None:
    # 1/D and its mirror image, half of each for a rate, half of each power for noise: a zero at √(Δ² + γ²).
    split, decay = 2 * np.pi * 40.0, 2 * np.pi * 3.0
    frequency = np.geomspace(1.0, 60.0, 80)
    s = 2j * np.pi * frequency
    sides = [abs((decay + sign * 1j * split) / (s + decay + sign * 1j * split)) ** 2 for sign in (1, -1)]
    w = np.hypot(split, decay)
    mode = Section(w / (2 * np.pi), decay / w, decay / w**2)
    output = Section(200.0, 0.8, 0.0)
    density = (sides[0] + sides[1]) / 2 * np.abs(transfer_of((output,), frequency)) ** 2
    boxcar = np.sinc(frequency * 1e-3) ** 2
    lead = fit_noise_lead((mode, output), frequency, 1e-9 * density * boxcar, 1e-3)
    assert lead == pytest.approx(1 / w, rel=1e-3)


def test_noise_passes_its_own_zero(simulated: Callable[..., Any]) -> None:
    # White noise beyond a first-order section whose zero cancels its pole stays white; without it, it does not.
    t = np.arange(4000) * 1e-3
    flat = {"filter_frequency_1": 10.0, "filter_damping_1": 50.0, "angle_random_walk": 1e-3}
    flat |= {name: value for name, value in FAST.items() if name.endswith("2")}
    lead = 2 * 50.0 / (2 * np.pi * 10.0)
    white = simulated(t, {**flat, "noise_lead": lead})["rate"][100:]
    brown = simulated(t, flat)["rate"][100:]
    deviation = 1e-3 / np.sqrt(1e-3)
    # 3,900 values know their deviation to 1.1 %, their correlation to 1.6 %.
    assert np.std(white) == pytest.approx(deviation, rel=0.05)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.06
    assert np.corrcoef(brown[1:], brown[:-1])[0, 1] > 0.9
