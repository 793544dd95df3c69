"""Pairs of effects that runs of a laboratory do not tell apart, drawn by seed with their devices, sizes and runs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from discrepancy.criteria import Criteria
from discrepancy.data.algebra import inverse_scaled
from discrepancy.data.record import Record, make_record
from discrepancy.fit.defect import Defect, effect_of, quantity_of
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from gyro_model.anatomy import Effect
from gyro_model.errors import InputError

RATE: Final = 200_000.0
NOISE: Final = 2e-5
"""White noise of a sample [V]: that of the reference device."""
GAIN: Final = 1e6
"""Both sense gains [V/m]."""
EVEN: Final = Criteria().even
"""Chi-square between two names that a diagnosis reports as `either`."""
PLAIN: Final = 25.0
"""Chi-square that the hidden effect takes at least: it is there, whichever it is."""
GAINS: Final = (40.0, 4e5)
"""Chi-square that sizes are drawn for, by the linear model."""
SMALLER: Final = 30.0
"""Of the chi-square, where runs tell a pair apart: the same pair is tried so much fainter."""
LARGE: Final = 0.3
"""Share of the voltage that a hidden effect changes at most."""


@dataclass(frozen=True)
class Situation:
    """Two effects, either of which may be the true one; held: conditions [SI] of all runs; equal: same axes; coupled:
    not so along the axes alone."""

    pair: tuple[str, str]
    held: Mapping[str, float]
    equal: bool = False
    coupled: bool = True


SITUATIONS: Final = tuple(
    Situation(pair, held, **more)
    for pair, held, more in (
        (("cubic_stiffness", "electrostatic_softening"), {"v_bias": 10.0}, {}),
        (("cubic_stiffness", "cross_cubic_stiffness"), {}, {}),
        (("nonlinear_damping", "squeeze_film"), {}, {}),
        (("actuator_delay", "amplifier_bandwidth"), {}, {}),
        (("pickoff_misalignment", "actuator_misalignment"), {}, {"equal": True}),
        (("pickoff_gain_mismatch", "actuator_gain_mismatch"), {}, {"coupled": False}),
        (("amplifier_offset", "linear_acceleration"), {"a_x": 9.8, "a_y": 9.8}, {}),
        (("amplifier_drift", "linear_acceleration"), {"a_x": 9.8, "a_y": 9.8}, {}),
        (("constant_force", "linear_acceleration"), {"a_x": 9.8, "a_y": 9.8}, {}),
        (("thermal_phase", "amplifier_bandwidth"), {"temperature": 318.15}, {}),
        (("thermal_phase", "actuator_delay"), {"temperature": 318.15}, {}),
    )
)


@dataclass(frozen=True)
class Pair:
    """names: the true effect, then its rival; fitted: all parameters of the model with each; records: the runs; gap:
    chi-square by which the rival fits worse to them; gain: by which the true effect fits better than none."""

    names: tuple[str, str]
    fitted: Mapping[str, Mapping[str, float]]
    records: tuple[Record, ...]
    gap: float
    gain: float


def draw_numbered(simulator: Simulator, number: int, seed: int = 1) -> Pair | None:
    """Draw ``number``: the situations in turn; None where its runs tell the two apart, or show none."""
    situation = SITUATIONS[number % len(SITUATIONS)]
    return draw_pair(simulator, situation, np.random.default_rng([seed, number]))


def draw_pair(simulator: Simulator, situation: Situation, rng: np.random.Generator) -> Pair | None:
    """A device, one effect of the situation in it and runs of it; None where these tell the two apart, or show
    none."""
    device = _device(rng, situation)
    blank = _runs(rng, device, situation)
    names = situation.pair if rng.random() < 0.5 else situation.pair[::-1]
    clean = [replace(r, v=simulator.run(r, device)) for r in blank]
    fitter = Fitter(simulator, clean)
    at = Fitted(device, fitter.starts(device), fitter.begin(device).free, fitter.plain(device), ())
    linear = fitter.with_grams(fitter.evaluated(at))
    effects = [effect_of(simulator.model, name) for name in names]
    units = [_unit(fitter, linear, effect) for effect in effects]
    if not all(units):
        return None
    gain = math.exp(rng.uniform(*np.log(GAINS)))
    while gain > PLAIN:
        hidden = {name: start + math.sqrt(gain) * size for name, (start, size) in units[0].items()}
        found = _undecided(simulator, names, device, hidden, clean, units, rng)
        if found is not None:
            return found
        gain /= SMALLER
    return None


def _undecided(
    simulator: Simulator,
    names: tuple[str, str],
    device: Mapping[str, float],
    hidden: Mapping[str, float],
    clean: Sequence[Record],
    units: Sequence[Mapping[str, tuple[float, float]]],
    rng: np.random.Generator,
) -> Pair | None:
    """The pair with sizes ``hidden``, if the runs show the effect and leave both names."""
    noisy = [measured(simulator, r, {**device, **hidden}, rng) for r in clean]
    records = [r for r in noisy if r is not None]
    if len(records) < len(clean):
        return None
    if max(_off(r, c) for r, c in zip(records, clean, strict=True)) > LARGE:
        return None
    fits = [fit(simulator, records, device, unit) for unit in units]
    gap = (fits[1].cost - fits[0].cost) / NOISE**2
    if not abs(gap) < EVEN:
        return None
    gain = (fit(simulator, records, device, {}).cost - fits[0].cost) / NOISE**2
    sets = {name: dict(own.parameters) for name, own in zip(names, fits, strict=True)}
    return Pair(names, sets, tuple(records), gap, gain) if gain > PLAIN else None


def _off(record: Record, clean: Record) -> float:
    return float(np.sqrt(np.mean((record.v - clean.v) ** 2) / np.mean(clean.v**2)))


def fit(simulator: Simulator, records: Sequence[Record], device: Mapping[str, float],
        unit: Mapping[str, tuple[float, float]]) -> Fitted:  # fmt: skip
    """Device and sizes fitted to runs under white noise; unit: by size its neutral value and a change that the runs
    show."""
    fitter = Fitter(simulator, records)
    nominal = fitter.begin(dict(device))
    free = [*nominal.free]
    for name, (_, size) in unit.items():
        quantity = quantity_of(simulator.model, name)
        free.append(Free(name, 0.1 * abs(size), quantity.low, quantity.high))
    values = {name: start + 3 * size for name, (start, size) in unit.items()}
    begun = Fitted({**nominal.parameters, **values}, fitter.starts(device), tuple(free), fitter.plain(device), ())
    return fitter.fit(fitter.evaluated(begun), rounds=15)


def _unit(fitter: Fitter, at: Fitted, effect: Effect | Defect) -> dict[str, tuple[float, float]]:
    """By size its neutral value and the change that takes a chi-square of one, all sizes together, beside the device;
    empty where the runs show none."""
    nominal = {q.name: (q.start, q.nominal if getattr(q, "nominal", None) else 1e-9) for q in effect.sizes}
    whole: dict[str, tuple[float, float]] = dict(nominal)
    for _ in range(3):
        probe = {name: start + size for name, (start, size) in whole.items()}
        linear = fitter.with_grams(at, [probe])
        assert linear.grams is not None
        total = linear.grams.sum(axis=0)
        p = linear.known
        taken = total[p, p] - total[p, :p] @ inverse_scaled(total[:p, :p]) @ total[:p, p]
        gain = float(np.sqrt(max(taken, 0.0))) / NOISE
        if not 1e-6 < gain < np.inf:
            return {}
        whole = {name: (start, size / gain) for name, (start, size) in whole.items()}
    return whole


def _device(rng: np.random.Generator, situation: Situation) -> dict[str, float]:
    """1.5 to 12 kHz, Q 300 to 30,000, 2 to 30 % between the axes."""
    m, f, q = 10 ** rng.uniform(-7.5, -6), 1500 * 8 ** rng.uniform(), 10 ** rng.uniform(2.5, 4.48)
    k, d = m * (2 * math.pi * f) ** 2, 2 * math.pi * f * m / q
    split = 1.0 if situation.equal else rng.uniform(1.02, 1.3) ** 2
    cross = rng.uniform(-0.15, 0.15) if situation.coupled else 0.0
    loss = 1.0 if situation.equal else rng.uniform(0.7, 1.4)
    return {
        "m": m, "kxx": k, "kyy": k * split, "kxy": k * math.sqrt(split) * cross, "dxx": d, "dyy": d * loss,
        "dxy": d * rng.uniform(-0.3, 0.3) if situation.coupled else 0.0, "sense_gain_x": GAIN, "sense_gain_y": GAIN,
    }  # fmt: skip


def _runs(rng: np.random.Generator, device: Mapping[str, float], situation: Situation) -> list[Record]:
    """Three runs at one level, of few tones or of many."""
    n, f = 4000 * int(rng.integers(1, 3)), math.sqrt(device["kxx"] / device["m"]) / 2 / math.pi
    few = rng.random() < 0.5
    t = np.arange(n) / RATE
    reach = 10 ** rng.uniform(-6.7, -5.8)
    records = []
    for number in range(3):
        tones = 3 if few else 30
        frequency = f * rng.uniform(0.4, 1.7, (tones, 2))
        phase = rng.uniform(0, 2 * math.pi, (tones, 2))
        u = np.sin(2 * math.pi * frequency * t[:, None, None] + phase).sum(axis=1)
        u *= reach * device["kxx"] / tones
        held = {name: np.full(n, value) for name, value in situation.held.items()}
        records.append(make_record(f"run-{number + 1}", t, u, u, sample_rate=RATE, conditions=held))
    return records


def measured(simulator: Simulator, record: Record, values: Mapping[str, float], rng: np.random.Generator
              ) -> Record | None:  # fmt: skip
    """The run of a device of these ``values``, with noise; None where the FMU refuses one or the motion leaves all
    bounds."""
    try:
        v = simulator.run(record, values)
    except InputError:
        return None
    return replace(record, v=v + NOISE * rng.standard_normal(v.shape)) if np.isfinite(v).all() else None
