"""What is missing shakes the mass, and a filter may take that for a noise of the motion."""

from collections.abc import Mapping
from dataclasses import replace

import pytest
from hidden_sets import MODEL, RATE, SAMPLES, made

from discrepancy.fit.simulate import Simulator
from discrepancy.fit.whitening import Setting
from discrepancy.name.begin import begin
from discrepancy.name.extend import accept_behind_noise
from discrepancy.name.search import Given

TRACKED = 2e4
"""Bandwidth [1/s] of a filter that follows the motion within 50 us: it leaves little of what a damping changes."""


@pytest.mark.parametrize(
    ("hidden", "named"),
    [({"damping_step_factor": 1.0007, "damping_step_time": 0.6 * SAMPLES / RATE}, ["damping_step"]), ({}, [])],
    ids=["step", "nothing"],
)
def test_an_effect_is_taken_in_where_the_residuals_are_likelier_with_it(
    hidden: Mapping[str, float], named: list[str]
) -> None:
    with Simulator(MODEL, 1) as simulator:
        search = begin(Given(made(dict(hidden))), simulator)
        strong = search.fitter.whitener(search.at.parameters, Setting(bandwidth=TRACKED))
        # Openings have been looked at when this is asked.
        search = replace(search, at=search.fitter.evaluated(replace(search.at, whiten=strong)), shortest=1)
        found = accept_behind_noise(search, 1)
        assert [a.id for a in found.accepted] == named
        assert (found is search) == (not named)
