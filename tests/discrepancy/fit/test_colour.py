"""The colour of a noise: known recursions are found where the device does not move, and nothing where there is none."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from discrepancy.fit.colour import ORDERS, _fitted, autoregression, gain, predicted_out, response
from discrepancy.fit.whitening import Setting, likeliest

N, RUNS, PERIOD = 8000, 3, 5e-6
DEVICE = {"m": 1.8e-7, "kxx": 63.955, "kyy": 95.92, "kxy": 12.779, "dxx": 1.8e-6, "dyy": 1.8e-6, "dxy": 3.6e-7,
          "sense_gain_x": 1e6, "sense_gain_y": 1e6}  # fmt: skip
T = np.arange(N) * PERIOD
VALID = np.ones(N, np.bool_)
RED = (1.0,), (1.0, -0.9)
BLUE = (1.0,), (1.0, 0.6)
LOW = butter(2, 0.2)


def moved(rng: np.random.Generator) -> np.ndarray:
    """A motion of 30 tones about the modes, 10,000 times the noise."""
    f = rng.uniform(1500, 6000, (30, 2))
    return np.asarray(0.1 * np.sin(2 * np.pi * f * T[:, None, None] + rng.uniform(0, 6.28, (30, 2))).sum(axis=1))


def found(noises: list[np.ndarray], missing: int = 0) -> tuple[float, ...]:
    rng = np.random.default_rng(7)
    valid = VALID.copy()
    valid[rng.choice(N, missing, replace=False)] = False
    return autoregression([moved(rng) + e for e in noises], noises, [valid] * len(noises))


def noises(b: tuple[float, ...], a: tuple[float, ...], more: float = 0.0) -> list[np.ndarray]:
    rng = np.random.default_rng(2)
    white = [2e-5 * rng.standard_normal((N, 2)) for _ in range(RUNS)]
    return [lfilter(b, a, e, axis=0) + more * rng.standard_normal((N, 2)) for e in white]


@pytest.mark.parametrize(("b", "a"), [RED, BLUE])
@pytest.mark.parametrize("missing", [0, 10])
def test_a_recursion_of_first_order_comes_back(b: tuple[float, ...], a: tuple[float, ...], missing: int) -> None:
    # Of 12,000 bins a number of 0.9 is sure to sqrt((1 - 0.9²)/12,000) = 4e-3, one of 0.6 to 7e-3; a median asks twice.
    assert found(noises(b, a), missing) == pytest.approx([-a[1]], abs=0.03)
    assert gain((-a[1],)) == pytest.approx(1 / (1 - a[1] ** 2), rel=1e-3)  # a mean over 4096 angles


def test_filtered_noise_has_its_density() -> None:
    own = found(noises(*LOW, more=2e-6))
    turns = np.linspace(0.02, np.pi - 0.1, 50)
    truth = np.abs(np.polyval(LOW[0][::-1], np.exp(-1j * turns)) / np.polyval(LOW[1][::-1], np.exp(-1j * turns))) ** 2
    # The level is free; 12 dB of a fall over three decades is what eight numbers can be off.
    ratio = 10 * np.log10((truth + 0.01) * np.abs(response(own, turns)) ** 2)
    assert np.ptp(ratio) < 12


@pytest.mark.parametrize("kind", ["white", "harmonics", "steps of a converter", "no noise"])
def test_nothing_is_found_where_nothing_is(kind: str) -> None:
    own = noises((1.0,), (1.0,))
    sine = np.sin(2 * np.pi * 3000 * T)[:, None] * np.ones(2)
    if kind == "harmonics":
        own = [e + 1e-3 * sine**3 for e in own]
    if kind == "steps of a converter":
        own = [np.round((0.3 * sine + 10 * e) / 1e-3) * 1e-3 - 0.3 * sine for e in own]
    if kind == "no noise":
        own = [1e-3 * sine**3 for _ in own]
    assert found(own) == ()


@pytest.mark.parametrize("samples", [100, 300, 600])
def test_short_pieces_have_a_colour_or_none(samples: int) -> None:
    rng = np.random.default_rng(3)
    red = [lfilter(*RED, rng.standard_normal((samples, 1)), axis=0) for _ in range(4)]
    still = [e + 1e-3 * rng.standard_normal(e.shape) for e in red]
    own = autoregression(still, red, [np.ones(samples, np.bool_)] * 4)
    assert own == () if samples < 512 else own[0] > 0.5


def test_predictions_are_those_of_the_recursion() -> None:
    numbers = (0.5, -0.3, 0.2)
    white = np.random.default_rng(4).standard_normal((2, N, 2))
    v = lfilter([1], [1, *(-n for n in numbers)], white, axis=1)
    np.testing.assert_allclose(predicted_out(v, VALID, numbers), white, atol=1e-12)  # rounding of sums of four
    holed = VALID.copy()
    holed[100:103] = False
    own = predicted_out(v, holed, numbers)
    assert not own[:, 100:103].any()
    # After three samples that were predicted all that they say is the same for any order of three again from the sixth.
    np.testing.assert_allclose(own[:, 106:], white[:, 106:], atol=1e-12)
    out = v.copy()
    assert predicted_out(out, VALID, numbers, out) is out


def test_colour_and_flicker_are_told_apart() -> None:
    rng = np.random.default_rng(5)
    f = np.fft.rfftfreq(16 * N, PERIOD)
    density = np.divide(5e-6**2, f, out=np.zeros_like(f), where=f >= 1)
    shaped = np.fft.rfft(rng.standard_normal((16 * N, 2)), axis=0) * np.sqrt(density / (2 * PERIOD))[:, None]
    flicker = np.fft.irfft(shaped, 16 * N, axis=0)[:N] + 2e-5 * rng.standard_normal((N, 2))
    red = noises(*RED)[0]
    for noise, expected in ((flicker, False), (red, True)):
        colour = autoregression([moved(rng) + noise], [noise], [VALID])
        setting: Setting = likeliest(DEVICE, PERIOD, [noise], [VALID], colour=colour).setting
        assert (setting.colour != ()) == expected
        assert (setting.corner > 0) != expected


@pytest.mark.parametrize("lines", [(64,), (64, 128), (1, 64, 128, 192)])
def test_a_density_of_lines_has_no_autoregression(lines: tuple[int, ...]) -> None:
    density = np.full(256, 1e-30)
    density[list(lines)] = 1.0
    # A line is predicted by two numbers, so that nothing white is left for more.
    assert [order for order in ORDERS if _fitted(density, np.ones(256, np.bool_), order) is None]
    for order in ORDERS:
        fitted = _fitted(density, np.ones(256, np.bool_), order)
        assert fitted is None or (np.isfinite(fitted[1]).all() and (fitted[1] > 0).all())


# Of 3000 such densities twelve, and that of a measured arm, made one beyond all numbers where it is hidden.
@pytest.mark.parametrize(("seed", "hidden"), [(16, 18), (327, 16), (879, 14), (1082, 19), (1189, 17)])
def test_a_density_that_falls_away_from_what_is_hidden_has_no_autoregression(seed: int, hidden: int) -> None:
    rng = np.random.default_rng(seed)
    rng.integers(10, 26)
    seen = np.exp(np.cumsum(-np.abs(rng.normal(0, 1.2, 51 - hidden))))
    density = np.concatenate((np.zeros(hidden), seen))
    assert _fitted(density, density > 0, 4) is None
