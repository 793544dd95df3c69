"""What may be hidden: every nameable effect, its sizes, its host experiment and its limits."""

import math
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np

from benchmarks.blind.physics import Plant


class Scale(NamedTuple):
    """How large things are in a data set without the effect: q, velocity, force, voltage, bias, kelvin over t_ref,
    acceleration (largest, SI), rate (largest, rad/s), duration (shortest run, s), omega (highest mode, rad/s)."""

    q: float
    u: float
    v: float
    bias: float
    warm: float
    duration: float
    omega: float
    low: float


Shape = Callable[[np.random.Generator, Plant, Scale], Mapping[str, float]]


def no_shape(rng: np.random.Generator, plant: Plant, scale: Scale) -> Mapping[str, float]:
    """Of effects without shape parameters."""
    return {}


def _step_time(rng: np.random.Generator, plant: Plant, scale: Scale) -> Mapping[str, float]:
    return {"damping_step_time": scale.duration * rng.uniform(0.25, 0.7)}


def _parasitic(rng: np.random.Generator, plant: Plant, scale: Scale) -> Mapping[str, float]:
    """A mode below, between or above the two, nowhere nearer than 4 % to one of them."""
    while True:
        frequency = rng.uniform(0.6 * scale.low, 1.5 * scale.omega)
        if min(abs(frequency / scale.low - 1), abs(frequency / scale.omega - 1)) > 0.04:
            return {"parasitic_frequency": frequency / (2 * math.pi), "parasitic_q": 10 ** rng.uniform(2.3, 3.5)}


def _charging(rng: np.random.Generator, plant: Plant, scale: Scale) -> Mapping[str, float]:
    return {"charging_time": scale.duration * rng.uniform(0.2, 2.0)}


def _gap(rng: np.random.Generator, plant: Plant, scale: Scale) -> Mapping[str, float]:
    return {"electrode_gap": scale.q * 10 ** rng.uniform(0.3, 1.2)}


def _film(rng: np.random.Generator, plant: Plant, scale: Scale) -> Mapping[str, float]:
    return {"squeeze_gap": scale.q * 10 ** rng.uniform(0.1, 0.8)}


def _stop(rng: np.random.Generator, plant: Plant, scale: Scale) -> Mapping[str, float]:
    return {"stop_gap": scale.q * rng.uniform(0.6, 0.95)}


def _friction(rng: np.random.Generator, plant: Plant, scale: Scale) -> Mapping[str, float]:
    speed = scale.q * scale.omega
    excess = rng.uniform(0.2, 1.0) * rng.integers(2)
    return {"friction_speed": speed * 10 ** rng.uniform(-2, -0.3), "stribeck": float(excess),
            "stribeck_speed": speed * 10 ** rng.uniform(-1, -0.3)}  # fmt: skip


def _hysteresis(rng: np.random.Generator, plant: Plant, scale: Scale) -> Mapping[str, float]:
    """Half of them with another sharpness, half with other shares of the limit."""
    sharp = 1 + rng.uniform(0.3, 2.0) * rng.integers(2)
    loss = 0.5 + rng.uniform(-0.4, 0.5) * rng.integers(2)
    return {"hysteresis_length": scale.q * 10 ** rng.uniform(-1.2, 0.3), "hysteresis_n": float(sharp),
            "hysteresis_beta": float(loss), "hysteresis_gamma": float(1 - loss)}  # fmt: skip


class Effect(NamedTuple):
    """One row of the table. sizes: its parameters that are zero (or ``base``) without it; host: the columns of the
    experiment that it needs; cap: the largest size that is sane and stable; signs: of the size; partner: what has to
    be there for it to act, as id, parameter and size of the partner relative to its cap; least: the smallest size that
    a step a sample resolves."""

    id: str
    sizes: tuple[str, ...]
    cap: Callable[[Plant, Scale], float]
    host: tuple[str, ...] = ()
    shape: Shape = no_shape
    base: float = 0.0
    signs: tuple[int, ...] = (1, -1)
    partner: tuple[str, str, float] | None = None
    least: Callable[[Scale], float] = lambda s: 0.0

    def placed(self, plant: Plant, size: float, direction: tuple[float, ...], scale: Scale) -> Plant:
        """``plant`` with the effect at ``size``; of adc_clipping that is the depth below the largest voltage [V]."""
        if self.id == "adc_clipping":
            return plant._replace(adc_limit=scale.v - size)
        return plant._replace(**{name: self.base + size * d for name, d in zip(self.sizes, direction, strict=True)})


def _stiff(p: Plant) -> float:
    return min(p.kxx, p.kyy)


EFFECTS: Final = (
    Effect("cubic_stiffness", ("k3_x", "k3_y"), lambda p, s: 0.2 * _stiff(p) / s.q**2),
    Effect("quadratic_stiffness", ("k2_x", "k2_y"), lambda p, s: 0.2 * _stiff(p) / s.q),
    Effect("electrostatic_softening", ("softening",), lambda p, s: 0.2 * _stiff(p) / max(s.bias, 1.0) ** 2,
           host=("v_bias",), shape=_gap, signs=(1,)),
    Effect("nonlinear_damping", ("d2_x", "d2_y"), lambda p, s: 0.1 * math.sqrt(_stiff(p) * p.m) / s.q**2, signs=(1,)),
    Effect("damping_step", ("damping_step_factor",), lambda p, s: 4.0, shape=_step_time, base=1.0, signs=(1,)),
    Effect("angular_gain", ("angular_gain",), lambda p, s: 0.9, host=("omega_z",), base=1.0, signs=(-1,)),
    Effect("frame_rotation", ("frame_rotation",), lambda p, s: 3.0, host=("omega_z",), signs=(1,)),
    Effect("linear_acceleration", ("acceleration_gain_x", "acceleration_gain_y"), lambda p, s: 3.0,
           host=("acceleration",)),
    Effect("thermal_stiffness", ("tck", "tck_split"), lambda p, s: 0.1 / max(s.warm, 1.0), host=("temperature",)),
    Effect("thermal_damping", ("tcd",), lambda p, s: 0.7 / max(s.warm, 1.0), host=("temperature",)),
    Effect("thermal_gain", ("tcg",), lambda p, s: 0.3 / max(s.warm, 1.0), host=("temperature",)),
    Effect("thermal_phase", ("tcp",), lambda p, s: 0.5 / s.omega / max(s.warm, 1.0), host=("temperature",),
           signs=(1,)),
    Effect("thermal_lag", ("structure_lag",), lambda p, s: 0.5 * s.duration, host=("temperature",), signs=(1,),
           partner=("thermal_stiffness", "tck", 0.1), least=lambda s: 1e-3 * s.duration),
    Effect("parasitic_mode", ("parasitic_coupling",),
           lambda p, s: 0.2 * math.sqrt(_stiff(p) * p.m) * 2 * math.pi * p.parasitic_frequency, shape=_parasitic,
           signs=(1,)),
    Effect("actuator_nonlinearity", ("actuator_a2", "actuator_a3"), lambda p, s: 0.2 / s.u**2),
    Effect("actuator_gain_mismatch", ("actuator_gain_mismatch",), lambda p, s: 0.3),
    Effect("actuator_misalignment", ("actuator_misalignment",), lambda p, s: 0.2),
    Effect("actuator_delay", ("actuator_delay",), lambda p, s: 1e-3, signs=(1,)),
    Effect("pickoff_misalignment", ("pickoff_misalignment",), lambda p, s: 0.2),
    Effect("pickoff_nonlinearity", ("pickoff_inverse_gap",), lambda p, s: 0.5 / s.q, signs=(1,)),
    Effect("pickoff_mismatch", ("pickoff_mismatch",), lambda p, s: 0.8,
           partner=("pickoff_nonlinearity", "pickoff_inverse_gap", 0.2)),
    Effect("pickoff_gain_mismatch", ("pickoff_gain_mismatch",), lambda p, s: 0.3),
    Effect("drive_feedthrough", ("feedthrough",), lambda p, s: s.v / s.u),
    Effect("amplifier_bandwidth", ("amplifier_time_constant",), lambda p, s: 1 / s.omega, signs=(1,)),
    Effect("amplifier_offset", ("offset_x", "offset_y"), lambda p, s: 0.5 * s.v),
    Effect("amplifier_drift", ("offset_drift",), lambda p, s: 0.5 * s.v / s.duration),
    Effect("dielectric_charging", ("charging_voltage",), lambda p, s: s.bias, host=("v_bias",), shape=_charging,
           partner=("electrostatic_softening", "softening", 0.1)),
    Effect("adc_clipping", ("adc_limit",), lambda p, s: 0.5 * s.v, signs=(1,)),
)  # fmt: skip
"""adc_clipping's size is the depth of the limit below the largest voltage of the fitted runs."""
MORE: Final = (
    Effect("dry_friction", ("friction_x", "friction_y"), lambda p, s: 0.05 * _stiff(p) * s.q, shape=_friction,
           signs=(1,)),
    Effect("constant_force", ("force_x", "force_y"), lambda p, s: 0.3 * _stiff(p) * s.q),
    Effect("cross_cubic_stiffness", ("k22",), lambda p, s: 0.2 * _stiff(p) / s.q**2),
    Effect("contact_stop", ("stop_stiffness",), lambda p, s: 20 * _stiff(p), shape=_stop, signs=(1,)),
    Effect("squeeze_film", ("squeeze_x", "squeeze_y"), lambda p, s: 0.1 * math.sqrt(_stiff(p) * p.m), shape=_film,
           signs=(1,)),
    Effect("play", ("play",), lambda p, s: 0.3 * s.u, signs=(1,)),
    Effect("hysteresis", ("hysteresis_x", "hysteresis_y"), lambda p, s: 0.05 * _stiff(p) * s.q, shape=_hysteresis,
           signs=(1,)),
    Effect("comb_fringe", ("comb_fringe",), lambda p, s: 0.3 / s.q),
)  # fmt: skip
"""Effects that came later: pairs and triples are drawn from those above, so that their names keep their data."""
BY_ID: Final = {effect.id: effect for effect in (*EFFECTS, *MORE)}


def direction(effect: Effect, rng: np.random.Generator, units: tuple[float, ...]) -> tuple[float, ...]:
    """How the size is shared among the parameters: the largest share 1, signs as the effect allows. ``units``: what
    one of each is worth, so that all of them show."""
    share = rng.uniform(0.3, 1.0, len(effect.sizes)) * rng.choice(effect.signs, len(effect.sizes)) * np.array(units)
    return tuple((share / np.abs(share).max()).tolist())


def units(effect: Effect, scale: Scale) -> tuple[float, ...]:
    """Sizes of the parameters of one effect that do about the same: a3 u² against a2 u."""
    return (1.0, 1 / scale.u) if effect.id == "actuator_nonlinearity" else (1.0,) * len(effect.sizes)
