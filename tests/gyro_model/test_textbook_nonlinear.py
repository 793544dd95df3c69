"""Nonlinear and random forces of the FMU against formulae from the textbook."""

from collections.abc import Callable

import numpy as np
import pytest
from gyro_runner import Runner
from scipy.constants import Boltzmann
from scipy.special import ellipj, ellipk

Residual = Callable[[str, float, float], None]

M, K = 1.8e-7, 63.955
W = np.sqrt(K / M)
LOSSLESS = {"m": M, "kxx": K, "kyy": 95.92, "kxy": 0.0, "dxx": 0.0, "dyy": 0.0, "dxy": 0.0}
A = 1e-6


def test_duffing_oscillation_is_an_elliptic_cosine(plant: Runner, residual: Residual) -> None:
    # x = A cn(wt | μ), w² = (k + k3 A²)/m, μ = k3 A²/(2(k + k3 A²)).
    hardening = 0.2 * K / A**2
    t = np.arange(1001) * 5e-6
    x = plant.run({**LOSSLESS, "x_start": A, "k3_x": hardening}, t)["x"]
    stiff = K + hardening * A**2
    wanted = A * ellipj(np.sqrt(stiff / M) * t, hardening * A**2 / (2 * stiff))[1]
    # Both round 1e-16 of a phase of 100 rad; scipy's ellipj is good to 1e-14 of it.
    residual("motion", np.max(np.abs(x - wanted)) / A, 1e-11)


@pytest.mark.parametrize("ratio", [1e-3, 1e-2, -1e-2])
def test_duffing_backbone(plant: Runner, residual: Residual, ratio: float) -> None:
    # ω(A) = ω (1 + 3/8 k3 A²/k): from the zero crossings of 100 periods.
    step = 5e-6
    t = np.arange(6801) * step
    out = plant.run({**LOSSLESS, "x_start": A, "k3_x": ratio * K / A**2}, t)
    x, rising = out["x"], np.flatnonzero((out["x"][:-1] < 0) & (out["x"][1:] >= 0))
    # The phase of a harmonic oscillator from the sample before: there ωΔt < 0.1, where the cubic force is nothing yet.
    crossing = t[rising] - np.arctan2(W * x[rising], out["x_dot"][rising]) / W
    frequency = 2 * np.pi * (len(rising) - 1) / (crossing[-1] - crossing[0])
    shift = frequency / W - 1
    # The next term of the expansion is -21/256 (k3 A²/k)², the one after a tenth of it at most.
    residual("backbone", abs(shift - 3 / 8 * ratio), 21 / 256 * ratio**2 * 1.1)
    # And the exact period 4 K(μ)/w: 0.1⁵ k3 A²/k of a radian at the crossings, over 100 turns; rounding 1e-12.
    stiff = 1 + ratio
    exact = np.pi * np.sqrt(stiff) / (2 * ellipk(ratio / (2 * stiff))) - 1
    residual("exact period", abs(shift - exact), 2e-8 * abs(ratio) + 1e-12)


def test_quadratic_stiffness_shifts_the_mean(plant: Runner, residual: Residual) -> None:
    k2 = 1e-3 * K / A
    t = np.arange(20001) * 5e-6
    x = plant.run({**LOSSLESS, "x_start": A, "k2_x": k2}, t)["x"]
    window = np.hanning(len(t))
    # -k2 A²/(2 k); the next order in k2 A/k = 1e-3 is 1e-6 A, and the Hann window leaves less of 300 periods.
    residual("mean", abs(np.sum(window * x) / np.sum(window) + k2 * A**2 / (2 * K)) / A, 2e-6)


def test_nonlinear_damping_is_d2_a2_over_4(plant: Runner, residual: Residual) -> None:
    # A' = -(d2 A²/4)/(2m) A gives A(t) = A0/√(1 + d2 A0² t/(4m)): after 30 ms 40 % smaller.
    t = np.arange(0, 0.03, 1e-4)
    d2 = 4 * M * 60.0 / A**2
    out = plant.run({**LOSSLESS, "x_start": A, "d2_x": d2}, t)
    amplitude = np.hypot(out["x"], out["x_dot"] / W)
    wanted = A / np.sqrt(1 + d2 * A**2 * t / (4 * M))
    # Averaging leaves a ripple of the first order in 1/Q = d2 A²/(4 m ω) = 3e-3, a quarter to a half of it.
    residual("amplitude", np.max(np.abs(amplitude - wanted)) / A, 60.0 / W)
    # Averaged over the ripple, the second order.
    mean = np.mean((amplitude - wanted)[150:]) / A
    residual("mean amplitude", abs(mean), (60.0 / W) ** 2)


def test_softening_moves_the_resonance(plant: Runner, residual: Residual) -> None:
    # Far from the electrode, k falls by a V²: cos(√((k - a V²)/m) t).
    a, bias = 0.05, 12.0
    t = np.arange(401) * 5e-6
    x = plant.run({**LOSSLESS, "x_start": 1e-12, "softening": a}, t, {"v_bias": np.full(401, bias)}, outputs=("x",))[
        "x"
    ]
    # (q/g)² = 1e-14 of the pull is left out.
    residual("motion", np.max(np.abs(x / 1e-12 - np.cos(np.sqrt((K - a * bias**2) / M) * t))), 1e-11)


def test_equipartition(plant: Runner, residual: Residual) -> None:
    # Q of 10, both axes coupled in stiffness and damping: <q qᵀ> = k_B T K⁻¹, <q' q'ᵀ> = k_B T/m.
    d = M * W / 10
    stiffness = np.array([[K, 0.3 * K], [0.3 * K, 1.2 * K]])
    own = {"m": M, "kxx": K, "kyy": 1.2 * K, "kxy": 0.3 * K, "dxx": d, "dyy": 2 * d, "dxy": -0.7 * d}
    temperature, n = 350.0, 100_000
    t = np.arange(n) * 1e-4
    steady = {"internal_step": 5e-6, "thermal_force": 1.0, "seed": 3}
    out = plant.run(own | steady, t, {"temperature": np.full(n, temperature)}, ("x", "y", "x_dot", "y_dot"))
    settled = slice(100, None)
    q = np.stack([out["x"], out["y"]])[:, settled]
    v = np.stack([out["x_dot"], out["y_dot"]])[:, settled]
    unit = Boltzmann * temperature
    root = np.linalg.cholesky(stiffness / unit)
    # Whitened, both covariances are the identity. Damping of 0.64 d at least makes Q = 16 of the slower mode: 10 s hold
    # 10 s·ω/Q = 12 000 independent squares, five standard errors √(2/12 000) are 0.065. The held force takes
    # (ωΔ)²/12 = 7e-4.
    residual("displacement", np.max(np.abs(root.T @ (q @ q.T / q.shape[1]) @ root - np.eye(2))), 0.065)
    residual("velocity", np.max(np.abs(v @ v.T / v.shape[1] * M / unit - np.eye(2))), 0.065)
