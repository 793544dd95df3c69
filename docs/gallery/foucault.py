# %% [markdown]
# # A Foucault pendulum of a tenth of a milligram
#
# The controller makes the mass an isotropic, lossless oscillator. Its line of swing then stays where it is in space, so
# that in the package it turns against the rate. The angle is read from the pattern; no rate is integrated.

# %%
import matplotlib.pyplot as plt
import numpy as np

import gyrotwin as gt

run = gt.run("constant", seed=7, duration=0.5)
run

# %%
t, angle, true = (run.trace[name].to_numpy() for name in ("t", "angle", "angle_true"))
figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 5))
above.plot(t, np.rad2deg(true), lw=4, color="#f2b84b", label="true")
above.plot(t, np.rad2deg(angle), color="#1f5fbf", label="read from the pattern")
above.set(ylabel="angle [°]")
above.legend()
below.plot(t, np.rad2deg(angle - true), color="#b4481f")
_ = below.set(xlabel="t [s]", ylabel="error [°]")

# %% [markdown]
# The angle is set to zero where the loop has converged; that choice is the constant part of the error. At each edge of
# the rate the filter of the angle unit lags for some milliseconds.
#
# Nothing is known of the device at first but gains and noise. The seven parameters are found while it runs:

# %%
figure, axes = plt.subplots(1, 3, figsize=(9, 2.6))
for axis, name in zip(axes, ("kxx", "dyy", "m"), strict=True):
    ratio = run.trace[f"est_{name}"].to_numpy() / run.trace[f"true_{name}"].to_numpy() - 1
    axis.semilogy(t, np.abs(ratio))
    axis.set(title=name, xlabel="t [s]")
axes[0].set_ylabel("relative error")
figure.tight_layout()
