"""What comes late gives way to what else does, beside a force that is not linear."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from discrepancy.data.dataset import Dataset
from discrepancy.data.record import make_record
from discrepancy.diagnose import diagnose
from discrepancy.fit.defect import effect_of
from discrepancy.fit.simulate import Simulator
from discrepancy.name.columns import Candidate, Probe
from discrepancy.name.lagging import other_lags
from discrepancy.name.score import Score
from gyro_model.device import load_device
from gyro_model.model import load_model

MODEL = load_model()
LATE = 4e-5
SCORE = Score(1.0, 1, 0.1, (1.0,), (0.1,), 1.0, 1.0)


def candidate(name: str, **shapes: float) -> Candidate:
    effect = effect_of(MODEL, name)
    size = next(q for q in effect.parameters if q.role == "size")
    return Candidate(effect, (Probe(size, 1e-6, 1),), shapes)


def searched(*accepted: str) -> Any:
    """What ``other_lags`` reads of a search with these effects, an amplifier's lag of LATE among them."""
    entries = [SimpleNamespace(id=name, candidate=candidate(name)) for name in accepted]
    at = SimpleNamespace(parameters={"amplifier_time_constant": LATE})
    return SimpleNamespace(simulator=SimpleNamespace(model=MODEL), at=at, accepted=entries)


SCORED = [(candidate("actuator_delay"), SCORE), (candidate("amplifier_bandwidth"), SCORE),
          (candidate("force_filter", force_filter_order=2.0), SCORE),
          (candidate("voltage_filter", voltage_filter_order=4.0), SCORE),
          (candidate("clock_skew"), SCORE), (candidate("cubic_stiffness"), SCORE)]  # fmt: skip


def test_the_others_are_as_late() -> None:
    search = searched("amplifier_bandwidth", "cubic_stiffness")
    found = other_lags(search, search.accepted[0], SCORED)
    values = {c.effect.id: c.values(s.amplitudes, s.deviations) for c, s in found}
    # The group delay of a Butterworth filter at rest, over 1/(2 pi f_c), is 1/sin(pi/(2 n)).
    assert values["actuator_delay"] == pytest.approx({"actuator_delay": LATE})
    assert values["force_filter"] == pytest.approx({"force_filter": LATE / np.sqrt(2)})
    assert values["voltage_filter"] == pytest.approx({"voltage_filter": LATE * np.sin(np.pi / 8)})
    assert values.keys() == {"actuator_delay", "force_filter", "voltage_filter"}


@pytest.mark.parametrize("beside", [(), ("parasitic_mode",), ("clock_skew",)])
def test_a_linear_device_does_not_ask(beside: tuple[str, ...]) -> None:
    search = searched("amplifier_bandwidth", *beside)
    assert other_lags(search, search.accepted[0], SCORED) == []


def test_what_is_not_late_has_no_others() -> None:
    search = searched("amplifier_bandwidth", "cubic_stiffness")
    assert other_lags(search, search.accepted[1], SCORED) == []


def test_a_filter_of_the_force_is_no_lag_of_the_voltage() -> None:
    rate, n = 12_000.0, 4000
    own = {"m": 0.05, "kxx": 0.05 * (2 * np.pi * 180) ** 2, "dxx": 1.6, "sense_gain_x": 1.0}
    hidden = {"k3_x": 3e10, "force_filter": 4e-4, "force_filter_order": 1.0, "sense_noise": 1e-7}
    rng, t, records = np.random.default_rng(3), np.arange(n) / rate, []
    with Simulator(MODEL, jobs=1) as simulator:
        for number, level in enumerate((0.2, 0.4, 0.3)):
            tones = np.sin(2 * np.pi * rng.uniform(80, 330, 60) * t[:, None] + rng.uniform(0, 6.28, 60))
            u = level * tones.sum(axis=1)
            # From rest: a filter that has settled on the first force is none of a record's begin.
            u[: n // 100] *= np.linspace(0, 1, n // 100)
            role = "held-out" if number == 2 else "fit"
            blank = make_record(f"run-{number}", t, u, np.ones(n), sample_rate=rate, role=role)
            device = {**load_device("reference").parameters, **own, **hidden, "seed": number}
            v = simulator.run(blank, device)
            records.append(make_record(f"run-{number}", t, u, v, sample_rate=rate, role=role))
    found = diagnose(Dataset(folder=None, nominal=own, records=tuple(records)), MODEL)  # type: ignore[arg-type]
    assert found.verdict == "missing effects"
    assert {f.id: f.either for f in found.effects} == {"cubic_stiffness": ()}
    assert {f.id for f in found.record} == {"force_filter"}
    value = found.effects[0].parameters["k3_x"]
    assert value.low < 3e10 < value.high
