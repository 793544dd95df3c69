# %% [markdown]
# # Find what a model lacks
#
# A device whose springs are cubic is measured: three runs, driven over both modes. The lab knows masses and springs to
# 2 % and suspects nothing.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import gyrotwin as gt

folder = Path(tempfile.mkdtemp())
data = gt.simulate_dataset(folder / "trial", hidden={"k3_x": 3e9, "k3_y": 3e9}, samples=2000)
found = gt.diagnose(data)
found

# %% [markdown]
# How the misfit on the run that no fit saw falls, down to the noise:

# %%
levels = {stage.name: stage.misfit[""] for stage in found.raw.stages}
figure, axis = plt.subplots(figsize=(6, 3))
axis.bar(list(levels), list(levels.values()), color="#1f5fbf")
axis.axhline(found.misfit["noise_floor"], color="#3d4652", ls="--")
axis.set_yscale("log")
_ = axis.set(ylabel="misfit [1]")

# %% [markdown]
# What else this data would have shown, had it been there: the five smallest sizes.

# %%
sizes = [(effect, name, size) for effect, own in found.report["detectable"].items() for name, size in own.items()]
sorted(sizes, key=lambda entry: entry[2])[:5]
