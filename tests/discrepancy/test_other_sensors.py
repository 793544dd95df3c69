"""Records of a velocity or an acceleration: the simulation against scipy's DOP853, and a cubic spring found in them."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discrepancy.data.dataset import load_dataset
from discrepancy.data.record import Floats, Record
from discrepancy.diagnose import diagnose
from discrepancy.fit.simulate import Simulator
from gyro_model.model import load_model
from gyrotwin.cli import main

M, F0, Q, K3 = 2e-7, 1200.0, 300.0, 5e7
K = M * (2 * np.pi * F0) ** 2
D = float(np.sqrt(K * M)) / Q
RATE, SAMPLES = 24e3, 4000
GAINS = {"velocity": 2.0, "acceleration": 1e-3}
UNITS = {"velocity": "m/s", "acceleration": "m/s2"}
TRUE = {"m": M, "kxx": K, "dxx": D, "k3_x": K3}


def motion(number: int) -> tuple[Floats, Floats, dict[str, Floats]]:
    """t, u held from sample to sample, and what sensors of 1 V s/m and 1 V s²/m show just before u changes."""
    return moved(number, "zero")


def moved(number: int, hold: str) -> tuple[Floats, Floats, dict[str, Floats]]:
    """The same, or under a force that goes straight from sample to sample."""
    rng = np.random.default_rng(number)
    t = np.arange(SAMPLES) / RATE
    f = rng.uniform(800, 1600, 30)
    u = 2e-6 * np.sin(2 * np.pi * f * t[:, None] + rng.uniform(0, 6.28, 30)).sum(axis=1)
    z, speed, rate = np.zeros(2), [0.0], [u[0] / M]
    for k in range(SAMPLES - 1):

        def slopes(s: float, z: Floats, force: float = u[k], rise: float = (u[k + 1] - u[k]) * (hold != "zero")
                   ) -> list[float]:  # fmt: skip
            return [z[1], (force + rise * s * RATE - K * z[0] - D * z[1] - K3 * z[0] ** 3) / M]

        z = solve_ivp(slopes, (0, 1 / RATE), z, method="DOP853", rtol=1e-9, atol=1e-15).y[:, -1]
        speed.append(z[1])
        rate.append(slopes(1 / RATE, z)[1])
    return t, u, {"velocity": np.array(speed), "acceleration": np.array(rate)}


@pytest.fixture(scope="module")
def runs() -> list[tuple[Floats, Floats, dict[str, Floats]]]:
    return [motion(number) for number in range(3)]


def tables(folder: Path, runs: list[tuple[Floats, Floats, dict[str, Floats]]], sensed: str) -> list[str]:
    """Two files with noise of 1e-4 of the signal and an offset, headed by the unit."""
    paths = []
    for number, (t, u, shown) in enumerate(runs):
        v = GAINS[sensed] * shown[sensed]
        v = v + 1e-4 * v.std() * np.random.default_rng(9 + number).standard_normal(len(v)) + 0.1 * v.std()
        path = folder / f"{number}.csv"
        head = f"t,u_x,v_x [{UNITS[sensed]}]"
        np.savetxt(path, np.column_stack((t, u, v / GAINS[sensed])), delimiter=",", header=head, comments="")
        paths.append(str(path))
    return paths


@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("sensed", list(GAINS))
def test_the_simulation_is_what_the_sensor_shows(sensed: str, hold: str) -> None:
    t, u, shown = moved(0, hold)
    record = Record("run", "fit", hold, RATE, t, u[:, None], shown[sensed][:, None], {}, np.ones(SAMPLES, bool),
                    sensed, 2 * np.pi * F0)  # type: ignore[arg-type]  # fmt: skip
    with Simulator(load_model(), jobs=1) as simulator:
        v = simulator.run(record, {**TRUE, "sense_gain_x": record.reference**record.order})
    # The force of a step is the mean of what goes straight: right to fourth order at 45 steps a period.
    accuracy = 1e-7 if hold == "zero" else 2e-4
    assert np.abs(v[:, 0] - shown[sensed]).max() < accuracy * np.abs(shown[sensed]).max()


def test_an_acceleration_behind_a_delay_is_that_of_a_sample_before() -> None:
    t, u, shown = moved(0, "zero")
    # What was commanded before the start is what is at it.
    u[0] = 0.0
    own = u[:, None], shown["acceleration"][:, None], {}, np.ones(SAMPLES, bool), "acceleration", 2 * np.pi * F0
    held, goes_on = (Record("run", "fit", hold, RATE, t, *own) for hold in ("zero", "first"))  # type: ignore[arg-type]
    late = {**TRUE, "sense_gain_x": held.reference**2, "actuator_delay": 1 / RATE}
    with Simulator(load_model(), jobs=1) as simulator:
        for record in (held, goes_on):
            at_once = simulator.run(record, {**late, "actuator_delay": 0.0})
            # A force that comes a sample late moves the mass a sample later, from rest.
            delayed = simulator.run(record, late)
            # A period is no whole number of picoseconds, 1e-7 of it at most. A force that goes straight is held over a
            # third of a sample, and beside a delay over a twelfth: 2.8e-4, as measured, and twice that.
            accuracy = 1e-7 if record is held else 5.6e-4
            assert np.abs(delayed[2:] - at_once[1:-1]).max() < accuracy * np.abs(at_once).max()


@pytest.mark.parametrize("sensed", list(GAINS))
def test_a_cubic_spring_is_found(
    sensed: str, runs: list[tuple[Floats, Floats, dict[str, Floats]]], tmp_path: Path
) -> None:
    with pytest.raises(SystemExit) as ending:
        main(["dataset", "init", *tables(tmp_path, runs, sensed), "--out", str(tmp_path / "data")])
    assert not ending.value.code
    dataset = load_dataset(tmp_path / "data")
    assert {record.senses for record in dataset.records} == {sensed}
    # In a sensor of known gain the mass is that of the device, to the bend of the spring before anything is fitted.
    assert dataset.nominal["m"] == pytest.approx(M, rel=0.02)
    found = diagnose(dataset, load_model(), jobs=1, max_effects=2)
    assert [finding.id for finding in found.effects] == ["cubic_stiffness"]
    value = found.effects[0].parameters["k3_x"]
    assert value.low < K3 < value.high
    assert found.verdict == "missing effects"
