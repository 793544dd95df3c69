"""What the game of the page hides: effects, by sizes that show in a run and that no nominal value would imitate."""

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from discrepancy.data.record import Floats, Record
from discrepancy.fit.simulate import Simulator
from discrepancy.trial_runs import RUNS, Tones, blank_run, draw_run
from gyro_model.device import Device
from gyrotwin.playing.sliders import Slider

SAMPLES: Final = 4000
"""Of a run: 20 ms, which the page computes anew at each move of a slider."""
RATE: Final = 200e3
"""Samples a second, as ``gyrotwin dataset simulate`` takes them."""
SEED: Final = 1
"""Of the drive: that of ``gyrotwin dataset simulate`` where nobody gives one."""
LEAST: Final = 0.02
MOST: Final = 0.4
"""Share of the voltage that a hidden effect makes up: seen at once, and nothing that a fit would lose its way in."""
OWN: Final = 0.005
"""Least share that no nominal parameter, moved a little, gives as well: some hundred times the noise."""
STEPS: Final = 7
"""Sizes tried of a parameter, two a decade."""
NOMINAL: Final = ("m", "kxx", "kyy", "kxy", "dxx", "dyy", "dxy", "sense_gain_x", "sense_gain_y")
NUDGE: Final = 1e-4
"""Relative step of a nominal parameter: small against LEAST, large against rounding."""


class Range(NamedTuple):
    """Sizes [SI] of a parameter that the game may hide, of either sign where ``signed``."""

    name: str
    low: float
    high: float
    signed: bool


class Experiment(NamedTuple):
    """The run of the game: force and rate [rad/s] of the first run of the data set."""

    tones: Tones
    omega_z: float

    @property
    def record(self) -> Record:
        """The run, its voltage not simulated yet."""
        return blank_run(np.arange(SAMPLES) / RATE, self.tones, self.omega_z, RATE)

    def data(self) -> dict[str, Any]:
        """As the page reads it."""
        tones = {"frequency": self.tones.frequency.T.tolist(), "phase": self.tones.phase.T.tolist()}
        size = float(self.tones.size)
        return {**tones, "size": size, "omega_z": self.omega_z, "samples": SAMPLES, "rate": RATE, "seed": SEED * RUNS}


def experiment_of(device: Device) -> Experiment:
    """What ``gyrotwin dataset simulate --device`` does first."""
    return Experiment(*draw_run(device.all_parameters, np.random.default_rng(SEED)))


def known_parameters(device: Device) -> dict[str, float]:
    """The device as it is known, at rest and without noise [SI]."""
    noise = {q.name: q.start for effect in device.model.effects if effect.noise for q in effect.sizes}
    return device.all_parameters | dict.fromkeys(device.model.start_of.values(), 0.0) | noise


def hideable(device: Device, experiment: Experiment, sliders: Sequence[Slider]) -> list[Range]:
    """Of the parameters with ``sliders`` those that can be hidden, in their order, measured on the FMU."""
    known, record = known_parameters(device), experiment.record
    sizes = {q.name for effect in device.model.effects if not effect.noise for q in effect.sizes}
    tried = [(s, value) for s in sliders if s.name in sizes for value in _sizes(s)]
    with Simulator(device.model) as simulator:
        plain = simulator.run(record, known)
        found = simulator.try_all([(record, {**known, s.name: value}) for s, value in tried])
        imitations = _imitations(simulator, record, known, plain)
    seen: dict[str, list[float]] = {}
    for (s, value), v in zip(tried, found, strict=True):
        if v is not None and _shows(v - plain, plain, imitations):
            seen.setdefault(s.name, []).append(value)
    by_name = {s.name: s for s in sliders}
    return [Range(n, float(min(v)), float(max(v)), by_name[n].low == -by_name[n].high) for n, v in seen.items()]


def _sizes(s: Slider) -> Floats:
    if s.scale == "limit":
        return np.geomspace(s.low, s.high, STEPS)
    return s.start + (s.high - s.start) * 10.0 ** (-np.arange(STEPS) / 2)


def _imitations(simulator: Simulator, record: Record, known: Mapping[str, float], plain: Floats) -> Floats:
    """An orthonormal basis of what small changes of nominal parameters do to the voltage, (2 n, k)."""
    # A coupling of zero is moved by a share of what it couples.
    of = {"kxy": known["kxx"], "dxy": known["dxx"]}
    jobs = [(record, {**known, name: known[name] + NUDGE * of.get(name, known[name])}) for name in NOMINAL]
    columns = [(v - plain).ravel() for v in simulator.try_all(jobs) if v is not None]
    return np.linalg.qr(np.array(columns).T)[0]


def _shows(change: Floats, plain: Floats, imitations: Floats) -> bool:
    flat = change.ravel()
    own = flat - imitations @ (imitations.T @ flat)
    share, share_alone = (float(np.linalg.norm(part) / np.linalg.norm(plain)) for part in (flat, own))
    return LEAST <= share <= MOST and share_alone >= OWN
