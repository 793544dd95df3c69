"""The binary format of WebAssembly's Component Model, as far as an FMU needs it (Binary.md of
github.com/WebAssembly/component-model). Types and functions are given in words of its interface language."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum
from typing import Final

RESOURCE: Final = "resource"
"""Instead of a type's words: a type of which only handles cross the border."""

_PRIMITIVES = {
    "bool": b"\x7f", "s8": b"\x7e", "u8": b"\x7d", "s16": b"\x7c", "u16": b"\x7b", "s32": b"\x7a", "u32": b"\x79",
    "s64": b"\x78", "u64": b"\x77", "f32": b"\x76", "f64": b"\x75", "string": b"\x73",
}  # fmt: skip
_HEADS = {
    "record": b"\x72", "list": b"\x70", "tuple": b"\x6f", "enum": b"\x6d", "option": b"\x6b", "result": b"\x6a",
    "own": b"\x69", "borrow": b"\x68",
}  # fmt: skip


class Sort(Enum):
    """What has an index of its own kind: how it is told, and the section that defines one."""

    CORE_FUNCTION = b"\0\0"
    CORE_MEMORY = b"\0\2"
    CORE_MODULE = b"\0\x11"
    CORE_INSTANCE = b"\0\x12"
    FUNCTION = b"\1"
    TYPE = b"\3"
    COMPONENT = b"\4"
    INSTANCE = b"\5"


Item = tuple[str, Sort, int]
"""What is exported or handed in: its name, sort and index."""


def unsigned(n: int) -> bytes:
    """LEB128."""
    return bytes([n]) if n < 0x80 else bytes([n & 0x7F | 0x80]) + unsigned(n >> 7)


def vector(items: Iterable[bytes]) -> bytes:
    """Items with their number before them."""
    listed = list(items)
    return unsigned(len(listed)) + b"".join(listed)


def text(name: str) -> bytes:
    """A name with its length before it."""
    return unsigned(len(name)) + name.encode()


def parts(words: str) -> list[str]:
    """What stands between the commas of ``words`` that are in no brackets."""
    found, depth = [""], 0
    for letter in words:
        depth += (letter == "<") - (letter == ">")
        if letter == "," and depth == 0:
            found.append("")
        else:
            found[-1] += letter
    return [part.strip() for part in found if part.strip()]


def called(signature: str) -> str:
    """The name of a function."""
    return signature.partition("(")[0]


def arguments(signature: str) -> list[str]:
    """The arguments of a function, each "name: type"."""
    return parts(signature.partition("(")[2].rpartition(")")[0])


class Types:
    """The types of a component, or within the type of an instance. ``known``: their indices by name or words;
    ``define`` writes a new one and gives its index."""

    def __init__(self, define: Callable[[bytes], int]) -> None:
        self.define = define
        self.known: dict[str, int] = {}

    def index(self, words: str) -> int:
        """The index of a type."""
        if words not in self.known:
            self.known[words] = self.define(self.body(words))
        return self.known[words]

    def function(self, signature: str) -> int:
        """The index of a new type of functions."""
        result = signature.rpartition(")")[2].removeprefix(" -> ")
        given = self._fields(arguments(signature))
        return self.define(b"\x40" + given + (b"\0" + self._value(result) if result else b"\1\0"))

    def body(self, words: str) -> bytes:
        """The definition of a type."""
        head, _, inside = words.partition("<")
        if not inside:
            return self._value(words)
        within = parts(inside[:-1])
        values: Callable[[], list[bytes]] = lambda: [self._value(part) for part in within]  # noqa: E731
        bodies = {
            "record": lambda: self._fields(within),
            "enum": lambda: vector(map(text, within)),
            "tuple": lambda: vector(values()),
            "result": lambda: b"".join(b"\1" + value for value in values()),
        }
        return _HEADS[head] + bodies.get(head, lambda: values()[0])()

    def _value(self, words: str) -> bytes:
        """How a type is referred to: where an index is meant, a negative number would be a primitive type."""
        return _PRIMITIVES[words] if words in _PRIMITIVES else _signed(self.index(words))

    def _fields(self, named: Sequence[str]) -> bytes:
        split = (one.partition(": ") for one in named)
        return vector(text(name) + self._value(words) for name, _, words in split)


def _signed(n: int) -> bytes:
    return bytes([n]) if n < 0x40 else bytes([n & 0x7F | 0x80]) + _signed(n >> 7)


class InstanceType:
    """The type of an instance, as it is written."""

    def __init__(self) -> None:
        self._declared: list[bytes] = []
        self._count = 0
        self.types = Types(lambda body: self._declare(b"\1" + body))

    def _declare(self, declaration: bytes) -> int:
        self._declared.append(declaration)
        self._count += 1
        return self._count - 1

    def export_type(self, name: str, index: int) -> None:
        """A type that it names."""
        self.types.known[name] = self._declare(b"\4\0" + text(name) + b"\3\0" + unsigned(index))

    def outer_type(self, index: int) -> int:
        """A type of the component around it."""
        return self._declare(b"\2\3\2\1" + unsigned(index))

    def export_function(self, signature: str) -> None:
        """A function that it has."""
        index = self.types.function(signature)
        self._declared.append(b"\4\0" + text(called(signature)) + b"\1" + unsigned(index))

    def body(self) -> bytes:
        """Its definition."""
        return b"\x42" + vector(self._declared)


class Component:
    """A component as it is written. Methods give the index, within its sort, of what they define."""

    def __init__(self) -> None:
        self._out = bytearray(b"\0asm\x0d\0\1\0")
        self._counts = dict.fromkeys(Sort, 0)
        self.types = Types(lambda body: self._add(7, body, Sort.TYPE))

    def whole(self) -> bytes:
        """The component."""
        return bytes(self._out)

    def _add(self, section: int, body: bytes, sort: Sort) -> int:
        # A section holds a module or a component, or as many definitions as it says.
        data = body if section in (1, 4) else b"\1" + body
        self._out += bytes([section]) + unsigned(len(data)) + data
        self._counts[sort] += 1
        return self._counts[sort] - 1

    def _take(self, name: str, description: bytes, sort: Sort) -> int:
        return self._add(10, b"\0" + text(name) + description, sort)

    def import_instance(self, name: str, type_: InstanceType) -> int:
        """An instance that the importer has."""
        return self._take(name, b"\5" + unsigned(self.types.define(type_.body())), Sort.INSTANCE)

    def import_type(self, name: str, words: str) -> int:
        """A type of these ``words`` that is handed in."""
        bound = b"\1" if words == RESOURCE else b"\0" + unsigned(self.types.index(words))
        return self._take(name, b"\3" + bound, Sort.TYPE)

    def import_function(self, name: str, signature: str) -> int:
        """A function that is handed in."""
        return self._take(name, b"\1" + unsigned(self.types.function(signature)), Sort.FUNCTION)

    def export_type(self, name: str, index: int) -> int:
        """Gives the type a name; the index is that of the type so named."""
        return self._add(11, b"\0" + text(name) + Sort.TYPE.value + unsigned(index) + b"\0", Sort.TYPE)

    def export_function(self, name: str, signature: str, index: int) -> int:
        """Exports a function by another ``signature``, equal but for the names of types."""
        type_ = b"\1\1" + unsigned(self.types.function(signature))
        return self._add(11, b"\0" + text(name) + Sort.FUNCTION.value + unsigned(index) + type_, Sort.FUNCTION)

    def export_instance(self, name: str, index: int) -> int:
        """Exports an instance."""
        return self._add(11, b"\0" + text(name) + Sort.INSTANCE.value + unsigned(index) + b"\0", Sort.INSTANCE)

    def alias(self, sort: Sort, instance: int, name: str) -> int:
        """An item of an instance, of a core instance where the ``sort`` is a core one."""
        core = b"\1" if sort.value.startswith(b"\0") else b"\0"
        return self._add(6, sort.value + core + unsigned(instance) + text(name), sort)

    def module(self, code: bytes, given: Mapping[str, int]) -> int:
        """A core instance of the module ``code``, which imports from core instances by their names."""
        index = self._add(1, code, Sort.CORE_MODULE)
        imports = vector(text(name) + b"\x12" + unsigned(instance) for name, instance in given.items())
        return self._add(2, b"\0" + unsigned(index) + imports, Sort.CORE_INSTANCE)

    def core_instance(self, *items: Item) -> int:
        """A core instance of given items."""
        exports = vector(text(name) + sort.value[1:] + unsigned(index) for name, sort, index in items)
        return self._add(2, b"\1" + exports, Sort.CORE_INSTANCE)

    def instance(self, component: bytes, items: Iterable[Item]) -> int:
        """An instance of a ``component`` that imports the items."""
        index = self._add(4, component, Sort.COMPONENT)
        imports = vector(text(name) + sort.value + unsigned(number) for name, sort, number in items)
        return self._add(5, b"\0" + unsigned(index) + imports, Sort.INSTANCE)

    def resource(self, drop: int) -> int:
        """A type of resources, each known by a number of 32 bits and ended by the core function ``drop``."""
        return self.types.define(b"\x3f\x7f\1" + unsigned(drop))

    def new_handle(self, resource: int) -> int:
        """The core function that makes a handle of a resource."""
        return self._add(8, b"\2" + unsigned(resource), Sort.CORE_FUNCTION)

    def lower(self, function: int, memory: int) -> int:
        """A function as modules call it, with strings and results in a core ``memory``."""
        options = vector([b"\0", b"\3" + unsigned(memory)])
        return self._add(8, b"\1\0" + unsigned(function) + options, Sort.CORE_FUNCTION)

    def lift(self, function: int, signature: str, memory: int, realloc: int) -> int:
        """A core function as importers call it; ``realloc`` is the core function that makes room in ``memory``."""
        type_ = self.types.function(signature)
        options = vector([b"\0", b"\3" + unsigned(memory), b"\4" + unsigned(realloc)])
        return self._add(8, b"\0\0" + unsigned(function) + options + unsigned(type_), Sort.FUNCTION)
