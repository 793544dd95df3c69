"""A mass that no spring holds, with dry friction, moved by a position controller: its own simulation, in fine steps."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rails import Rails

from discrepancy.data.dataset import Dataset, load_dataset
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Record, Role, make_record
from discrepancy.diagnose import diagnose
from discrepancy.fit.simulate import Simulator
from discrepancy.name.begin import begin, resume
from discrepancy.name.search import Given
from gyro_model.model import load_model

RATE, SAMPLES, FINE = 1000.0, 8000, 10
MASS, VISCOUS, COULOMB, CONSTANT = 95.0, 200.0, 20.0, 3.0
NOISE = 5e-6
INERTIA, DRAG, FRICTION, ENCODER = 1.4e-4, 1.4e-4, 0.03, 6e-4


def _moves(rng: np.random.Generator) -> np.ndarray:
    """Positions [m] from point to point, with rests between."""
    wanted, place, k = np.zeros(SAMPLES), 0.0, 100
    while k < SAMPLES - 1500:
        new, length = float(rng.uniform(0, 0.25)), int(rng.uniform(500, 1400))
        s = np.linspace(0, 1, length)
        wanted[k : k + length] = place + (new - place) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        wanted[k + length :] = new
        place, k = new, k + length + int(rng.uniform(50, 200))
    return wanted


def _record(number: int) -> Record:
    rng = np.random.default_rng(number)
    wanted, x, v = _moves(rng), 0.0, 0.0
    rails = Rails(MASS, VISCOUS, COULOMB, 1 / RATE / FINE)
    seen, u = np.empty(SAMPLES), np.empty(SAMPLES)
    for k in range(SAMPLES):
        seen[k] = x
        u[k] = MASS * (900 * (wanted[k] - x) - 60 * (x - seen[k - 1]) * RATE * (k > 0))
        x, v = rails.slide(x, v, u[k] + CONSTANT, FINE)
    seen += NOISE * rng.standard_normal(SAMPLES)
    role = "held-out" if number == 1 else "fit"
    return make_record(f"{number}", np.arange(SAMPLES) / RATE, u[:, None], seen[:, None], sample_rate=RATE, role=role)


@pytest.fixture(scope="module")
def runs() -> tuple[Record, Record]:
    return _record(0), _record(1)


def test_its_mass_is_found_without_a_mode(runs: tuple[Record, Record]) -> None:
    found = linear_start(runs[:1], (1.0,))
    assert found is not None
    # Friction, a sixth of the force, is left out.
    assert found["m"] == pytest.approx(MASS, rel=0.2)
    assert 0 < found["kxx"] < 1e-3 * found["m"] * (2 * np.pi) ** 2


def test_friction_and_a_constant_force_are_named(runs: tuple[Record, Record]) -> None:
    nominal = linear_start(runs[:1], (1.0,))
    assert nominal is not None
    found = diagnose(Dataset(Path(), nominal, runs), load_model(), jobs=1)
    by_id = {finding.id: finding.parameters for finding in found.effects}
    assert set(by_id) == {"dry_friction", "constant_force"}
    # In steps of 0.1 ms the simulation here stops up to one step late: 1e-4 of a move.
    assert by_id["dry_friction"]["friction_x"].value == pytest.approx(COULOMB, rel=2e-3)
    assert by_id["constant_force"]["force_x"].value == pytest.approx(CONSTANT, rel=1e-2)
    assert found.misfit["final"] < 1e-2 * found.misfit["refit"]


def test_a_folder_without_nominal_values_is_taken(tmp_path: Path, runs: tuple[Record, Record]) -> None:
    lines = ["format = 1", "[nominal]"]
    for run in runs:
        table = np.column_stack((run.t, run.u, run.v))
        np.savetxt(tmp_path / f"{run.name}.csv", table, delimiter=",", header="t,u_x,v_x", comments="")
        lines += ["[[run]]", f'file = "{run.name}.csv"', f"sample_rate = {RATE}"]
    (tmp_path / "dataset.toml").write_text("\n".join(lines), encoding="utf-8")
    assert "is empty" in " ".join(load_dataset(tmp_path).notes)


def test_what_resists_a_motor_that_turns_one_way_is_in_the_model_first() -> None:
    runs = tuple(_motor(steps, role) for steps, role in (((0.05, 0.07), "fit"), ((0.06, 0.055), "held-out")))
    nominal = linear_start(runs[:1], (1.0,))
    assert nominal is not None
    model = load_model()
    with Simulator(model, 1) as simulator:
        search = begin(Given(Dataset(Path(), nominal, runs)), simulator)
        [entry] = search.accepted
        # No sample of a motion one way tells friction from a constant force against it.
        assert entry.id in ("dry_friction", "constant_force")
        assert search.at.parameters["m"] == pytest.approx(INERTIA, rel=0.02)
        assert search.at.parameters["dxx"] == pytest.approx(DRAG, rel=0.02)
        assert search.fitter.off(search.at) < 1e-3
        # The model without ended at bounds: it is the one that the answer is held against.
        assert search.fitter.off(search.refitted) > 10 * search.fitter.off(search.at)


def test_bearings_that_rub_more_in_one_run_than_in_another_lead_no_fit_to_a_start_that_never_was() -> None:
    levels = [(0.05, 0.1), (-0.1, -0.05), (0.045, 0.07), (-0.05, -0.09)]
    frictions = [FRICTION * share for share in (0.95, 1.05, 1.05, 0.95)]
    runs = [_motor(steps, "fit", own, f"{own}") for steps, own in zip(levels, frictions, strict=True)]
    nominal = linear_start(runs, (1.0,))
    assert nominal is not None
    dataset = Dataset(Path(), nominal, (*runs, _motor((0.06, 0.055), "held-out")))
    states: list[Mapping[str, Any]] = []
    with Simulator(load_model(), 1) as simulator:
        search = begin(Given(dataset, keep=states.append), simulator)
        again = resume(Given(dataset), simulator, (), states[-1])
    assert [run.begun for run in again.dataset.records] == [run.begun for run in search.dataset.records]
    assert again.at.starts == search.at.starts
    assert {entry.id for entry in search.accepted} >= {"dry_friction"}
    # At 1 ms from rest; a fit with starts free ended at up to 290 rad/s.
    assert all(abs(start["x_dot_start"]) < 1.0 for start in search.at.starts)
    assert search.at.parameters["m"] == pytest.approx(INERTIA, rel=0.3)
    assert search.at.parameters["friction_x"] == pytest.approx(FRICTION, rel=0.3)


def _motor(steps: tuple[float, float], role: Role, friction: float = FRICTION, name: str = "") -> Record:
    """An inertia on an encoder, at first at rest, that a torque drives in two steps one way against friction."""
    x, v, way = 0.0, 0.0, np.sign(steps[0])
    seen, u = np.empty(SAMPLES), np.repeat(steps, SAMPLES // 2)
    for k in range(SAMPLES):
        seen[k] = way * x
        for _ in range(FINE):
            after = max(v + (way * u[k] - friction - DRAG * v) / INERTIA / RATE / FINE, 0.0)
            x, v = x + 0.5 * (v + after) / RATE / FINE, after
    seen = ENCODER * np.round(seen / ENCODER)
    t = np.arange(SAMPLES) / RATE
    return make_record(name or role, t, u[:, None], seen[:, None], sample_rate=RATE, role=role)
