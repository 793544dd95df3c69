"""What the grids of effect files mean on runs, and how far a refit may move a shape from them."""

from dataclasses import replace

import numpy as np
import pytest

from discrepancy.data.record import make_record
from discrepancy.fit.fitted import Fitted
from discrepancy.fit.whitening import Setting, whitener
from discrepancy.name.grids import MOST, Grids, around, free_shape
from gyro_model.errors import InputError
from gyro_model.model import load_model
from gyro_model.quantities import Grid, shape

RATE, GAIN, W = 2e5, 1e6, 2 * np.pi * 3000.0
PARAMETERS = {"sense_gain_x": GAIN, "m": 1.8e-7, "kxx": 64.0, "dxx": 1.8e-6}


@pytest.fixture(scope="module")
def swing():
    """A run of 4000 samples in which x swings by 2 µm, and a fit of it without a residual."""
    t = np.arange(4000) / RATE
    v = GAIN * 2e-6 * np.sin(W * t)[:, None]
    record = make_record(
        "swing.csv", t, np.full((4000, 1), 3e-6), v, conditions={"v_bias": np.linspace(1.0, 6.0, 4000)}
    )
    plain = whitener(PARAMETERS, 1, 1 / RATE, Setting(), 4000)
    at = Fitted(PARAMETERS, ({},), (), plain, (np.zeros((4000, 1)),))
    return Grids((record,), 1 / RATE), at


def searched(search: Grid | None, start: float = 1e-3, low: float = 1e-12):
    return shape("any", "1", start, "any", low=low, search=search)


# 2 µm at 3 kHz: 37.7 mm/s; kept to two digits.
@pytest.mark.parametrize(
    ("of", "scale"),
    [
        ("x", 2.0e-6),
        ("x_dot", 3.8e-2),
        ("u_x", 3e-6),
        ("v_bias", 5.0),
        ("duration", 0.02),
        ("dxx", 1.8e-6),
        ("1", 1.0),
        ("itself", 1e-3),
    ],
)
def test_a_grid_spans_its_scale(swing, of, scale):
    grids, at = swing
    points = grids.of([searched(Grid.log(0.1, 10, of=of, points=3))], at)
    assert [p["any"] for p in points.values] == pytest.approx([0.1 * scale, scale, 10 * scale], rel=1e-12)
    assert [q.name for q in points.moved] == ["any"]


@pytest.mark.parametrize("senses", ["velocity", "acceleration"])
def test_the_speed_of_what_is_seen_by_other_sensors(swing, senses):
    grids, at = swing
    [own] = grids.records
    record = make_record(own.name, own.t, own.u, own.v, senses=senses)
    points = Grids((record,), grids.period).of([searched(Grid.log(1, 1, of="x_dot", points=1))], at)
    # 37.7 mm/s, of a frequency that its spectrum has to a bin of 50 Hz.
    assert points.values[0]["any"] == pytest.approx(3.77e-2, rel=0.03)


def test_a_fit_of_pieces_has_the_scales_of_the_whole(swing):
    grids, at = swing
    pieces = replace(at, residuals=(np.zeros((1500, 1)), np.zeros((2500, 1))))
    own = [searched(Grid.log(1, 1, of="x_dot", points=1))]
    fresh = Grids(grids.records, grids.period)
    assert fresh.of(own, pieces).values == grids.of(own, at).values


def test_what_no_run_shows_is_searched_about_itself(swing):
    grids, at = swing
    assert grids.of([searched(Grid.log(1, 1, of="temperature", points=1))], at).values == ({"any": 1e-3},)


def test_a_shape_without_a_search_stays(swing):
    grids, at = swing
    points = grids.of([searched(None)], at)
    assert points.values == ({},)
    assert points.moved == ()


def test_a_shape_that_may_move_alone_is_tried_in_the_middle_of_the_others(swing):
    grids, at = swing
    own = [
        replace(searched(Grid.log(0.1, 10, points=3)), name="length"),
        replace(searched(Grid.usual, 0.5), name="share"),
        replace(searched(Grid.rest("share", alone=(-1.5, -0.5)), 0.5, -np.inf), name="rest"),
    ]
    usual, alone = grids.forms(own, at)
    assert len(usual.values) == 3 and [q.name for q in usual.moved] == ["length"]
    assert alone.values == ({"length": 1e-3, "rest": -1.0},)
    assert [q.name for q in alone.moved] == ["length", "rest"]
    free = free_shape(own[2], -1.0, 1e-5, (-1.0, -1.0))
    assert free.bounded(-1.0, 3.0) == -0.5 and free.bounded(-1.0, -1e3) == -1.5


@pytest.mark.parametrize("alone", [(-0.5, -1.0), (-1.0, -1.0), (-np.inf, 1.0)])
def test_a_shape_moves_alone_within_bounds(alone):
    with pytest.raises(InputError, match="two finite bounds"):
        Grid.rest("share", alone=alone)


def test_many_grids_do_not_multiply_without_end(swing):
    grids, at = swing
    many = [replace(searched(Grid.log(0.1, 10, points=5)), name=f"shape_{i}") for i in range(4)]
    points = grids.of(many, at)
    assert len(points.values) <= MOST
    assert all(len(value) == 4 for value in points.values)


def test_a_shape_that_may_vanish_moves_like_a_size_and_others_in_strides():
    vanishing = free_shape(searched(Grid.around, low=0.0), 0.3, 1 / RATE, (0.3, 0.3))
    assert vanishing.bounded(0.3, -1.0) == 0.0
    staying = free_shape(searched(Grid.around), 0.3, 1 / RATE, (0.1, 1.0))
    assert staying.bounded(0.3, -1.0) == pytest.approx(0.1)
    assert staying.low > 0.0


def test_only_resonances_and_instants_are_searched_finer():
    log = searched(Grid.around)
    assert around({"any": 1.0}, (log,), 0.0) == []
    instant = searched(Grid.instant, start=0.0, low=0.0)
    assert around({"any": 1.0}, (instant,), 0.4)[0]["any"] == pytest.approx(1.0 - 4 * 0.1)


def test_a_shape_that_starts_at_zero_has_to_say_how_it_is_searched():
    with pytest.raises(InputError, match="search=None"):
        shape("any", "s", 0.0, "any")


@pytest.mark.parametrize(("low", "high", "of"), [(0.0, 1.0, "x"), (2.0, 1.0, "x"), (1.0, 2.0, "z")])
def test_a_grid_that_is_none_is_refused(low, high, of):
    with pytest.raises(InputError, match="grid"):
        Grid.log(low, high, of=of)


def test_no_effect_is_left_with_a_shape_that_starts_nowhere():
    shapes = [q for effect in load_model().effects for q in effect.parameters if q.role == "shape"]
    for q in shapes:
        assert q.search is None or q.search.kind == "instant" or q.typical > 0 or q.search.of != "itself", q.name
