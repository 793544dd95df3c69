"""The time constant of the amplifier changes with the temperature of the circuit, and the phase of the output with it.

    τ → max(0, τ + tcp (T_circuit - t_ref))

A first-order model. A lag of phase of ωτ that moves with temperature mixes quadrature into the demodulated rate
(X. Liu et al., Chinese Journal of Sensors and Actuators 27, 2014, eq. 11). Where the sum would be negative there is no
lag.
"""

from sympy import Max

from gyro_model.anatomy import Law, Limit
from gyro_model.effects.amplifier_bandwidth import TIME_CONSTANT
from gyro_model.effects.thermal_stiffness import REFERENCE
from gyro_model.quantities import size
from gyro_model.symbols import temperature_circuit

TCP = size("tcp", "s/K", "change of the amplifier's time constant with temperature", nominal=1e-8)
tau = TIME_CONSTANT.symbol

EFFECT = Law(
    id="thermal_phase",
    parameters=(TCP,),
    changes={tau: Max(tau + TCP.symbol * (temperature_circuit - REFERENCE.symbol), 0)},
    signature="the phase of both outputs moves with temperature; quadrature appears as bias",
    host_experiment="temperature step",
    limits=(
        Limit(
            why="2 µs and 50 K above at 20 ns/K: 1 µs more",
            at={"tcp": 2e-8, "t_ref": 300.0, "temperature_circuit": 350.0, "amplifier_time_constant": 2e-6},
            gives={"amplifier_time_constant": 3e-6},
        ),
        Limit(
            why="0.5 µs and 50 K below at 20 ns/K would be -0.5 µs: no lag",
            at={"tcp": 2e-8, "t_ref": 300.0, "temperature_circuit": 250.0, "amplifier_time_constant": 5e-7},
            gives={"amplifier_time_constant": 0.0},
        ),
    ),
)
