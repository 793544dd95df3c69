"""What docs/loop.md says of settings and designs is what there is."""

import re
from pathlib import Path

import pytest

from cosim.core.settings import FILTER, FOUCAULT
from cosim.design import load_design, packaged_designs
from cosim.monitor import MONITOR
from gyro_model.device import load_device, packaged_devices

TEXT = (Path(__file__).parents[2] / "docs" / "loop.md").read_text(encoding="utf-8")
TABLES = {"observer": FILTER, "controller": FOUCAULT, "monitor": MONITOR}


def rows(part: str) -> str:
    """The table of settings under the heading of ``part``."""
    return TEXT.partition(f"\n| {part} ")[2].partition("\n\n")[0]


@pytest.mark.parametrize(("part", "name"), [(part, name) for part, table in TABLES.items() for name in table])
def test_every_setting_is_in_its_table(part: str, name: str) -> None:
    assert f"`{name}`" in rows(part)


@pytest.mark.parametrize("part", TABLES)
def test_a_table_names_no_setting_that_is_not_there(part: str) -> None:
    named = set(re.findall(r"`(\w+)`", "\n".join(row.split("|")[1] for row in rows(part).splitlines()[2:])))
    assert named == set(TABLES[part])


@pytest.mark.parametrize("part", TABLES)
def test_a_table_says_what_its_settings_can_be(part: str) -> None:
    for row in rows(part).splitlines()[2:]:
        names, _, can_be, _ = (cell.strip() for cell in row.strip("|").split("|"))
        shown = [TABLES[part][name].shown for name in re.findall(r"`(\w+)`", names)]
        assert can_be == (shown[0] if len(set(shown)) == 1 else "; ".join(shown)), names


def test_every_packaged_design_is_there() -> None:
    assert all(f"`{name}`" in TEXT for name in packaged_designs())


# Those of rate mode are not meant for this loop.
LOOP_DEVICES = [name for name in packaged_devices() if name.endswith("_as_built") and not load_device(name).rate_mode]


@pytest.mark.parametrize("name", LOOP_DEVICES)
@pytest.mark.parametrize("seed", range(1, 9))
def test_devices_as_built_lie_within_the_intervals_of_lab(name: str, seed: int) -> None:
    # An interval goes with the stiffness that the seed draws, 10 to 50 % off.
    assert f"`{name}`" in TEXT
    device = load_device(name)
    # The start that `constant` gives to a device without one of its own.
    device = device.with_parameters({"x_start": 1e-6, **device.parameters})
    design = load_design("lab", device, seed)
    for parameter in design.known_model.estimated:
        error = device.all_parameters[parameter] - design.values[parameter]
        assert abs(error) <= 1.96 * design.deviations[parameter], parameter
