"""The damping of the axes against one another walks at random: the bias of the rate drifts without end.

    dxy → dxy + bias_walk W √(dxx dyy), W a Wiener process: W(0) = 0, <(W(t) - W(s))²> = |t - s|

The rate random walk of IEEE Std 952-1997, annex C, an Allan deviation K √(τ/3). W steps at the samples, in the envelope
form at the internal steps.
"""

from sympy import Symbol, sqrt

from gyro_model.anatomy import Law, Limit, Memory
from gyro_model.quantities import size
from gyro_model.symbols import dxx, dxy, dyy, normal_x, since

WALK = size(
    "bias_walk", "1/s0.5", "random walk of the cross damping, rms in 1 s, over √(dxx dyy)", low=0.0, nominal=1e-6
)
walked = Symbol("bias_walked", real=True)

EFFECT = Law(
    id="bias_walk",
    parameters=(WALK,),
    memories=(Memory(walked, "s0.5", "Wiener process", sample=walked + sqrt(since) * normal_x),),
    changes={dxy: dxy + WALK.symbol * walked * sqrt(dxx * dyy)},
    noise=True,
    signature="the bias of the rate, or the drift of the pattern, strays with the root of time",
    host_experiment="a record of many hours",
    limits=(
        Limit(
            why="0.002/√s at -2 √s: 0.004 of √(1e-6 · 4e-6) less; a quarter of a second on, half a number √s is added",
            at={
                "bias_walk": 0.002,
                "bias_walked": -2.0,
                "since": 0.25,
                "normal_x": 3.0,
                "dxx": 1e-6,
                "dyy": 4e-6,
                "dxy": 3e-7,
            },
            gives={"dxy": 2.92e-7, "start_bias_walked": 0.0, "sample_bias_walked": -0.5},
        ),
    ),
)
