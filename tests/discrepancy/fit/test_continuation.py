"""Fits of runs that hold more than the model: they stay with the motion, whatever a noise filter takes for noise."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hidden_sets import MODEL
from scipy.signal import cont2discrete, lfilter, ss2tf

from benchmarks.bent import Bent, runs
from discrepancy.data.dataset import Dataset
from discrepancy.data.linear_start import linear_start
from discrepancy.data.record import Record, Senses, make_record
from discrepancy.fit.continuation import beginnings, cut, grown, in_pieces, leaves, nearly_settled, started, unsprung
from discrepancy.fit.fitted import Fitted, Free
from discrepancy.fit.measures import start_fitted
from discrepancy.fit.refit import Fitter
from discrepancy.fit.simulate import Simulator
from discrepancy.name.begin import begin
from discrepancy.name.search import Given

RATE, SAMPLES, Q = 100.0, 800, 100.0
OWN, OTHER, RESIDUE = 12.67, 5.82, -0.75


def _answer(u: np.ndarray, frequency: float) -> np.ndarray:
    """The displacement per stiffness of a mode to a force that is held between samples."""
    w = 2 * np.pi * frequency
    state = np.array([[0.0, 1.0], [-(w**2), -w / Q]]), np.array([[0.0], [w**2]]), np.eye(2)[:1], np.zeros((1, 1))
    numerator, denominator = ss2tf(*cont2discrete(state, 1 / RATE)[:4])
    return np.asarray(lfilter(numerator[0], denominator, u))


def _shaken() -> Record:
    """A run of the mode under a force that jumps at every sample."""
    u = np.random.default_rng(2).standard_normal(SAMPLES)
    return make_record("1", np.arange(SAMPLES) / RATE, u[:, None], _answer(u, OWN)[:, None], sample_rate=RATE)


def test_a_motion_out_of_bounds_is_further_off_than_any_other() -> None:
    w = 2 * np.pi * OWN
    device = {"m": w**-2, "kxx": 1.0, "dxx": 1 / (w * Q), "sense_gain_x": 1.0}
    with Simulator(MODEL, 1) as simulator:
        whole = Fitter(simulator, (_shaken(),))
        at = whole.begin(device)
        lost = replace(at, residuals=tuple(np.full_like(own, np.nan) for own in at.residuals))
        # Of starts that are sorted by it the lost one is the last.
        assert min((lost, at), key=whole.off) is at and whole.off(lost) == np.inf


def test_a_run_that_stands_still_at_first_begins_at_rest() -> None:
    u = np.random.default_rng(2).standard_normal(SAMPLES)
    u[: SAMPLES // 2] = 0.0
    record = make_record("1", np.arange(SAMPLES) / RATE, u[:, None], _answer(u, OWN)[:, None], sample_rate=RATE)
    w = 2 * np.pi * OWN
    device = {"m": w**-2, "kxx": 1.0, "dxx": 1 / (w * Q), "sense_gain_x": 1.0}
    with Simulator(MODEL, 1) as simulator:
        residual, _ = start_fitted(simulator, record, device)
        assert np.std(residual) < 1e-6 * np.std(record.v)
        # As of the openings of such a run: what steps are made for is that of the run.
        whole = Fitter(simulator, (record,))
        still = beginnings(whole, 4)
        assert not still.records[0].v.any()
        assert still.fit(started(still, whole.begin(device))).cost < 1e-12 * still.signal**2


def test_parameters_that_the_fmu_refuses_are_a_place_to_go_on_from() -> None:
    record = _shaken()
    w = 2 * np.pi * OWN
    device = {"m": w**-2, "kxx": 1.0, "dxx": 1 / (w * Q), "sense_gain_x": 1.0}
    with Simulator(MODEL, 1) as simulator:
        whole = Fitter(simulator, (record,))
        linear = whole.with_grams(whole.begin(device))
        refused = whole.evaluated(replace(linear, parameters={**device, "m": -1.0}))
        assert refused.cost == np.inf
        # What was linearised elsewhere is no slope here, least of all of other runs.
        assert (refused.grams, refused.fill) == (None, ())
        assert whole.fit(refused).cost == np.inf


def test_a_fit_of_pieces_goes_on_over_whole_runs() -> None:
    record = _shaken()
    w = 2 * np.pi * OWN
    device = {"m": w**-2, "kxx": 1.01, "dxx": 1 / (w * Q), "sense_gain_x": 1.0}
    with Simulator(MODEL, 1) as simulator:
        whole = Fitter(simulator, (record,))
        pieces = cut(whole, 4)
        of_pieces = pieces.fit(started(pieces, whole.begin(device)), 2)
        fitter, at = nearly_settled(whole, of_pieces)
        assert fitter is whole
        assert whole.off(at) < 1e-3


def test_a_device_that_no_spring_brings_back_has_no_period() -> None:
    u = np.random.default_rng(2).standard_normal((SAMPLES, 2))
    v = np.stack([_answer(column, OWN) for column in u.T], axis=1)
    record = make_record("1", np.arange(SAMPLES) / RATE, u, v, sample_rate=RATE)
    w = 2 * np.pi * OWN
    device = {"m": w**-2, "kxx": 1.0, "kyy": 1.0, "kxy": 1.5, "dxx": 1 / (w * Q), "dyy": 1 / (w * Q), "dxy": 0.0,
              "sense_gain_x": 1.0, "sense_gain_y": 1.0}  # fmt: skip
    with Simulator(MODEL, 1) as simulator:
        whole = Fitter(simulator, (record,))
        at = whole.evaluated(Fitted(device, whole.starts(device), (), whole.plain(device), ()))
        assert unsprung(whole, at)
        assert not np.isnan(grown(whole, at).cost)


def test_a_mode_that_no_effect_can_be_is_left_without_spoiling_the_fit() -> None:
    # The second mode answers with the other sign, as far from where a structure is driven: no force on the mass does.
    u = np.random.default_rng(1).standard_normal(SAMPLES)
    own, other = _answer(u, OWN), RESIDUE * _answer(u, OTHER)
    record = make_record("1", np.arange(SAMPLES) / RATE, u[:, None], (own + other)[:, None], sample_rate=RATE)
    nominal = linear_start([record], (1.0,))
    assert nominal is not None
    with Simulator(MODEL, 1) as simulator:
        search = begin(Given(Dataset(Path(), nominal, (record,))), simulator)
        assert search.fitter is search.whole
        # What is left is the other mode; a fit that predicted a sample ahead left 1.67 times as much.
        assert search.fitter.off(search.at) < 1.1 * np.std(other) / np.std(own + other)
        frequency = np.sqrt(search.at.parameters["kxx"] / search.at.parameters["m"]) / (2 * np.pi)
        assert frequency == pytest.approx(OWN, rel=0.01)


@pytest.mark.parametrize(
    ("frequency", "before", "after", "left"),
    [
        # An angular gain without the cubic spring beside it, in 600 periods: it is what is missing.
        (3000.0, 0.011, 0.020, False),
        (3000.0, 0.30, 0.50, True),
        # Forty periods, in which what is missing adds up.
        (200.0, 0.011, 0.019, False),
        (200.0, 0.067, 0.297, True),
        # Less than one: a motor without a spring.
        (2.0, 0.011, 0.020, True),
        (2.0, 0.011, 0.013, False),
    ],
)
def test_what_leaves_the_motion(frequency: float, before: float, after: float, left: bool) -> None:
    run = SimpleNamespace(t=np.arange(40_000) / 2e5, sample_rate=2e5)
    fitter = SimpleNamespace(records=(run,), axes=1, off=lambda at: at.off)
    device = {"m": (2 * np.pi * frequency) ** -2, "kxx": 1.0}
    fits = [SimpleNamespace(parameters=device, off=off) for off in (after, before)]
    assert leaves(fitter, *fits) is left  # type: ignore[arg-type]


CHAOTIC = Bent(1.0, 0.628, 158.0, 7.2e6, 0.0)
"""2 Hz, Q = 20; under 1 N rms the cube is most of the spring's force."""


@pytest.mark.parametrize("senses", ["position", "velocity", "acceleration"])
def test_a_chaotic_motion_is_fitted_over_pieces(senses: Senses) -> None:
    own, noise = CHAOTIC, 2e-3
    records, grown = runs(own, 2.0, np.random.default_rng(7), senses, "zero", noise)
    assert grown > 1e4
    gain = records[0].reference ** records[0].order
    true = {"m": own.m, "kxx": own.k, "dxx": own.d, "k3_x": own.k3}
    # As far off as a weak form is that has lost the slow part of the place.
    begun = {"sense_gain_x": gain, "m": 0.7, "kxx": 1.1 * own.k, "dxx": 0.8 * own.d, "k3_x": 0.5 * own.k3}
    with Simulator(MODEL, 1) as simulator:
        whole = Fitter(simulator, records[:2])
        free = tuple(Free(name, 1e-6 * begun[name]) for name in true)
        at = whole.evaluated(Fitted(begun, whole.starts(begun), free, whole.plain(begun), ()))
        assert whole.off(at) > 0.5
        pieces, found = in_pieces(whole, at)
    assert pieces.off(found) < 1.1 * noise
    for name, value in true.items():
        # 3.0e-4 at most of three sensors.
        assert found.parameters[name] == pytest.approx(value, rel=1e-3), name
