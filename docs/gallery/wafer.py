# %% [markdown]
# # Many devices together
#
# Eight dies of a wafer, whose cubic stiffness falls along x; one has lost its vacuum. Each is measured and diagnosed,
# then all of them together.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import gyrotwin as gt

folder = Path(tempfile.mkdtemp())
rng = np.random.default_rng(3)
lines = ["die,x [mm]"]
for x in range(8):
    k3 = 4e9 - 3e8 * x + 5e7 * rng.standard_normal()
    hidden = {"k3_x": k3, "k3_y": k3}
    if x == 5:
        hidden |= {"dxx": 7.2e-6, "dyy": 7.2e-6}
    gt.simulate_dataset(folder / f"die-{x}", hidden=hidden, samples=1500, runs=2, seed=x + 1)
    lines.append(f"die-{x},{x}")
_ = (folder / "devices.csv").write_text("\n".join(lines))

# %%
fleet = gt.diagnose_each(folder, folder / "results", max_effects=1)
fleet

# %%
for die, reasons in fleet.outliers.items():
    print(die, *reasons, sep="\n    ")

# %%
spread = fleet.summary["parameters"]["k3_x"]
slope = spread["slopes"]["x [mm]"]
table = fleet.devices
figure, axis = plt.subplots(figsize=(6, 3.2))
axis.errorbar(table["x [mm]"], table["k3_x"], 1.96 * table["k3_x_deviation"], fmt="o", capsize=3)
ends = np.array([0, 7])
axis.plot(ends, spread["mean"]["value"] + slope["value"] * (ends - 3.5), "--", color="#8a95a3")
axis.set(xlabel="x [mm]", ylabel="k3_x [N/m³]")
print(f"slope {slope['value']:.3g} ({slope['low']:.3g} to {slope['high']:.3g}) N/m³ per mm")
