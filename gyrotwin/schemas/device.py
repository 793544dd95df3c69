"""Device files."""

from gyro_model.device import CONTROLLER_UNITS, FORMAT, RATE_MODE_UNITS
from gyro_model.model import load_model
from gyrotwin.schemas.record import TEXT, Json, Schema, in_units, interval, quantity, table


def settable() -> tuple[Json, Json]:
    """The tables of all parameters of the packaged effects, and of their intervals."""
    quantities = [q for q in load_model().quantities if q.role not in ("input", "output")]
    return (
        table({q.name: quantity(q) for q in quantities}, (), "values, SI"),
        table({q.name: interval(q) for q in quantities}, (), "what is uncertain of them, SI"),
    )


def described(**more: Json) -> Json:
    """A file that describes a device, with ``more`` tables."""
    parameters, intervals = settable()
    own: Json = {"format": {"const": FORMAT}, "name": TEXT, "parameters": parameters, "intervals": intervals}
    rate_mode = in_units(RATE_MODE_UNITS, "amplitude, range and bandwidths of rate mode")
    return table({**own, **more, "rate_mode": rate_mode}, ("format", "name"))


def _build() -> Json:
    return described(controller=in_units(CONTROLLER_UNITS, "the loop that fits the device"))


SCHEMA = Schema("device", "Device file: what one device is", _build)
