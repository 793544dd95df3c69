"""Mechanical-thermal noise: the white force that keeps a damped mass at temperature T.

    one-sided density S_F = 4 k_B T D, with D the damping matrix

A force held over a sample period Δ has the variance 2 k_B T D/Δ; the matrix root of D is taken in closed form,
√D = (D + √det D · I)/√(tr D + 2 √det D). T. B. Gabrielson, IEEE Trans. Electron Devices 40, 1993, eq. 7.
"""

from sympy import Max, sqrt

from gyro_model.anatomy import Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import BOLTZMANN, dxx, dxy, dyy, normal_x, normal_y, sample_period, temperature_structure

SWITCH = size("thermal_force", "1", "thermal noise force times this (1: physical)", low=0.0, nominal=1.0)

# The smallest normal double keeps an undamped device at 0 instead of 0/0.
TINY = 2.2250738585072014e-308

root_det = sqrt(Max(dxx * dyy - dxy**2, 0))
root_trace = sqrt(Max(dxx + dyy + 2 * root_det, TINY))
scale = SWITCH.symbol * sqrt(2 * BOLTZMANN * temperature_structure / sample_period) / root_trace

EFFECT = Force(
    id="thermal_force",
    parameters=(SWITCH,),
    force=(
        scale * ((dxx + root_det) * normal_x + dxy * normal_y),
        scale * (dxy * normal_x + (dyy + root_det) * normal_y),
    ),
    energy=None,
    noise=True,
    signature="a hump of width f/Q at each resonance; ½ k_B T of energy in each quadratic term at rest",
    host_experiment="any",
    limits=(
        Limit(
            why="d = 4e-6 N·s/m, no cross damping: √(2 · 1.380649e-23 · 300 · 4e-6/5e-6) N on each axis",
            at={
                "thermal_force": 1.0,
                "dxx": 4e-6,
                "dyy": 4e-6,
                "dxy": 0.0,
                "temperature_structure": 300.0,
                "sample_period": 5e-6,
                "normal_x": 1.0,
                "normal_y": -1.0,
            },
            gives={"force_x": 8.140709551384326e-11, "force_y": -8.140709551384326e-11},
        ),
        Limit(
            why="an undamped device feels none",
            at={"thermal_force": 1.0, "dxx": 0.0, "dyy": 0.0, "dxy": 0.0, "normal_x": 1.0},
            gives={"force_x": 0.0, "force_y": 0.0},
        ),
    ),
)
