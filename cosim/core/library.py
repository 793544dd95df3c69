"""The compiled loop: one shared library for each structure of what a loop knows, built where it is not there yet.

A structure is which effects act and which parameters are estimated; values are data. So a thousand devices under one
design share a library.
"""

import ctypes
import hashlib
import tempfile
from collections.abc import Sequence
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import platformdirs
from numpy.typing import NDArray

from cosim.core.settings import settings_header
from cosim.known_model import KnownModel
from cosim.layout import STATE_NAMES
from gyro_model.compiling import compile_library, find_compiler
from gyro_model.whole_file import whole_file

Floats = NDArray[np.float64]

FOLDER: Final = Path(__file__).parent
# A product or quotient of complex numbers is not looked at for infinities: none is near the ends of the numbers. A sum
# may be taken in any order, several numbers at a time: none relies on its own. What is no number stays none.
FLAGS: Final = (
    *("-O3", "-fno-math-errno", "-ffp-contract=fast", "-fcx-limited-range", "-Wno-unused-function"),
    *("-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math"),
)
VECTORS: Final = (("avx2", "fma"), ("avx512f", "avx512dq", "avx512vl"))
"""Instructions that are used where the processor has them: kinds of them, each whole or not at all. The library is
named after the flags, so that another processor makes its own."""
CONTROL_NAMES: Final = (
    *("u_x", "u_y", "forced_x", "forced_x_dot", "forced_y", "forced_y_dot", "omega_squared", "turned"),
    *("near_x", "near_x_dot", "near_y", "near_y_dot", "lacking", "own_rate", "behind"),
)
"""What a controller gives at a sample: command [N], response to the tones and what held forces bend [m, m/s], k/m of
the isotropic oscillator [1/s^2], angle by which it has turned the pattern electronically [rad]; the part of the
response that is due to tones near the oscillator's own frequency; the force that its limit has taken away [N]; the
rate at which it turns the pattern electronically, and at which gains turn it that are older than the constants, at its
worst angle [rad/s]."""
HEALTH_NAMES: Final = (
    *("chi2", "white_x", "white_y", "restarted_at", "restarts", "walk", "share", "forget"),
    *("pink_x", "pink_y", "start", "strayed", "innovation"),
)
"""What the filter says of itself: mean squared innovation over its variance and mean product of neighbouring ones, over
some milliseconds, less what known pink noise makes of both; time of the last restart from the design [s]; restarts
lately; random walk of the rate [rad/s per sqrt(s)]; share of the innovation's variance that the constants explain;
fastest forgetting [1/s]; what pink noise makes of the product of neighbours, in the mean; mean squared innovation
that the last whole start left, infinite where it ended 1.5 deviations beside its fit or more, or is not over yet with
more than the seven to find; variance of what the pattern has turned by so far that is no turn of the device, by noise
that the force feeds back and by steps of the rate [rad^2]; innovation lately, rms [V]."""

DRIFT_NAMES: Final = ("turning", "turning_now", "bending", "unseen")
"""Standard deviations that come of unknown constants: of the pattern's turning at its worst angle and where it stands
[rad/s], of the bending [rad], and of the turning at the worst angle by what no sample shows [rad/s]."""


class Library:
    """The library of a structure; ``sizes`` as in KnownModel.sizes, ``call`` its C functions."""

    def __init__(self, known: KnownModel) -> None:
        self.known = known
        self.sizes = known.sizes()
        self.call: Any = ctypes.CDLL(str(_built(known)))
        for name in ("core_filter_size", "core_foucault_size", "core_loop_size"):
            getattr(self.call, name).restype = ctypes.c_size_t
        self.call.core_loop_run.restype = ctypes.c_int64

    @cached_property
    def estimate_names(self) -> tuple[str, ...]:
        """What an observer gives at a sample, in its order: states, rate, constants, effects' parameters and states."""
        own = tuple(state.name for state in self.known.states[len(STATE_NAMES) :])
        return (*STATE_NAMES, "omega_z", *self.known.value_names, *own)

    @property
    def moving_size(self) -> int:
        """Length of what moves: states, rate, lagging voltages, slope of the rate."""
        return self.sizes["NS"] + 2 + 2 * self.sizes["HAS_LAG"]

    def address(self, function: str) -> ctypes.c_void_p:
        """The address of a C function."""
        return ctypes.cast(getattr(self.call, function), ctypes.c_void_p)

    def memory(self, kind: str) -> Floats:
        """Zeroed memory for a ``filter``, ``foucault`` or ``loop``."""
        size = getattr(self.call, f"core_{kind}_size")()
        return np.zeros(-(-size // np.dtype(float).itemsize))


def pointer(array: NDArray[Any]) -> ctypes.c_void_p:
    """The address of an array's data, which must stay alive and be contiguous."""
    if not array.flags.c_contiguous:
        raise ValueError("array: give a contiguous one to C")
    return ctypes.c_void_p(array.ctypes.data)


@lru_cache(maxsize=64)
def library(known: KnownModel) -> Library:
    """The library of what a loop knows, compiled where it has not been. Raises InputError as ``compile_library``
    does."""
    return Library(known)


def is_built(known: KnownModel) -> bool:
    """Whether the library is there already, so that nothing has to be compiled."""
    return _path(known).is_file()


def _texts(known: KnownModel) -> dict[str, str]:
    texts = {path.name: path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.[ch]"))}
    return texts | {"settings.h": settings_header()}


@lru_cache(maxsize=1)
def _flags() -> tuple[str, ...]:
    try:
        present = Path("/proc/cpuinfo").read_text(encoding="ascii", errors="replace").split()
    except OSError:
        present = []
    return (*FLAGS, *(f"-m{name}" for kind in VECTORS if set(kind) <= set(present) for name in kind))


@lru_cache(maxsize=64)
def _path(known: KnownModel) -> Path:
    # What is written from a model follows from its effect files, which the fingerprint names without printing them.
    key = [known.fingerprint(), *_texts(known).values(), " ".join((*find_compiler(), *_flags()))]
    digest = hashlib.sha256("\0".join(key).encode()).hexdigest()[:24]
    return Path(platformdirs.user_cache_dir("gyrotwin")) / "loop" / f"{digest}.so"


def _built(known: KnownModel) -> Path:
    path = _path(known)
    if path.is_file():
        return path
    with tempfile.TemporaryDirectory(prefix="gyrotwin-") as name:
        folder = Path(name)
        texts = _texts(known) | {"known_model.h": known.header(), "sizes.h": known.sizes_header()}
        for file, text in texts.items():
            (folder / file).write_text(text, encoding="utf-8")
        made = folder / "loop.so"
        compile_library(folder, _sources(texts), made, _flags())
        with whole_file(path) as library_file:
            library_file.write(made.read_bytes())
    return path


def _sources(texts: Sequence[str] | dict[str, str]) -> list[str]:
    return sorted(name for name in texts if name.endswith(".c"))
