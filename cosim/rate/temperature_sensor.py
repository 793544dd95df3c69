"""The two temperature sensors of rate mode: a platinum resistor on the structure, a digital sensor on the board.

Liu et al. 2014, eqs. 12 and 13: R_T = R_0 (1 + βT) in a bridge with R1 = R2 = 5 kΩ above, R3 = 500 Ω and the trimmer
R4 = 25 Ω in the other lower arm, then a difference amplifier of gain 16 (set by R_G = 9.1 kΩ) and a converter,

    V = 16 V_s [R_T/(R1 + R_T) - (R3 + R4)/(R2 + R3 + R4)]

R_0 and the supply V_s are chosen, the paper prints neither: R_0 = 500 Ω balances the bridge at 22.9 °C.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cosim.rate.courses import ZERO_CELSIUS

Floats = NDArray[np.float64]


class Bridge(NamedTuple):
    """The resistor's bridge, amplifier and converter: resistances [Ω], beta [1/K], supply [V], noise [V rms a
    reading], lsb [V]."""

    r0: float = 500.0
    beta: float = 2.183e-3
    r1: float = 5e3
    r2: float = 5e3
    r3: float = 500.0
    r4: float = 25.0
    gain: float = 16.0
    supply: float = 5.0
    noise: float = 30e-6  # low-noise amplifier and the converter's own: 2 mK
    lsb: float = 5.0 / 2**16  # 16 bit over ±2.5 V: 5 mK

    def voltage(self, temperature: Floats) -> Floats:
        """Voltage at the converter [V] for a resistor at ``temperature`` [K], shape (n,)."""
        r_t = self.r0 * (1 + self.beta * (temperature - ZERO_CELSIUS))
        lower = self.r3 + self.r4
        return self.gain * self.supply * (r_t / (self.r1 + r_t) - lower / (self.r2 + lower))

    def temperature(self, voltage: Floats) -> Floats:
        """Inverse of ``voltage`` [K], shape (n,)."""
        lower = self.r3 + self.r4
        share = voltage / (self.gain * self.supply) + lower / (self.r2 + lower)
        r_t = self.r1 * share / (1 - share)
        return ZERO_CELSIUS + (r_t / self.r0 - 1) / self.beta

    def read(self, temperature: Floats, rng: np.random.Generator) -> Floats:
        """Readings [K], one each row, with noise and rounding."""
        voltage = self.voltage(temperature) + self.noise * rng.standard_normal(len(temperature))
        return self.temperature(np.rint(voltage / self.lsb) * self.lsb)


class BoardSensor(NamedTuple):
    """A digital sensor on the board: noise [K rms a reading], lsb [K]; 12 bit parts resolve 1/16 K."""

    noise: float = 0.02
    lsb: float = 0.0625

    def read(self, temperature: Floats, rng: np.random.Generator) -> Floats:
        """Readings [K], one each row, with noise and rounding."""
        noisy = temperature - ZERO_CELSIUS + self.noise * rng.standard_normal(len(temperature))
        return ZERO_CELSIUS + np.rint(noisy / self.lsb) * self.lsb
