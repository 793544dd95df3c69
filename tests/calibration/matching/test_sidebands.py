"""The pole from both sides of a dither, against the exact equation of motion."""

from cmath import exp
from math import pi

import numpy as np
import pytest

from calibration.matching import Sensed, find_pole
from gyro_model.errors import InputError

F, TONE, PERIOD, COUNT = 5123.0, 60.0, 2e-5, 40_000
MASS = 2e-8


def answers(split: float, q: float, line: float = 0.0, noise: float = 0.0, seed: int = 1) -> Sensed:
    """Settled v_y and force around the drive: y'' + (ω_y/Q) y' + ω_y² y = u/m, both tones each by its own gain at its
    own frequency (a second derivation: no pole, no frame). Images of the held force, of order (νT)², are left out."""
    omega, own = 2 * pi * F, 2 * pi * (F + split)
    t = PERIOD * np.arange(COUNT)
    voltage = np.full(COUNT, line, complex)
    force = np.zeros(COUNT, complex)
    for side in (1, -1):
        w = omega + side * 2 * pi * TONE
        turn = np.exp(2j * pi * side * TONE * t)
        force += -1j * turn
        # A force held over the period is sinc(νT/2) of the continuous one and half a period late.
        held = np.sinc(TONE * PERIOD) * exp(-1j * pi * side * TONE * PERIOD)
        voltage += -1j * turn * held / (MASS * (own**2 - w**2 + 1j * w * own / q))
    rng = np.random.default_rng(seed)
    voltage += noise * (rng.standard_normal(COUNT) + 1j * rng.standard_normal(COUNT))
    return Sensed(PERIOD, 0.0, voltage, force, np.full(COUNT, F))


@pytest.mark.parametrize("split", [-8.0, -0.5, 0.0, 3.0])
@pytest.mark.parametrize("q", [500.0, 5000.0, 20_000.0])
def test_split_is_that_of_the_equation_of_motion(split: float, q: float) -> None:
    found = find_pole(answers(split, q), TONE)
    # What the images left out above make, at the widest line; a thirtieth of what is asked of the match.
    assert found.split(F) == pytest.approx(split, abs=1e-4 * abs(split) + 1.5e-4)
    assert found.value.real == pytest.approx(-pi * F / q, rel=0.02)


def test_a_line_at_the_drive_frequency_changes_nothing() -> None:
    # Whole periods and a Hann window: no more than rounding leaks from a line 100 times as strong.
    clean = answers(1.0, 2000.0)
    strong = 100 * float(np.abs(clean.voltage).max())
    assert find_pole(answers(1.0, 2000.0, strong), TONE).split(F) == pytest.approx(
        find_pole(clean, TONE).split(F), abs=1e-9
    )


def test_neither_gain_nor_phase_of_the_chain_needs_to_be_known() -> None:
    clean = answers(0.0, 2000.0)
    turned = clean._replace(voltage=clean.voltage * 0.83 * exp(0.3j))
    assert find_pole(turned, TONE).split(F) == pytest.approx(find_pole(clean, TONE).split(F), abs=1e-12)


def test_a_delay_moves_the_damping_and_not_the_match() -> None:
    clean = answers(0.0, 2000.0)
    late = find_pole(clean._replace(voltage=np.roll(clean.voltage, 2)), TONE)
    # 40 µs at 60 Hz turns one side by -0.0151 rad and the other by 0.0151: p moves by ν tan 0.0151 along the reals.
    angle = 2 * pi * TONE * 2 * PERIOD
    assert late.value.real - find_pole(clean, TONE).value.real == pytest.approx(2 * pi * TONE * angle, rel=0.02)
    assert late.split(F) == pytest.approx(0.0, abs=3e-4)


def test_a_wobble_of_the_oscillator_drops_out() -> None:
    clean = answers(0.0, 2000.0, line=100.0)
    wobble = 1e-4 * np.sin(2 * pi * TONE * PERIOD * np.arange(COUNT))
    turn = np.exp(-1j * wobble)
    frequency = F + np.diff(wobble, append=wobble[0]) / (2 * pi * PERIOD)
    seen = clean._replace(voltage=clean.voltage * turn, force=clean.force * turn, frequency=frequency)
    unaware = seen._replace(frequency=clean.frequency)
    off = abs(find_pole(seen, TONE).split(F) - find_pole(clean, TONE).split(F))
    assert off < 0.2 * abs(find_pole(unaware, TONE).split(F) - find_pole(clean, TONE).split(F))


def test_deviation_is_what_noise_makes() -> None:
    level = 1e-3 * float(np.abs(answers(0.0, 2000.0).voltage).max())
    found = [find_pole(answers(0.0, 2000.0, noise=level, seed=seed), TONE) for seed in range(60)]
    error = np.array([pole.value.imag for pole in found])
    said = np.sqrt(np.mean([pole.deviation**2 for pole in found]))
    # 60 errors give their deviation to 9 %: three of that.
    assert error.std() == pytest.approx(said, rel=0.27)


def test_a_short_block_is_refused() -> None:
    short = answers(0.0, 2000.0)
    short = short._replace(**{name: getattr(short, name)[:10_000] for name in ("voltage", "force", "frequency")})
    with pytest.raises(InputError, match="12 periods of the dither"):
        find_pole(short, TONE)
