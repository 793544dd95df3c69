"""Pairs of effects that one excitation can't tell apart, and the experiment proposed, carried out with the FMU."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from discrepancy.data.record import Record, make_record
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.fit.whitening import Setting, whitener
from discrepancy.tell.drives import Drive, Player
from discrepancy.tell.experiment import ASKED, Experiment, designer_of, next_experiment, odds_of
from discrepancy.tell.limits import Limits, room_of
from discrepancy.tell.rivals import Rival, ends_of, followed
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
               {"a_x": 9.8, "a_y": 9.8}, {"a_x", "a_y"}),
    "acceleration": ({"linear_acceleration": ACCELERATION, "amplifier_offset": OFFSET},
                     {"acceleration_gain_x": -0.05, "acceleration_gain_y": -0.05},
                     {"a_x": 9.8, "a_y": 9.8}, {"a_x", "a_y"}),
    # At constant bias the pull is a V² q (1 + 2 (q/g)² + ...): its first part is one with k, its second a cubic spring.
    "softening": ({"electrostatic_softening": SOFTENING, "cubic_stiffness": CUBIC}, {"softening": 2e-5},
                  {"v_bias": 10.0}, {"v_bias"}),
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


def proposed(
    simulator: Simulator, records: Sequence[Record], sets: Mapping[str, Mapping[str, float]], **more: object
) -> Experiment:
    found = next_experiment(simulator, records, sets, NOISE, **{"seconds": 1.0, **more})  # type: ignore[arg-type]
    assert found is not None
    return found


@pytest.mark.parametrize("pair", PAIRS)
def test_proposed_experiment_decides(pair: str, simulator: Simulator) -> None:
    sizes, hidden, conditions, wanted = PAIRS[pair]
    right, wrong = sizes
    records = runs(simulator, hidden, conditions)
    fits = {name: fitted(simulator, records, free) for name, free in sizes.items()}
    # Not told apart: within three standard deviations of each other.
    assert abs(fits[wrong].cost - fits[right].cost) < 9 * NOISE**2
    found = proposed(simulator, records, {name: {**TRUE, **at.parameters} for name, at in fits.items()})
    assert {name for name, _ in found.drive.steps} & wanted
    assert found.enough
    assert found.runs == 1
    # A fifth of the run whose condition steps at its middle, which was the best that was proposed before.
    assert found.seconds <= 0.2 * (SAMPLES / 2 / RATE)
    assert f"tells {right} from {wrong} with 95% after" in found.text
    # The device itself plays the table, and both are refitted to all. By the odds the separation is D in the mean and
    # scatters by its root: half of 30 at least is left but once in 300.
    again = [*records, measured(simulator, found.record, hidden, 9)]
    cost = {name: fitted(simulator, again, free).cost / NOISE**2 for name, free in sizes.items()}
    assert cost[wrong] > cost[right] + 9


def test_limits_are_kept(simulator: Simulator) -> None:
    """Without a supply and an oven, on a short leash: what is proposed stays within, whichever effect is the true
    one."""
    sizes, hidden, conditions, _ = PAIRS["softening"]
    records = runs(simulator, hidden, conditions)
    sets = {name: {**TRUE, **fitted(simulator, records, free).parameters} for name, free in sizes.items()}
    limits = Limits(force_x=2e-6, force_y=1e-6, voltage_x=1.0, voltage_y=0.5, longest=0.01, v_bias=(10.0, 10.0),
                    temperature=(298.15, 298.15), omega_z=(-1.0, 2.0))  # fmt: skip
    found = proposed(simulator, records, sets, limits=limits)
    assert len(found.record.t) <= 0.01 * RATE
    # Rounding of one product.
    assert (np.abs(found.record.u).max(axis=0) <= np.array([2e-6, 1e-6]) * (1 + 1e-15)).all()
    for values in sets.values():
        assert (np.abs(simulator.run(found.record, values)).max(axis=0) <= [1.0, 0.5]).all()
    played = found.table
    assert (played["v_bias"] == 10.0).all()
    assert "temperature" not in played.columns
    assert "omega_z" not in played.columns or played["omega_z"].is_between(-1, 2).all()


def test_table_is_what_a_generator_plays(simulator: Simulator) -> None:
    records = runs(simulator, {}, {})
    sets = {"cubic_stiffness": {**TRUE, "k3_x": 1e9}, "nonlinear_damping": {**TRUE, "d2_x": 1e6}}
    found = proposed(simulator, records, sets)
    assert found.table.columns[:3] == ["t", "u_x", "u_y"]
    assert not {"v_x", "v_y"} & set(found.table.columns)
    assert len(found.table) == len(found.record.t)
    # It is simulated as any other run.
    assert np.array_equal(simulator.run(found.record, sets["cubic_stiffness"]), found.record.v)


def test_what_no_experiment_decides(simulator: Simulator) -> None:
    """Two effects of a nanovolt, under noise of 20 µV: nothing tells them apart."""
    records = runs(simulator, {}, {})
    tiny = {"amplifier_offset": {"offset_x": 1e-9}, "drive_feedthrough": {"feedthrough": 1e-7}}
    found = proposed(simulator, records, {name: {**TRUE, **size} for name, size in tiny.items()})
    assert not found.enough
    assert found.text.startswith("nothing within the limits tells amplifier_offset from drive_feedthrough")


def test_odds_are_those_of_a_matched_filter() -> None:
    """Nothing follows: D is the energy over the noise. One column along the error with a prior of one deviation takes
    all but D/(1 + D) of it, by hand."""
    error = np.full((200, 1), 0.5)
    none = followed(np.zeros((1, 200, 1)), error)
    energy = 0.25 * np.array(ends_of(200))
    assert none == pytest.approx(energy, rel=1e-12)
    assert followed(error[None], error) == pytest.approx(energy / (1 + energy), rel=1e-9)
    # Φ(√D/2) = 0.95 is 19 to 1.
    assert odds_of(ASKED) == pytest.approx(19, rel=1e-9)


def test_force_holds_the_largest_voltage(simulator: Simulator) -> None:
    """A tone on a mode at full force: the motion rises to the limit and stays there."""
    records = runs(simulator, {}, {})
    room = room_of(Limits(voltage_x=5.0, voltage_y=5.0), records)
    player = Player(room, TRUE, records[0])
    drive = Drive(player.modes[:1], np.ones((1, 2)), np.zeros((1, 2)), np.array([1.0, -1.0]), hard=True)
    v = simulator.run(player.record(drive, SAMPLES), TRUE)
    # Speed is held against that of the higher mode: at the lower one motion goes beyond by their ratio, 1.3. A design
    # is simulated, and played lower then.
    assert 4 < np.abs(v[SAMPLES // 2 :]).max() < 5 * player.modes[1] / player.modes[0]


def test_first_of_several_rivals_is_told_from_each(simulator: Simulator) -> None:
    records = runs(simulator, {}, {})
    sizes = {
        "cubic_stiffness": {"k3_x": 1e9},
        "nonlinear_damping": {"d2_x": 1e6},
        "drive_feedthrough": {"feedthrough": 1},
    }
    rivals = [Rival(simulator, records, name, {**TRUE, **size}, NOISE) for name, size in sizes.items()]
    player = designer_of(rivals, records, Limits(), 1.0).player
    drive = Drive(player.modes[:1], np.ones((1, 2)), np.zeros((1, 2)), np.array([1.0, 0.0]))
    record = player.record(drive, 1000)
    pairs = [designer_of([a, b], records, Limits(), 1.0).separation(record)
             for a, b in zip(rivals[:1] * 2, rivals[1:], strict=True)]  # fmt: skip
    assert designer_of(rivals, records, Limits(), 1.0).separation(record) == pytest.approx(np.min(pairs, axis=0))


def test_what_nothing_tells_apart_does_not_spoil_the_rest(simulator: Simulator) -> None:
    """A constant force displaces as an offset does whatever is played; an acceleration can be tilted away."""
    records = runs(simulator, {"offset_x": 2e-3, "offset_y": 1e-3}, {"a_x": 9.8, "a_y": 9.8})
    force = (Free("force_x", 1e-12), Free("force_y", 1e-12))
    sizes = {"amplifier_offset": OFFSET, "linear_acceleration": ACCELERATION, "constant_force": force}
    sets = {name: {**TRUE, **fitted(simulator, records, free).parameters} for name, free in sizes.items()}
    found = proposed(simulator, records, sets)
    assert found.enough
    assert "tells amplifier_offset from linear_acceleration with" in found.text
    assert found.text.endswith("; from constant_force nothing within the limits tells it")
    assert found.record.u.any() or found.text.startswith("no force; a_")


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
    found = proposed(simulator, records, sets)
    assert "actuator_delay from voltage_filter" in found.text
    assert np.array_equal(simulator.run(found.record, sets["actuator_delay"]), found.record.v)


def test_one_axis(simulator: Simulator) -> None:
    """A record of x alone: no value of y is asked for."""
    whole = runs(simulator, {}, {})[0]
    record = make_record("x", whole.t, whole.u[:, 0], whole.v[:, 0], sample_rate=RATE)
    known = {name: TRUE[name] for name in ("m", "kxx", "dxx", "sense_gain_x")}
    sets = {"cubic_stiffness": {**known, "k3_x": 1e9}, "nonlinear_damping": {**known, "d2_x": 1e6}}
    found = proposed(simulator, [record], sets)
    assert found.table.columns[:2] == ["t", "u_x"]
    assert found.enough
