"""Terms that are in no file: found from sets that the FMU makes with a term hidden in a file of its own."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sympy import Expr, sympify

from discrepancy.criteria import Criteria
from discrepancy.data.record import Record, make_record
from discrepancy.discover import discovery
from discrepancy.discover.discovery import Discovery, discover
from discrepancy.discover.refutation import rivals
from discrepancy.fit.continuation import cut, started
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.terms.effect_file import Term, joined
from discrepancy.terms.library import SIGNALS, forms, known
from gyro_model import symbols
from gyro_model.anatomy import Force
from gyro_model.contract import check_effect
from gyro_model.device import load_device
from gyro_model.errors import InputError
from gyro_model.model import Model, load_model, read_model
from gyro_model.units import Dimension, dimension

sys.path.insert(0, str(Path(__file__).parents[2] / "gyro_model"))
from effect_library import EffectLibrary
from test_effects import test_documents_itself as documents_itself

from gyro_model.effect_points import condition, evaluate, random_point

RATE, SAMPLES, NOISE = 200_000.0, 4000, 2e-5
MODEL = load_model()
TRUE = {**load_device("reference").parameters, "sense_gain_x": 1e6, "sense_gain_y": 1e6}
NOMINAL = {name: TRUE[name] for name in ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy", "sense_gain_x", "sense_gain_y")}

HIDDEN = '''"""A term that no packaged file states, 2026."""
from sympy import Abs

from gyro_model.anatomy import Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import u_x, u_y, x, x_dot, y, y_dot

C = size("hidden_size", "{unit}", "coefficient")
c = C.symbol
EFFECT = Force(id="hidden", parameters=(C,), force=({x}, {y}), energy=None, signature="any", host_experiment="any",
               limits=(Limit(why="at rest", at={{"hidden_size": 1.0}}, gives={{"force_x": 0.0, "force_y": 0.0}}),))
'''
# Ten times the detectable size or more, 50 standard deviations: at seven, drag and x² x' differ by a chi-square of 6.
TERMS = {
    "quintic": ("N/m5", "-c*x**5", "-c*y**5", 3e18),
    "coupling by x² y": ("N/m2", "-2*c*x*y", "-c*x**2", 300.0),
    "drag": ("N.s2/m2", "-c*Abs(x_dot)*x_dot", "-c*Abs(y_dot)*y_dot", 1e-7),
    "one axis": ("N.s/m2", "-c*x_dot*y", "0*c", 0.01),
    "gap": ("1/m", "-c*u_x*y", "-c*u_y*x", 100.0),
    "asymmetric damping": ("N.s/m2", "-c*x*x_dot", "-c*y*y_dot", 0.02),
}


def drive(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Forty tones of 5 µN over the modes: (n,) [s], (n, 2) [N]."""
    rng = np.random.default_rng(seed)
    t = np.arange(SAMPLES) / RATE
    f = rng.uniform(200, 6000, (40, 2))
    return t, 5e-6 * np.sin(2 * np.pi * f * t[:, None, None] + rng.uniform(0, 6.28, (40, 2))).sum(axis=1)


def runs(model: Model, hidden: dict[str, float]) -> tuple[Record, ...]:
    """Two runs of the reference device with what is hidden, noise of 20 µV a sample."""
    records = []
    with Simulator(model, jobs=1) as simulator:
        for number in range(2):
            t, u = drive(number)
            blank = make_record(f"run-{number}", t, u, u)
            v = simulator.run(blank, {**TRUE, **hidden, "sense_noise": NOISE, "seed": number + 1})
            records.append(make_record(f"run-{number}", t, u, v, sample_rate=RATE))
    return tuple(records)


def refitted(simulator: Simulator, records: tuple[Record, ...]) -> tuple[Fitter, Fitted]:
    fitter = Fitter(simulator, records)
    return fitter, fitter.fit(fitter.whitened(fitter.fit(fitter.begin(NOMINAL))))


def with_effect(fitter: Fitter, at: Fitted, *sizes: Free) -> Fitted:
    """``at`` with sizes fitted from one step off neutral."""
    values = {free.name: free.step for free in sizes}
    begun = replace(at, parameters={**at.parameters, **values}, free=(*at.free, *sizes), grams=None)
    return fitter.fit(fitter.whitened(fitter.fit(fitter.evaluated(begun))))


@pytest.fixture(scope="module")
def simulator() -> Iterator[Simulator]:
    with Simulator(MODEL) as opened:
        yield opened


@pytest.mark.parametrize("term", TERMS)
def test_finds_the_formula(term: str, simulator: Simulator, tmp_path: Path) -> None:
    unit, on_x, on_y, true = TERMS[term]
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab" / "hidden.py").write_text(HIDDEN.format(unit=unit, x=on_x, y=on_y), encoding="utf-8")
    records = runs(read_model(tmp_path / "lab"), {"hidden_size": true})
    found = discover(*refitted(simulator, records), tmp_path / "found")
    assert found is not None
    assert found.effect.id == "discovered_1"
    assert not found.known
    for axis, wanted in (("x", on_x), ("y", on_y)):
        assert same_term(found.forces[f"force_{axis}"], wanted), found.forces
    hold_as_effects(found, tmp_path / "found")


def test_terms_that_fit_alike_are_written_too(simulator: Simulator, tmp_path: Path) -> None:
    unit, on_x, on_y, true = TERMS["quintic"]
    (tmp_path / "hidden.py").write_text(HIDDEN.format(unit=unit, x=on_x, y=on_y), encoding="utf-8")
    records = runs(read_model(tmp_path), {"hidden_size": true})
    fitter, at = refitted(simulator, records)
    # As if nothing could be told from anything.
    fitter.criteria = Criteria(even=1e12)
    found = discover(fitter, at, tmp_path / "found")
    assert found is not None
    assert same_term(found.forces["force_x"], on_x), found.forces
    assert found.terms[0].id == "discovered_1"
    assert "discovered_2" in found.either
    hold_as_effects(found, tmp_path / "found")


def test_finds_it_over_pieces_where_the_whole_is_out_of_step(
    simulator: Simulator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def halves(whole: Fitter, at: Fitted, _: float) -> tuple[Fitter, Fitted]:
        fitter = cut(whole, 2)
        return fitter, fitter.fit(started(fitter, at), 3)

    monkeypatch.setattr(discovery, "IN_STEP", 0.0)
    monkeypatch.setattr(discovery, "settled", halves)
    unit, on_x, on_y, true = TERMS["gap"]
    (tmp_path / "hidden.py").write_text(HIDDEN.format(unit=unit, x=on_x, y=on_y), encoding="utf-8")
    records = runs(read_model(tmp_path), {"hidden_size": true})
    found = discover(*refitted(simulator, records), tmp_path / "found")
    assert found is not None
    assert same_term(found.forces["force_x"], on_x), found.forces
    assert same_term(found.forces["force_y"], on_y), found.forces


def same_term(found: str, wanted: str) -> bool:
    """Whether two force texts are one product, coefficient aside."""
    names = {s.name: s for s in SIGNALS}
    a, b = (sympify(text, locals=names) for text in (found, wanted))
    if a == 0 or b == 0:
        return a == b
    return not (_bare(a) / _bare(b)).free_symbols


def _bare(force: Expr) -> Expr:
    return force.subs({s: 1 for s in force.free_symbols if s not in SIGNALS})


def hold_as_effects(found: Discovery, folder: Path) -> None:
    """The files load: the term's, and those of the new ones that it can't be told from."""
    model = read_model(folder)
    assert model.effect("discovered_1") == found.effect
    assert {f"{term.id}.py" for term in found.terms} == {path.name for path in folder.iterdir()}
    assert {e.id for e in model.effects} == {e.id for e in MODEL.effects} | {"discovered_1", *found.either}


def test_nothing_is_found_in_noise(simulator: Simulator, tmp_path: Path) -> None:
    assert discover(*refitted(simulator, runs(MODEL, {})), tmp_path) is None
    assert not list(tmp_path.iterdir())


def test_term_of_an_effect_is_that_effect(simulator: Simulator, tmp_path: Path) -> None:
    found = discover(*refitted(simulator, runs(MODEL, {"k3_x": 3e6, "k3_y": 3e6})), tmp_path)
    assert found is not None
    assert found.known
    assert found.effect.id == "cubic_stiffness"
    assert not list(tmp_path.iterdir())


def test_known_terms() -> None:
    found = {effect.id for effect, _ in known(MODEL, forms(2)).values()}
    further = {"cross_cubic_stiffness", "comb_fringe"}
    assert found == {"cubic_stiffness", "quadratic_stiffness", "nonlinear_damping", "actuator_nonlinearity"} | further


def test_a_wrong_name_is_refuted(simulator: Simulator, tmp_path: Path) -> None:
    unit, on_x, on_y, true = TERMS["quintic"]
    (tmp_path / "hidden.py").write_text(HIDDEN.format(unit=unit, x=on_x, y=on_y), encoding="utf-8")
    fitter, at = refitted(simulator, runs(read_model(tmp_path), {"hidden_size": true}))
    at = with_effect(fitter, at, *CUBIC)
    found = rivals(fitter, at, ["cubic_stiffness"])
    assert found.refuted
    assert "x**5" in found.instead[("cubic_stiffness",)]


CUBIC = (Free("k3_x", 1e4), Free("k3_y", 1e4))


def test_names_that_imitate_one_term_together_give_way_together(simulator: Simulator, tmp_path: Path) -> None:
    unit, on_x, on_y, true = TERMS["quintic"]
    (tmp_path / "hidden.py").write_text(HIDDEN.format(unit=unit, x=on_x, y=on_y), encoding="utf-8")
    fitter, at = refitted(simulator, runs(read_model(tmp_path), {"hidden_size": true}))
    named = ["cubic_stiffness", "nonlinear_damping"]
    at = with_effect(fitter, at, *CUBIC, Free("d2_x", 1e4), Free("d2_y", 1e4))
    found = rivals(fitter, at, named)
    assert list(found.instead) == [tuple(named)]
    assert found.names == named


def test_two_right_names_stand(simulator: Simulator) -> None:
    fitter, at = refitted(simulator, runs(MODEL, {"k3_x": 3e6, "k3_y": 3e6, "feedthrough": 0.5}))
    at = with_effect(fitter, at, *CUBIC, Free("feedthrough", 1e-4))
    assert not rivals(fitter, at, ["cubic_stiffness", "drive_feedthrough"]).refuted


def test_a_name_with_one_size_for_both_axes_is_refuted_by_a_term_on_one(simulator: Simulator, tmp_path: Path) -> None:
    (tmp_path / "hidden.py").write_text(HIDDEN.format(unit="1/m", x="-c*u_x*x", y="0*c"), encoding="utf-8")
    fitter, at = refitted(simulator, runs(read_model(tmp_path), {"hidden_size": 300.0}))
    named = with_effect(fitter, at, Free("comb_fringe", 1.0))
    assert rivals(fitter, named, ["comb_fringe"]).refuted
    found = discover(fitter, at, tmp_path / "terms")
    assert found is not None
    assert not found.known
    assert {axis for axis, force in found.forces.items() if force != "0"} == {"force_x"}
    assert "u_x*x" in found.forces["force_x"]


@pytest.mark.parametrize(
    ("effect", "sizes", "hidden"),
    [
        ("comb_fringe", (Free("comb_fringe", 1.0),), {"comb_fringe": 300.0}),
        ("cubic_stiffness", CUBIC, {"k3_x": 3e6, "k3_y": 3e6}),
        ("drive_feedthrough", (Free("feedthrough", 1e-4),), {"feedthrough": 0.5}),
    ],
)
def test_a_right_name_stands(
    effect: str, sizes: tuple[Free, ...], hidden: dict[str, float], simulator: Simulator
) -> None:
    fitter, at = refitted(simulator, runs(MODEL, hidden))
    found = rivals(fitter, with_effect(fitter, at, *sizes), [effect])
    assert not found.refuted
    assert not found.beside


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> tuple[Model, EffectLibrary]:
    """Every seventh form and the couplings by one spring, as files, loaded, compiled."""
    folder = tmp_path_factory.mktemp("terms")
    chosen = [*forms(2)[:-5:7], *forms(2)[-5:]]
    for number, form in enumerate(chosen, 1):
        Term(replace(form, id=f"discovered_{number}"), dict.fromkeys((s.name for s in SIGNALS), 1e-6)).write(folder)
    model = load_model(folder)
    return model, EffectLibrary(model, tmp_path_factory.mktemp("compiled"))


def test_files_fulfil_the_contract_of_effects(library: tuple[Model, EffectLibrary]) -> None:
    model, compiled = library
    rng = np.random.default_rng(1)
    for effect in (e for e in model.effects if e.id.startswith("discovered_")):
        assert isinstance(effect, Force)
        documents_itself(effect)
        check_effect(effect, model)
        for _ in range(20):
            point = random_point(effect, rng, model)
            wanted, scale = evaluate(effect, point), condition(effect, point)
            for name, value in compiled.evaluate(effect, point).items():
                # As in the contract tests of the packaged effects: each operation rounds by half a unit.
                assert abs(value - float(wanted[name])) <= 2 * sys.float_info.epsilon * scale[name]


def test_units_make_a_force(library: tuple[Model, EffectLibrary]) -> None:
    signals = {"x": "m", "y": "m", "x_dot": "m/s", "y_dot": "m/s", "u_x": "N", "u_y": "N"}
    for effect in (e for e in library[0].effects if e.id.startswith("discovered_")):
        for term in effect.terms().values():
            for summand in term.as_ordered_terms() if term != 0 else ():
                total = Dimension()
                for base, power in summand.as_powers_dict().items():
                    for symbol in base.free_symbols:
                        unit = signals.get(symbol.name) or library[0].by_name[symbol.name].unit
                        total = total * dimension(unit) ** power
                assert total == dimension("N"), summand


def test_energy_is_said_where_it_is_known() -> None:
    x, x_dot = symbols.x, symbols.x_dot
    balance = {form.parts[0][0]: form.energy() for form in forms(1)}
    assert balance[x**5] is not None
    assert balance[x * abs(x)] is not None
    assert balance[x_dot**3] is not None
    assert balance[x_dot**2] is None, "brakes one way and drives the other"
    assert balance[symbols.u_x * x] is None


def test_one_axis_has_no_term_of_the_other() -> None:
    other = {symbols.y, symbols.y_dot, symbols.u_y}
    assert forms(1)
    assert not any(e.free_symbols & other for form in forms(1) for part in form.parts for e in part)


def test_model_with_a_twin_is_refused() -> None:
    twin = replace(forms(2)[0], id="cubic_stiffness").effect()
    with pytest.raises(InputError, match="twice"):
        joined(joined(MODEL, [replace(twin, id="other")]), [replace(twin, id="other_2")])


def test_folder_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match="choose another folder"):
        Term(forms(2)[0], dict.fromkeys((s.name for s in SIGNALS), 1.0)).write(tmp_path / "taken")
