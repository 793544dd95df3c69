"""The symbols that an effect file may write its term in, besides its own parameters.

Signals run along the chain (docs/theory/effects.md, eq. 1): ``u_x, u_y`` are the force after the actuator stages
that come before the effect, ``q_x, q_y`` [m] the displacement as the pickoff stages before it leave it, ``v_x, v_y``
[V] likewise the voltage.
"""

from sympy import Expr, Float, Function, Integer, Symbol

from gyro_model.quantities import INPUTS, OUTPUTS, PARAMETERS

BY_NAME = {quantity.name: quantity.symbol for quantity in (*INPUTS, *OUTPUTS, *PARAMETERS)}

m, kxx, kyy, kxy, dxx, dyy, dxy = (BY_NAME[name] for name in ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy"))
sense_gain_x, sense_gain_y = BY_NAME["sense_gain_x"], BY_NAME["sense_gain_y"]
sample_period = BY_NAME["sample_period"]
temperature_structure, temperature_circuit = BY_NAME["temperature_structure"], BY_NAME["temperature_circuit"]
temperature, omega_z, a_x, a_y, v_bias = (
    BY_NAME["temperature"],
    BY_NAME["omega_z"],
    BY_NAME["a_x"],
    BY_NAME["a_y"],
    BY_NAME["v_bias"],
)
x, y, x_dot, y_dot = BY_NAME["x"], BY_NAME["y"], BY_NAME["x_dot"], BY_NAME["y_dot"]
u_x, u_y, v_x, v_y = BY_NAME["u_x"], BY_NAME["u_y"], BY_NAME["v_x"], BY_NAME["v_y"]

q_x, q_y = Symbol("q_x", real=True), Symbol("q_y", real=True)

v_x_rate, v_y_rate = Symbol("v_x_rate", real=True), Symbol("v_y_rate", real=True)
"""Rate [V/s] of the voltage that enters the sampled block, parameters held; for maps of that block only."""

omega_z_change = Symbol("omega_z_change", real=True)
CHANGES = {omega_z_change: omega_z}
"""The step [of its unit] by which a held input has just changed, and the input; an impulse is written in it."""

t = Symbol("t", real=True)
"""Time [s]."""

since = Symbol("since", real=True)
"""Time [s] that has gone by since what an effect remembers was as its symbol says; for a ``Memory`` only."""

after = Symbol("after", real=True)
"""1 from the effect's event on, 0 before it."""

normal_x, normal_y = Symbol("normal_x", real=True), Symbol("normal_y", real=True)
"""Two independent standard normal numbers, of the effect's own stream, new at every sample."""

pink_x, pink_y = Symbol("pink_x", real=True), Symbol("pink_y", real=True)
"""In place of normal numbers: pink noise [√Hz] of one-sided density 1 Hz/f, new at every sample (fmu_src/pink.h)."""

NORMAL, PINK = (normal_x, normal_y), (pink_x, pink_y)


class nearest_integer(Function):
    """Rounds to the nearest integer, ties to even."""

    is_real = True

    def fdiff(self, argindex: int = 1) -> Expr:
        """Zero: it stands still between its steps."""
        return Integer(0)


BOLTZMANN = Float("1.380649e-23", 17)
"""Boltzmann constant [J/K], exact by the definition of the kelvin (SI brochure, 9th edition)."""

STATES = (x, x_dot, y, y_dot)

SET_BY = {temperature_structure: temperature, temperature_circuit: temperature}
"""What the device makes of an input, before any effect changes it: both temperatures are the ambient one."""
