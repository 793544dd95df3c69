"""Copies of a force: what holds of the original holds of them, names and axes exchanged."""

import pytest
from sympy import simplify

from gyro_model import symbols
from gyro_model.anatomy import Force
from gyro_model.copies import copied
from gyro_model.errors import InputError
from gyro_model.model import load_model

MODE = load_model().effect("parasitic_mode")
assert isinstance(MODE, Force)


@pytest.mark.parametrize(("suffix", "turned"), [("_2", False), ("_y", True), ("_y_2", True)])
def test_limit_cases_hold_of_a_copy(suffix: str, turned: bool) -> None:
    copy = copied(MODE, suffix, turned=turned)
    own = {q.name: q.start for q in copy.parameters} | dict.fromkeys(("x", "x_dot", "y", "y_dot"), 0.0)
    for limit in copy.limits:
        still = dict.fromkeys([s.symbol.name for s in copy.states] + ["u_x", "u_y"], 0.0)
        at = {**own, **still, **limit.at}
        for name, value in limit.gives.items():
            found = float(copy.terms()[name].subs({s: at[s.name] for s in copy.terms()[name].free_symbols}))
            # The working has twelve digits.
            assert found == pytest.approx(value, rel=1e-12, abs=1e-30)


def test_a_turned_copy_acts_on_the_other_axis_and_keeps_its_energy() -> None:
    copy = copied(MODE, "_y", turned=True)
    assert copy.force[0] == 0
    assert symbols.y in copy.symbols
    assert symbols.x not in copy.symbols
    assert copy.energy is not None
    speed = {symbols.y: symbols.y_dot} | {s.symbol: s.rate for s in copy.states}
    stored = sum(copy.energy.stored.diff(state) * rate for state, rate in speed.items())
    balance = copy.force[1] * symbols.y_dot + stored + copy.energy.dissipated
    assert simplify(balance.subs(symbols.u_y, 0)) == 0


def test_copies_share_no_name() -> None:
    names = [q.name for suffix in ("", "_2", "_y") for q in copied(MODE, suffix).parameters]
    assert len(set(names)) == len(names)


def test_a_force_that_has_a_sense_is_not_turned() -> None:
    rotation = next(e for e in load_model().effects if isinstance(e, Force) and symbols.omega_z in e.symbols)
    with pytest.raises(InputError, match="omega_z"):
        copied(rotation, "_y", turned=True)
