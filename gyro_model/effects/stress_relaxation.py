"""The die attach gives way slowly: stiffness follows the ambient temperature with a lag of tens of minutes.

    k → k (1 + r s),  τ s' = (temperature - t_ref) - s,  s = temperature - t_ref at the start

A first-order model of the relaxing stress between die and package, which no temperature sensor sees (for that stress
itself: X. Zhang, S. Park, M. W. Judy, Accurate assessment of packaging stress effects on MEMS sensors, Journal of
Microelectromechanical Systems 16, 2007).
"""

from sympy import Symbol, exp

from gyro_model.anatomy import Law, Limit, Memory
from gyro_model.effects.thermal_stiffness import REFERENCE
from gyro_model.quantities import Grid, shape, size
from gyro_model.symbols import kxx, kxy, kyy, since, temperature

RELAXATION = size(
    "relaxation", "1/K", "change of stiffness with the lagging temperature", nominal=1e-6, display="ppm/K"
)
TIME = shape(
    "relaxation_time",
    "s",
    2500.0,
    "time constant of the relaxing stress",
    low=1e-6,
    search=Grid.log(0.01, 10, of="duration", points=6),
)
# Above t_ref, and added to: beside 300 K what a step of microseconds adds would round away.
slow = Symbol("relaxing_temperature", real=True)
above = temperature - REFERENCE.symbol

EFFECT = Law(
    id="stress_relaxation",
    parameters=(RELAXATION, TIME),
    memories=(
        Memory(
            slow,
            "K",
            "ambient temperature above t_ref as the relaxing stress follows it",
            start=above,
            now=slow + (above - slow) * (1 - exp(-since / TIME.symbol)),
        ),
    ),
    changes={k: k * (1 + RELAXATION.symbol * slow) for k in (kxx, kyy, kxy)},
    signature="the resonances creep for an hour after a change of temperature, when no sensor moves any more",
    host_experiment="temperature step, long record",
    limits=(
        Limit(
            why="12 K behind 20 K; after ln 2 time constants half way, at 16 K",
            at={
                "relaxation": 1e-5,
                "relaxation_time": 2000.0,
                "since": 1386.2943611198906,
                "t_ref": 300.0,
                "temperature": 320.0,
                "relaxing_temperature": 12.0,
                "kxx": 1.0,
                "kyy": 2.0,
                "kxy": 0.5,
            },
            gives={
                "kxx": 1.00012,
                "kyy": 2.00024,
                "kxy": 0.50006,
                "start_relaxing_temperature": 20.0,
                "now_relaxing_temperature": 16.0,
            },
        ),
    ),
)
