"""Thermal hysteresis: after warming, the split of the stiffnesses and the damping are others than after cooling.

    kyy → kyy + h s (kyy - kxx),  d → d (1 + h s),  s = mean of (T - p_i)/w_i,  T = T_structure
    p_i = max(T - w_i, min(T + w_i, p_i before)),  p_i = T at the start

A Prandtl-Ishlinskii model of three play operators of half widths w_i (K. Kuhnen, Modeling, identification and
compensation of complex hysteretic nonlinearities, European Journal of Control 9, 2003; M. Brokate, J. Sprekels,
Hysteresis and Phase Transitions, Springer 1996). Far along one way s is 1, back on the other -1: between
both, split and damping differ by 2 h; it takes twice the largest width to change over. Speed does not matter.
"""

from sympy import Max, Min, Rational, Symbol

from gyro_model.anatomy import Law, Limit, Memory
from gyro_model.quantities import shape, size
from gyro_model.symbols import dxx, dxy, dyy, kxx, kyy, temperature_structure

HYSTERESIS = size(
    "thermal_hysteresis",
    "1",
    "by what warming changes split and damping, relative; cooling as much back",
    low=-1.0,
    high=1.0,
    nominal=1e-3,
)
WIDTHS = tuple(
    shape(f"thermal_hysteresis_width_{i}", "K", width, f"half width of play operator {i}", low=1e-6, search=None)
    for i, width in enumerate((2.0, 6.0, 18.0), 1)
)
plays = tuple(Symbol(f"thermal_play_{i}", real=True) for i in (1, 2, 3))
T = temperature_structure
share = Rational(1, len(WIDTHS)) * sum((T - p) / w.symbol for p, w in zip(plays, WIDTHS, strict=True))
factor = HYSTERESIS.symbol * share

EFFECT = Law(
    id="thermal_hysteresis",
    parameters=(HYSTERESIS, *WIDTHS),
    memories=tuple(
        Memory(p, "K", f"temperature behind play operator {i}", start=T, now=Max(T - w.symbol, Min(T + w.symbol, p)))
        for i, (p, w) in enumerate(zip(plays, WIDTHS, strict=True), 1)
    ),
    changes={kyy: kyy + factor * (kyy - kxx), **{d: d * (1 + factor) for d in (dxx, dyy, dxy)}},
    signature="bias and split at one temperature depend on whether it was warmer or colder before",
    host_experiment="temperature cycle, up and down",
    limits=(
        Limit(
            why="on the way up two lag by their widths, the wide one by half of its: s = (1 + 1 + ½)/3 = 5/6",
            at={
                "thermal_hysteresis": 0.06,
                "thermal_hysteresis_width_1": 2.0,
                "thermal_hysteresis_width_2": 6.0,
                "thermal_hysteresis_width_3": 18.0,
                "temperature_structure": 309.0,
                "thermal_play_1": 307.0,
                "thermal_play_2": 303.0,
                "thermal_play_3": 300.0,
                "kxx": 60.0,
                "kyy": 64.0,
                "dxx": 1e-6,
                "dyy": 2e-6,
                "dxy": -1e-7,
            },
            gives={
                "kyy": 64.2,
                "dxx": 1.05e-6,
                "dyy": 2.1e-6,
                "dxy": -1.05e-7,
                "start_thermal_play_1": 309.0,
                "now_thermal_play_1": 307.0,
                "start_thermal_play_2": 309.0,
                "now_thermal_play_2": 303.0,
                "start_thermal_play_3": 309.0,
                "now_thermal_play_3": 300.0,
            },
        ),
    ),
)
