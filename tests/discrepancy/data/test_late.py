"""A voltage that comes late by a part of a period is seen before anything is fitted."""

import pytest
from hidden_sets import MODEL, SHORT, made

from discrepancy.data.late import lateness
from discrepancy.fit.simulate import Simulator
from discrepancy.name.begin import begin
from discrepancy.name.search import Given

FILTER = {"voltage_filter": 1.8e-5, "voltage_filter_order": 4.0}
"""Of fourth order at 8.8 kHz: a delay of 2.61 times that, 47 µs, an eighth to a sixth of a period of the modes."""


def test_a_filter_near_the_modes_is_seen_as_a_delay() -> None:
    data = made(FILTER, samples=SHORT)
    late = lateness(data.fit, data.nominal)
    assert late is not None
    # Its delay grows by a tenth towards 3.8 kHz.
    assert late.delay == pytest.approx(2.61 * 1.8e-5, rel=0.1)


@pytest.mark.parametrize("hidden", [{}, {"k3_x": 3e11, "k3_y": 3e11}, {"actuator_delay": 2e-6}])
def test_what_is_no_delay_or_a_small_one_is_none(hidden: dict[str, float]) -> None:
    data = made(hidden, samples=SHORT)
    assert lateness(data.fit, data.nominal) is None


def test_the_nominal_model_stays_in_step_with_it() -> None:
    data = made(FILTER, samples=SHORT)
    with Simulator(MODEL, jobs=1) as simulator:
        search = begin(Given(data), simulator)
    assert search.names == {"actuator_delay"}
    assert search.fitter is search.whole
    # Without the delay four fifths of the voltage are left.
    assert search.fitter.off(search.at) < 0.1
