"""The force acts later than commanded: converter, driver and computation time.

    u(t) → u(t - τ), τ ≤ 1 ms; before the start the force is the first one

A model of a pure dead time, a phase of ωτ. In a loop that cancels stiffness ΔK the delay acts as a damping ΔK·τ.
"""

from gyro_model.anatomy import Delay, Limit
from gyro_model.quantities import size

DELAY = size("actuator_delay", "s", "the force acts later by this", low=0.0, high=1e-3, nominal=1e-6, display="µs")

EFFECT = Delay(
    id="actuator_delay",
    parameters=(DELAY,),
    delay=DELAY.symbol,
    signature="phase of the response to u falls in proportion to frequency; a loop gains or loses damping",
    host_experiment="any drive; best at several frequencies",
    limits=(Limit(why="the delay is the parameter", at={"actuator_delay": 7e-6}, gives={"delay": 7e-6}),),
)
