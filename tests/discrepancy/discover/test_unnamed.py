"""Terms that are in no file, found by the whole diagnosis, and names held against them."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from hidden_sets import MODEL, QUINTIC, SHORT, made, names, quintic

from discrepancy.data.dataset import Dataset
from discrepancy.diagnose import diagnose
from discrepancy.discover.term_search import TermSearch
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name import competition
from discrepancy.name.further import Wider
from gyro_model.model import Model, load_model, read_model

CUBIC = (Free("k3_x", 1e5), Free("k3_y", 1e5))


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Model:
    """A model with x⁵ in a file."""
    folder = tmp_path_factory.mktemp("lab")
    quintic(folder, "hardening")
    return read_model(folder)


@pytest.fixture(scope="module")
def set_of_fifth(lab: Model) -> Dataset:
    return made(QUINTIC, model=lab, samples=SHORT)


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    with Simulator(MODEL) as opened:
        yield opened


def fitted(simulator: Simulator, data: Dataset, *sizes: Free) -> tuple[Fitter, Fitted]:
    """The nominal model with further sizes, from one step off neutral, fitted to the runs of ``data``."""
    fitter = Fitter(simulator, data.fit)
    begun = fitter.begin({**data.nominal, **{free.name: free.step for free in sizes}}, sizes)
    return fitter, fitter.fit(fitter.whitened(fitter.fit(begun)))


@pytest.mark.parametrize("first", ["the term", "a name"])
def test_a_term_in_no_file_comes_before_or_in_the_place_of_the_name_that_it_refutes(
    set_of_fifth: Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, first: str
) -> None:
    if first == "a name":
        # A known effect that comes near is then named first: a spring of odd power, or a stop.
        monkeypatch.setattr(competition, "WEAK", 0.0)
    lines: list[str] = []
    found = diagnose(set_of_fifth, MODEL, progress=lines.append, further=TermSearch(tmp_path, lines.append))
    assert any(line.startswith("gave up ") for line in lines) == (first == "a name")
    assert names(found) == {"discovered_1"}
    [term] = found.effects
    for axis in "xy":
        assert term.forces[f"force_{axis}"] == f"-discovered_1_{axis}*{axis}**5"
        size = term.parameters[f"discovered_1_{axis}"]
        # Four deviations instead of the two of the interval, so that one in ten thousand sets fails.
        assert abs(size.value - QUINTIC[f"c_{axis}"]) < size.high - size.low
    assert found.misfit["final"] < 1.1 * found.misfit["noise_floor"]
    # What --effects loads.
    assert load_model(tmp_path).effect("discovered_1") == found.model.effect("discovered_1")


def test_an_effect_of_the_model_that_refutes_a_name_is_written_nowhere(
    set_of_fifth: Dataset, lab: Model, tmp_path: Path
) -> None:
    with Simulator(lab) as simulator:
        fitter, at = fitted(simulator, set_of_fifth, *CUBIC)
        assert TermSearch(tmp_path)(fitter, at, ["cubic_stiffness"], 1) == Wider(wrong=("cubic_stiffness",))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("hidden", "sizes", "named"),
    [
        ({}, (), []),
        ({"k3_x": 2e9, "k3_y": 2e9}, CUBIC, ["cubic_stiffness"]),
    ],
)
def test_where_nothing_is_open_nothing_changes(
    hidden: dict[str, float], sizes: tuple[Free, ...], named: list[str], simulator: Simulator, tmp_path: Path
) -> None:
    fitter, at = fitted(simulator, made(hidden, samples=SHORT), *sizes)
    assert TermSearch(tmp_path)(fitter, at, named, 1) is None
    assert not list(tmp_path.iterdir())
