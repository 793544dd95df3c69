# %% [markdown]
# # An effect of your own
#
# One file states what an effect is. From it come the C of the FMU, its variables, the reference simulation and what a
# diagnosis looks for. Here is a spring that hardens with the fifth power.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import gyrotwin as gt
from gyrotwin import contract

folder = Path(tempfile.mkdtemp()) / "my_effects"
folder.mkdir()
text = '''"""A spring whose force grows with the fifth power of the displacement along x.

F_x = -k5_x x^5
"""

from sympy import Integer, Rational

from gyro_model.anatomy import Energy, Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import x

K5 = size("k5_x", "N/m5", "fifth-power stiffness, x axis")

EFFECT = Force(
    id="quintic",
    parameters=(K5,),
    force=(-K5.symbol * x**5, Integer(0)),
    energy=Energy(stored=Rational(1, 6) * K5.symbol * x**6),
    signature="the resonance of x rises with the fourth power of the amplitude",
    host_experiment="ring-down from a large amplitude",
    limits=(
        Limit(
            why="2e20 N/m5 at 1 µm: 2e20 times 1e-30 m5, against the displacement",
            at={"k5_x": 2e20, "x": 1e-6},
            gives={"force_x": -2e-10, "force_y": 0.0},
        ),
    ),
)
'''
_ = (folder / "quintic.py").write_text(text)
contract.check(folder)

# %% [markdown]
# A mistake is refused with its reason: with a force of the fourth power the unit no longer fits.

# %%
wrong = Path(tempfile.mkdtemp())
_ = (wrong / "quintic.py").write_text(text.replace("x**5", "x**4"))
try:
    contract.check(wrong)
except gt.InputError as error:
    print(error)

# %% [markdown]
# The new parameter is one of the device like any other. A loop that knows of no such spring takes it for stiffness:

# %%
figure, axis = plt.subplots(figsize=(8, 3))
for k5 in (0.0, 1e22):
    run = gt.run("constant", effects=[folder], parameters={"k5_x": k5}, duration=0.2)
    axis.plot(run.trace["t"], run.trace["est_kxx"], label=f"k5_x = {k5:g} N/m⁵")
axis.set(xlabel="t [s]", ylabel="kxx as estimated [N/m]")
_ = axis.legend()
