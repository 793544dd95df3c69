"""What an effect remembers along a course of what it reads, without the FMU: for true values in records."""

import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri
from sympy import Expr, sympify

from gyro_model.anatomy import Effect, Memory
from gyro_model.evaluate import compiled

Floats = NDArray[np.float64]

_MASK, _32 = np.uint64(0xFFFFFFFF), np.uint64(32)


def normal_numbers(effect_id: str, seed: int, count: int) -> Floats:
    """The standard normal numbers ``normal_x, normal_y`` of an effect at samples 0 .. count - 1, shape (count, 2), as
    the FMU draws them: Philox 4x32-10 (J. K. Salmon et al., SC'11), then the inverse of the normal distribution."""
    index = np.arange(count, dtype=np.uint64)
    words = [index & _MASK, index >> _32, np.zeros_like(index), np.zeros_like(index)]
    keys = [np.uint64(seed), np.uint64(zlib.crc32(effect_id.encode()))]
    for _ in range(10):
        first, second = words[0] * np.uint64(0xD2511F53), words[2] * np.uint64(0xCD9E8D57)
        words = [
            (second >> _32) ^ words[1] ^ keys[0],
            second & _MASK,
            (first >> _32) ^ words[3] ^ keys[1],
            first & _MASK,
        ]
        keys = [(key + np.uint64(step)) & _MASK for key, step in zip(keys, (0x9E3779B9, 0xBB67AE85), strict=True)]
    bits = [(words[i] << np.uint64(21)) ^ (words[i + 1] >> np.uint64(11)) for i in (0, 2)]
    return np.asarray(ndtri((np.array(bits).T.astype(np.float64) + 0.5) * 2.0**-53))


def remembered(effect: Effect, t: Floats, values: Mapping[str, Any]) -> dict[str, Floats]:
    """What a parameter law remembers at times ``t`` [s] since the start, shape (n,), not falling, by symbol name.

    values: all that it reads by name, SI, numbers or shape (n,), held from one time to the next; ``seed`` and
    ``sample_period`` among them. What the effect lags by between two times is exact, what it walks at samples too.
    """
    return {memory.symbol.name: _course(memory, effect, t, values) for memory in effect.memories}


def _course(memory: Memory, effect: Effect, t: Floats, values: Mapping[str, Any]) -> Floats:
    read = {name: np.broadcast_to(value, t.shape) for name, value in values.items() if not isinstance(value, str)}
    own = memory.symbol.name
    number = dict(zip(("normal_x", "normal_y"), normal_numbers(effect.id, int(values["seed"]), 1)[0], strict=True))
    value = _at(memory.start, {name: course[0] for name, course in read.items()} | number)
    if memory.sample is not None:
        return _walked(memory, effect, t, values, value)
    if memory.now is None:
        return np.full(len(t), value)
    used = [s.name for s in sympify(memory.now).free_symbols if s.name not in (own, "since")]
    out = np.empty(len(t))
    before = 0.0
    for k, time in enumerate(t):
        at = {name: read[name][max(k - 1, 0) if memory.flows else k] for name in used}
        out[k] = value = _at(memory.now, at | {own: value, "since": time - before})
        before = time
    return out


def _walked(memory: Memory, effect: Effect, t: Floats, values: Mapping[str, Any], start: float) -> Floats:
    period = float(values["sample_period"])
    samples = np.floor(t / period * (1 + 1e-12)).astype(int)
    numbers = normal_numbers(effect.id, int(values["seed"]), int(samples[-1]) + 1)
    course = np.empty(len(numbers))
    course[0] = value = start
    for k in range(1, len(numbers)):
        at = {memory.symbol.name: value, "since": period, "normal_x": numbers[k, 0], "normal_y": numbers[k, 1]}
        course[k] = value = _at(memory.sample, at)
    return course[samples]


def _at(expr: Expr | None, values: Mapping[str, Any]) -> float:
    arguments = tuple(sorted(sympify(expr).free_symbols, key=lambda symbol: symbol.name))
    return float(compiled(sympify(expr), arguments)(*(values[symbol.name] for symbol in arguments)))
