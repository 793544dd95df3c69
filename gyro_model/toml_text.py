"""TOML texts of users, where any text is read or refused in one line."""

import tomllib
from pathlib import Path
from typing import Any

from gyro_model.errors import InputError


def read_toml_file(path: Path) -> dict[str, Any]:
    """The content of a TOML file. Raises InputError, without the path, where it is none.

    A whole number beyond what a float holds is infinite, so that whoever checks for finite numbers refuses it.
    """
    try:
        content: dict[str, Any] = _floats(tomllib.loads(path.read_text(encoding="utf-8")))
    except RecursionError:
        raise InputError("not TOML: brackets are nested too deeply") from None
    except OSError as error:
        raise InputError(f"can't be read: {error.strerror}") from None
    except ValueError as error:  # no TOML, no UTF-8, or a number of thousands of digits
        raise InputError(f"not TOML: {str(error).splitlines()[0]}") from None
    return content


def _floats(value: Any) -> Any:
    """``value`` with whole numbers that no float holds as infinity."""
    if isinstance(value, dict):
        return {key: _floats(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [_floats(entry) for entry in value]
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 10**300:
        return float("inf") if value > 0 else float("-inf")
    return value
