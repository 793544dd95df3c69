"""Charge collects in the dielectric of the electrodes and adds to the bias voltage.

    v_bias → v_bias + V_c (1 - exp(-t/τ)); acts where softening ≠ 0

A first-order model with one time constant.
"""

from sympy import exp

from gyro_model.anatomy import Law, Limit
from gyro_model.quantities import Grid, shape, size
from gyro_model.symbols import t, v_bias

VOLTAGE = size("charging_voltage", "V", "what the charge adds to the bias voltage in the end", nominal=1.0)
TIME = shape(
    "charging_time", "s", 1.0, "time constant of charging", low=1e-9, search=Grid.log(0.01, 10, of="duration", points=6)
)

EFFECT = Law(
    id="dielectric_charging",
    parameters=(VOLTAGE, TIME),
    changes={v_bias: v_bias + VOLTAGE.symbol * (1 - exp(-t / TIME.symbol))},
    signature="resonance drifts exponentially after power-on, by the bias that softens it",
    host_experiment="bias step, long record",
    limits=(
        Limit(
            why="after ln 2 time constants half of 3 V",
            at={"charging_voltage": 3.0, "charging_time": 2.0, "t": 1.3862943611198906, "v_bias": 10.0},
            gives={"v_bias": 11.5},
        ),
    ),
)
