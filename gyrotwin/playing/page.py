"""The page: module, sliders and game in one HTML file."""

import base64
import gzip
import html
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from gyro_model.anatomy import SLOTS, Effect, Force
from gyro_model.build import build, build_module, model_token
from gyro_model.device import Device
from gyro_model.model import Model, load_model
from gyrotwin.playing.hidden import RATE, experiment_of, hideable, known_parameters
from gyrotwin.playing.native import Floats, NativeFmu, Score, fnv1a
from gyrotwin.playing.sliders import UNLIMITED, Slider, slider, sliders_of
from gyrotwin.report import as_json, template, write_whole
from gyrotwin.results import Saved, Writer

FILE: Final = "play.html"
TURNING: Final = 5.0
"""Rate [rad/s] at which the page opens."""
STEPS: Final = 400
"""Of the run whose hash is compared."""
PLUCK: Final = 1e-6
"""Amplitude [m] where a device states none: that of the reference run."""
STARTS: Final = ("x_start", "y_start", "x_dot_start", "y_dot_start")
BEYOND: Final = 1000.0
"""Voltage over its typical one at which the page stops: a mass pulled through its electrodes swings by centimetres."""
BALANCED: Final = 0.1
"""Frequency split [Hz] below which the orbit stays a line for seconds."""
SHOWN_SLOWER: Final = 20
"""Times slower than the device that the page opens."""


class Group(NamedTuple):
    """Sliders under one heading; ``name`` is the key of theirs in the page's data."""

    name: str
    heading: str
    text: str


class Stage(NamedTuple):
    """A stage of the model with its effects."""

    name: str
    effects: Sequence[Group]


@dataclass(frozen=True)
class PlayResult(Saved):
    """A page that runs the FMU; see `gyrotwin.play`."""

    html: str = field(repr=False)
    hash: str
    """Of the fixed run, as the native FMU gave it."""

    @property
    def summary(self) -> Mapping[str, Any]:
        """Size of the page [bytes] and the hash of the fixed run."""
        return {"bytes": len(self.html.encode()), "hash": self.hash}

    def writers(self) -> Mapping[str, Writer]:
        """play.html."""
        return {FILE: lambda path: write_whole(self.html, path)}

    def headline(self) -> Sequence[tuple[str, str]]:
        """Size and hash."""
        return [("page", f"{len(self.html.encode()) / 1e3:.0f} kB"), ("hash of the native FMU", self.hash)]

    def _repr_html_(self) -> str:
        return f'<iframe srcdoc="{html.escape(self.html)}" width="100%" height="900" title="gyrotwin play"></iframe>'


def play_page(device: Device, named: str) -> PlayResult:
    """The page of a device that commands know as ``named``. Raises InputError where there is no compiler for the
    module."""
    model = device.model
    module = build_module(model).read_bytes()
    parameters = dict(device.all_parameters)
    if not any(parameters[name] for name in STARTS):
        parameters["x_start"] = PLUCK
    outer = _outer_sliders(model, parameters)
    effects = {effect.id: sliders_of(model, effect, parameters) for effect in model.effects if effect.parameters}
    game = _game(device, [s for group in effects.values() for s in group])
    fingerprint = _fingerprint(model, build(model).fmi3, parameters, [s for group in effects.values() for s in group])
    data = {
        "token": model_token(model),
        "device": shlex.quote(named),
        "frequency": device.frequencies[0],
        "gains": [parameters["sense_gain_x"], parameters["sense_gain_y"]],
        "beyond": BEYOND * model.by_name["v_x"].typical,
        "references": {q.name: index for index, q in enumerate(model.quantities)},
        "sliders": {name: [s.data() for s in group] for name, group in (outer | effects).items()},
        "effects": {
            effect.id: {
                "title": _title(effect),
                "signature": effect.signature,
                "sliders": [s.data() for s in effects[effect.id]],
            }
            for effect in model.effects
            if effect.parameters
        },
        "fingerprint": fingerprint,
        **_motion(model, parameters | {s.name: s.start for s in (*outer["turn"], *outer["inputs"])}),
        **game,
    }
    stages = _stages(model)
    split = device.frequencies[1] - device.frequencies[0]
    page = template("play.html.j2").render(
        device=device,
        data=as_json(data),
        # A third of its bytes; without a time, so that a page made twice is the same page.
        module=base64.b64encode(gzip.compress(module, mtime=0)).decode(),
        groups=_OUTER,
        stages=stages,
        effects=sum(len(stage.effects) for stage in stages),
        hidden=len({hidden["effect"] for hidden in game["hideable"]}),
        split=split,
        balanced=split < BALANCED,
        slower=math.log10(SHOWN_SLOWER),
        hash=fingerprint["hash"],
    )
    return PlayResult(page, fingerprint["hash"])


def _motion(model: Model, values: Mapping[str, float]) -> dict[str, Any]:
    """What the device starts with, by value reference, and the ideal one beside it."""
    numbers, whole = _split(model, values)
    ideal, _ = _split(model, dict(values) | _neutral(model))
    return {"step": values["sample_period"], "numbers": numbers, "whole": whole, "ideal": ideal}


def _game(device: Device, sliders: Sequence[Slider]) -> dict[str, Any]:
    """The run of the game and what it may hide."""
    # A user's own effect can't be hidden by the commands that the page names.
    packaged = {effect.id for effect in load_model().effects}
    owner = {s.name: s.effect for s in sliders}
    experiment = experiment_of(device)
    ranges = hideable(device, experiment, [s for s in sliders if s.effect in packaged])
    clock = {"internal_step": 1 / RATE, "sample_period": 1 / RATE}
    numbers = {
        "device": _split(device.model, _at_rest(device) | clock)[0],
        "known": _split(device.model, known_parameters(device) | clock)[0],
    }
    return {
        "hideable": [{"effect": owner[r.name], **r._asdict()} for r in ranges],
        "experiment": experiment.data() | numbers,
    }


_OUTER: Final = (
    Group("inputs", "What else acts on it", "Forces swing with the frequency below; the others are held."),
    Group("start", "Where it is plucked", "Or drag the mass."),
    Group("device", "The device as made", "Ten percent to either side; the ideal device has the same."),
)


def _outer_sliders(model: Model, parameters: Mapping[str, float]) -> dict[str, list[Slider]]:
    inputs = [slider(model, q.name, TURNING if q.name == "omega_z" else q.start) for q in model.quantities
              if q.role == "input"]  # fmt: skip
    clock = {"internal_step", "sample_period"}
    own = [q for q in model.quantities if q.role == "parameter" and not q.integer and q.name not in clock]
    made = [slider(model, q.name, parameters[q.name]) for q in own if q.name not in STARTS and parameters[q.name]]
    turn = [s for s in inputs if s.name == "omega_z"]
    inputs = [s for s in inputs if s not in turn]
    return {
        "turn": turn,
        "inputs": inputs,
        "start": [slider(model, name, parameters[name]) for name in STARTS],
        "device": made,
    }


def _stages(model: Model) -> list[Stage]:
    shown = [effect for effect in model.effects if effect.parameters]
    order = dict.fromkeys(effect.stage for effect in sorted(shown, key=_place))
    return [Stage(name, [Group(e.id, _title(e), e.signature) for e in shown if e.stage == name]) for name in order]


def _place(effect: Effect) -> int:
    """The order of the stages: forces on the mass, the chain as a signal passes it, what changes parameters."""
    chain = list(dict.fromkeys(slot.split()[0] for slot in SLOTS))
    stage = effect.stage.split()[0]
    return -1 if isinstance(effect, Force) else chain.index(stage) if stage in chain else len(chain)


def _title(effect: Effect) -> str:
    return effect.doc.strip().partition("\n")[0].rstrip(".")


def _neutral(model: Model) -> dict[str, float]:
    return {q.name: q.start for q in model.quantities if q.role == "size"}


def _at_rest(device: Device) -> dict[str, float]:
    return device.all_parameters | dict.fromkeys(device.model.start_of.values(), 0.0)


def _split(model: Model, values: Mapping[str, float]) -> tuple[list[tuple[int, float]], list[tuple[int, int]]]:
    """``values`` by value reference: numbers, and whole numbers."""
    known = [(index, q) for index, q in enumerate(model.quantities) if q.name in values]
    numbers = [(index, float(values[q.name])) for index, q in known if not q.integer]
    return numbers, [(index, int(values[q.name])) for index, q in known if q.integer]


def _fingerprint(
    model: Model, native: Path, parameters: Mapping[str, float], sliders: Sequence[Slider]
) -> dict[str, Any]:
    """A fixed run with every effect on and every input moving, and the hash of the native FMU's outputs."""
    on = {s.name: _some_way(s) for s in sliders if model.by_name[s.name].role == "size"}
    values = dict(parameters) | on | {"seed": 7}
    inputs = [slider(model, q.name, q.start) for q in model.quantities if q.role == "input"]
    outputs = [q.name for q in model.quantities if q.role == "output"]
    # Not a multiple of the grid: steps that end between its points are compared, too.
    step = 0.62 * parameters["internal_step"]
    pattern = np.array([[(37 * k + 11 * i) % 17 - 8 for i in range(len(inputs))] for k in range(STEPS)], float)
    sizes = [(s.high - s.start) / 100 for s in inputs]
    held: dict[str, Floats] = {
        s.name: s.start + size * column for s, size, column in zip(inputs, sizes, pattern.T, strict=True)
    }
    with NativeFmu(model, native) as fmu:
        found = fmu.play(Score(values, held, step), outputs)
    numbers, whole = _split(model, values)
    references = {q.name: index for index, q in enumerate(model.quantities)}
    return {
        "numbers": numbers,
        "whole": whole,
        "inputs": [s.reference for s in inputs],
        "rest": [s.start for s in inputs],
        "sizes": sizes,
        "outputs": [references[name] for name in outputs],
        "step": step,
        "steps": STEPS,
        "done": len(found),
        "hash": fnv1a(found.astype("<f8").tobytes()),
    }


def _some_way(s: Slider) -> float:
    """A value at which the effect acts, well within the slider."""
    if s.neutral >= UNLIMITED:
        return s.low * (s.high / s.low) ** 0.5
    return s.neutral + 0.05 * (s.high - s.neutral)
