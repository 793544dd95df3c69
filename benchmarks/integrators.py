"""Explicit Runge-Kutta methods as data, and the C that runs them all in the same way: the stages unrolled, the rates of
two coupled axes inlined."""

import ctypes
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853, RK45

from gyro_model.compiling import compile_library

Floats = NDArray[np.float64]

RATES_SIZE: Final = 8
"""kxx, kyy, kxy, dxx, dyy, dxy, k3_x, k3_y, each over the mass."""
TAYLOR_ORDER: Final = 30


class Method(NamedTuple):
    """A Butcher tableau: a shape (s, s) strictly lower, b and c shape (s,). Raises ValueError where it is none."""

    title: str
    order: int
    a: Floats
    b: Floats
    c: Floats

    def check(self) -> "Method":
        """Itself, where stages and weights are consistent."""
        # Printed coefficients have 16 digits; sums of twelve up to 40 in size lose two.
        consistent = np.allclose(self.a.sum(axis=1), self.c, atol=1e-13) and abs(self.b.sum() - 1) < 1e-13
        if not consistent or np.triu(self.a).any():
            raise ValueError(f"{self.title}: rows of a must sum to c, b to 1, and a be strictly lower triangular")
        return self


def _rk4() -> Method:
    a = np.diag([0.5, 0.5, 1.0], -1)
    return Method("Runge-Kutta 4", 4, a, np.array([1, 2, 2, 1]) / 6, np.array([0, 0.5, 0.5, 1.0]))


def _luther() -> Method:
    """H. A. Luther, An explicit sixth-order Runge-Kutta formula, Math. Comp. 22 (1968), 434-436."""
    r = np.sqrt(21.0)
    a = np.zeros((7, 7))
    a[1, 0] = 1.0
    a[2, :2] = np.array([3, 1]) / 8
    a[3, :3] = np.array([8, 2, 8]) / 27
    a[4, :4] = np.array([3 * (3 * r - 7), -8 * (7 - r), 48 * (7 - r), -3 * (21 - r)]) / 392
    a[5, :5] = np.array([-5 * (231 + 51 * r), -40 * (7 + r), -320 * r, 3 * (21 + 121 * r), 392 * (6 + r)]) / 1960
    a[6, :6] = np.array(
        [15 * (22 + 7 * r), 120, 40 * (7 * r - 5), -63 * (3 * r - 2), -14 * (49 + 9 * r), 70 * (7 - r)]
    ) / 180  # fmt: skip
    b = np.array([9, 0, 64, 0, 49, 49, 9]) / 180
    return Method("Luther 6", 6, a, b, np.array([0, 1, 0.5, 2 / 3, (7 - r) / 14, (7 + r) / 14, 1.0]))


def _scipy(title: str, order: int, solver: Any) -> Method:
    stages = len(solver.B)
    a = np.zeros((stages, stages))
    given = np.asarray(solver.A)[:stages, :stages]
    a[: given.shape[0], : given.shape[1]] = given
    return Method(title, order, a, np.asarray(solver.B), np.asarray(solver.C)[:stages])


METHODS: Final[Mapping[str, Method]] = {
    name: method.check()
    for name, method in {
        "rk4": _rk4(),
        "dopri5": _scipy("Dormand-Prince 5", 5, RK45),
        "luther6": _luther(),
        "dop853": _scipy("Dormand-Prince 8 (DOP853)", 8, DOP853),
    }.items()
}

_HEAD: Final = """#include <stdint.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

static inline void rate(const double *p, const double *s, double *k)
{
    k[0] = s[1];
    k[1] = -p[0] * s[0] - p[2] * s[2] - p[3] * s[1] - p[5] * s[3] - p[6] * s[0] * s[0] * s[0];
    k[2] = s[3];
    k[3] = -p[2] * s[0] - p[1] * s[2] - p[5] * s[1] - p[4] * s[3] - p[7] * s[2] * s[2] * s[2];
}
"""

# The Taylor series of the motion in extended precision: s is a sum of powers of time, a product one of Cauchy's.
_TAYLOR: Final = """
EXPORT void run_taylor(const double *p, double *state, double step, int64_t steps)
{
    long double s[4], c[4][ORDER + 1], square[2][ORDER + 1], cube[2];
    const long double h = (long double)1 / steps * (step * steps);
    for (int i = 0; i < 4; i++) {
        s[i] = state[i];
    }
    for (int64_t k = 0; k < steps; k++) {
        for (int i = 0; i < 4; i++) {
            c[i][0] = s[i];
        }
        for (int n = 0; n < ORDER; n++) {
            for (int axis = 0; axis < 2; axis++) {
                const long double *q = c[2 * axis];
                square[axis][n] = 0;
                for (int i = 0; i <= n; i++) {
                    square[axis][n] += q[i] * q[n - i];
                }
                cube[axis] = 0;
                for (int i = 0; i <= n; i++) {
                    cube[axis] += q[i] * square[axis][n - i];
                }
            }
            c[0][n + 1] = c[1][n] / (n + 1);
            c[2][n + 1] = c[3][n] / (n + 1);
            const long double x = c[0][n], x_dot = c[1][n], y = c[2][n], y_dot = c[3][n];
            c[1][n + 1] = (-p[0] * x - p[2] * y - p[3] * x_dot - p[5] * y_dot - p[6] * cube[0]) / (n + 1);
            c[3][n + 1] = (-p[2] * x - p[1] * y - p[5] * x_dot - p[4] * y_dot - p[7] * cube[1]) / (n + 1);
        }
        for (int i = 0; i < 4; i++) {
            s[i] = c[i][ORDER];
            for (int n = ORDER - 1; n >= 0; n--) {
                s[i] = s[i] * h + c[i][n];
            }
        }
    }
    for (int i = 0; i < 4; i++) {
        state[i] = (double)s[i];
    }
}
"""


def _source() -> str:
    loops = (_loop(name, method) for name, method in METHODS.items())
    return _HEAD + "".join(loops) + _TAYLOR.replace("ORDER", str(TAYLOR_ORDER))


def _loop(name: str, method: Method) -> str:
    stages = len(method.b)
    lines = [f"\nEXPORT void run_{name}(const double *p, double *s, double h, int64_t steps)", "{"]
    lines += [f"    double k[{stages}][4], y[4];", "    for (int64_t n = 0; n < steps; n++) {"]
    for stage in range(stages):
        lines += [f"        for (int i = 0; i < 4; i++) {{ y[i] = s[i] + h * ({_sum(method.a[stage])}); }}"]
        lines += [f"        rate(p, y, k[{stage}]);"]
    lines += [f"        for (int i = 0; i < 4; i++) {{ s[i] += h * ({_sum(method.b)}); }}", "    }", "}", ""]
    return "\n".join(lines)


def _sum(weights: Floats) -> str:
    terms = [f"{float(weight)!r} * k[{i}][i]" for i, weight in enumerate(weights) if weight]
    return " + ".join(terms) or "0.0"


class Integrators:
    """All methods, compiled with the flags of the FMU."""

    def __init__(self) -> None:
        with tempfile.TemporaryDirectory(prefix="gyrotwin-", ignore_cleanup_errors=True) as name:
            folder = Path(name)
            (folder / "integrators.c").write_text(_source(), encoding="utf-8")
            compile_library(folder, ["integrators.c"], folder / "integrators.bin")
            self._library = ctypes.CDLL(str(folder / "integrators.bin"))

    def run(self, name: str, rates: Floats, start: Floats, step: float, steps: int) -> Floats:
        """The state x, x', y, y' [m, m/s] after ``steps`` of ``step`` [s] from ``start``; ``rates`` shape (8,), see
        RATES_SIZE; name: of METHODS, or ``taylor``."""
        state = np.array(start, dtype=np.float64)
        function = getattr(self._library, f"run_{name}")
        function.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_double, ctypes.c_int64]
        function.restype = None
        rates = np.ascontiguousarray(rates, dtype=np.float64)
        function(rates.ctypes.data, state.ctypes.data, step, steps)
        return state
