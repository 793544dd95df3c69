"""The token of a model on disk, so that a fresh process need not print hundreds of expressions to hash them.

A file is named by the digest of all that a token follows from: how the model states itself, the files that go into an
FMU as they are, this program, the programs under it. It is text, checked as it is read; nothing of it is executed. What
is not stated in full by its fields (a class or a function of a user's own) has no name, and its token is made anew.
"""

import contextlib
import hashlib
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import mpmath
import numpy as np
import platformdirs
import sympy
from sympy import Basic, preorder_traversal, srepr
from sympy.external.gmpy import GROUND_TYPES

from gyro_model.digest import digest_of
from gyro_model.form import Form
from gyro_model.platforms import own_platform
from gyro_model.whole_file import whole_file

PLAIN: Final = (type(None), bool, int, float, str)
STATED: Final = ("gyro_model", "sympy")
"""Packages whose classes are stated by their fields and their version."""
_TOKEN: Final = re.compile(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}")

# Taken as the program is loaded: a file that changes later changes nothing of what runs.
_CODE: Final = digest_of(Path(__file__).parent)
_UNDER: Final = (sys.version, sympy.__version__, mpmath.__version__, np.__version__, GROUND_TYPES, own_platform())


def key_of(model: Form, files: Iterable[tuple[str, bytes]]) -> str | None:
    """Names the token of ``model`` whose FMU holds ``files`` (name, content) as they are; SHA-256 in hexadecimal. None
    where the model is not stated in full by its fields."""
    stated = _stated(model)
    if stated is None:
        return None
    digest = hashlib.sha256(repr((_CODE, _UNDER, stated)).encode())
    for name, content in files:
        digest.update(f"{len(name)} {name} {len(content)} ".encode() + content)
    return digest.hexdigest()


def kept(key: str) -> str | None:
    """The token kept under ``key``; None where there is none, or a file that is not as ``keep`` writes it."""
    path = _path(key)
    try:
        text = path.read_text(encoding="ascii") if path.is_file() else ""
    except (OSError, ValueError):
        return None
    token = text.partition(" ")[0]
    return token if _TOKEN.fullmatch(token) and text == _content(key, token) else None


def keep(key: str, token: str) -> None:
    """Keeps ``token`` under ``key``. Where it can't be written, it is made again."""
    with contextlib.suppress(OSError), whole_file(_path(key)) as file:
        file.write(_content(key, token).encode())


def _path(key: str) -> Path:
    return Path(platformdirs.user_cache_dir("gyrotwin")) / "tokens" / key


def _content(key: str, token: str) -> str:
    return f"{token} {hashlib.sha256((key + token).encode()).hexdigest()}\n"


@lru_cache(maxsize=8)
def _stated(model: Form) -> str | None:
    try:
        return _text(model)
    except _Unstated:
        return None


class _Unstated(Exception):
    """What can't be told from its fields."""


def _text(value: Any) -> str:
    """All that ``value`` states. Raises _Unstated where that may not be all."""
    kind = type(value)
    if kind in PLAIN:
        return f"{kind.__name__} {value!r}"
    if isinstance(value, Basic):
        _refuse_foreign(type(node) for node in preorder_traversal(value))
        # With the assumptions of symbols and the digits of numbers, which str leaves out.
        return srepr(value)
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_text(k)}: {_text(v)}' for k, v in value.items())}}}"
    if kind in (tuple, list):
        return f"({', '.join(map(_text, value))})"
    _refuse_foreign((kind,))
    if is_dataclass(value):
        parts = [getattr(value, field.name) for field in fields(value)]
    elif isinstance(value, tuple):
        parts = list(value)
    else:
        raise _Unstated
    return f"{kind.__module__}.{kind.__qualname__}{_text(parts)}"


def _refuse_foreign(kinds: Iterable[type]) -> None:
    for kind in kinds:
        if (kind.__module__ or "").partition(".")[0] not in STATED:
            raise _Unstated
