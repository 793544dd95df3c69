"""Location of disagreement: nothing on noise, thermal motion included; what is put in comes out where it was put."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from discrepancy.data.conditions import split
from discrepancy.data.record import Record, make_record
from discrepancy.fit.locate import Place, bands, drive_tones, located

RATE = 200_000.0
LENGTH = 20_000
NOISE = 2e-5
P = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
     "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip
T = np.arange(LENGTH) / RATE
LOWER, UPPER = 2893.0, 3759.0
"""The coupled modes [Hz] of the reference device."""


def run(number: int, rng: np.random.Generator, temperature: np.ndarray | None = None) -> Record:
    """A run driven over the modes; the motion (0.5 µm, its level turning with the runs) only sets amplitudes."""
    f = rng.uniform(200, 6000, (12, 2))
    u = 1e-5 * np.sin(2 * np.pi * f * T[:, None, None] + rng.uniform(0, 6.28, (12, 2))).sum(axis=1)
    level = (0.2 + 0.2 * number) * (1 + 0.8 * np.sin(2 * np.pi * 23 * T + rng.uniform(0, 6.28)))
    v = level[:, None] * np.sin(2 * np.pi * np.array([LOWER, UPPER]) * T[:, None])
    held = {} if temperature is None else {"temperature": temperature}
    return make_record(f"run-{number}", T, u, v, sample_rate=RATE, conditions=held)


def white(rng: np.random.Generator) -> np.ndarray:
    return NOISE * rng.standard_normal((LENGTH, 2))


def thermal(rng: np.random.Generator) -> np.ndarray:
    """Voltage of the thermal motion at 298.15 K beside a fitted initial state, so from rest; it settles to <q qᵀ> = kT
    K⁻¹ and <q' q'ᵀ> = kT/m (equipartition)."""
    k = np.array([[P["kxx"], P["kxy"]], [P["kxy"], P["kyy"]]])
    d = np.array([[P["dxx"], P["dxy"]], [P["dxy"], P["dyy"]]])
    rate = np.block([[np.zeros((2, 2)), np.eye(2)], [-k / P["m"], -d / P["m"]]])
    energy = 1.380649e-23 * 298.15
    covariance = np.block([[energy * np.linalg.inv(k), np.zeros((2, 2))],
                           [np.zeros((2, 2)), energy / P["m"] * np.eye(2)]])  # fmt: skip
    scale = np.sqrt(np.diag(covariance))
    step = expm(rate / RATE) * scale / scale[:, None]
    unit = covariance / np.outer(scale, scale)
    # What the decay takes away in a step comes back as noise; its rank is 2, hence the clipped eigenvalues.
    values, vectors = np.linalg.eigh(unit - step @ unit @ step.T)
    root = vectors * np.sqrt(np.maximum(values, 0))
    shocks = rng.standard_normal((LENGTH, 4)) @ root.T
    state = np.zeros(4)
    out = np.empty((LENGTH, 2))
    for i in range(LENGTH):
        out[i] = state[:2]
        state = step @ state + shocks[i]
    return out * scale[:2] * P["sense_gain_x"]


def found(extra: list[np.ndarray], records: list[Record], rng: np.random.Generator) -> tuple[Place, ...]:
    return located([white(rng) + e for e in extra], records, P)


def false_discoveries(seeds: range, *, coloured: bool) -> int:
    """Null sets of three runs in which anything at all was located."""
    count = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        records = [run(n, rng) for n in range(3)]
        extra = [thermal(rng) if coloured else np.zeros((LENGTH, 2)) for _ in records]
        count += bool(found(extra, records, rng))
    return count


@pytest.mark.parametrize("coloured", [False, True])
def test_nothing_on_noise(coloured: bool) -> None:
    # Of 100 sets each 0 to 2 are expected at a rate of 1 %; more than two of eight has a chance of 5e-5.
    assert false_discoveries(range(8), coloured=coloured) <= 2


def test_a_tone_is_found_where_and_when_it_sounds() -> None:
    rng = np.random.default_rng(3)
    records = [run(n, rng) for n in range(3)]
    extra = [np.zeros((LENGTH, 2)) for _ in records]
    sounds = (T >= 0.05) & (T < 0.07)
    extra[1][sounds, 1] = 1e-4 * np.sin(2 * np.pi * 3 * UPPER * T[sounds])
    [place] = found(extra, records, rng)
    assert (place.run, place.channel) == ("run-1", "v_y")
    assert place.f[0] <= 3 * UPPER <= place.f[1]
    # A run of 0.1 s has sixteen or more blocks: 6 ms at either end.
    assert place.t == pytest.approx((0.05, 0.07), abs=0.007)
    # 1e-4²/2 over 4000 of 120,000 samples beside 2e-5²; noise within the band adds some per cent.
    power = 5e-9 * 4000
    assert place.share == pytest.approx(power / (power + NOISE**2 * 6 * LENGTH), rel=0.1)


def test_the_condition_is_named() -> None:
    rng = np.random.default_rng(5)
    ramp = np.linspace(290.0, 330.0, LENGTH)
    records = [run(n, rng, ramp) for n in range(3)]
    hot = np.where(ramp > 310, 1e-4, 0.0)[:, None]
    places = found([hot * np.sin(2 * np.pi * 1500 * T)[:, None] for _ in records], records, rng)
    assert places
    for place in places:
        assert place.condition.startswith("temperature above 3"), place
        assert abs(float(place.condition.split()[2]) - 310) <= 5
        assert place.t[0] > 0.04


def test_amplitude_is_the_condition_of_a_third_harmonic() -> None:
    rng = np.random.default_rng(7)
    records = [run(n, rng) for n in range(3)]
    places = found([3e-4 * r.v**3 for r in records], records, rng)
    assert any(p.f[0] <= 3 * LOWER <= p.f[1] and p.condition.startswith("amplitude above") for p in places)
    assert len(places) <= 20
    assert sum(p.share for p in places) <= 1


def test_bands_cover_everything_once() -> None:
    rng = np.random.default_rng(1)
    edges = bands([run(0, rng)], P)
    assert edges[0][0] == 0 and edges[-1][1] == RATE / 2
    assert all(a[1] == b[0] for a, b in itertools.pairwise(edges))
    assert any(low <= LOWER <= high < 3 * LOWER for low, high in edges)


def test_tones_of_the_drive() -> None:
    u = np.stack([np.sin(2 * np.pi * 450 * T), np.sin(2 * np.pi * 900 * T)], axis=1)
    record = make_record("tones", T, u, u, sample_rate=RATE)
    # Half a bin of the run: 5 Hz.
    assert drive_tones([record]) == pytest.approx([450, 900], abs=5)
    assert drive_tones([run(0, np.random.default_rng(2))]) == []


def test_split_between_two_levels() -> None:
    values = np.arange(80.0)
    chosen = split("temperature", values, np.where(values < 30, 1.0, 5.0), rising=True)
    # Bins of ten: the level changes at the edge of one.
    assert chosen.threshold == pytest.approx(30, abs=1)
    assert str(split("amplitude", values * 1e-8, values + 1, rising=True)) == "amplitude above 197 nm"


def test_nothing_in_an_exact_residual() -> None:
    rng = np.random.default_rng(1)
    assert located([np.zeros((LENGTH, 2))], [run(0, rng)], P) == ()


if __name__ == "__main__":
    for colour in (False, True):
        print(Path(__file__).stem, "coloured" if colour else "white", false_discoveries(range(100), coloured=colour))
