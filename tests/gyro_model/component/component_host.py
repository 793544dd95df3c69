"""An importer of WebAssembly components by the draft of fmi-ls-wasm, on the Python package wasmtime.

A result that is an error comes as its status, a word; one that is none as its value."""

import functools
import struct
from collections.abc import Callable
from typing import Any

import wasmtime
from wasmtime import component

INTERFACE = "fmi:fmi3/{}@3.0.0"


@functools.cache
def _compiled(code: bytes) -> tuple[wasmtime.Engine, component.Component]:
    engine = wasmtime.Engine()
    return engine, component.Component(engine, code)


class Host:
    """A component in a store of its own, with at most ``memory`` bytes. ``log``: what came through log-message;
    ``update`` answers intermediate updates, which ``seen`` lists. Without ``updates`` it lacks that import, or with
    ``traps`` has a trap there."""

    def __init__(self, code: bytes, memory: int = 1 << 26, *, updates: bool = True, traps: bool = False) -> None:
        self.engine, self.component = _compiled(code)
        self.store = wasmtime.Store(self.engine)
        self.store.set_limits(memory_size=memory)
        self.log: list[tuple[str, str, str, str]] = []
        self.seen: list[tuple[Any, ...]] = []
        self.update: Callable[[float], tuple[bool, float]] = lambda time: (False, 0.0)
        linker = component.Linker(self.engine)
        with linker.root() as root:
            with root.add_instance(INTERFACE.format("callbacks")) as callbacks:
                callbacks.add_func("log-message", lambda store, *said: self.log.append(said))
            if updates:
                with root.add_instance(INTERFACE.format("intermediate-update-callbacks")) as callbacks:
                    callbacks.add_func("intermediate-update", self._updated)
        if traps:
            linker.define_unknown_imports_as_traps(self.component)
        self.instance = linker.instantiate(self.store, self.component)
        self._functions: dict[tuple[str, str], component.Func] = {}

    def _updated(self, store: Any, time: float, *flags: bool) -> tuple[bool, float]:
        self.seen.append((time, *flags))
        return self.update(time)

    def call(self, interface: str, name: str, *arguments: Any) -> Any:
        """Calls a function of an interface."""
        if (interface, name) not in self._functions:
            inside = self.instance.get_export_index(self.store, INTERFACE.format(interface))
            index = self.instance.get_export_index(self.store, name, inside)
            self._functions[interface, name] = self.instance.get_func(self.store, index)
        return self._functions[interface, name](self.store, *arguments)


class Instance:
    """An instance of a kind, "co-simulation" or "model-exchange", made of its function's arguments; ``made``: whether
    there is one."""

    def __init__(self, host: Host, kind: str, *arguments: Any) -> None:
        self.host, self.kind = host, kind
        self._handle = host.call(kind, f"[static]{kind}-instance.instantiate-{kind}", *arguments)
        self.made = self._handle is not None

    def __call__(self, method: str, *arguments: Any) -> Any:
        return self.host.call(self.kind, f"[method]{self.kind}-instance.{method}", self._handle, *arguments)

    def drop(self) -> None:
        """Ends it."""
        self._handle.drop(self.host.store)


def co_simulation(host: Host, token: str, *, log: bool = False, events: bool = False, early: bool = False) -> Instance:
    """An instance for co-simulation."""
    return Instance(host, "co-simulation", "gyro", token, "", False, log, events, early, [])


def _hash(found: int, data: bytes) -> int:
    """FNV-1a, 64 bit."""
    for byte in data:
        found = (found ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return found


_FIRST = 0xCBF29CE484222325


def played(code: bytes, score: str) -> dict[str, list[str]]:
    """What play.c says of a ``score``, on a component."""
    host = Host(code)
    words = iter(score.split())

    def double() -> float:
        return float(struct.unpack(">d", bytes.fromhex(next(words)))[0])

    def pairs() -> dict[int, float]:
        return {int(next(words)): double() for _ in range(int(next(words)))}

    token = next(words)
    outputs = [int(next(words)) for _ in range(int(next(words)))]
    found = {}
    for name in words:
        scales, offsets, parameters = pairs(), pairs(), pairs()
        seed, steps, step = (int(next(words)), int(next(words))), int(next(words)), double()
        fmu = co_simulation(host, token)
        done = [fmu("set-float64", list(parameters), list(parameters.values())), fmu("set-int32", [seed[0]], [seed[1]])]
        done += [fmu("enter-initialization-mode", None, 0.0, None), fmu("exit-initialization-mode")]
        assert done == ["ok"] * 4, name
        k, heard = 0, _FIRST
        while k < steps:
            signs = [(37 * k + 11 * i) % 17 - 8 for i in range(len(scales))]
            values = [offsets[vr] + scale * sign for (vr, scale), sign in zip(scales.items(), signs, strict=True)]
            assert fmu("set-float64", list(scales), values) == "ok"
            if isinstance(fmu("do-step", k * step, step, True), str):
                break
            heard = _hash(heard, struct.pack(f"<{len(outputs)}d", *fmu("get-float64", outputs)))
            k += 1
        state = _hash(_FIRST, fmu("get-fmu-state")) if k == steps else 0
        found[name] = [str(k), f"{heard:016x}", f"{state:016x}"]
        fmu.drop()
    return found
