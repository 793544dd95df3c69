"""Design files."""

from cosim.monitor import MONITOR
from gyrotwin.schemas.device import described
from gyrotwin.schemas.record import NUMBER, Json, Schema, mapping, setting, table


def _build() -> Json:
    return described(
        controller=mapping(NUMBER, "settings of the controller by name"),
        monitor=table(
            {name: setting(found) for name, found in MONITOR.items()}, (), "by what the angle counts as valid"
        ),
        scaling=mapping(mapping(NUMBER), "an interval times (nominal / reference)^power, by parameter"),
        reference=mapping(NUMBER, "the values for which the intervals hold as they stand"),
    )


SCHEMA = Schema("design", "Design file: all that a loop may know of a device", _build)
