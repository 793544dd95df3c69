# %% [markdown]
# # What the spread of a process costs
#
# Forty devices are drawn around a design, each is run, and limits give the yield. The same plan in a file goes to
# `gyrotwin sweep`, which spreads it over the cores of a machine or of a Dask cluster.

# %%
import matplotlib.pyplot as plt
import polars as pl
from scipy.stats import qmc

import gyrotwin as gt

points = qmc.scale(qmc.LatinHypercube(2, seed=1).random(40), [2900, 5], [3100, 60])
rows = []
for number, (frequency, split) in enumerate(points):
    device = gt.Device.from_designer(frequency=frequency, split=split, q=2000, mass=1e-7, noise=2e-5)
    run = gt.run("constant", device=device, seed=number + 1, duration=0.2)
    summary = run.summary
    rows.append({"frequency": frequency, "split": split, "converged": summary["converged_at"],
                 "angle": summary["angle"]["rms_deg"]})  # fmt: skip
table = pl.DataFrame(rows, infer_schema_length=None)
table.describe()

# %%
figure, axes = plt.subplots(1, 2, figsize=(9, 3.2), sharey=True)
for axis, name in zip(axes, ("frequency", "split"), strict=True):
    axis.plot(table[name], table["angle"], "o")
    axis.set(xlabel=f"{name} [Hz]")
axes[0].set_ylabel("angle error, rms [°]")
good = table.filter(pl.col("angle") < 0.1)
print(f"yield {len(good) / len(table):.0%} at 0.1° rms")
