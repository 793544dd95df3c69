"""Records that would give a wrong answer without a word: refused, or asked about with the option that mends them."""

import numpy as np
import pytest
from scipy.signal import lfilter

from benchmarks.split_records import SenseAxis, make_record
from calibration.mode_split import NothingFoundError, Question, VoltageRecord, find_split, follow_split
from calibration.mode_split.checks import check_levels, check_steps, thermal_ratio, unchecked
from calibration.mode_split.model import SplitModel
from gyro_model.errors import InputError

AXIS = SenseAxis(q=500.0, f_y=3030.0)


def record(rate: float = 20000.0, seed: int = 1) -> VoltageRecord:
    return make_record(AXIS, 8.0, seed, rate)


def folded(seed: int) -> VoltageRecord:
    """Every fourth of 20 kHz: a converter without a filter."""
    whole = record(seed=seed)
    return VoltageRecord(whole.values[::4], whole.rate / 4)


def test_a_drive_beyond_half_the_sample_rate_is_asked_about() -> None:
    with pytest.raises(InputError, match=r"folded to 2000 Hz, and mirrored.*--unfold"):
        find_split(folded(1), Question(drive_frequency=3000.0))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_confirmed_it_is_unfolded_with_the_right_sign(seed: int) -> None:
    split = find_split(folded(seed), Question(drive_frequency=3000.0, unfold=True)).split
    # Four deviations: folding adds the floor of the other zones to the interval.
    assert split.split == pytest.approx(30.0, abs=4 * split.deviation)


def test_unfold_without_need_is_refused() -> None:
    with pytest.raises(InputError, match="leave it out"):
        find_split(record(), Question(unfold=True))


def test_time_of_i_and_q_in_another_unit_is_asked_about() -> None:
    # 20 kHz of I and Q read in ms.
    pairs = record().values[::100] + 0j
    with pytest.raises(InputError, match=r"2 pairs a second.*in ms or µs"):
        find_split(VoltageRecord(pairs, 2.0, 3000.0), Question())


def test_time_in_another_unit_is_asked_about() -> None:
    slow = record()
    with pytest.raises(InputError, match=r"20 samples a second.*in ms or µs"):
        find_split(VoltageRecord(slow.values, 20.0), Question())


def test_steps_wider_than_the_noise_are_refused() -> None:
    rng = np.random.default_rng(1)
    values = np.linspace(1.0, 1.2, 20_000) + 1e-3 * (rng.standard_normal(20_000) + 1j * rng.standard_normal(20_000))
    rounded = np.round(values.real / 17e-3) * 17e-3 + 1j * np.round(values.imag / 17e-3) * 17e-3
    with pytest.raises(InputError, match="samples equal the one before"):
        find_split(VoltageRecord(rounded, 1000.0, 3000.0), Question())


def drifting(hertz: float, seed: int, seconds: float = 60.0, rate: float = 200.0) -> VoltageRecord:
    """I and Q of a line and of a mode 1 Hz wide, 30 Hz away, that moves by ``hertz`` through the record: an exact
    process of first order in the mode's own frame, in white noise 20 dB below its top."""
    rng = np.random.default_rng(seed)
    n = int(seconds * rate)
    kept = np.exp(-np.pi / rate)
    drawn = np.sqrt(1 - kept**2) * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
    drawn[0] = rng.standard_normal() + 1j * rng.standard_normal()
    t = np.arange(n) / rate
    mode = lfilter([1], [1, -kept], drawn) * np.exp(
        2j * np.pi * (30 * t + 0.5 * hertz * (t - seconds / 2) ** 2 / seconds)
    )
    noise = np.sqrt((1 + kept) / (1 - kept) / 100) * (rng.standard_normal(n) + 1j * rng.standard_normal(n))
    return VoltageRecord(30.0 + mode + noise, rate, 5000.0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_mode_that_moves_through_the_record_is_refused(seed: int) -> None:
    # By two line widths: of 30 records 9 intervals missed.
    with pytest.raises(InputError, match=r"moves through the record, by .*--track 6"):
        find_split(drifting(2.0, seed), Question())
    split = find_split(drifting(0.0, seed), Question()).split
    assert split.split == pytest.approx(30.0, abs=4 * split.deviation)


def test_a_guard_as_wide_as_the_band_is_refused() -> None:
    with pytest.raises(InputError, match=r"--guard 1e\+06: it leaves nothing"):
        find_split(record(), Question(guard=1e6))


def test_the_level_of_thermal_noise() -> None:
    # By equipartition <y²> = kT/k: a Lorentzian of height h and width f/Q holds h π/2 f/Q.
    mass, gain, temperature, q, f = 2e-8, 1e6, 300.0, 600.0, 5050.0
    power = gain**2 * 1.380649e-23 * temperature / (mass * (2 * np.pi * f) ** 2)
    model = SplitModel(f, q, power / (0.5 * np.pi * f / q), 1e-12, 0.0, 0.0, 5000.0, 1.0)
    assert thermal_ratio(model, mass, gain, temperature) == pytest.approx(1.0, rel=1e-6)


def test_a_hump_that_is_not_thermal_is_refused() -> None:
    with pytest.raises(InputError, match="not thermal"):
        find_split(record(), Question(mass=1e-3, sense_gain=1.0))


def test_what_was_not_given_to_hold_the_hump_against_kt_is_named() -> None:
    assert unchecked(2e-8, 1e6) == []
    [text] = unchecked(None, None)
    assert "not checked against kT" in text
    assert text.endswith("give --mass and --sense-gain")
    assert unchecked(2e-8, None)[0].endswith("give --sense-gain")


def test_a_drive_that_nobody_gave_may_be_an_image() -> None:
    found = find_split(folded(1), Question())
    assert found.split.split == pytest.approx(-30.0, abs=1.0)
    [text] = found.doubts
    assert "the sign of the split could be wrong; give --drive-frequency" in text
    assert find_split(record(), Question(drive_frequency=3000.0)).doubts == ()


def test_a_track_asks_of_a_record_what_a_split_asks() -> None:
    with pytest.raises(InputError, match=r"folded to 2000 Hz, and mirrored.*--unfold"):
        follow_split(folded(1), Question(q=500.0, drive_frequency=3000.0), 2.0)
    found = follow_split(folded(1), Question(q=500.0, drive_frequency=3000.0, unfold=True), 2.0)
    assert found.steps[-1].split == pytest.approx(30.0, abs=2.0)
    values = record().values.real
    edge = 0.5 * float(np.abs(values).max())
    with pytest.raises(InputError, match="clipped"):
        follow_split(VoltageRecord(np.clip(values, -edge, edge), 20000.0), Question(q=500.0), 2.0)


def rounded_under_a_carrier(drive: float) -> VoltageRecord:
    """A drive line of 10 mV over noise of 20 µV, in steps of 100 µV."""
    rng = np.random.default_rng(3)
    t = np.arange(64_000) / 16_000.0
    values = 1e-2 * np.cos(2 * np.pi * drive * t) + 2e-5 * rng.standard_normal(len(t))
    return VoltageRecord(np.round(values / 1e-4) * 1e-4, 16_000.0)


def test_steps_under_a_carrier_that_comes_back_to_its_phase_are_refused() -> None:
    # 5 periods in 16 samples: rounding answers each of 16 voltages in its own way, and intervals cover 4 times of 8.
    with pytest.raises(InputError, match=r"equal that (16|32|48|64|80|96) before.*slightly different sample rate"):
        check_steps(rounded_under_a_carrier(5000.0))


@pytest.mark.parametrize("drive", [5000.37, 5023.7])
def test_a_carrier_that_drifts_through_the_steps_whitens_them(drive: float) -> None:
    check_steps(rounded_under_a_carrier(drive))


@pytest.mark.parametrize(("noise", "steps", "fits"), [(1e-5, 8, False), (1e-5, 40, True), (2e-3, 8, True)])
def test_a_carrier_of_few_steps_is_refused_but_where_noise_blurs_them(noise: float, steps: int, fits: bool) -> None:
    turn = 5023.7 / 16_000.0
    values = 1e-2 * np.cos(2 * np.pi * turn * np.arange(64_000))
    values += noise * np.random.default_rng(4).standard_normal(len(values))
    step = 2e-2 / steps
    rounded = np.round(values / step) * step
    if fits:
        check_levels(rounded, turn)
    else:
        with pytest.raises(InputError, match=r"takes 9 values, 0\.0025 V apart"):
            check_levels(rounded, turn)


def test_a_temperature_in_celsius_is_told() -> None:
    with pytest.raises(InputError, match=r"25 °C is 298.15 K"):
        Question(temperature=25.0)


def test_what_is_too_narrow_for_the_record_is_not_called_nothing() -> None:
    # A resonance of Q = 1e5 at 3030 Hz decays over 10 s: in 8 s it is one line.
    lasting = make_record(SenseAxis(q=1e5, f_y=3030.0), 8.0, 1, 20000.0)
    with pytest.raises(NothingFoundError, match=r"stands out at 303\d.* narrower than 0.5 Hz"):
        find_split(lasting, Question())


def hump(split: float, q: float, seed: int = 1, seconds: float = 40.0, rate: float = 1000.0) -> VoltageRecord:
    """I and Q around a drive of 3 kHz: a line and a hump 22 dB over white noise."""
    rng = np.random.default_rng(seed)
    n, decay = int(seconds * rate), np.pi * (3000 + split) / q
    pole = np.exp((-decay + 2j * np.pi * split) / rate)
    noise = rng.standard_normal((2, n)) + 1j * rng.standard_normal((2, n))
    mode = lfilter([1], [1, -pole], noise[0])
    return VoltageRecord(1e3 + mode + 0.08 / abs(1 - abs(pole)) * noise[1], rate, 3000.0)


@pytest.mark.parametrize("seed", [1, 2, 5, 9])  # The skirt is fitted as a hump, without bound, and as a line.
def test_a_hump_whose_top_is_not_searched_is_refused(seed: int) -> None:
    # Behind the guard a fit to the skirt came out 7 Hz off, with an interval of ±2.4 Hz.
    with pytest.raises(InputError, match="reaches into the guard of 45 Hz"):
        find_split(hump(40.0, 800.0, seed), Question(guard=45.0))
    with pytest.raises(InputError, match="lies at the end of the band"):
        find_split(hump(430.0, 800.0, seed), Question())
    split = find_split(hump(40.0, 800.0, seed), Question(guard=35.0)).split
    assert split.split == pytest.approx(40.0, abs=4 * split.deviation)


@pytest.mark.parametrize("q", [None, 800.0])
@pytest.mark.parametrize("seed", range(4))
def test_a_hump_under_an_unclean_line_is_refused_and_no_other_place_named(seed: int, q: float | None) -> None:
    # 0.6 Hz beside the line, 1.9 Hz of half-width. With Q known a fifth of such answers were 10 to 30 Hz off, ± 1 Hz.
    record = hump(0.6, 800.0, seed)
    with pytest.raises(InputError, match=r"under the drive line.*--clean-line"):
        find_split(record, Question(q=q))
    split = find_split(record, Question(q=q, clean_line=True)).split
    assert split.split == pytest.approx(0.6, abs=5 * split.deviation)


def test_a_hump_too_broad_for_a_resonance_is_named_as_such() -> None:
    with pytest.raises(InputError, match=r"as broad as one of Q = [5-9]\.\d+: no resonance"):
        find_split(hump(40.0, 8.0), Question())


def test_a_drive_frequency_beside_the_line_is_told() -> None:
    with pytest.raises(InputError, match=r"wanders.*the line at 3000 Hz is more than 20 dB stronger"):
        find_split(hump(40.0, 800.0), Question(drive_frequency=2990.0))
    # A guard over both lets the line pass: the split is counted from 2990 Hz, as was asked for.
    found = find_split(hump(40.0, 800.0), Question(drive_frequency=2990.0, guard=15.0))
    assert found.split.split == pytest.approx(50.0, abs=0.5)
    [told] = found.doubts
    assert "the line at 3000 Hz is more than 20 dB stronger" in told
    assert find_split(hump(40.0, 800.0), Question(drive_frequency=3000.0)).doubts == ()


def test_a_clipped_voltage_is_refused() -> None:
    z = hump(40.0, 800.0).values
    with pytest.raises(InputError, match="clipped"):
        find_split(VoltageRecord(z.real.clip(None, 1e3) + 1j * z.imag, 1000.0, 3000.0), Question())


def test_a_channel_that_never_changes_is_refused() -> None:
    with pytest.raises(InputError, match="I or Q never changes"):
        find_split(VoltageRecord(hump(40.0, 800.0).values.real + 0j, 1000.0, 3000.0), Question())
