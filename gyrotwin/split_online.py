"""`gyrotwin rate --split-estimate`: the frequency split block by block while the gyroscope works (CN 111272193).

Each block is judged when it ends, by what came before it and what the design says of Q; nothing is fitted afterwards.
"""

from math import ceil, pi
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import polars as pl

from calibration.mode_split import Envelope, Question, Tracked, expected_wander, track
from calibration.mode_split.estimate import NORMAL_95, check_length
from gyro_model.errors import InputError

if TYPE_CHECKING:
    from cosim.rate.run import RateRun

FEWEST: Final = 3
"""Blocks of a run: two for the split and its drift, one to see whether they hold."""


def sense_rate_for(run: "RateRun") -> float:
    """The rate of the record that the estimate needs [Hz]: as wide as the loop, or as the drive frequency, allows."""
    loop = 1 / run.period
    return loop / ceil(loop / min(loop, run.nominal.calibration.frequency))


def check_blocks(run: "RateRun", block: float) -> None:
    """Raises InputError where blocks of ``block`` [s] can't show the split of ``run``."""
    if not (np.isfinite(block) and block > 0):
        raise InputError(f"--split-estimate {block:g}: give the length of a block in s")
    if run.duration < FEWEST * block:
        raise InputError(
            f"--split-estimate {block:g}: the run of {run.duration:g} s holds fewer than {FEWEST} blocks; give a "
            "longer --duration, or shorter blocks"
        )
    check_length(block, run.nominal.calibration.frequency, _q(run), "a block of --split-estimate")


def split_blocks(run: "RateRun", sense: pl.DataFrame, block: float) -> list[Tracked]:
    """The split as it is known at the end of each block [Hz], from the first hump on."""
    values = sense["v_y_i"].to_numpy() + 1j * sense["v_y_q"].to_numpy()
    t = sense["t"].to_numpy()
    rate = (len(t) - 1) / (t[-1] - t[0])
    centre = float(sense["carrier_frequency"].to_numpy().mean())
    part = Envelope(values, rate, centre, 0.4 * rate)
    question = Question(q=_q(run), drive_frequency=centre, guard=0.0, clean_line=True)
    return list(track(part, question, block, expected_wander(centre)))


def summarise(steps: list[Tracked], run: "RateRun", block: float) -> dict[str, Any]:
    """The estimates as JSON-ready values: s, Hz, intervals 95 %."""
    return {
        "block_s": block,
        "q_of_the_design": _q(run),
        "blocks": int(run.duration / block),
        "blocks_with_a_hump": sum(step.block is not None for step in steps),
        "estimates": [
            {
                "t": step.t + 0.5 * block,
                "split_hz": step.split,
                "low_hz": step.split - NORMAL_95 * step.deviation,
                "high_hz": step.split + NORMAL_95 * step.deviation,
            }
            for step in steps
        ],
    }


def _q(run: "RateRun") -> float:
    return pi * run.nominal.calibration.frequency / max(-run.nominal.pole.real, 1e-9)
