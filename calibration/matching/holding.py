"""Rate mode with its bias tuned: block by block the method measures, the tuner decides, the bias moves."""

from dataclasses import replace
from math import pi
from typing import Final, NamedTuple

import numpy as np
import polars as pl
from numpy.typing import NDArray

from calibration.matching.asking import Asking
from calibration.matching.known import Sensed
from calibration.matching.methods.method import Answer, Estimator, Plan
from calibration.matching.tuner import Tuner
from cosim.rate.dither import Dither
from cosim.rate.master import BLOCK_ROWS, LoopedPlant, check_lock, record_frame, start_up
from cosim.rate.resonance import sense_resonance
from cosim.rate.run import V_BIAS, RateRun
from gyro_model.errors import InputError
from gyro_model.progress import Progress

Floats = NDArray[np.float64]

NOTCH: Final = 2.0
"""Half-width of the notch that keeps the dither from loops and output [Hz]: it settles in 0.1 s, and costs the phase of
a loop of half the tone's bandwidth less than a degree."""


class Block(NamedTuple):
    """A block. t: its end [s]; length: of its measurement [s]; v_bias [V] in it; answer: its own, None where nothing
    was found; split, deviation: at that bias, by all blocks up to it [Hz]."""

    t: float
    length: float
    v_bias: float
    answer: Answer | None
    split: float
    deviation: float


class Matched(NamedTuple):
    """A finished run. record: columns of ``record_frame``, v_bias [V] and split_true [Hz], for judging; blocks;
    locked_at, started_at [s] from power on."""

    record: pl.DataFrame
    blocks: list[Block]
    locked_at: float
    started_at: float


def match(asking: Asking, progress: Progress | None = None) -> Matched:
    """Runs rate mode with its bias tuned.

    Raises InputError where a block is longer than the run, and where the drive loop never locks or loses its lock.
    """
    run, known = asking.run, asking.known
    estimator, tuner = asking.method.start(known, asking.asked), Tuner(known)
    first = estimator.plan().before + estimator.plan().measure
    if first > run.duration:
        raise InputError(f"duration {run.duration:g} s: a block lasts {first:.4g} s; give more, or a shorter --block")
    rows: list[Floats] = []
    held: list[Floats] = []
    blocks: list[Block] = []
    with LoopedPlant(run) as plant:
        locked_at, started_at = start_up(run, plant)
        done, bias = 0, known.first_bias
        while done < run.rows:
            plan = estimator.plan()
            aim = tuner.bias(plan.before + 0.5 * plan.measure) if blocks else bias
            step = _Step(run, plan, done, bias, aim)
            new_rows, new_held, sensed = step.run(plant, progress)
            rows.append(new_rows)
            held.append(new_held)
            done, bias = done + len(new_rows), aim
            if step.whole:
                blocks.append(_judge(estimator, tuner, plan, sensed, bias, done * run.interval))
    return Matched(_frame(run, np.concatenate(rows), np.concatenate(held)), blocks, locked_at, started_at)


def _judge(estimator: Estimator, tuner: Tuner, plan: Plan, sensed: Sensed, bias: float, t: float) -> Block:
    """What a block tells, taken in by the tuner; its split is that in the middle of the measurement."""
    square = bias**2
    tuner.predict(plan.before + 0.5 * plan.measure)
    answer = estimator.measure(sensed, tuner.split(square))
    if answer is not None:
        tuner.update(answer.split, answer.deviation, square)
    tuner.predict(0.5 * plan.measure)
    return Block(t, len(sensed.voltage) * sensed.period, bias, answer, *tuner.split(square))


def _frame(run: RateRun, rows: Floats, held: Floats) -> pl.DataFrame:
    frame = record_frame(rows, held, run.interval, run.seed)
    bias = held[:, V_BIAS]
    f_y = sense_resonance(run.device, frame["temperature_structure"].to_numpy(), bias)
    return frame.with_columns(v_bias=pl.Series(bias), split_true=f_y - frame["drive_frequency"].to_numpy())


class _Step:
    """One block of a run: its rows, and its bias sample by sample."""

    def __init__(self, run: RateRun, plan: Plan, first: int, bias: float, aim: float) -> None:
        self._run, self._plan, self._first = run, plan, first
        ends = plan.settle, plan.before, plan.before + plan.measure
        moved, settle, count = (max(round(time / run.interval), 1) for time in ends)
        self._count = min(count, run.rows - first)
        self.whole = self._count == count
        self._settle = settle * run.per_row
        share = np.minimum(np.arange(1, self._count * run.per_row + 1) / (moved * run.per_row), 1.0)
        self._bias = np.sqrt(bias**2 + share * (aim**2 - bias**2))

    def run(self, plant: LoopedPlant, progress: Progress | None) -> tuple[Floats, Floats, Sensed]:
        """Rows of the record, inputs as held by row, and what is sensed once the bias is there."""
        run, plan = self._run, self._plan
        blocks = (run if plan.closed == run.closed else replace(run, closed=plan.closed)).blocks()
        tone = Dither.design(plan.tone, plan.force, NOTCH, run.period) if plan.force else Dither()
        plant.blocks = blocks._replace(dither=tone)
        rows, held, sensed = [], [], []
        for first in range(0, self._count, BLOCK_ROWS):
            count = min(BLOCK_ROWS, self._count - first)
            samples = first * run.per_row, count * run.per_row
            inputs = run.inputs(self._first * run.per_row + samples[0], samples[1])
            inputs[:, V_BIAS] = self._bias[samples[0] : sum(samples)]
            block, seen = plant.step(inputs, count)
            check_lock(run, block, self._first + first)
            rows.append(block)
            held.append(inputs.reshape(count, run.per_row, -1).mean(axis=1))
            sensed.append(seen)
            if progress is not None:
                progress((self._first + first + count) * run.interval, run.duration)
        voltage, omega, force = np.concatenate(sensed, axis=1)
        whole = Sensed(run.period, 0.0 if run.envelope else run.period, voltage, force, omega.real / (2 * pi))
        return np.concatenate(rows), np.concatenate(held), whole.after(self._settle)
