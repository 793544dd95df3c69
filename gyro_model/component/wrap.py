"""A component around the WebAssembly module of an FMU."""

from collections.abc import Sequence
from typing import Final

from gyro_model.component.binary import (
    RESOURCE,
    Component,
    InstanceType,
    Sort,
    arguments,
    called,
    text,
    unsigned,
    vector,
)
from gyro_model.component.interface import CALLBACKS, GET_VERSION, INNER, PACKAGE, TYPES, Kind

STACK: Final = 16
"""Stack of a component in pages of 64 KiB; the largest frame of the C takes half a page."""
PAGES: Final = STACK + 4
"""Memory that a component begins with: the stack, and tables, which take 20 KB. Instances lie in what malloc adds."""

_NUMBERS = {"string": 2, "list": 2, "bool": 1}
"""How many numbers an argument of the function that makes an instance is passed as."""


def component(module: bytes, kinds: Sequence[Kind]) -> bytes:
    """A component with the interfaces of ``kinds`` around a core ``module``, which imports memory of ``PAGES`` and the
    callbacks from "env" and exports a function for each method."""
    fmu = _Fmu(module)
    fmu.export_common()
    for kind in kinds:
        fmu.export_kind(kind)
    return fmu.component.whole()


class _Fmu:
    """The component around ``module``, at first without an export."""

    def __init__(self, module: bytes) -> None:
        c = self.component = Component()
        _import_types(c)
        functions = {called(signature): _import_callback(c, name) for name, signature in CALLBACKS.items()}
        self.memory = c.alias(Sort.CORE_MEMORY, c.module(_module_of_memory(), {}), "memory")
        lowered = [(name, Sort.CORE_FUNCTION, c.lower(index, self.memory)) for name, index in functions.items()]
        self.main = c.module(module, {"env": c.core_instance(("memory", Sort.CORE_MEMORY, self.memory), *lowered)})
        c.module(_module_that_starts(), {"env": self.main})
        self.realloc = self.core("cabi_realloc")

    def core(self, name: str) -> int:
        """A function of the module."""
        return self.component.alias(Sort.CORE_FUNCTION, self.main, name)

    def lift(self, signature: str, core: int) -> int:
        return self.component.lift(core, signature, self.memory, self.realloc)

    def export_common(self) -> None:
        """The interface without instances."""
        name = called(GET_VERSION)
        self._export("common", {}, [(name, GET_VERSION, self.lift(GET_VERSION, self.core(name)))])

    def export_kind(self, kind: Kind) -> None:
        """The interface of a kind of instance."""
        c = self.component
        resource = f"{kind.name}-instance"
        c.types.known[resource] = c.resource(self.core("drop"))
        record, words = kind.record
        c.types.known[record] = c.types.index(words)
        made = f"{kind.make} -> option<own<{resource}>>"
        functions = [(f"[static]{resource}.{called(made)}", made, self.lift(made, self._make(kind, resource)))]
        for method in kind.methods:
            name = called(method)
            given = ", ".join((f"self: borrow<{resource}>", *arguments(method)))
            signature = f"{name}({given}){method.rpartition(')')[2]}"
            functions.append((f"[method]{resource}.{name}", signature, self.lift(signature, self.core(name))))
        self._export(kind.name, {**TYPES, record: words, resource: RESOURCE}, functions)

    def _make(self, kind: Kind, resource: str) -> int:
        """The module's function that makes an instance, with a handle in its answer."""
        c = self.component
        given = c.core_instance(
            ("new", Sort.CORE_FUNCTION, c.new_handle(c.types.known[resource])),
            ("make", Sort.CORE_FUNCTION, self.core(called(kind.make))),
            ("memory", Sort.CORE_MEMORY, self.memory),
        )
        n = sum(_NUMBERS[one.partition(": ")[2].partition("<")[0]] for one in arguments(kind.make))
        return c.alias(Sort.CORE_FUNCTION, c.module(_module_of_handles(n), {"env": given}), "make")

    def _export(self, interface: str, types: dict[str, str], functions: Sequence[tuple[str, str, int]]) -> None:
        """Exports an ``interface`` of types by their words, and of functions (name, signature, index)."""
        c = self.component
        items = [(f"t-{name}", Sort.TYPE, c.types.known[name]) for name in types]
        items += [(f"f{i}", Sort.FUNCTION, index) for i, (*_, index) in enumerate(functions)]
        c.export_instance(PACKAGE.format(interface), c.instance(_component_of_names(types, functions), items))


def _import_types(c: Component) -> None:
    shared = InstanceType()
    for name, words in TYPES.items():
        shared.export_type(name, shared.types.define(shared.types.body(words)))
    instance = c.import_instance(PACKAGE.format("types"), shared)
    c.types.known |= {name: c.alias(Sort.TYPE, instance, name) for name in TYPES}


def _import_callback(c: Component, interface: str) -> int:
    """The importer's function of that interface."""
    signature = CALLBACKS[interface]
    type_ = InstanceType()
    for name in TYPES:
        if f": {name}" in signature:
            type_.export_type(name, type_.outer_type(c.types.known[name]))
    type_.export_function(signature)
    return c.alias(Sort.FUNCTION, c.import_instance(PACKAGE.format(interface), type_), called(signature))


def _component_of_names(types: dict[str, str], functions: Sequence[tuple[str, str, int]]) -> bytes:
    """A component that takes types and functions and exports them by name, the functions in terms of the types so
    named: a method belongs to a resource that is exported beside it."""
    c = Component()
    for name, words in types.items():
        c.types.known[name] = c.import_type(f"t-{name}", words)
    taken = [c.import_function(f"f{i}", signature) for i, (_, signature, _) in enumerate(functions)]
    inner = c.types.known
    c.types.known = {name: inner[name] if name in INNER else c.export_type(name, inner[name]) for name in types}
    for (name, signature, _), index in zip(functions, taken, strict=True):
        c.export_function(name, signature, index)
    return c.whole()


# Core modules, by the binary format of WebAssembly 1.0.
_HEAD = b"\0asm\1\0\0\0"
_I32 = b"\x7f"


def _section(number: int, *items: bytes) -> bytes:
    body = vector(items)
    return bytes([number]) + unsigned(len(body)) + body


def _import(name: str, description: bytes) -> bytes:
    return text("env") + text(name) + description


def _module_of_memory() -> bytes:
    """Nothing but memory: the importer's functions, which the FMU's module imports, need it before."""
    return _HEAD + _section(5, b"\0" + unsigned(PAGES)) + _section(7, text("memory") + b"\2\0")


def _module_that_starts() -> bytes:
    """Calls what the C library may have to do at first."""
    return _HEAD + _section(1, b"\x60\0\0") + _section(2, _import("_initialize", b"\0\0")) + b"\x08\1\0"


def _module_of_handles(n: int) -> bytes:
    """Calls the FMU's function of ``n`` arguments that makes an instance, and puts a handle in place of its address. To
    make one takes the type of resources, which takes the FMU's function that ends one: so its module can't do it."""
    types = (b"\x60" + vector([_I32] * given) + vector([_I32]) for given in (n, 1))
    imports = (("make", b"\0\0"), ("new", b"\0\1"), ("memory", b"\2\0" + unsigned(PAGES)))
    answer = b"\x20" + unsigned(n)  # local.get
    code = b"".join(b"\x20" + unsigned(i) for i in range(n)) + b"\x10\0\x22" + unsigned(n)  # call make, local.tee
    code += b"\x2d\0\0\x04\x40"  # i32.load8_u, if: there is an instance
    code += answer + answer + b"\x28\2\4\x10\1\x36\2\4\x0b"  # i32.load offset=4, call new, i32.store offset=4, end
    body = b"\1\1" + _I32 + code + answer + b"\x0b"
    return b"".join(
        (
            _HEAD,
            _section(1, *types),
            _section(2, *(_import(name, description) for name, description in imports)),
            _section(3, b"\0"),
            _section(7, text("make") + b"\0\2"),
            _section(10, unsigned(len(body)) + body),
        )
    )
