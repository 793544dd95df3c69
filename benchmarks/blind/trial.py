"""One labelled data set: a device with something hidden, what the lab measured, and the sealed truth about it."""

import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np

from benchmarks.blind.detect import DEVIATIONS, Projector
from benchmarks.blind.difficulties import DIFFICULTIES, Difficulty
from benchmarks.blind.effects import BY_ID, EFFECTS, Effect, Scale, direction, no_shape, units
from benchmarks.blind.experiment import TOLERANCE, Device, Plan, draw_device, draw_runs
from benchmarks.blind.noise import Noise, clean, measured, sigma
from benchmarks.blind.physics import Floats, Plant, Run, clipped, simulate
from benchmarks.blind.terms import TERMS, extra_force

BLOCKS: Final = {"tune": 1_000_000, "report": 2_000_000}
"""Seeds to tune thresholds on, and those of the reported run."""
LARGEST: Final = 4.0
"""Peak displacement with the effect, over that without, from which a size counts as unstable."""
APART: Final = 0.2
"""Least part of the length of a change that must stay outside of the other effects' changes for a set to count as
separable."""
NULLS: Final = ("clean", "noisy", "quantised", "thermal", "flicker", "jitter", "badly", "short")
SETTLE: Final = (5e-3, 50)
"""Not scored at the begin of a run: [s], samples (docs/theory/records.md, eq. 2)."""


@dataclass(frozen=True)
class Trial:
    """A labelled data set. measured: (n, 2) [V] a run; label: what is hidden, read by nobody before the answer."""

    id: str
    nominal: Mapping[str, float]
    runs: Sequence[Run]
    measured: Sequence[Floats]
    label: Mapping[str, Any] = field(repr=False)


class Hidden(NamedTuple):
    """An effect at a size. direction: its share by parameter; detectable: the size that shows at five deviations."""

    effect: Effect
    size: float
    direction: tuple[float, ...]
    detectable: float
    capped: bool


def rng_of(block: str, name: str) -> np.random.Generator:
    """The random numbers of one trial, the same whatever else runs."""
    return np.random.default_rng([BLOCKS[block], zlib.crc32(name.encode())])


def scale_of(device: Device, runs: Sequence[Run]) -> Scale:
    """How large things are without any effect."""
    motions = [simulate(device.true, run) for run in runs]
    return Scale(
        q=max(float(np.abs(m.state[:, :2]).max()) for m in motions),
        u=max(float(np.abs(run.u).max()) for run in runs),
        v=max(float(np.abs(m.v).max()) for m in motions[:-1]),
        bias=max(float(np.abs(run.v_bias).max()) for run in runs),
        warm=max(float(np.abs(run.temperature - device.true.t_ref).max()) for run in runs),
        duration=min(len(run.u) / run.rate for run in runs),
        omega=2 * math.pi * device.high,
        low=2 * math.pi * device.low,
    )


def make_null(name: str, kind: str, block: str = "tune") -> Trial:
    """Nothing hidden; kind: of NULLS, or a difficulty of the record."""
    rng = rng_of(block, name)
    device = draw_device(rng, badly=kind == "badly")
    host = tuple(h for h in ("temperature", "v_bias", "omega_z", "acceleration") if rng.random() < 0.3)
    runs = draw_runs(rng, device, Plan(host, 4000 if kind == "short" else None))
    noise = {
        "noisy": Noise(white=2e-4),
        "quantised": Noise(lsb=10 ** rng.uniform(-4.5, -3)),
        "thermal": Noise(thermal=True),
        "flicker": Noise(flicker=10 ** rng.uniform(-5, -4)),
        "jitter": Noise(jitter=10 ** rng.uniform(-9, -8)),
    }.get(kind, Noise())
    difficulty = DIFFICULTIES[kind](rng, device, runs) if kind in DIFFICULTIES else None
    label = {"kind": "null", "level": kind, "effects": []}
    return finished(rng, name, device, device.true, runs, noise, label, difficulty)


def make_effects(
    name: str,
    ids: Sequence[str],
    multiple: float | tuple[float, float],
    block: str = "tune",
    *,
    partner_known: bool = True,
    difficulty: str = "",
) -> Trial:
    """The effects ``ids`` at ``multiple`` of their detectable sizes (a range: drawn from it), each in the host
    experiment that all need together. partner_known: what an effect needs to act stands in [nominal], else it is
    hidden too. difficulty: of the record, by its id. Draws again, up to 30 times, until the effects can be told from
    one another. Raises KeyError for an unknown id, RuntimeError where no draw will do."""
    rng = rng_of(block, name)
    effects = [BY_ID[i] for i in ids]
    host = tuple(dict.fromkeys(h for effect in effects for h in effect.host))
    for _ in range(30):
        device = draw_device(rng)
        runs = draw_runs(rng, device, Plan(host))
        trouble = DIFFICULTIES[difficulty](rng, device, runs) if difficulty else None
        drawn = _drawn(rng, device, runs, effects, multiple, trouble.louder if trouble else 1.0)
        if drawn is None:
            continue
        start, hidden, scale = drawn
        plant = _placed(start, hidden, scale)
        if not _stable(plant, runs, scale):
            continue
        return _with_effects(rng, name, device, start, plant, runs, hidden, partner_known, scale, trouble)
    raise RuntimeError(f"trial {name}: no draw in 30 has {', '.join(ids)} visible and separable")


def _drawn(
    rng: np.random.Generator,
    device: Device,
    runs: list[Run],
    effects: Sequence[Effect],
    multiple: float | tuple[float, float],
    louder: float,
) -> tuple[Plant, list[Hidden], Scale] | None:
    """The device with shapes and partners in, and the sizes, beside a noise that is so much ``louder`` than the
    sensor's; None where an effect does not show apart from others."""
    scale, start = scale_of(device, runs), device.true
    for effect in effects:
        start = start._replace(**effect.shape(rng, start, scale))
        if effect.partner:
            partner, parameter, share = effect.partner
            start = start._replace(**{parameter: share * BY_ID[partner].cap(start, scale)})
    projector = Projector(start, runs[:-1], sigma(Noise()))
    aims = [direction(effect, rng, units(effect, scale)) for effect in effects]
    partners = [projector.raw(start._replace(**{e.partner[1]: 1.01 * getattr(start, e.partner[1])}))
                for e in effects if e.partner]  # fmt: skip

    def place(effect: Effect, aim: tuple[float, ...], size: float) -> Plant:
        return effect.placed(start, size, aim, scale)

    found = [max(louder * projector.detectable(lambda s, e=e, a=a: place(e, a, s), e.cap(start, scale), partners),  # type: ignore[misc]
                 e.least(scale)) for e, a in zip(effects, aims, strict=True)]  # fmt: skip
    if not all(math.isfinite(f) for f in found):
        return None
    if len(effects) > 1:
        changes = [projector.raw(place(e, a, f)) for e, a, f in zip(effects, aims, found, strict=True)]
        for i, change in enumerate(changes):
            others = changes[:i] + changes[i + 1 :] + partners
            left = float(np.linalg.norm(projector.visible(change, others)))
            if left < APART * DEVIATIONS:
                return None
            found[i] *= DEVIATIONS / left
    hidden = []
    for effect, aim, detectable in zip(effects, aims, found, strict=True):
        wanted = multiple if isinstance(multiple, float | int) else float(np.exp(rng.uniform(*np.log(multiple))))
        cap = effect.cap(start, scale)
        if len(effects) > 1 and cap < _lowest(multiple) * detectable:
            return None
        hidden.append(Hidden(effect, min(wanted * detectable, cap), aim, detectable, wanted * detectable > cap))
    return start, hidden, scale


def _lowest(multiple: float | tuple[float, float]) -> float:
    """The lower end of a range of multiples."""
    return multiple[0] if isinstance(multiple, tuple) else multiple


def _placed(start: Plant, hidden: Sequence[Hidden], scale: Scale) -> Plant:
    plant = start
    for h in hidden:
        plant = h.effect.placed(plant, h.size, h.direction, scale)
    return plant


def _stable(plant: Plant, runs: Sequence[Run], scale: Scale) -> bool:
    """Whether ``plant`` moves by no more than LARGEST times what it does without effects."""
    for run in runs:
        state = simulate(plant, run).state
        if not np.isfinite(state).all() or np.abs(state[:, :2]).max() > LARGEST * scale.q:
            return False
    return True


def _with_effects(
    rng: np.random.Generator, name: str, device: Device, start: Plant, plant: Plant, runs: list[Run],
    hidden: Sequence[Hidden], partner_known: bool, scale: Scale, difficulty: Difficulty | None,
) -> Trial:  # fmt: skip
    true: dict[str, float] = {}
    known: dict[str, float] = {}
    ids = [h.effect.id for h in hidden]
    for h in hidden:
        if h.effect.id == "adc_clipping":
            peak = max(float(np.abs(simulate(plant, run).v).max()) for run in runs[:-1])
            plant = plant._replace(adc_limit=peak - h.size)
        true |= {n: getattr(plant, n) for n in h.effect.sizes}
        if h.effect.shape is not no_shape:
            true |= {n: getattr(plant, n) for n in h.effect.shape(np.random.default_rng(0), start, scale)}
        if h.effect.partner:
            partner, parameter, _ = h.effect.partner
            value = {parameter: getattr(plant, parameter)}
            if partner_known:
                known |= value
            elif partner not in ids:
                true |= value
                ids.append(partner)
    kind = "difficulty" if difficulty else {1: "single", 2: "pair", 3: "triple"}[len(hidden)]
    label = {
        "kind": kind,
        "level": "",
        "effects": ids,
        "parameters": true,
        "sizes": {h.effect.id: h.size for h in hidden},
        "detectable": {h.effect.id: h.detectable for h in hidden},
        "multiple": {h.effect.id: h.size / h.detectable for h in hidden},
        "capped": [h.effect.id for h in hidden if h.capped],
        "known_partner": known,
    }
    nominal = device._replace(nominal=device.nominal | known)
    return finished(rng, name, nominal, plant, runs, Noise(), label, difficulty)


def make_unknown(name: str, number: int, block: str = "tune", multiple: float = 10.0) -> Trial:
    """Term ``number`` (1 to 20) of ``terms.TERMS``, as large as to leave ``multiple`` times the detectable length
    outside of everything that the plain effects together imitate (of 1 % of their caps), or its cap."""
    rng = rng_of(block, name)
    for _ in range(30):
        device = draw_device(rng)
        runs = draw_runs(rng, device, Plan())
        scale = scale_of(device, runs)
        projector = Projector(device.true, runs[:-1], sigma(Noise()))
        rivals = _rival_changes(projector, device.true, scale)

        def placed(size: float, true: Plant = device.true) -> Plant:
            return true._replace(term=float(number), term_size=size)

        cap = _term_cap(placed, device.true, runs, 0.2 * min(device.true.kxx, device.true.kyy) * scale.q)
        found = projector.detectable(placed, cap)
        apart = projector.detectable(placed, cap, rivals)
        size = min(multiple * apart, cap)
        if not (math.isfinite(apart) and size >= 2 * apart and size >= 10 * found):
            continue
        if not _stable(placed(size), runs, scale):
            continue
        term = TERMS[number - 1]
        label = {"kind": "unknown", "level": term.name, "effects": [], "parameters": {"c": size},
                 "detectable": {term.name: found}, "multiple": {term.name: size / found},
                 "multiple_apart": size / apart, "force_x": term.force_x, "force_y": term.force_y,
                 "points": _points(placed(size), runs)}  # fmt: skip
        return finished(rng, name, device, placed(size), runs, Noise(), label)
    raise RuntimeError(f"trial {name}: no draw in 30 shows term {number} apart from every effect")


def _points(plant: Plant, runs: Sequence[Run]) -> list[list[float]]:
    """Some 100 states and forces of every fitted run, x, y, x', y', u_x, u_y, on which formulas are compared."""
    rows = []
    for run in runs[:-1]:
        some = slice(len(run.u) // 5, None, len(run.u) // 120)
        rows += np.hstack([simulate(plant, run).state[some], run.u[some]]).tolist()
    return rows


def _rival_changes(projector: Projector, true: Plant, scale: Scale) -> list[Floats]:
    """What every effect of the plain host experiment does, one change a parameter."""
    changes = []
    for effect in EFFECTS:
        if effect.host or effect.partner or effect.shape is not no_shape or effect.id == "adc_clipping":
            continue
        for place in range(len(effect.sizes)):
            aim = tuple(u * (i == place) for i, u in enumerate(units(effect, scale)))
            changes.append(projector.raw(effect.placed(true, 1e-4 * effect.cap(true, scale), aim, scale)))
    return changes


def _term_cap(placed: Any, true: Plant, runs: Sequence[Run], force: float) -> float:
    """Coefficient at which the term is as large as ``force`` [N] on the motion without it."""
    number, largest = placed(1.0).term, 0.0
    for run in runs[:-1]:
        state = simulate(true, run).state
        for s, u in zip(state[::7], run.u[::7], strict=True):
            largest = max(largest, *map(abs, extra_force(number, 1.0, s[0], s[1], s[2], s[3], u[0], u[1])))
    return force / largest


def finished(
    rng: np.random.Generator,
    name: str,
    device: Device,
    plant: Plant,
    runs: list[Run],
    noise: Noise,
    label: dict[str, Any],
    difficulty: Difficulty | None = None,
) -> Trial:
    """The data of ``plant``, and the label completed by what is the same for every kind."""
    voltages = [measured(rng, plant, run, noise, difficulty) for run in runs]
    quiet = clipped(clean(plant, runs[-1], difficulty), plant)
    first = max(int(SETTLE[0] * runs[-1].rate), SETTLE[1])
    noisy = voltages[-1]
    floor = float(np.sqrt(np.mean((noisy - quiet)[first:] ** 2) / np.mean(noisy[first:] ** 2)))
    more = {
        "record": {difficulty.id: difficulty.value} if difficulty else {},
        "noise": noise._asdict(),
        "floor": floor,
        "true": {n: getattr(plant, n) for n in TOLERANCE},
        "modes_hz": [device.low, device.high],
        "samples": len(runs[0].u),
        "host": [h for h in ("omega_z", "temperature", "acceleration", "v_bias") if columns_of(runs[0], h)],
    }
    return Trial(name, device.nominal, runs, voltages, {"id": name} | label | more)


def columns_of(run: Run, host: str) -> bool:
    """Whether a run carries that condition at all."""
    values = {"omega_z": run.omega, "temperature": run.temperature - 298.15, "acceleration": run.acceleration,
              "v_bias": run.v_bias}[host]  # fmt: skip
    return bool(np.any(values))
