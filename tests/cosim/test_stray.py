"""How far noise that the force feeds back turns the pattern: what is predicted against the angle's own error."""

import numpy as np
import pytest

from cosim.master import simulate
from gyrotwin.tasks.run import Request, prepare

BAND = (40.0, 160.0)
"""Where a random walk is above what the reading of the angle adds, and a drift is below it [Hz]."""
SPAN = 0.05
"""Of a piece whose spectrum is taken [s]."""


def walk_of(t, error):
    """Angle random walk [rad/s^0.5] of an error of the angle [rad] at times t [s]: a walk w has the one-sided density
    2 w^2/(2 pi f)^2."""
    period = t[1] - t[0]
    count = round(SPAN / period)
    window, n = np.hanning(count), np.arange(count)
    f = np.fft.rfftfreq(count, period)
    inside = (f >= BAND[0]) & (f < BAND[1])
    found = []
    for first in range(0, len(t) - count + 1, count):
        piece = error[first : first + count]
        piece = piece - np.polyval(np.polyfit(n, piece, 1), n)
        density = np.abs(np.fft.rfft(piece * window)) ** 2 * 2 * period / np.sum(window**2)
        found.append(np.mean(density[inside] * (2 * np.pi * f[inside]) ** 2) / 2)
    return np.sqrt(np.mean(found)), len(found) * inside.sum()


@pytest.mark.parametrize(("device", "design"), [("reference", "plain"), ("reference_as_built", "lab")])
def test_the_walk_of_the_angle_is_predicted(device, design, residual):
    """With the nominal stiffness, which the device is off by some tens of per cent: noise of the sensor goes through
    what is cancelled of it. With that which `lab` finds a third of the walk is predicted, and 1.6, 1.5 and 0.9 of the
    prediction are measured with seeds 3 to 5: what is beyond it is not known."""
    own = ("controller.found_stiffness=0",)
    trace = simulate(prepare(Request("spin", device, design, seed=3, duration=0.8, settings=own))).trace
    t, strayed = trace["t"].to_numpy(), trace["stray_sigma"].to_numpy() ** 2
    late = t > 0.3
    measured, count = walk_of(t[late], (trace["angle_C"] - trace["angle_true"]).to_numpy()[late])
    predicted = np.sqrt((strayed[late][-1] - strayed[late][0]) / (t[late][-1] - t[late][0]))
    # Neighbouring bins of a windowed piece share half of what they hold: of `count` some 2/3 are independent, with a
    # deviation of 1 each; a root has half of that. Three deviations; beside them 20 %, half of what four random devices
    # were off by and more (0.7 to 1.1 of the prediction).
    limit = 0.2 + 3 * 0.5 / np.sqrt(2 / 3 * count)
    residual(f"walk of {device}, of the prediction", abs(measured / predicted - 1), limit)
