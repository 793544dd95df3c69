"""The registry of effects: what the packaged model is, what a user's file adds, what is refused."""

from pathlib import Path

import numpy as np
import pytest
from gyro_runner import Runner

from gyro_model.anatomy import SLOTS
from gyro_model.build import build, generated_files, made_token
from gyro_model.device import Device
from gyro_model.effect_points import MODEL
from gyro_model.errors import InputError
from gyro_model.model import EFFECTS_FOLDER, chain, load_model
from gyro_model.quantities import INPUTS, OUTPUTS, PARAMETERS, Quantity, size
from gyro_model.reference import simulate

QUINTIC = '''"""Quintic stiffness. F_x = -k5 x^5 (a test)."""

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x

K5 = size("k5", "N/m5", "quintic stiffness")

EFFECT = Force(
    id="quintic",
    parameters=(K5,),
    force=(-K5.symbol * x**5, 0),
    energy=Energy(stored=K5.symbol * x**6 / 6),
    signature="resonance moves with the fourth power of the amplitude",
    host_experiment="drive level ramp",
    limits=(Limit(why="1e24 at 1 um", at={"k5": 1e24, "x": 1e-6}, gives={"force_x": -1e-6, "force_y": 0.0}),),
)
'''


def write(folder: Path, text: str, name: str = "quintic") -> Path:
    """A folder with that effect file; each test has its own, since models are cached by folder."""
    (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return folder


def test_every_file_is_an_effect_and_nominal_ones_come_first() -> None:
    files = {path.stem for path in EFFECTS_FOLDER.glob("*.py") if path.stem != "__init__"}
    assert {effect.id for effect in MODEL.effects} == files
    order = [(not effect.nominal, effect.id) for effect in MODEL.effects]
    assert order == sorted(order)


def test_value_references_begin_with_the_table_of_quantities() -> None:
    assert MODEL.quantities[: len(INPUTS) + len(OUTPUTS) + len(PARAMETERS)] == (*INPUTS, *OUTPUTS, *PARAMETERS)
    assert len({q.name for q in MODEL.quantities}) == len(MODEL.quantities)
    assert all(MODEL.by_name[q.name] is q for q in MODEL.quantities)


def test_chain_runs_in_its_order() -> None:
    slots = [slot for slot, _ in chain(MODEL)]
    assert slots == [slot for slot in SLOTS if slot in slots]
    assert {effect.id for _, members in chain(MODEL) for effect in members} == {
        effect.id for effect in MODEL.effects if getattr(effect, "slot", "") in slots
    }


def test_stages_are_the_six() -> None:
    stages = {"parameter law", "actuator", "force", "pickoff", "amplifier", "sampled block"}
    assert {effect.stage for effect in MODEL.effects} == stages


def test_a_user_file_joins_the_model_and_acts(tmp_path: Path, plant: Runner) -> None:
    model = load_model(write(tmp_path, QUINTIC))
    assert model.effect("quintic").doc.startswith("Quintic")
    assert made_token(model) != made_token(MODEL)
    runner = Runner(build(model, tmp_path / "fmus").fmi3, tmp_path / "extracted")
    t = np.arange(101) * 5e-6
    parameters = {"x_start": 1e-6, "k5": 2e25}
    fmu, reference = runner.run(parameters, t), simulate(Device("mine", parameters, model=model), t, {})
    # Both integrate and round as for the packaged effects, see test_fmu_equals_reference.
    assert np.max(np.abs(fmu["x"] - reference["x"])) <= 1e-12 * 1e-6
    without = plant.run({"x_start": 1e-6}, t)
    assert np.max(np.abs(fmu["x"] - without["x"])) > 1e-8
    # At neutral, the model with one more effect gives the same bits.
    assert np.array_equal(runner.run({"x_start": 1e-6}, t)["x"], without["x"])


def test_words_of_the_c_and_of_the_generator_are_ids_like_others(tmp_path: Path) -> None:
    words = ("follows", "power", "product", "sizes", "memories", "flow", "actuate")
    ids = (*words, "step", "state", "time", "x", "rate", "main", "double")
    for effect_id in ids:
        text = QUINTIC.replace('"k5"', f'"k5_{effect_id}"').replace('id="quintic"', f'id="{effect_id}"')
        write(tmp_path, text, effect_id)
    model = load_model(tmp_path)
    runner = Runner(build(model, tmp_path / "fmus").fmi3, tmp_path / "extracted")
    t = np.arange(101) * 5e-6
    # Each a part of the quintic spring above.
    parameters = {"x_start": 1e-6, **{f"k5_{effect_id}": 2e25 / len(ids) for effect_id in ids}}
    fmu, reference = runner.run(parameters, t), simulate(Device("mine", parameters, model=model), t, {})
    assert np.max(np.abs(fmu["x"] - reference["x"])) <= 1e-12 * 1e-6
    assert np.max(np.abs(fmu["x"] - runner.run({"x_start": 1e-6}, t)["x"])) > 1e-8


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("x**5, 0)", "xx**5, 0)"), "xx"),
        (('id="quintic"', 'id="quintics"'), "its id is 'quintics'; name the file quintics.py"),
        (("EFFECT = Force", "OTHER = Force"), "defines no EFFECT"),
        (('id="quintic"', 'id="quin tic"'), "an id is a C identifier"),
        (('id="quintic"', 'id="quintiç"'), "'quintiç': an id is a C identifier; use letters, digits and _"),
        (('"k5"', '"K3_x"'), "'K3_x' is defined twice, by effect cubic_stiffness and by effect quintic; rename one"),
        (
            ('size("k5", "N/m5"', 'size("k3_x", "N/m5"'),
            "'k3_x' is defined twice, by effect cubic_stiffness and by effect quintic",
        ),
        (('"N/m5"', '"N/mm5"'), "unit 'N/mm5': factor 'mm5' is unknown"),
        (('"quintic stiffness")', '"quintic stiffness", low=1.0)'), r"start 0.0 is outside \[1.0, inf\]"),
        (("    parameters=(K5,),\n", ""), "has no size parameter"),
    ],
)
def test_bad_user_files(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    assert change[0] in QUINTIC
    with pytest.raises((InputError, NameError), match=message):
        load_model(write(tmp_path, QUINTIC.replace(*change)))


def test_unknown_symbol_is_named_with_the_nearest(tmp_path: Path) -> None:
    text = QUINTIC.replace("import x\n", "import x\nfrom sympy import Symbol\n").replace(
        "x**5, 0)", 'x**4 * Symbol("x_dott"), 0)'
    )
    with pytest.raises(InputError, match=r"effect quintic: symbol 'x_dott' is unknown; did you mean 'x_dot'\?"):
        load_model(write(tmp_path, text))


def test_no_limit_case_is_refused(tmp_path: Path) -> None:
    start = QUINTIC.index("    limits=")
    with pytest.raises(InputError, match="limit case"):
        load_model(write(tmp_path, QUINTIC[:start] + "    limits=(),\n)\n"))


def test_an_effect_twice_is_refused(tmp_path: Path) -> None:
    text = (EFFECTS_FOLDER / "cubic_stiffness.py").read_text(encoding="utf-8")
    folder = write(tmp_path, text, "cubic_stiffness")
    with pytest.raises(
        InputError, match=r"effect 'cubic_stiffness' is defined twice, by .* and by .*; rename one"
    ) as told:
        load_model(folder)
    for place in (EFFECTS_FOLDER, folder):
        assert str(place / "cubic_stiffness.py") in str(told.value)


def test_an_unknown_parameter_may_be_of_an_effect_of_one_s_own(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"parameter 'k5' is unknown.*--effects DIR"):
        load_model().parameter("k5")
    with pytest.raises(InputError, match="parameter 'k6' is unknown") as told:
        load_model(write(tmp_path, QUINTIC)).parameter("k6")
    assert "--effects" not in str(told.value)


@pytest.mark.parametrize(("effect", "kind"), [("actuator_delay", "delay"), ("amplifier_bandwidth", "lag")])
def test_a_second_delay_or_lag_is_refused(tmp_path: Path, effect: str, kind: str) -> None:
    text = (EFFECTS_FOLDER / f"{effect}.py").read_text(encoding="utf-8")
    name = MODEL.effect(effect).parameters[0].name
    with pytest.raises(InputError, match=f"{kind} in the chain"):
        load_model(write(tmp_path, text.replace(effect, "second").replace(f'"{name}"', '"another"'), "second"))


def test_a_law_on_the_mass_is_refused(tmp_path: Path) -> None:
    text = (EFFECTS_FOLDER / "damping_step.py").read_text(encoding="utf-8")
    text = text.replace("damping_step", "mass_step").replace("dxx, dxy, dyy", "m").replace("(dxx, dyy, dxy)", "(m,)")
    with pytest.raises(InputError, match="a law can't change m"):
        load_model(write(tmp_path, text, "mass_step"))


def test_an_unknown_slot_is_named_with_the_nearest(tmp_path: Path) -> None:
    text = (EFFECTS_FOLDER / "amplifier_offset.py").read_text(encoding="utf-8")
    with pytest.raises(InputError, match="slot 'amplifier ofset' is unknown; did you mean 'amplifier offset'"):
        load_model(
            write(tmp_path, text.replace('slot="amplifier offset"', 'slot="amplifier ofset"'), "amplifier_offset")
        )


def test_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is not a folder"):
        load_model(tmp_path / "nowhere")


def test_unknown_names_are_refused_with_the_nearest() -> None:
    with pytest.raises(InputError, match="effect 'cubic_stifness' is unknown; did you mean 'cubic_stiffness'"):
        MODEL.effect("cubic_stifness")
    with pytest.raises(InputError, match="parameter 'sense_nois' is unknown; did you mean 'sense_noise'"):
        MODEL.parameter("sense_nois")
    with pytest.raises(InputError, match="parameter 'u_x' is unknown"):
        MODEL.parameter("u_x")


def test_a_quantity_checks_values() -> None:
    limited = Quantity("width", "m", 1.0, "a width", low=0.5, high=2.0)
    assert limited.check(2) == 2.0
    for wrong in (float("nan"), float("inf"), True, "1", None, 0.4, 2.1):
        with pytest.raises(InputError, match="width = "):
            limited.check(wrong)
    with pytest.raises(InputError, match="give a whole number"):
        MODEL.parameter("seed").check(1.5)
    assert size("own", "m", "one", neutral=1.0).role == "size"


def test_other_starts_make_another_model_with_the_same_neutral_values() -> None:
    started = MODEL.starting_at({"kxx": 70.0, "k3_x": 2e9, "seed": 5})
    cubic = started.parameter("k3_x")
    assert (started.start(cubic), cubic.start) == (2e9, 0.0)
    assert started.start(started.parameter("m")) == MODEL.parameter("m").start
    assert made_token(started) != made_token(MODEL)
    assert generated_files(started)["generated/effects.h"] == generated_files(MODEL)["generated/effects.h"]
    assert Device("d", {}, model=started).acts(started.effect("cubic_stiffness"))
    with pytest.raises(InputError, match="did you mean 'k3_x'"):
        MODEL.starting_at({"k3_xx": 1.0})
    with pytest.raises(InputError, match="m = 0"):
        MODEL.starting_at({"m": 0.0})
