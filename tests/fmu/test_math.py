"""The C's own exp, log, sin and the rest against mpmath, over the whole range of each and where it is hard."""

import ctypes as ct
import math
import sys
from collections.abc import Callable
from pathlib import Path

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from gyro_model.build import handwritten_folder
from gyro_model.compiling import compile_library

COUNT = 4000
RNG = np.random.default_rng(20)
ONE_ARGUMENT = ("exp", "expm1", "log", "log1p", "sin", "cos", "tan", "atan", "asin", "acos", "sinh", "cosh", "tanh")
EXPORT = "__declspec(dllexport)" if sys.platform == "win32" else '__attribute__((visibility("default")))'
_HARNESS = f"""#include "gyro_math.h"
#include "pair_math.h"
#define LANES(name, ...) \\
    {EXPORT} void lanes_##name(const double *x, const double *z, double *y, int n) \\
    {{ \\
        for (int i = 0; i < n - 1; i += 2) {{ \\
            const gyro_pair got = name##_of_pair(pair_of(x[i], x[i + 1]) __VA_ARGS__); \\
            y[i] = lane_of(got, 0); \\
            y[i + 1] = lane_of(got, 1); \\
            (void)z; \\
        }} \\
    }}
#define EACH(name) \\
    {EXPORT} void each_##name(const double *x, double *y, int n) \\
    {{ for (int i = 0; i < n; i++) y[i] = gyro_##name(x[i]); }}
#define PAIR(name) \\
    {EXPORT} void each_##name(const double *x, const double *z, double *y, int n) \\
    {{ for (int i = 0; i < n; i++) y[i] = gyro_##name(x[i], z[i]); }}
"""
Floats = NDArray[np.float64]


class Compiled:
    """Every function over arrays."""

    def __init__(self, folder: Path) -> None:
        text = _HARNESS + "".join(f"EACH({name})\n" for name in (*ONE_ARGUMENT, "rint", "floor", "ceil", "fabs"))
        text += "PAIR(pow)\nPAIR(power)\nPAIR(atan2)\n"
        text += "LANES(exp, )\nLANES(tanh, )\nLANES(power, , pair_of(z[i], z[i + 1]))\n"
        (folder / "harness.c").write_text(text, encoding="utf-8")
        for source in ("gyro_math.c", "gyro_trigonometry.c"):
            (folder / source).write_text((handwritten_folder() / source).read_text(encoding="utf-8"), encoding="utf-8")
        include = ("-I", str(handwritten_folder()), "-I", str(handwritten_folder() / "full"))
        compile_library(folder, ["harness.c", "gyro_math.c", "gyro_trigonometry.c"], folder / "math.so", include)
        self.library = ct.CDLL(str(folder / "math.so"))

    def lanes(self, name: str, x: Floats, z: Floats) -> Floats:
        """A function that takes two numbers at once, over arrays of even length; ``z``: exponents of the power."""
        result = np.empty_like(x)
        pointers = (a.ctypes.data_as(ct.c_void_p) for a in (x, z, result))
        getattr(self.library, f"lanes_{name}")(*pointers, len(x))
        return result

    def __call__(self, name: str, *arguments: Floats) -> Floats:
        arguments = tuple(np.ascontiguousarray(a, dtype=float) for a in arguments)
        result = np.empty_like(arguments[0])
        pointers = (a.ctypes.data_as(ct.c_void_p) for a in (*arguments, result))
        getattr(self.library, f"each_{name}")(*pointers, len(result))
        return result


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    return Compiled(tmp_path_factory.mktemp("math"))


def signs(x: Floats) -> Floats:
    return x * RNG.choice([-1.0, 1.0], len(x))


def sizes(low: float, high: float) -> Floats:
    """Both signs, sizes from 2^low to 2^high evenly on a logarithmic scale."""
    return signs(np.exp2(RNG.uniform(low, high, COUNT)))


# Near multiples of pi/2 little is left of the argument: J.-M. Muller, Elementary Functions, 2006, section 11.2, gives
# 6381956970095103 2^797 as the double that comes nearest, 4.7e-19.
MULTIPLES = np.array([k * math.pi / 2 for k in (1, 2, 3, 4, 7, 22, 355, 1e5, 103993, 1e9, 1e15, 1e22)])
NEAR = np.concatenate([MULTIPLES, np.nextafter(MULTIPLES, 0), np.nextafter(MULTIPLES, np.inf)])
WORST = np.array([6381956970095103.0 * 2.0**797, -6381956970095103.0 * 2.0**797, 1.7e308, 5e-324])
ANGLES = (np.linspace(-20, 20, COUNT), sizes(-40, 40), sizes(20, 1023), NEAR, WORST)
UNIT = (np.linspace(-1, 1, COUNT), sizes(-60, 0), 1 - np.exp2(RNG.uniform(-53, -1, COUNT)))
EXPONENTS = (np.linspace(-5, 5, COUNT), sizes(-60, 0), RNG.uniform(-745.0, 709.7, COUNT), np.array([709.78, -745.1]))
SHORT = (np.linspace(-3, 3, COUNT), sizes(-60, 0), RNG.uniform(-709.7, 709.7, COUNT))
BEYOND = (*SHORT, np.array([710.4, -710.4]))
POSITIVE = (np.linspace(0.5, 2.0, COUNT), np.abs(sizes(-1074, 1023)), 1 + sizes(-52, -2), np.array([5e-324, 1.7e308]))

# The largest error allowed, in units in the last place, as gyro_math.h states it.
CASES = {
    "exp": (1.0, EXPONENTS),
    "expm1": (1.0, SHORT),
    "log": (1.0, POSITIVE),
    "log1p": (3.0, (*UNIT, sizes(-60, -1), np.abs(sizes(-1, 1023)))),
    "sin": (1.0, ANGLES),
    "cos": (1.0, ANGLES),
    "tan": (3.0, ANGLES),
    "atan": (2.0, (np.linspace(-3, 3, COUNT), sizes(-60, 60), sizes(-1074, 1023))),
    "asin": (3.0, UNIT),
    "acos": (3.0, UNIT),
    "sinh": (3.0, BEYOND),
    "cosh": (3.0, BEYOND),
    "tanh": (3.0, SHORT),
}


def off(got: Floats, exact: Callable[..., mpmath.mpf], *arguments: Floats) -> Floats:
    """Errors in units in the last place of the exact values."""
    errors = []
    with mpmath.workprec(140):
        for value, *at in zip(got.tolist(), *(a.tolist() for a in arguments), strict=True):
            true = exact(*(mpmath.mpf(a) for a in at))
            errors.append(float(abs(mpmath.mpf(value) - true)) / math.ulp(float(true)))
    return np.array(errors)


@pytest.mark.parametrize("name", CASES)
def test_errors_are_of_the_last_place(name: str, compiled: Compiled, residual: Callable[..., None]) -> None:
    bound, arguments = CASES[name]
    x = np.concatenate(arguments)
    x = x[x > -1.0] if name == "log1p" else x
    worst = off(compiled(name, x), getattr(mpmath, name), x)
    residual(f"{name} at {x[worst.argmax()]!r}, ulp", worst.max(), bound)


def test_errors_of_powers(compiled: Compiled, residual: Callable[..., None]) -> None:
    x = np.abs(np.concatenate([sizes(-1074, 1023), sizes(-1, 1), 1 + sizes(-50, -2)]))
    y = signs(np.concatenate([RNG.uniform(-1.0, 1.0, 2 * COUNT), RNG.uniform(0.0, 1.0, COUNT)]))
    # Exponents for which the power is a number, up to both ends of the range.
    y *= 740.0 / np.maximum(1.0, np.abs(np.log(x))) * np.maximum(1.0, 1.0 / np.maximum(np.abs(np.log(x)), 1e-15)) ** 0.9
    power = compiled("pow", x, y)
    usual = (power > 1e-300) & (power < 1e300)
    assert usual.mean() > 0.5
    worst = off(power[usual], lambda a, b: a**b, x[usual], y[usual])
    residual(f"pow({x[usual][worst.argmax()]!r}, {y[usual][worst.argmax()]!r}), ulp", worst.max(), 1.0)


def test_errors_of_quick_powers(compiled: Compiled, residual: Callable[..., None]) -> None:
    x = np.abs(np.concatenate([sizes(-1022, 1023), sizes(-1, 1), 1 + sizes(-50, -2)]))
    y = signs(RNG.uniform(0.0, 3.0, len(x)))
    power = compiled("power", x, y)
    usual = (power > 1e-300) & (power < 1e300)
    assert usual.mean() > 0.5
    # A unit of the logarithm and half of one of the product, times the exponent, and twice where a power of 2 lies
    # between.
    allowed = 2.0 + 3.0 * np.abs(y * np.log(x))[usual]
    worst = off(power[usual], lambda a, b: a**b, x[usual], y[usual]) / allowed
    residual(f"power({x[usual][worst.argmax()]!r}, {y[usual][worst.argmax()]!r})", worst.max(), 1.0)
    assert np.all(compiled("power", x, np.zeros_like(x)) == 1.0)


@pytest.mark.parametrize("name", ["exp", "tanh", "power"])
def test_two_at_once_have_the_bits_of_one_alone(name: str, compiled: Compiled) -> None:
    x = np.concatenate([np.concatenate(EXPONENTS), np.concatenate(POSITIVE), np.repeat(SPECIAL, len(SPECIAL))])
    # Beside any other, and each special value beside each.
    x = np.concatenate([x, RNG.permutation(x), np.array([(a, b) for a in SPECIAL for b in SPECIAL]).ravel()])
    x = np.abs(x[: len(x) // 2 * 2]) if name == "power" else x[: len(x) // 2 * 2]
    z = np.where(RNG.uniform(size=len(x)) < 0.1, RNG.choice([0.0, 1.0, 2.0], len(x)), RNG.uniform(-3.0, 3.0, len(x)))
    alone = compiled(name, x, z) if name == "power" else compiled(name, x)
    same_bits = compiled.lanes(name, x, z).view(np.uint64) == alone.view(np.uint64)
    assert np.all(same_bits | np.isnan(alone)), x[~same_bits & ~np.isnan(alone)][:5]
    assert np.array_equal(np.isnan(compiled.lanes(name, x, z)), np.isnan(alone))


def test_errors_of_directions(compiled: Compiled, residual: Callable[..., None]) -> None:
    y, x = sizes(-30, 30), sizes(-30, 30)
    worst = off(compiled("atan2", y, x), mpmath.atan2, y, x)
    residual("atan2, ulp", worst.max(), 3.0)


NAN, INF = math.nan, math.inf
SPECIAL = [NAN, INF, -INF, 0.0, -0.0, 1.0, -1.0, 0.5, -0.5, 2.0, -2.0, 3.0, -3.0, 1e300, -1e300, 5e-324, 2.5, -2.5]


def same(got: float, wanted: float) -> bool:
    """Equal with the sign of zero, or to the last bits of what need not be exact."""
    got, wanted = float(got), float(wanted)
    if math.isnan(wanted):
        return math.isnan(got)
    if math.isinf(wanted) or wanted == 0.0:
        return repr(got) == repr(wanted)
    return math.isclose(got, wanted, rel_tol=1e-15)


@pytest.mark.parametrize("name", CASES)
def test_special_values_are_those_of_the_standard(name: str, compiled: Compiled) -> None:
    # Through numpy, the math.h of this platform, whose special values C99, annex F, fixes.
    usual = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}.get(name, name)
    with np.errstate(all="ignore"):
        wanted = getattr(np, usual)(np.array(SPECIAL))
    for x, got, expected in zip(SPECIAL, compiled(name, np.array(SPECIAL)), wanted, strict=True):
        assert same(got, expected), (name, x, got, expected)


@pytest.mark.parametrize("name", ["pow", "atan2"])
def test_special_values_of_two_arguments(name: str, compiled: Compiled) -> None:
    x, y = (a.ravel() for a in np.meshgrid(np.array(SPECIAL), np.array(SPECIAL)))
    with np.errstate(all="ignore"):
        wanted = {"pow": np.power, "atan2": np.arctan2}[name](x, y)
    for a, b, got, expected in zip(x, y, compiled(name, x, y), wanted, strict=True):
        if expected != 0.0 or name == "pow":
            assert same(got, expected), (name, a, b, got, expected)


@pytest.mark.parametrize("name", ["rint", "floor", "ceil", "fabs"])
def test_whole_numbers_are_exact(name: str, compiled: Compiled) -> None:
    halves = np.arange(-1000.5, 1000.5, 0.5)
    x = np.concatenate([halves, np.nextafter(halves, 0), np.nextafter(halves, INF), sizes(-1074, 1023), sizes(48, 54)])
    x = np.append(x, SPECIAL)
    got, wanted = compiled(name, x), getattr(np, name)(x)
    assert np.array_equal(got, wanted, equal_nan=True)
    if name == "rint":
        assert np.array_equal(np.signbit(got[x == x]), np.signbit(wanted[x == x]))
