"""Observer and controller at work: their memory, begun with what a design knows, and the C function that steps them.

A part of one's own, compiled with numba, is bridged to the same C interface.
"""

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from cosim.controllers.record import OUTPUT_SIZE, Controller, CoreController
from cosim.core.library import CONTROL_NAMES, DRIFT_NAMES, HEALTH_NAMES, Library, library, pointer
from cosim.design import Design
from cosim.layout import ESTIMATE_SIZE, KXX, OMEGA_Z, PARAMETER_NAMES, M
from cosim.observers.record import NOISE_RMS, SENSE_GAIN_X, SENSE_GAIN_Y, SENSOR_SIZE, CoreObserver, Observer
from cosim.rehearsal import AT_EVERY_START, rehearse_controller, rehearse_observer, require_compiled
from gyro_model.errors import InputError, one_line

Floats = NDArray[np.float64]

FIRST_RATE_DEVIATION: Final = 10.0
FIRST_SLOPE_DEVIATION: Final = 30.0
"""What is known of the rate at the start [rad/s], and of its slope [rad/s2]."""
NOISE_FLOOR: Final = 1e-6
"""An observer is told at least this noise, as a fraction of the signal: a filter without noise is singular."""
OWN_SIZE: Final = 32
"""Room for the estimates of an observer of one's own, which writes the first ESTIMATE_SIZE."""
_VOID = ctypes.c_void_p
_OBSERVE = ctypes.CFUNCTYPE(None, *[_VOID] * 6)
_CONTROL = ctypes.CFUNCTYPE(None, _VOID, ctypes.c_double, *[_VOID] * 4)


@dataclass
class Part:
    """An observer or a controller at work: the address of its C step, its memory, and what must stay alive beside
    it. complain: raises InputError where a step of one's own has raised since the start."""

    address: int
    memory: Floats
    kept: tuple[Any, ...] = field(default=(), repr=False)
    complain: Callable[[], None] = field(default=lambda: None, repr=False)


def known_values(design: Design, lib: Library, period: float) -> Floats:
    """The parameters that the loop takes as known, in the order of the C."""
    values = design.all_values | {"sample_period": period}
    floor = NOISE_FLOOR * abs(values["sense_gain_x"]) * design.amplitude
    values["sense_noise"] = max(values["sense_noise"], floor)
    return np.array([values[symbol.name] for symbol in lib.known.constants] or [0.0])


def design_for(observer: Observer | CoreObserver, design: Design) -> Design:
    """What the observer works on: one that estimates no effects takes their nominal values as known."""
    return design if isinstance(observer, CoreObserver) else design.without_estimates()


def library_for(observer: Observer | CoreObserver, design: Design) -> Library:
    """The compiled loop for an observer under a design."""
    return library(design_for(observer, design).known_model)


def begin_observer(
    observer: Observer | CoreObserver, design: Design, period: float, settings: dict[str, float]
) -> tuple[Library, Part]:
    """The observer with what the design says of the device, ready for the first sample."""
    lib = library_for(observer, design)
    own = design_for(observer, design)
    if isinstance(observer, CoreObserver):
        return lib, _core_observer(observer, own, lib, period, settings)
    return lib, _plain_observer(observer, own, lib, period, settings)


def begin_controller(
    controller: Controller | CoreController, design: Design, lib: Library, period: float, settings: dict[str, float]
) -> Part:
    """The controller, ready for the first sample."""
    if isinstance(controller, CoreController):
        memory = lib.memory("foucault")
        values, known = controller.settings_array(1 / period, **settings), known_values(design, lib, period)
        lib.call.core_foucault_start(pointer(memory), pointer(values), pointer(known), ctypes.c_double(period))
        return Part(lib.address("core_foucault_step").value or 0, memory)
    return _bridged_controller(controller, design, period, settings)


def first_estimates(design: Design) -> tuple[Floats, Floats]:
    """First estimates of states, rate and the seven, and their standard deviations, in the order of cosim.layout."""
    start, deviation = np.zeros(ESTIMATE_SIZE), np.zeros(ESTIMATE_SIZE)
    start[KXX : M + 1] = [design.values[name] for name in PARAMETER_NAMES]
    deviation[KXX : M + 1] = [design.deviations[name] for name in PARAMETER_NAMES]
    speed = design.amplitude * np.sqrt(start[KXX] / start[M])
    deviation[:OMEGA_Z] = [design.amplitude, speed, design.amplitude, speed]
    deviation[OMEGA_Z] = FIRST_RATE_DEVIATION
    return start, deviation


def prior(design: Design, lib: Library) -> tuple[Floats, Floats]:
    """The estimated constants in the filter's coordinates, shape (n,), and a root of their covariance, upper
    triangular, shape (n, n)."""
    known = lib.known
    names = known.value_names
    value = {name: design.values[name] for name in names}
    sigma = {name: design.deviations[name] for name in names}
    mass = value["m"]
    per_mass = PARAMETER_NAMES[:-1]
    p = np.array([*(value[name] / mass for name in per_mass), *(value[name] for name in known.estimated), 1 / mass])
    root = np.diag(
        [*(sigma[name] / mass for name in per_mass), *(sigma[name] for name in known.estimated), sigma["m"] / mass**2]
    )
    # k/m and d/m share the error of 1/m.
    root[: len(per_mass), -1] = [value[name] * sigma["m"] / mass**2 for name in per_mass]
    return p, np.ascontiguousarray(root)


def start_filter(
    lib: Library,
    design: Design,
    period: float,
    settings: Floats,
    memory: Floats,
    slope_deviation: float = FIRST_SLOPE_DEVIATION,
) -> None:
    """Begins the filter of ``memory`` with what the design says; slope_deviation of the rate [rad/s2]."""
    states, size = lib.sizes["NS"], lib.moving_size
    _, deviation = first_estimates(design)
    z, dz = np.zeros(size), np.zeros(size)
    dz[:states] = np.resize(deviation[:2], states)
    dz[states] = deviation[OMEGA_Z]
    dz[states + 1 : -1] = abs(design.all_values["sense_gain_x"]) * design.amplitude
    dz[-1] = slope_deviation
    p, root = prior(design, lib)
    lowest = np.array([bound if bound > -inf else -1e300 for bound in lib.known.lowest])
    known = known_values(design, lib, period)
    arrays = (settings, known, z, dz, p, root, lowest)
    lib.call.core_filter_start(pointer(memory), *map(pointer, arrays), ctypes.c_double(period))


def filter_health(lib: Library, part: Part) -> dict[str, float]:
    """What the filter says of itself, by HEALTH_NAMES."""
    count = lib.sizes["NP"]
    p, root, health = np.zeros(count), np.zeros((count, count)), np.zeros(len(HEALTH_NAMES))
    lib.call.core_filter_found(pointer(part.memory), pointer(p), pointer(root), pointer(health))
    return dict(zip(HEALTH_NAMES, health.tolist(), strict=True))


def filter_drift(lib: Library, memory: Floats, stiffness: float, phi: float) -> dict[str, float]:
    """How sure the filter is of the pattern, by DRIFT_NAMES: stiffness [N/m] of the oscillator, phi [rad] where the
    pattern stands."""
    sizes = np.zeros(len(DRIFT_NAMES))
    lib.call.core_filter_drift(pointer(memory), ctypes.c_double(stiffness), ctypes.c_double(phi), pointer(sizes))
    return dict(zip(DRIFT_NAMES, sizes.tolist(), strict=True))


def estimate_drift(
    lib: Library, known: Floats, estimate: Floats, deviation: Floats, inputs: Floats, stiffness: float, phi: float
) -> dict[str, float]:
    """The same for estimates with independent deviations, of a device with the values ``known``."""
    sizes = np.zeros(len(DRIFT_NAMES))
    arrays = map(pointer, map(np.ascontiguousarray, (known, estimate, deviation, inputs)))
    lib.call.core_estimate_drift(*arrays, ctypes.c_double(stiffness), ctypes.c_double(phi), pointer(sizes))
    return dict(zip(DRIFT_NAMES, sizes.tolist(), strict=True))


def plain_health(lib: Library, part: Part) -> dict[str, float]:
    """The innovations of an observer of one's own, seen from outside: over what they should be, whose size is not
    known."""
    chi2, white = ctypes.c_double(), np.zeros(2)
    lib.call.core_plain_found(pointer(part.memory), ctypes.byref(chi2), pointer(white))
    pink = {"pink_x": 0.0, "pink_y": 0.0}
    return {
        "chi2": chi2.value,
        "white_x": float(white[0]),
        "white_y": float(white[1]),
        "restarted_at": -1.0,
        "start": 1.0,
        "strayed": 0.0,
        "innovation": float("nan"),
        **pink,
    }


def observe(part: Part, u: Floats, v: Floats, inputs: Floats, estimate: Floats, deviation: Floats) -> None:
    """One step of an observer from Python, for tests: see cosim/core/loop.h."""
    _OBSERVE(part.address)(*map(pointer, (part.memory, u, v, inputs, estimate, deviation)))


def control(part: Part, t: float, estimate: Floats, deviation: Floats, inputs: Floats, output: Floats) -> None:
    """One step of a controller from Python, for tests: see cosim/core/loop.h."""
    arrays = (estimate, deviation, inputs, output)
    _CONTROL(part.address)(pointer(part.memory), t, *map(pointer, arrays))


def _core_observer(
    observer: CoreObserver, design: Design, lib: Library, period: float, settings: dict[str, float]
) -> Part:
    memory = lib.memory("filter")
    start_filter(lib, design, period, observer.settings_array(**settings), memory)
    return Part(lib.address("core_filter_step").value or 0, memory)


def _plain_observer(
    observer: Observer, design: Design, lib: Library, period: float, settings: dict[str, float]
) -> Part:
    inner = _bridged_observer(observer, design, period, settings)
    memory = lib.memory("plain")
    known = known_values(design, lib, period)
    lib.call.core_plain_start(
        pointer(memory), _VOID(inner.address), pointer(inner.memory), pointer(known), ctypes.c_double(period)
    )
    return Part(lib.address("core_plain_step").value or 0, memory, (inner,), inner.complain)


def rehearse(
    part: Observer | Controller, design: Design, period: float, settings: dict[str, float], count: int
) -> None:
    """Runs ``count`` samples in plain Python on arrays of the declared sizes. Raises InputError where it isn't compiled
    with numba, or uses a place beyond an array."""
    kind = "observer" if isinstance(part, Observer) else "controller"
    require_compiled(kind, part)
    values, (start, deviation) = part.settings_array(**settings), _own_first_estimates(design)
    if isinstance(part, Observer):
        rehearse_observer(part, values, start, deviation, _sensor(design), period, count)
    else:
        rehearse_controller(part, values, start, deviation, period, count)


@contextmanager
def _blamed(kind: str, name: str) -> Iterator[None]:
    """Turns what a user's own part raises, when it begins or in a step of its own, into an InputError of one line."""
    try:
        yield
    except Exception as error:
        raise InputError(f"{kind} {name}: {one_line(error)}") from error


def _own_first_estimates(design: Design) -> tuple[Floats, Floats]:
    """First estimates and deviations in arrays of OWN_SIZE."""
    start, deviation = (np.concatenate((part, np.zeros(OWN_SIZE - len(part)))) for part in first_estimates(design))
    return start, deviation


def _sensor(design: Design) -> Floats:
    """What an observer of one's own is told of the sensing: see cosim.observers.record."""
    sensor = np.zeros(SENSOR_SIZE)
    values = design.all_values
    sensor[SENSE_GAIN_X], sensor[SENSE_GAIN_Y] = values["sense_gain_x"], values["sense_gain_y"]
    floor = NOISE_FLOOR * abs(values["sense_gain_x"]) * design.amplitude
    # A converter that rounds adds lsb^2/12.
    sensor[NOISE_RMS] = max(float(np.hypot(values["sense_noise"], values["adc_lsb"] / np.sqrt(12))), floor)
    return sensor


def _bridged_observer(observer: Observer, design: Design, period: float, settings: dict[str, float]) -> Part:
    """Memory: settings, the observer's own memory, its estimate, its deviation, whether it has raised, u and v of that
    step, its own memory before it."""
    from numba import carray, cfunc, types

    rehearse(observer, design, period, settings, AT_EVERY_START)
    values = observer.settings_array(**settings)
    count, size = len(values), observer.memory_size
    memory = np.concatenate((values, np.zeros(2 * size + 2 * OWN_SIZE + 5)))
    first = count + size
    second, raised = first + OWN_SIZE, first + 2 * OWN_SIZE
    before = raised + 5
    with _blamed("observer", observer.name):
        observer.init(memory[count:first], values, *_own_first_estimates(design), _sensor(design), period)
    step, total = observer.step, len(memory)
    real = types.CPointer(types.float64)

    @cfunc(types.void(real, real, real, real, real, real))
    def bridge(address, u, v, inputs, estimate, deviation):  # type: ignore[no-untyped-def]
        whole = carray(address, (total,))
        if whole[raised] == 0.0:
            whole[before:] = whole[count:first]
            try:
                own, known = whole[count:first], whole[:count]
                step(own, known, u[0], u[1], v[0], v[1], whole[first:second], whole[second:raised])
            except Exception:
                whole[raised] = 1.0
                whole[raised + 1], whole[raised + 2] = u[0], u[1]
                whole[raised + 3], whole[raised + 4] = v[0], v[1]
        for i in range(ESTIMATE_SIZE):
            estimate[i] = whole[first + i]
            deviation[i] = whole[second + i]

    def again() -> None:
        u_v = memory[raised + 1 : before]
        step(memory[before:], memory[:count], *u_v, memory[first:second], memory[second:raised])

    return Part(bridge.address, memory, (bridge,), _complaint("observer", observer.name, memory, raised, again))


def _complaint(kind: str, name: str, memory: Floats, raised: int, again: Callable[[], None]) -> Callable[[], None]:
    """Says what a step has raised: compiled code keeps only that it did, so that step is run once more."""

    def complain() -> None:
        if memory[raised]:
            with _blamed(kind, name):
                again()
            raise InputError(f"{kind} {name}: a step raised an exception; run its step.py_func to see which")

    return complain


def _bridged_controller(controller: Controller, design: Design, period: float, settings: dict[str, float]) -> Part:
    """Memory: settings, the controller's own memory, estimate, deviation, output, whether it has raised, t of that
    step, its own memory before it."""
    from numba import carray, cfunc, types

    rehearse(controller, design, period, settings, AT_EVERY_START)
    values = controller.settings_array(**settings)
    count, size = len(values), controller.memory_size
    memory = np.concatenate((values, np.zeros(2 * size + 2 * OWN_SIZE + OUTPUT_SIZE + 2)))
    first = count + size
    second, third = first + OWN_SIZE, first + 2 * OWN_SIZE
    raised = third + OUTPUT_SIZE
    before = raised + 2
    with _blamed("controller", controller.name):
        controller.init(memory[count:first], values, period)
    step, total = controller.step, len(memory)
    real = types.CPointer(types.float64)

    @cfunc(types.void(real, types.float64, real, real, real, real))
    def bridge(address, t, estimate, deviation, inputs, control):  # type: ignore[no-untyped-def]
        whole = carray(address, (total,))
        for i in range(ESTIMATE_SIZE):
            whole[first + i] = estimate[i]
            whole[second + i] = deviation[i]
        if whole[raised] == 0.0:
            try:
                step(
                    whole[count:first], whole[:count], t, whole[first:second], whole[second:third], whole[third:raised]
                )
            except Exception:
                whole[raised], whole[raised + 1] = 1.0, t
        out = whole[third:]
        control[0], control[1] = out[0], out[1]
        for i in range(5):
            control[2 + i] = out[4 + i]
        for i in range(7, len(CONTROL_NAMES)):
            control[i] = 0.0

    def again() -> None:
        arrays = memory[first:second], memory[second:third], memory[third:raised]
        step(memory[before:], memory[:count], memory[raised + 1], *arrays)

    return Part(bridge.address, memory, (bridge,), _complaint("controller", controller.name, memory, raised, again))
