"""What changes nothing on given runs is probed once, and again only when something could have woken it."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from discrepancy.data.dataset import load_dataset
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import columns
from discrepancy.name.columns import Library, Probe
from discrepancy.trial_runs import write_trial
from gyro_model.device import load_device
from gyro_model.model import load_model
from gyro_model.quantities import Quantity

MODEL = load_model()


@pytest.fixture(scope="module")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Fitter, Fitted]]:
    path = write_trial(load_device("reference"), {}, tmp_path_factory.mktemp("silent") / "trial", runs=2, samples=2000)
    dataset = load_dataset(path.parent)
    with Simulator(MODEL, jobs=1) as simulator:
        fitter = Fitter(simulator, dataset.fit)
        yield fitter, fitter.begin(dataset.nominal)


def probed(
    library: Library, begun: tuple[Fitter, Fitted], present: list[str], monkeypatch: pytest.MonkeyPatch
) -> set[str]:
    """Sizes that are probed for the candidates beside ``present``."""
    found: set[str] = set()
    probe = columns._Scale.probe

    def noted(self: columns._Scale, q: Quantity, *given: object) -> Probe | None:
        found.add(q.name)
        return probe(self, q, *given)  # type: ignore[arg-type]

    with monkeypatch.context() as patched:
        patched.setattr(columns._Scale, "probe", noted)
        library.candidates(*begun, present)
    return found


def test_what_changes_the_same_whatever_its_size_is_no_candidate(begun: tuple[Fitter, Fitted]) -> None:
    # Beside a lag the force goes in shorter steps, whatever lag a temperature that stays at its reference makes.
    records = [replace(record, hold="first") for record in begun[0].records]
    fitter = Fitter(begun[0].simulator, records)
    at = fitter.evaluated(begun[1])
    assert not Library(fitter).candidates(fitter, at, [], lambda effect: effect.id == "thermal_phase")


def test_only_what_may_have_woken_is_tried_again(begun: tuple[Fitter, Fitted], monkeypatch: pytest.MonkeyPatch) -> None:
    silent: columns.Silent = {}
    library = Library(begun[0], silent=silent)
    # The temperature of these runs stays where it is: no law of it changes anything.
    assert "structure_lag" in probed(library, begun, [], monkeypatch)
    assert not probed(library, begun, ["clock_skew"], monkeypatch)
    assert not probed(Library(begun[0], library.kept, silent), begun, [], monkeypatch)
    assert "structure_lag" not in probed(library, begun, ["cubic_stiffness"], monkeypatch)
    assert "structure_lag" in probed(library, begun, ["thermal_stiffness"], monkeypatch)


@pytest.mark.parametrize(
    ("asleep", "present", "wakers"),
    [
        ("thermal_lag", ["thermal_stiffness", "cubic_stiffness"], {"thermal_stiffness"}),
        ("thermal_lag", ["voltage_filter", "play"], set()),
        # By what both read of a third.
        ("thermal_stiffness", ["stress_relaxation", "contact_stop", "play"], {"stress_relaxation", "contact_stop"}),
    ],
)
def test_wakers_share_a_symbol(begun: tuple[Fitter, Fitted], asleep: str, present: list[str], wakers: set[str]) -> None:
    assert Library(begun[0])._wakers([MODEL.effect(asleep)], present) == wakers


def test_of_one_axis_no_law_of_the_other_is_tried() -> None:
    across = {effect.id for effect in MODEL.effects if columns.is_across(effect)}
    assert {"ageing"} <= across
    assert not across & {"damping_step", "thermal_stiffness", "thermal_damping", "cubic_stiffness"}
