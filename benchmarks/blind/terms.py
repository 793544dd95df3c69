"""Forces that stand in no effect file: the diagnosis may discover or refuse them, never call them by a wrong name."""

from typing import Final, NamedTuple

import numpy as np
from numba import njit


class Term(NamedTuple):
    """One force on the two axes: sympy text in x, y, x_dot, y_dot, u_x, u_y, with the coefficient c [SI]. known: the
    effect that states it by now, by its id; such a term is no trial any more."""

    name: str
    force_x: str
    force_y: str
    known: str = ""


TERMS: Final = (
    Term("quintic_stiffness", "-c*x**5", "0"),
    Term("three_wave_spring", "-2*c*x*y", "-c*x**2"),
    Term("cross_spring", "-c*x*y**2", "-c*x**2*y", "cross_cubic_stiffness"),
    Term("square_drag", "-c*Abs(x_dot)*x_dot", "-c*Abs(y_dot)*y_dot"),
    Term("smooth_friction", "-c*tanh(x_dot/1e-3)", "-c*tanh(y_dot/1e-3)", "dry_friction"),
    Term("odd_damping", "-c*x**3*x_dot", "0"),
    Term("parametric_drive", "c*u_x*x", "0"),
    Term("velocity_coupling", "-c*x_dot*y", "0"),
    Term("skew_damping", "0", "-c*x*x_dot"),
    Term("cross_damping", "-c*y**2*x_dot", "-c*x**2*y_dot"),
    Term("cubic_drag", "-c*x_dot**3", "-c*y_dot**3"),
    Term("drive_coupling", "c*u_x*y", "0"),
    Term("bilinear_spring", "-c*Abs(x)*x", "-c*Abs(y)*y"),
    Term("quartic_spring", "-c*x**4", "0"),
    Term("inertial", "-c*x*x_dot**2", "-c*y*y_dot**2"),
    Term("cubic_coupling", "-c*y**3", "0"),
    Term("drive_gradient", "0", "c*u_y*y"),
    Term("soft_contact", "-c*tanh(x/2e-7)", "0"),
    Term("velocity_square", "-c*x_dot**2", "0"),
    Term("one_way_damping", "-c*y**2*x_dot", "0"),
)


@njit(cache=True)
def extra_force(
    number: float, c: float, x: float, y: float, dx: float, dy: float, ux: float, uy: float
) -> tuple[float, float]:
    """Force [N] on x and y of TERMS[number - 1]; none for number 0. The test compares it with the sympy text."""
    if number == 1:
        return -c * x**5, 0.0
    if number == 2:
        return -2 * c * x * y, -c * x * x
    if number == 3:
        return -c * x * y * y, -c * x * x * y
    if number == 4:
        return -c * abs(dx) * dx, -c * abs(dy) * dy
    if number == 5:
        return -c * np.tanh(dx / 1e-3), -c * np.tanh(dy / 1e-3)
    if number == 6:
        return -c * x**3 * dx, 0.0
    if number == 7:
        return c * ux * x, 0.0
    if number == 8:
        return -c * dx * y, 0.0
    if number == 9:
        return 0.0, -c * x * dx
    if number == 10:
        return -c * y * y * dx, -c * x * x * dy
    if number == 11:
        return -c * dx**3, -c * dy**3
    if number == 12:
        return c * ux * y, 0.0
    if number == 13:
        return -c * abs(x) * x, -c * abs(y) * y
    if number == 14:
        return -c * x**4, 0.0
    if number == 15:
        return -c * x * dx * dx, -c * y * dy * dy
    if number == 16:
        return -c * y**3, 0.0
    if number == 17:
        return 0.0, c * uy * y
    if number == 18:
        return -c * np.tanh(x / 2e-7), 0.0
    if number == 19:
        return -c * dx * dx, 0.0
    if number == 20:
        return -c * y * y * dx, 0.0
    return 0.0, 0.0
