"""The yardstick of designed experiments: a menu of eight fixed ones, each a run made of the loudest one measured."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from discrepancy.data.linear_fit import mode_frequencies
from discrepancy.data.record import Floats, Record
from discrepancy.tell.limits import LEVEL, LONGEST, ORDINARY, REST

BESIDE: Final = (0.3, 0.6, 1.5, 2.0)
"""Off-resonance tones: two below the lowest mode, two above the highest, as multiples of it."""


@dataclass(frozen=True)
class Proposal:
    """An experiment: ``name`` on the menu, what to do in words, and the run to be measured, its v empty."""

    name: str
    text: str
    record: Record


def menu(records: Sequence[Record], parameters: Mapping[str, float]) -> list[Proposal]:
    """Every experiment for the device of these runs, cheapest first."""
    run = _blank(_loudest(records))
    makers: tuple[Callable[[Record, Sequence[Record], Mapping[str, float]], Proposal], ...] = (
        _level_step, _level_ramp, _ring_down, _off_resonance, _bias_step, _acceleration, _rate_step, _temperature_step,
    )  # fmt: skip
    return [make(run, records, parameters) for make in makers]


def _blank(run: Record) -> Record:
    n = min(len(run.t), LONGEST)
    held = {name: values[:n] for name, values in run.conditions.items()}
    return replace(run, name="proposed", role="fit", t=run.t[:n], u=run.u[:n], v=np.zeros_like(run.v[:n]),
                   conditions=held, valid=np.ones(n, dtype=bool))  # fmt: skip


def _late(run: Record) -> Floats:
    """0 in the first half of a run, 1 in the second."""
    return (np.arange(len(run.t)) >= len(run.t) // 2).astype(np.float64)


def _lasting(run: Record) -> str:
    return f"{len(run.t) / run.sample_rate:.3g} s"


def _level_step(run: Record, records: Sequence[Record], parameters: Mapping[str, float]) -> Proposal:
    text = f"drive level step to {LEVEL:g} times the level of {_source(records)}, {_lasting(run)}"
    return Proposal("drive level step", text, replace(run, u=run.u * (1 + (LEVEL - 1) * _late(run))[:, None]))


def _level_ramp(run: Record, records: Sequence[Record], parameters: Mapping[str, float]) -> Proposal:
    ramp = LEVEL * np.linspace(0.0, 1.0, len(run.t))
    text = f"drive level ramp from 0 to {LEVEL:g} times the level of {_source(records)}, {_lasting(run)}"
    return Proposal("drive level ramp", text, replace(run, u=run.u * ramp[:, None]))


def _ring_down(run: Record, records: Sequence[Record], parameters: Mapping[str, float]) -> Proposal:
    """The run's own drive up to the middle, then none: it rings from the amplitude that it had reached."""
    text = f"ring-down, the drive of {_source(records)} switched off after half of {_lasting(run)}"
    return Proposal("ring-down", text, replace(run, u=run.u * (1 - _late(run))[:, None]))


def _off_resonance(run: Record, records: Sequence[Record], parameters: Mapping[str, float]) -> Proposal:
    modes = mode_frequencies(parameters, run.axes)
    tones = [BESIDE[0] * modes[0], BESIDE[1] * modes[0], BESIDE[2] * modes[-1], BESIDE[3] * modes[-1]]
    tones = [f for f in tones if f < 0.4 * run.sample_rate]
    peak = max(float(np.abs(r.u).max()) for r in records)
    u = np.zeros_like(run.u)
    for axis in range(run.axes):
        # The axes a fiftieth of an octave apart, so that each is known from its own tone.
        for number, f in enumerate(tones):
            u[:, axis] += np.sin(2 * np.pi * f * 2 ** (axis / 50) * run.t + number)
    u *= LEVEL * peak / np.abs(u).max()
    told = ", ".join(f"{f:.4g}" for f in tones)
    text = f"off-resonance drive at {told} Hz, peak {LEVEL * peak:.3g} N, {_lasting(run)}"
    return Proposal("off-resonance drive", text, replace(run, u=u))


def _bias_step(run: Record, records: Sequence[Record], parameters: Mapping[str, float]) -> Proposal:
    return _condition_step("bias step", ("v_bias",), "V", run, records)


def _acceleration(run: Record, records: Sequence[Record], parameters: Mapping[str, float]) -> Proposal:
    return _condition_step("added acceleration", ("a_x", "a_y")[: run.axes], "m/s²", run, records)


def _rate_step(run: Record, records: Sequence[Record], parameters: Mapping[str, float]) -> Proposal:
    return _condition_step("rate step", ("omega_z",), "rad/s", run, records)


def _temperature_step(run: Record, records: Sequence[Record], parameters: Mapping[str, float]) -> Proposal:
    return _condition_step("temperature step", ("temperature",), "K", run, records)


def _condition_step(name: str, inputs: Sequence[str], unit: str, run: Record, records: Sequence[Record]) -> Proposal:
    """The run with conditions that step at its middle, by what the runs have seen of them or what is usual."""
    conditions = dict(run.conditions)
    sizes = []
    for quantity in inputs:
        base = float(conditions[quantity][0]) if quantity in conditions else REST[quantity]
        seen = max((float(np.abs(r.conditions[quantity] - REST[quantity]).max())
                    for r in records if quantity in r.conditions), default=0.0)  # fmt: skip
        sizes.append(max(seen, ORDINARY[quantity]))
        conditions[quantity] = base + sizes[-1] * _late(run)
    text = f"{name} of {sizes[0]:.3g} {unit} under the drive of {_source(records)}, {_lasting(run)}"
    return Proposal(name, text, replace(run, conditions=conditions))


def _source(records: Sequence[Record]) -> str:
    return f"run {_loudest(records).name}"


def _loudest(records: Sequence[Record]) -> Record:
    return max(records, key=lambda r: float(np.mean(r.u**2)))
