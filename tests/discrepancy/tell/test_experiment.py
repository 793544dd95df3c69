"""Pairs of effects that one excitation can't tell apart, and the experiment proposed, carried out with the FMU."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from discrepancy.data.record import Record, make_record
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.fit.whitening import Setting, whitener
from discrepancy.tell.experiment import Experiment, next_experiment
from discrepancy.tell.menu import LEVEL, menu
from gyro_model.device import load_device
from gyro_model.errors import InputError
from gyro_model.model import load_model

RATE, SAMPLES, NOISE = 200_000.0, 4000, 2e-5
MODEL = load_model()
TRUE = {**load_device("reference").parameters, "sense_gain_x": 1e6, "sense_gain_y": 1e6}
NOMINAL = {name: TRUE[name] for name in ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy", "sense_gain_x", "sense_gain_y")}
OFFSET = (Free("offset_x", 1e-5), Free("offset_y", 1e-5))
ACCELERATION = (Free("acceleration_gain_x", 1e-4), Free("acceleration_gain_y", 1e-4))
SOFTENING = (Free("softening", 1e-8),)
CUBIC = (Free("k3_x", 1e3), Free("k3_y", 1e3))

PAIRS = {
    # A constant acceleration shifts the mean as an offset does, exactly, as long as it stays constant.
    "offset": ({"amplifier_offset": OFFSET, "linear_acceleration": ACCELERATION}, {"offset_x": 2e-3, "offset_y": 1e-3},
               {"a_x": 9.8, "a_y": 9.8}, "added acceleration"),
    "acceleration": ({"linear_acceleration": ACCELERATION, "amplifier_offset": OFFSET},
                     {"acceleration_gain_x": -0.05, "acceleration_gain_y": -0.05},
                     {"a_x": 9.8, "a_y": 9.8}, "added acceleration"),
    # At constant bias the pull is a V² q (1 + 2 (q/g)² + ...): its first part is one with k, its second a cubic spring.
    "softening": ({"electrostatic_softening": SOFTENING, "cubic_stiffness": CUBIC}, {"softening": 2e-5},
                  {"v_bias": 10.0}, "bias step"),
}  # fmt: skip


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(MODEL) as opened:
        yield opened


def measured(simulator: Simulator, record: Record, hidden: Mapping[str, float], seed: int) -> Record:
    """The record as the device with the hidden effect would give it, noise of 20 µV a sample."""
    return replace(record, v=simulator.run(record, {**TRUE, **hidden, "sense_noise": NOISE, "seed": seed}))


def runs(simulator: Simulator, hidden: Mapping[str, float], conditions: Mapping[str, float]) -> list[Record]:
    """Two runs of 28 tones of 1 µN over the modes: some 2 µm."""
    records = []
    t = np.arange(SAMPLES) / RATE
    for number in (1, 2):
        f = np.stack((np.linspace(400, 5800, 28) + 3 * number, np.linspace(470, 5900, 28) + 5 * number), axis=1)
        phase = np.random.default_rng(number).uniform(0, 6.28, f.shape)
        u = 1e-6 * np.sin(2 * np.pi * f * t[:, None, None] + phase).sum(axis=1)
        held = {name: np.full(SAMPLES, value) for name, value in conditions.items()}
        blank = make_record(f"run-{number}", t, u, u, sample_rate=RATE, conditions=held)
        records.append(measured(simulator, blank, hidden, number))
    return records


def fitted(simulator: Simulator, records: list[Record], sizes: tuple[Free, ...]) -> Fitted:
    """Device and sizes fitted under white noise."""
    fitter = Fitter(simulator, records)
    at = fitter.fit(fitter.begin(NOMINAL))
    values = {free.name: 10 * free.step for free in sizes}
    plain = whitener(NOMINAL, 2, 1 / RATE, Setting())
    begun = replace(at, parameters={**at.parameters, **values}, free=(*at.free, *sizes), whiten=plain, grams=None)
    return fitter.fit(fitter.evaluated(begun), rounds=20)


@pytest.mark.parametrize("pair", PAIRS)
def test_proposed_experiment_decides(pair: str, simulator: Simulator) -> None:
    sizes, hidden, conditions, wanted = PAIRS[pair]
    right, wrong = sizes
    records = runs(simulator, hidden, conditions)
    fits = {name: fitted(simulator, records, free) for name, free in sizes.items()}
    # Not told apart: within three standard deviations of each other.
    assert abs(fits[wrong].cost - fits[right].cost) < 9 * NOISE**2
    found = next_experiment(simulator, records, {name: {**TRUE, **at.parameters} for name, at in fits.items()}, NOISE)
    assert found.name == wanted
    assert found.enough
    assert found.odds >= 99
    assert f"tells {right} from {wrong} with odds of" in found.text
    # The device itself, in that experiment, and both refitted to all: 99:1 is a chi-square of 21 in the mean.
    again = [*records, measured(simulator, found.record, hidden, 9)]
    cost = {name: fitted(simulator, again, free).cost / NOISE**2 for name, free in sizes.items()}
    assert cost[wrong] > cost[right] + 9


def test_what_no_experiment_decides(simulator: Simulator) -> None:
    """Two effects of a nanovolt, under noise of 20 µV: nothing tells them apart."""
    records = runs(simulator, {}, {})
    tiny = {"amplifier_offset": {"offset_x": 1e-9}, "drive_feedthrough": {"feedthrough": 1e-7}}
    found = next_experiment(simulator, records, {name: {**TRUE, **size} for name, size in tiny.items()}, NOISE)
    assert not found.enough
    assert found.odds < 99
    assert found.text.startswith("nothing on the menu tells amplifier_offset from drive_feedthrough")


def test_odds_are_those_of_a_matched_filter(simulator: Simulator) -> None:
    """A drift too small to matter against a constant offset: at most the whole offset over the noise is seen."""
    records = runs(simulator, {}, {})
    noise = 1e-3
    sets = {"amplifier_offset": {**TRUE, "offset_x": 1e-5}, "amplifier_drift": {**TRUE, "offset_drift": 1e-9}}
    found = next_experiment(simulator, records, sets, noise)
    n = SAMPLES
    # An upper bound by hand: nothing refitted, the whole offset seen.
    bound = norm.cdf(np.sqrt(n * 1e-5**2 / noise**2) / 2)
    assert 1 <= found.odds <= bound / (1 - bound) * (1 + 1e-6)


def test_menu_keeps_to_what_the_device_bore(simulator: Simulator) -> None:
    records = runs(simulator, {}, {"v_bias": 15.0})
    found = {proposal.name: proposal.record for proposal in menu(records, TRUE)}
    peak = max(float(np.abs(record.u).max()) for record in records)
    assert list(found) == ["drive level step", "drive level ramp", "ring-down", "off-resonance drive", "bias step",
                           "added acceleration", "rate step", "temperature step"]  # fmt: skip
    for record in found.values():
        # Rounding of one product.
        assert np.abs(record.u).max() <= LEVEL * peak * (1 + 1e-15)
        assert record.axes == 2
    assert not found["ring-down"].u[SAMPLES // 2 :].any()
    assert found["bias step"].conditions["v_bias"][[0, -1]].tolist() == [15.0, 30.0]
    assert found["temperature step"].conditions["temperature"][[0, -1]].tolist() == [298.15, 318.15]


def test_bad_input(simulator: Simulator) -> None:
    records = runs(simulator, {}, {})
    one = {"cubic_stiffness": {**TRUE, "k3_x": 1e6}}
    two = {**one, "nonlinear_damping": {**TRUE, "d2_x": 1e3}}
    with pytest.raises(InputError, match="two effects or more"):
        next_experiment(simulator, records, one, NOISE)
    with pytest.raises(InputError, match="noise_rms = 0"):
        next_experiment(simulator, records, two, 0.0)
    with pytest.raises(InputError, match="none of its sizes is fitted; give d2_x, d2_y"):
        next_experiment(simulator, records, {**one, "nonlinear_damping": TRUE}, NOISE)


def test_a_rival_may_be_a_defect_of_the_record(simulator: Simulator) -> None:
    """A delay of the force, or a filter of the voltage, whose size is no parameter of the device."""
    records = runs(simulator, {"actuator_delay": 2e-8}, {})
    sets = {"actuator_delay": {**TRUE, "actuator_delay": 2e-8}, "voltage_filter": {**TRUE, "voltage_filter": 2e-8}}
    found = next_experiment(simulator, records, sets, NOISE)
    assert "actuator_delay from voltage_filter" in found.text
    assert np.array_equal(simulator.run(found.record, sets["actuator_delay"]), found.record.v)


def test_is_for_reuse(simulator: Simulator) -> None:
    """The record proposed is simulated as any other."""
    records = runs(simulator, {}, {})
    sets = {"cubic_stiffness": {**TRUE, "k3_x": 1e7}, "nonlinear_damping": {**TRUE, "d2_x": 1e4}}
    found = next_experiment(simulator, records, sets, NOISE)
    assert isinstance(found, Experiment)
    assert np.array_equal(simulator.run(found.record, sets["cubic_stiffness"]), found.record.v)
