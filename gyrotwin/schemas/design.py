"""Design files."""

from cosim.monitor import MONITOR
from gyro_model.device import FORMAT, RATE_MODE_UNITS
from gyrotwin.schemas.device import settable
from gyrotwin.schemas.record import NUMBER, TEXT, Json, Schema, in_units, mapping, table


def _build() -> Json:
    parameters, intervals = settable()
    return table(
        {
            "format": {"const": FORMAT},
            "name": TEXT,
            "parameters": parameters,
            "intervals": intervals,
            "controller": mapping(NUMBER, "settings of the controller by name"),
            "monitor": table({name: NUMBER for name in MONITOR}, (), "by what the angle counts as valid"),
            "scaling": mapping(mapping(NUMBER), "an interval times (nominal / reference)^power, by parameter"),
            "reference": mapping(NUMBER, "the values for which the intervals hold as they stand"),
            "rate_mode": in_units(RATE_MODE_UNITS, "amplitude, range and bandwidths of rate mode"),
        },
        ("format", "name"),
    )


SCHEMA = Schema("design", "Design file: all that a loop may know of a device", _build)
