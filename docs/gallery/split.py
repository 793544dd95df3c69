# %% [markdown]
# # The frequency split, from noise alone
#
# While a gyroscope works, thermal noise shakes its sense mode. The hump it leaves beside the drive line says where the
# mode is: no sweep, no test force.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import welch

import gyrotwin as gt

record = gt.rate(plant="envelope", duration=60, sense_record=1000)
i, q = (record.sense[name].to_numpy() for name in ("v_y_i", "v_y_q"))
f, density = welch(i + 1j * q, fs=1000, nperseg=4096, return_onesided=False, detrend=False)
order = np.argsort(f)
figure, axis = plt.subplots(figsize=(8, 3))
axis.semilogy(f[order], density[order], lw=0.8)
_ = axis.set(xlim=(-150, 150), xlabel="f - f_x [Hz]", ylabel="density [V²/Hz]")

# %%
folder = Path(tempfile.mkdtemp())
found = gt.split(record.save(folder / "rest") / "sense.parquet")
found

# %% [markdown]
# The device file says what is true:

# %%
low, high = gt.load_device("rate-mode").frequencies
print(f"{high - low:.2f} Hz between the modes")
