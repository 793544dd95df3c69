"""Friction, stops, films and couplings of the FMU against formulae from the textbook."""

from collections.abc import Callable

import numpy as np
import pytest
from gyro_runner import Runner
from scipy.integrate import quad, solve_ivp

Residual = Callable[[str, float, float], None]

M, K = 1.8e-7, 63.955
W = np.sqrt(K / M)
LOSSLESS = {"m": M, "kxx": K, "kyy": 95.92, "kxy": 0.0, "dxx": 0.0, "dyy": 0.0, "dxy": 0.0}
A = 1e-6
STEP = 5e-6


def extremes(out: dict[str, np.ndarray]) -> np.ndarray:
    """Turning points of x [m], from the sample before each: there the motion is that of k alone but for the friction,
    whose shift of the centre is of second order in the time to the turn."""
    speed = out["x_dot"]
    turns = np.flatnonzero(np.sign(speed[:-1]) != np.sign(speed[1:]))[1:]
    return np.hypot(out["x"][turns], speed[turns] / W)


# The second is far below what a step of 5 µs sees of a velocity of 19 mm/s.
@pytest.mark.parametrize("speed", [1e-4, 1e-6])
def test_coulomb_friction_takes_a_fixed_step_each_half_period(plant: Runner, residual: Residual, speed: float) -> None:
    f = 2e-3 * K * A
    t = np.arange(2001) * STEP
    out = plant.run({**LOSSLESS, "x_start": A, "friction_x": f, "friction_speed": speed}, t)
    falls = np.diff(extremes(out)) / (-2 * f / K)
    # Between turns the fall is 2 f/k exactly where v = 0; of a smoothed sign the share lost is of the order v/(A w),
    # 5e-3 and 5e-5, times its logarithm. Reading off a turn a sample before it adds f/k · (w Δt)²/2 = 4e-3 either way.
    residual("mean fall", abs(np.mean(falls) - 1), 1e-3 + 2 * speed / (A * W))
    residual("each fall", np.max(np.abs(falls - 1)), 1.5e-2 + 2 * speed / (A * W))


def test_friction_holds_what_the_spring_can_not_pull_off(plant: Runner) -> None:
    # k x = 0.5 f: the mass creeps at v atanh(0.5) at most, it does not swing.
    f = 2 * K * A
    t = np.arange(401) * STEP
    x = plant.run({**LOSSLESS, "x_start": A, "friction_x": f, "friction_speed": 1e-6}, t, outputs=("x",))["x"]
    assert A - 1e-6 * np.arctanh(0.5) * t[-1] - 1e-12 <= x[-1] < A


@pytest.mark.parametrize("speed", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("pushes", [0.95, 1.4])
def test_what_friction_holds_creeps_and_breaks_away_as_an_implicit_method_says(
    plant: Runner, residual: Residual, speed: float, pushes: float
) -> None:
    """Time constants m v/f from a 30th to a 300,000th of a step, by Radau's method of fifth order."""
    f, steps, rng = 1e-4, 60, np.random.default_rng(7)
    u = pushes * f * rng.uniform(-1, 1, steps)
    t = np.arange(steps + 1) * STEP
    own = {**LOSSLESS, "dxx": 1e-6, "friction_x": f, "friction_speed": speed}
    out = plant.run(own, t, {"u_x": np.append(u, 0.0)}, outputs=("x", "x_dot"))
    state, found = np.zeros(2), [np.zeros(2)]
    for force in u:

        def rates(_: float, s: np.ndarray, force: float = force) -> list[float]:
            return [s[1], (force - K * s[0] - 1e-6 * s[1] - f * np.tanh(s[1] / speed)) / M]

        scale = speed * STEP
        state = solve_ivp(rates, (0, STEP), state, "Radau", rtol=1e-11, atol=[1e-11 * scale, 1e-11 * speed]).y[:, -1]
        found.append(state)
    place = np.array(found)[:, 0]
    # Radau's own tolerance over sixty steps: 7e-11 is reached.
    residual("place", np.abs(out["x"] - place).max() / np.ptp(place), 1e-9)


def test_stribeck_adds_to_friction_near_rest(plant: Runner, residual: Residual) -> None:
    # On a soft spring the friction alone brakes: m dv/dt = -f (1 + s exp(-(v/v_s)²)), tanh being 1 above 40 v.
    f, excess, at, start, end = 1e-6, 0.8, 5e-3, 2e-2, 1e-3
    own = {"friction_x": f, "friction_y": 0.0, "friction_speed": 2e-5, "stribeck": excess, "stribeck_speed": at}
    soft = {**LOSSLESS, "kxx": 1e-13}
    brake, _ = quad(lambda v: M / (f * (1 + excess * np.exp(-((v / at) ** 2)))), end, start, epsrel=1e-13)
    t = np.linspace(0, brake, 101)
    speed = plant.run({**soft, "x_dot_start": start, **own}, t, outputs=("x_dot",))["x_dot"][-1]
    # Communication points are whole picoseconds: half of one at f/m and an excess of 1.8 is 5e-12 m/s.
    residual("speed", abs(speed - end) / end, 1e-8)


def rebound(plant: Runner, own: dict[str, float], gap: float) -> float:
    """Speed away from the stop [m/s] just after it; no suspension to speak of."""
    t = np.arange(2001) * 5e-8
    out = plant.run({**LOSSLESS, "kxx": 1e-6, "stop_gap": gap, "x_start": gap, **own}, t, outputs=("x", "x_dot"))
    free = 1 + int(np.argmax(out["x"][1:] < gap))
    return float(-out["x_dot"][free])


def test_stop_gives_back_what_it_takes(plant: Runner, residual: Residual) -> None:
    speed = 2.0
    back = rebound(plant, {"stop_stiffness": 1e3, "x_dot_start": speed}, 1e-6)
    # Each part of a step is good to 1e-12 of the motion; the contact takes a hundred of them.
    residual("rebound", abs(back / speed - 1), 1e-10)


@pytest.mark.parametrize("ratio", [0.1, 0.5])
def test_stop_with_damper_has_the_restitution_of_spring_and_dashpot(
    plant: Runner, residual: Residual, ratio: float
) -> None:
    # e = exp(-π ζ/√(1 - ζ²)) when spring and dashpot let go at no depth (G. Gilardi, I. Sharf, 2002).
    speed, stiffness = 2.0, 1e3
    own = {"stop_stiffness": stiffness, "stop_damping": 2 * ratio * np.sqrt(stiffness * M), "x_dot_start": speed}
    back = rebound(plant, own, 1e-6)
    wanted = np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2))
    # The stop takes hold over w = 16 nm of a depth of v √(m/k) = 27 µm: 6e-4 on the way in, w over what is left of the
    # speed more on the way out.
    residual("restitution", abs(back / speed / wanted - 1), 6e-4 * (1 + 1 / wanted))


def test_nothing_is_felt_before_the_stop(plant: Runner) -> None:
    t = np.arange(401) * STEP
    own = {**LOSSLESS, "x_start": A, "kxy": 1.0}
    free = plant.run({**own, "k3_x": 1e-30}, t)
    near = plant.run({**own, "k3_x": 1e-30, "stop_stiffness": 1e5, "stop_gap": 1.0001 * A, "stop_damping": 1.0}, t)
    assert all(np.array_equal(free[name], near[name]) for name in free)


def test_squeeze_film_decays_by_its_mean_over_the_cycle(plant: Runner, residual: Residual) -> None:
    # A' = -A/(2m) · (1/π) ∫ d sin²φ/(1 - (A/g)² cos²φ)^1.5 dφ over the circle.
    d, gap = 2e-6, 1.5e-6

    def rate(amplitude: float) -> float:
        mean, _ = quad(lambda p: np.sin(p) ** 2 / (1 - (amplitude / gap * np.cos(p)) ** 2) ** 1.5, 0, 2 * np.pi)
        return float(-amplitude * d * mean / (2 * M * np.pi))

    t = np.arange(0, 0.04, 1e-4)
    out = plant.run({**LOSSLESS, "x_start": A, "squeeze_x": d, "squeeze_gap": gap}, t)
    amplitude = np.hypot(out["x"], out["x_dot"] / W)
    expected = np.empty_like(t)
    expected[0] = A
    for k in range(len(t) - 1):
        half = expected[k] + 0.5e-4 * rate(expected[k])
        expected[k + 1] = expected[k] + 1e-4 * rate(half)
    # Ripple within a cycle, of the order of the loss per radian d/(m ω) = 6e-4.
    residual("amplitude", np.max(np.abs(amplitude - expected)) / A, d / (M * W))
    assert expected[-1] < 0.8 * A * np.exp(-d * t[-1] / (2 * M)) / np.exp(0) + 0.2 * A


def test_cross_cubic_stiffness_is_half_a_square(plant: Runner, residual: Residual) -> None:
    # A faint x beside y of amplitude A: k_x = kxx + ½ k22 A², where the modes lie far apart.
    shift = 2e-3
    k22 = 2 * shift * K / A**2
    t = np.arange(4001) * STEP
    out = plant.run({**LOSSLESS, "kyy": 3.1 * K, "y_start": A, "x_start": 1e-4 * A, "k22": k22}, t)
    phase = np.unwrap(np.arctan2(-out["x_dot"] / W, out["x"]))
    slope = np.polyfit(t, phase, 1)[0] / W
    # Second order: -shift²/8 of the square root and (shift/4)² of the parametric part, over 2.5 and 4.5.
    residual("frequency", abs(slope - np.sqrt(1 + shift)), 2 * shift**2)


def test_constant_force_moves_the_centre(plant: Runner, residual: Residual) -> None:
    # From rest: x = F/k (1 - cos ωt).
    f = 1e-6
    t = np.arange(401) * STEP
    out = plant.run({**LOSSLESS, "force_x": f, "force_y": -2 * f}, t)
    # Rounding, as of the free oscillation.
    residual("x", np.max(np.abs(out["x"] - f / K * (1 - np.cos(W * t)))) / (f / K), 1e-12)
    w_y = np.sqrt(95.92 / M)
    residual("y", np.max(np.abs(out["y"] + 2 * f / 95.92 * (1 - np.cos(w_y * t)))) / (f / K), 1e-12)


def test_comb_fringe_under_a_steady_force_is_a_spring(plant: Runner, residual: Residual) -> None:
    # u (1 + c x): k falls by c u, about the point u/(k - c u).
    u, c = 2e-5, 1e5
    t = np.arange(401) * STEP
    force = {"u_x": np.full(401, u)}
    x = plant.run({**LOSSLESS, "comb_fringe": c}, t, force, outputs=("x",))["x"]
    k = K - c * u
    residual("motion", np.max(np.abs(x - u / k * (1 - np.cos(np.sqrt(k / M) * t)))) / (u / k), 1e-12)


def test_hysteresis_on_the_first_way_is_an_exponential(plant: Runner, residual: Residual) -> None:
    # n = 1, β + γ = 1: z = 1 - e^(-x/L) while x grows, so m v²/2 falls by h (x - L (1 - e^(-x/L))).
    h, length, speed = 1e-6, 3e-7, 2e-2
    own = {"hysteresis_x": h, "hysteresis_length": length, "x_dot_start": speed}
    out = plant.run({**LOSSLESS, "kxx": 1e-13, **own}, np.arange(401) * STEP, outputs=("x", "x_dot"))
    x = out["x"]
    wanted = np.sqrt(speed**2 - 2 * h / M * (x - length * (1 - np.exp(-x / length))))
    # A step is good to 1e-12 of what moves in it; 400 of them.
    residual("speed", np.max(np.abs(out["x_dot"] - wanted)) / speed, 1e-10)
    assert wanted[-1] < 0.9 * speed


@pytest.mark.parametrize("sharpness", [1.0, 2.0])
def test_hysteresis_loses_the_area_of_its_loop(plant: Runner, residual: Residual, sharpness: float) -> None:
    # The loop of x = A cos φ by quadrature, whatever the frequency; it takes m w² A ΔA a period.
    h, length = 1e-3 * K * A, 0.2 * A
    own = {"hysteresis_x": h, "hysteresis_length": length, "hysteresis_n": sharpness}
    t = np.arange(4001) * STEP
    turns = extremes(plant.run({**LOSSLESS, "x_start": A, **own}, t))[::2]
    number = len(turns) // 2
    amplitude = turns[number]
    phases = np.linspace(0, 6 * np.pi, 600_001)
    x, z, area = amplitude * np.cos(phases), 0.0, 0.0
    for k in range(len(x) - 1):
        way = x[k + 1] - x[k]
        middle = z
        for _ in range(2):
            bend = abs(way) * abs(middle) ** (sharpness - 1) * middle + way * abs(middle) ** sharpness
            middle = z + 0.5 * (way - 0.5 * bend) / length
        if k >= 400_000:
            area += h * middle * way
        z = 2 * middle - z
    fall = (turns[number - 5] - turns[number + 5]) / 10
    # The fall of 3e-3 A a period bends the loop of the middle by its square.
    residual("loss", abs(K * amplitude * fall / area - 1), 5e-3)
