# %% [markdown]
# # Rate mode over temperature, compensated
#
# Drive and sense loop turn a rate into a voltage, whose bias and scale change with temperature. Three cycles are
# recorded on the envelope FMU, which is the same device as slow amplitudes, a thousand times faster.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import polars as pl

import gyrotwin as gt

folder = Path(tempfile.mkdtemp())
turns = 1500.0 * np.arange(7)
degrees = [-40.0, 85.0, -40.0, 85.0, -40.0, 85.0, -40.0]
pl.DataFrame({"t": turns, "temperature_deg_c": degrees}).write_csv(folder / "cycles.csv")
record = gt.rate(plant="envelope", temperature=folder / "cycles.csv", rate_step=100, rate_period=40)
record

# %%
trace = record.trace
figure, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 4.5))
above.plot(trace["t"], np.rad2deg(trace["rate"]), lw=0.8)
above.set(ylabel="output [°/s]")
below.plot(trace["t"], trace["temperature_structure"] - 273.15)
_ = below.set(xlabel="t [s]", ylabel="structure [°C]")

# %% [markdown]
# The compensation is fitted to the first two cycles and judged by the last. It comes as TOML and as C:

# %%
saved = record.save(folder / "record")
fitted = gt.compensate(saved / "trace.parquet", method="piecewise")
fitted
