# %% [markdown]
# # What knowing the device is worth
#
# `device` is what the plant is, `design` all that the loop may know of it. Here the springs are cubic (`k3_x`, `k3_y`).
# A loop that knows of no such effect runs beside one that looks for it in a wide interval.

# %%
import matplotlib.pyplot as plt
import numpy as np

import gyrotwin as gt

device = gt.load_device("reference").with_parameters({"k3_x": 2e10, "k3_y": 2e10})
runs = {design: gt.run("constant", device=device, design=design, duration=0.6) for design in ("plain", "lab")}
{design: (run.valid, run.summary["angle"]["rms_deg"]) for design, run in runs.items()}

# %% [markdown]
# The first never calls its angle valid, and so gives none. The angle of the second, from convergence on:

# %%
figure, axis = plt.subplots(figsize=(8, 3))
trace = runs["lab"].trace
axis.plot(trace["t"].to_numpy(), np.rad2deg((trace["angle"] - trace["angle_true"]).to_numpy()), lw=1)
_ = axis.set(xlabel="t [s]", ylabel="error of the angle [°]")

# %% [markdown]
# What the loop with the wide interval found of the spring, in N/m³:

# %%
{name: value for name, value in runs["lab"].summary["effects"].items() if name.startswith("k3")}
