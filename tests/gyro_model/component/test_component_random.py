"""Random calls of the component end nothing."""

import random
from pathlib import Path
from typing import Any

import pytest
from component_fmus import FULL, MODELS, TOKENS, code_of
from component_host import Host, Instance
from wasmtime import component

from gyro_model.component.binary import arguments, called, parts
from gyro_model.component.interface import KINDS

NUMBERS = (0.0, 1e-6, 2.3e-5, 1e-4, -1e-5, 1e300, float("inf"), float("nan"))


def random_value(kind: str, rng: random.Random, n: int) -> Any:
    """A value of a type in words; value references up to a little more than there are."""
    head, _, inside = kind.partition("<")
    match head:
        case "value-reference":
            return rng.randrange(n + 3) if rng.random() < 0.95 else rng.randrange(1 << 32)
        case "bool":
            return rng.random() < 0.5
        case "f32" | "f64":
            return rng.choice(NUMBERS)
        case "string":
            return rng.choice(("", "logAll", "logEvents", "ä\0ö", "x" * 300))
        case "fmu-state":
            return rng.randbytes(rng.choice((0, 7, 64, 4000)))
        case "option":
            return random_value(inside[:-1], rng, n) if rng.random() < 0.5 else None
        case "list":
            size = rng.choice((0, 1, 1, 2, 5, 40))
            return rng.randbytes(size) if inside == "u8>" else [random_value(inside[:-1], rng, n) for _ in range(size)]
        case "tuple":
            return tuple(random_value(one, rng, n) for one in parts(inside[:-1]))
        case "interval-fraction":
            pair = component.Record()
            pair.counter, pair.resolution = rng.randrange(1 << 64), rng.randrange(1 << 64)
            return pair
    low = -(1 << int(kind[1:]) - 1) if kind.startswith("s") else 0
    return rng.randrange(low, low + (1 << int(kind[1:])))


LIFE = ("enter-initialization-mode", "exit-initialization-mode", "do-step", "set-float64", "get-float64", "reset")
TUNED = {"set-float64": NUMBERS[:3]}


@pytest.mark.parametrize(
    ("name", "kind"),
    [(name, kind) for name in MODELS for kind in KINDS if kind.name == "co-simulation" or name == FULL.NAME],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_random_calls_end_nothing(name: str, kind: Any, seed: int, folder: Path) -> None:
    rng = random.Random(f"{name} {kind.name} {seed}")
    host = Host(code_of(folder, name))
    host.update = lambda time: (rng.random() < 0.1, rng.choice(NUMBERS))
    methods = {called(method): [one.partition(": ")[2] for one in arguments(method)] for method in kind.methods}
    n = len(MODELS[name].quantities)
    living: list[Instance] = []
    statuses: dict[str, int] = {}
    now: dict[int, float] = {}
    for _ in range(2500):
        if len(living) < 2 or rng.random() < 0.01:
            flags = [rng.random() < 0.5 for _ in arguments(kind.make)[3:]][: 4 if kind.name == "co-simulation" else 2]
            more = [[0, 99]] if kind.name == "co-simulation" else []
            token = TOKENS[name] if rng.random() < 0.9 else ""
            one = Instance(host, kind.name, "ä", token, "file:///nowhere/", *flags, *more)
            living += [one] if one.made else []
            continue
        one = rng.choice(living)
        method = rng.choice(LIFE if rng.random() < 0.4 else tuple(methods))
        if method not in methods:
            method = "set-time"
        given = [random_value(kind_, rng, n) for kind_ in methods[method]]
        if method == "do-step" and rng.random() < 0.8:
            given = [now.get(id(one), 0.0), rng.choice((1e-6, 2.3e-5, 1e-4)), True]
        if method == "enter-initialization-mode" and rng.random() < 0.8:
            given = [None, 0.0, None]
        result = one(method, *given)
        if method == "do-step" and not isinstance(result, str):
            now[id(one)] = getattr(result, "last-successful-time")
        if method in ("reset", "enter-initialization-mode") and result == "ok":
            now[id(one)] = 0.0 if method == "reset" else given[1]
        said = result if isinstance(result, str) else "value"
        statuses[said] = statuses.get(said, 0) + 1
        if rng.random() < 0.01:
            living.remove(one)
            one.drop()
    assert set(statuses) <= {"ok", "value", "error", "discard"}
    # It got somewhere, and was stopped there.
    assert min(statuses[said] for said in ("ok", "value", "error")) > 50
