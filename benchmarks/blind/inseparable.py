"""Ten situations in which one effect does what another does, and the experiment that tells them apart.

Why each holds follows from the equations; the generator's own columns confirm it for the data made (label: ``left``).
"""

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np

from benchmarks.blind.detect import Projector
from benchmarks.blind.effects import BY_ID, Scale, direction
from benchmarks.blind.experiment import ROOM, RUNS, Device, Plan, draw_device, draw_run
from benchmarks.blind.noise import Noise, sigma
from benchmarks.blind.physics import Floats, Plant, Run
from benchmarks.blind.trial import Trial, finished, rng_of, scale_of

Conditions = Callable[[Floats, int], dict[str, Floats]]
ALIKE, TOLD = 2.0, 10.0
"""Noise deviations that the rival must not leave before, and must leave after the experiment that separates."""
ADDED: Final = 2
"""Runs of the separating experiment."""
RATES: Final = (10.0, 18.0, 26.0, 32.0)
"""Held rates of the four runs [rad/s]."""


class Situation(NamedTuple):
    """truth is hidden, rival imitates it. why: the equation; before, after: conditions of run number i; next: the
    experiment that separates them; symmetric, coupled: the device; high: the added drive lies above the modes."""

    truth: str
    rival: str
    why: str
    next: str
    before: Conditions
    after: Conditions
    symmetric: bool = False
    coupled: bool = True
    high: bool = False


def _plain(t: Floats, number: int) -> dict[str, Floats]:
    return {}


def _step(t: Floats, low: float, high: float, at: float = 0.4) -> Floats:
    return np.where(t < at * t[-1], low, high)


def _warm(t: Floats, kelvin: float) -> dict[str, Floats]:
    return {"temperature": np.full(len(t), ROOM + kelvin)}


def _rate(t: Floats, rate: float) -> dict[str, Floats]:
    return {"omega": np.full(len(t), rate)}


def _bias(t: Floats, volt: float) -> dict[str, Floats]:
    return {"v_bias": np.full(len(t), volt)}


def _pushed(course: Floats) -> dict[str, Floats]:
    return {"acceleration": np.stack([60 * course, 40 * course], axis=1)}


SITUATIONS: Final = (
    Situation("electrostatic_softening", "frame_rotation", "a V² x = m Ω² x where V follows Ω from run to run",
              "bias step", lambda t, i: _rate(t, RATES[i]) | _bias(t, 0.4 * RATES[i]),
              lambda t, i: {"v_bias": _step(t, 4, 13)}),
    Situation("electrostatic_softening", "thermal_stiffness", "kxy = 0 and V² follows T from run to run", "bias step",
              lambda t, i: _bias(t, 0.4 * RATES[i]) | _warm(t, 0.02 * RATES[i] ** 2),
              lambda t, i: {"v_bias": _step(t, 4, 13)}, coupled=False),
    Situation("thermal_damping", "damping_step", "the temperature steps once, at the same time in every run",
              "temperature step", lambda t, i: {"temperature": _step(t, ROOM, ROOM + 15)},
              lambda t, i: {"temperature": _step(t, ROOM + 15, ROOM, 0.65)}),
    Situation("amplifier_offset", "linear_acceleration", "a constant acceleration displaces by c m a/k",
              "added acceleration", lambda t, i: _pushed(np.ones_like(t)),
              lambda t, i: _pushed(_step(t, -1, 1))),
    Situation("amplifier_drift", "linear_acceleration", "an acceleration that grows with t displaces with t",
              "added acceleration", lambda t, i: _pushed(20 * t), lambda t, i: _pushed(_step(t, -1, 1))),
    Situation("thermal_phase", "amplifier_bandwidth", "one temperature: tcp ΔT is a time constant",
              "temperature step", lambda t, i: _warm(t, 20), lambda t, i: {"temperature": _step(t, ROOM, ROOM + 30)}),
    Situation("amplifier_bandwidth", "actuator_delay", "to first order in τ a lag is a delay", "off-resonance drive",
              _plain, _plain, high=True),
    Situation("pickoff_misalignment", "actuator_misalignment", "equal axes: 1 + ε σ commutes with K and D",
              "rate step", _plain, lambda t, i: {"omega": _step(t, -30, 30)}, symmetric=True),
    Situation("pickoff_gain_mismatch", "actuator_gain_mismatch", "uncoupled axes: y/u_y alone is seen", "rate step",
              _plain, lambda t, i: {"omega": _step(t, -30, 30)}, coupled=False),
    Situation("frame_rotation", "thermal_stiffness", "kxy = 0 and T follows Ω² from run to run", "rate step",
              lambda t, i: _rate(t, RATES[i]) | _warm(t, 0.02 * RATES[i] ** 2),
              lambda t, i: {"omega": _step(t, -33, 33)}, coupled=False),
)  # fmt: skip


def make_inseparable(name: str, number: int, stage: str, block: str = "tune") -> Trial:
    """Situation ``number`` (0 to 9); stage ``before`` or ``after``: the same device and runs, then with the runs of
    the separating experiment added. Raises RuntimeError where 30 draws give none that is alike before and told apart
    after."""
    rng, case = rng_of(block, name), SITUATIONS[number]
    for _ in range(30):
        made = _made(rng, case)
        if made is None:
            continue
        device, plant, runs, added, label = made
        # Added runs are fitted; the held-out one stays last.
        shown = runs if stage == "before" else [*runs[:-1], *added, runs[-1]]
        stage_rng = rng_of(block, f"{name} {stage}")
        return finished(stage_rng, f"{name}-{stage}", device, plant, shown, Noise(), label | {"level": stage})
    raise RuntimeError(f"trial {name}: no draw in 30 makes {case.truth} and {case.rival} alike, and apart afterwards")


def _made(
    rng: np.random.Generator, case: Situation
) -> tuple[Device, Plant, list[Run], list[Run], dict[str, object]] | None:
    device = draw_device(rng, symmetric=case.symmetric, coupled=case.coupled)
    n, rate = int(np.clip(200 / device.low * 200_000, 8000, 16000)), 200_000.0
    t = np.arange(n) / rate

    def drawn(number: int, conditions: dict[str, Floats], high: bool = False) -> Run:
        # Far above the modes q = u/(m w²): the band of a mode three times as high.
        lifted = device._replace(low=3 * device.low, high=3 * device.high) if high else device
        run = draw_run(rng, lifted, Plan(), number, n, rate)
        return Run(**(run._asdict() | conditions))

    runs = [drawn(i, case.before(t, i)) for i in range(RUNS)]
    added = [drawn(i, case.after(t, i), case.high) for i in range(ADDED)]
    scale = scale_of(device, runs)
    effect, rival = BY_ID[case.truth], BY_ID[case.rival]
    aim = direction(effect, rng, (1.0,) * len(effect.sizes))
    before = Projector(device.true, runs[:-1], sigma(Noise()))
    after = Projector(device.true, [*runs[:-1], *added], sigma(Noise()))
    start = device.true._replace(damping_step_time=float(t[np.argmax(t >= 0.4 * t[-1])]))

    def placed(size: float) -> Plant:
        return effect.placed(device.true, size, aim, scale)

    cap = effect.cap(device.true, scale)
    detectable = before.detectable(placed, cap)
    rivals = [_rival(rival.id, start, scale, place) for place in range(len(rival.sizes))]
    for multiple in (300.0, 100.0, 30.0, 10.0):
        size = min(multiple * detectable, cap)
        left = [p.length(placed(size), [p.raw(r) for r in rivals]) for p in (before, after)]
        if left[0] < ALIKE and left[1] > TOLD and size >= 3 * detectable:
            label: dict[str, object] = {
                "kind": "inseparable",
                "effects": [case.truth],
                "rival": case.rival,
                "why": case.why,
                "next": case.next,
                "parameters": {s: getattr(placed(size), s) for s in effect.sizes},
                "detectable": {case.truth: detectable},
                "multiple": {case.truth: size / detectable},
                "left": left,
            }
            return device, placed(size), runs, added, label
    return None


def _rival(name: str, start: Plant, scale: Scale, place: int) -> Plant:
    """The rival alone, one of its parameters, at a size at which it is linear."""
    effect = BY_ID[name]
    aim = tuple(float(i == place) for i in range(len(effect.sizes)))
    return effect.placed(start, 1e-6 * effect.cap(start, scale), aim, scale)
