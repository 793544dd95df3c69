# %% [markdown]
# # The FMU alone
#
# The plant is a file that any FMI tool runs. With FMPy: the mass is pulled along x and let go, and the springs that
# couple the axes pass the motion to y and back.

# %%
import matplotlib.pyplot as plt
import numpy as np
from fmpy import simulate_fmu

import gyrotwin as gt

fmi2, fmi3, *others = gt.build()
fmi3.name, fmi3.stat().st_size

# %%
result = simulate_fmu(
    str(fmi3),
    stop_time=0.02,
    output_interval=5e-6,
    start_values={"x_start": 1e-6, "omega_z": 0.0},
    output=["v_x", "v_y"],
)
figure, axis = plt.subplots(figsize=(8, 3))
for name in ("v_x", "v_y"):
    axis.plot(1e3 * result["time"], result[name], lw=0.7, label=name)
axis.set(xlabel="t [ms]", ylabel="[V]")
_ = axis.legend()

# %%
spectrum = np.abs(np.fft.rfft(result["v_x"] * np.hanning(len(result))))
f = np.fft.rfftfreq(len(result), 5e-6)
figure, axis = plt.subplots(figsize=(8, 3))
axis.semilogy(f, spectrum)
axis.set(xlim=(0, 8000), xlabel="f [Hz]", ylabel="|v_x|")
print("modes of the device file [Hz]:", gt.load_device("reference").frequencies)
