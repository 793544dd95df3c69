"""The type of the component is that of the draft."""

from pathlib import Path
from typing import Any

import pytest
from component_fmus import FULL, MODELS, code_of
from component_host import INTERFACE, Host
from wasmtime import component

from gyro_model.component.binary import arguments, called, parts
from gyro_model.component.interface import CALLBACKS, INNER, KINDS, TYPES


def words(type_: Any) -> str:
    """A type of wasmtime's in words of the interface language."""
    match type_:
        case component.ListType():
            return f"list<{words(type_.element)}>"
        case component.OptionType():
            return f"option<{words(type_.payload)}>"
        case component.ResultType():
            return f"result<{words(type_.ok)}, {words(type_.err)}>"
        case component.TupleType():
            return f"tuple<{', '.join(map(words, type_.elements))}>"
        case component.EnumType():
            return f"enum<{', '.join(type_.names)}>"
        case component.RecordType():
            return f"record<{', '.join(f'{name}: {words(field)}' for name, field in type_.fields)}>"
        case component.FuncType():
            given = ", ".join(f"{name}: {words(one)}" for name, one in type_.params)
            return f"({given})" + (f" -> {words(type_.result)}" if type_.result else "")
    return type(type_).__name__.removesuffix("Type").lower()


def plain(text: str, types: dict[str, str]) -> str:
    """The words of a type or function with the words of each type in place of its name."""
    if text.startswith("("):
        given = ", ".join(
            f"{one.partition(': ')[0]}: {plain(one.partition(': ')[2], types)}" for one in arguments(text)
        )
        result = text.rpartition(")")[2].removeprefix(" -> ")
        return f"({given})" + (f" -> {plain(result, types)}" if result else "")
    head, _, inside = text.partition("<")
    if not inside:
        return plain(types[text], types) if text in types else text
    if head in ("own", "borrow"):
        return head
    if head == "enum":
        return text
    named = [one.rpartition(": ") for one in parts(inside[:-1])]
    return f"{head}<{', '.join(name + colon + plain(one, types) for name, colon, one in named)}>"


def exported(instance: Any, engine: Any) -> dict[str, str]:
    return {name: words(item.ty) for name, item in instance.ty.exports(engine).items()}


@pytest.mark.parametrize("name", MODELS)
def test_its_type_is_that_of_the_draft(name: str, folder: Path) -> None:
    host = Host(code_of(folder, name))
    type_ = host.component.type
    kinds = [kind for kind in KINDS if kind.name == "co-simulation" or name == FULL.NAME]
    taken, given = type_.imports(host.engine), type_.exports(host.engine)
    # Nothing of WASI: it asks for no files, no clock, no random numbers.
    assert set(taken) == {INTERFACE.format(one) for one in ("types", *CALLBACKS)}
    assert set(given) == {INTERFACE.format(one) for one in ("common", *(kind.name for kind in kinds))}
    assert exported(taken[INTERFACE.format("types")], host.engine) == {one: plain(one, TYPES) for one in TYPES}
    for interface, signature in CALLBACKS.items():
        functions = exported(taken[INTERFACE.format(interface)], host.engine)
        assert functions[called(signature)] == plain(signature.removeprefix(called(signature)), TYPES)
    for kind in kinds:
        types = TYPES | {kind.record[0]: kind.record[1]}
        resource = f"{kind.name}-instance"
        wanted = {one: plain(one, types) for one in types if one not in INNER} | {resource: "resource"}
        made = f"{kind.make.removeprefix(called(kind.make))} -> option<own<{resource}>>"
        wanted[f"[static]{resource}.{called(kind.make)}"] = plain(made, types)
        for method in kind.methods:
            rest = method.removeprefix(f"{called(method)}(")
            full = f"(self: borrow<{resource}>{'' if rest.startswith(')') else ', '}{rest}"
            wanted[f"[method]{resource}.{called(method)}"] = plain(full, types)
        assert exported(given[INTERFACE.format(kind.name)], host.engine) == wanted
