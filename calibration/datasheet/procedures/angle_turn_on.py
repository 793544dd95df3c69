"""Turn-on time in whole-angle mode: until the angle is valid by what the loop itself knows."""

from calibration.datasheet.figure import Figure, Outcome, mean
from calibration.datasheet.procedure import WHOLE_ANGLE, Procedure
from cosim.angle_bench import AngleBench


def measure(bench: AngleBench) -> Outcome:
    """Of all records at rest."""
    if bench.refusal:
        return Outcome(reason=bench.refusal)
    times = [one.valid_at for one in bench.rest if one.valid_at is not None]
    value, error = mean(times)
    note = "from power on with the pattern swinging, first estimates 10 to 50 % off"
    return Outcome([Figure("turn_on_output", "turn-on time of the angle", value, "s", error, len(times), note=note)])


PROCEDURE = Procedure("Turn-on time", "12.5", WHOLE_ANGLE, measure, 10)
