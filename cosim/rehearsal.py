"""Observers and controllers of one's own in plain Python, before their compiled code runs: that would read and write
beyond its arrays unseen, plain Python says where."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from types import FunctionType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from cosim.controllers.record import OUTPUT_SIZE, Controller
from cosim.layout import KXX, M
from cosim.observers.record import SENSE_GAIN_X, SENSE_GAIN_Y, Observer
from gyro_model.errors import InputError

Floats = NDArray[np.float64]

AT_EVERY_START: Final = 20
"""Samples rehearsed before each run, in which most branches of a step are met once."""


class _Outside(IndexError):
    """An index beyond an argument: its name, its size and the index."""


class _Argument(np.ndarray[Any, np.dtype[np.float64]]):
    """An array that knows as which argument it was handed over; a slice of it knows no more."""

    name: str = ""

    def __getitem__(self, index: Any) -> Any:
        with self._named(index):
            return super().__getitem__(index)

    def __setitem__(self, index: Any, value: Any) -> None:
        with self._named(index):
            super().__setitem__(index, value)

    @contextmanager
    def _named(self, index: Any) -> Iterator[None]:
        try:
            yield
        except IndexError as error:
            if not self.name:
                raise
            raise _Outside(self.name, len(self), index) from error


def require_compiled(kind: str, part: Observer | Controller) -> None:
    """Raises InputError where ``init`` or ``step`` is no function that numba has compiled."""
    for name in ("init", "step"):
        if not hasattr(getattr(part, name), "py_func"):
            raise InputError(
                f"{kind} {part.name}: {name} is not compiled; write @njit({name.upper()}_SIGNATURE) above it"
            )


def rehearse_observer(
    observer: Observer, settings: Floats, start: Floats, deviation: Floats, sensor: Floats, period: float, count: int
) -> None:
    """Runs ``count`` samples of an oscillation of the design's amplitude and frequency, at no force.

    The arrays are those that ``init`` gets. Raises InputError for an index beyond an argument. Whatever else is
    raised ends the rehearsal: compiled code may well do what plain Python does not.
    """
    memory, values = _named("memory", np.zeros(observer.memory_size)), _named("settings", settings.copy())
    estimate, error = _named("estimate", np.zeros_like(start)), _named("deviation", np.zeros_like(start))
    phase = period * np.sqrt(start[KXX] / start[M])
    volts = deviation[0] * sensor[SENSE_GAIN_X], deviation[0] * sensor[SENSE_GAIN_Y]
    handed = (
        _named("start", start.copy()),
        _named("start_deviation", deviation.copy()),
        _named("sensor", sensor.copy()),
    )

    def step(k: int) -> tuple[Any, ...]:
        v_x, v_y = float(volts[0] * np.cos(phase * k)), float(volts[1] * np.sin(phase * k))
        return memory, values, 0.0, 0.0, v_x, v_y, estimate, error

    _rehearse("observer", observer, (memory, values, *handed, period), step, count)


def rehearse_controller(
    controller: Controller, settings: Floats, start: Floats, deviation: Floats, period: float, count: int
) -> None:
    """As ``rehearse_observer``, with estimates of that oscillation."""
    memory, values = _named("memory", np.zeros(controller.memory_size)), _named("settings", settings.copy())
    estimate, error = _named("estimate", start.copy()), _named("deviation", deviation.copy())
    output = _named("output", np.zeros(OUTPUT_SIZE))
    phase = period * np.sqrt(start[KXX] / start[M])

    def step(k: int) -> tuple[Any, ...]:
        c, s = np.cos(phase * k), np.sin(phase * k)
        estimate[:4] = np.array([c, -s, s, c]) * deviation[:4]
        return memory, values, period * k, estimate, error, output

    _rehearse("controller", controller, (memory, values, period), step, count)


def _rehearse(
    kind: str, part: Observer | Controller, begin: tuple[Any, ...], step: Callable[[int], tuple[Any, ...]], count: int
) -> None:
    stage = "init"
    try:
        with np.errstate(all="ignore"):
            _plain(part.init)(*begin)
            stage, run = "step", _plain(part.step)
            for k in range(count):
                run(*step(k))
    except _Outside as error:
        raise InputError(f"{kind} {part.name}: {_remedy(stage, part.settings, kind, *error.args)}") from error
    except IndexError as error:
        raise InputError(f"{kind} {part.name}: {stage}: {error}") from error
    except Exception:
        return


def _remedy(stage: str, settings: Iterable[str], kind: str, name: str, size: int, index: Any) -> str:
    said = f"{stage} uses {name}[{index}], but {name} has size {size}"
    if name == "memory":
        more = f" of {index + 1} or more" if isinstance(index, int) and index >= 0 else ""
        return f"{said}; give {kind.capitalize()}(...) a memory size{more}"
    if name == "settings":
        return f"{said} ({', '.join(settings) or 'none'}); add to the settings of {kind.capitalize()}(...)"
    return f"{said}; use an index below {size}"


def _named(name: str, values: Floats) -> _Argument:
    array = values.view(_Argument)
    array.name = name
    return array


def _plain(function: Any) -> Callable[..., None]:
    """``function`` without numba, and so whatever it calls of its own file."""
    home = function.py_func.__globals__
    names = dict(home)

    def without(compiled: Any) -> Any:
        inner = compiled.py_func
        return FunctionType(inner.__code__, names, inner.__name__, inner.__defaults__, inner.__closure__)

    for name, value in home.items():
        if getattr(getattr(value, "py_func", None), "__globals__", None) is home:
            names[name] = without(value)
    plain: Callable[..., None] = without(function)
    return plain
