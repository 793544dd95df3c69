"""The drive voltage couples into the amplifier's input past the mass.

    v → v + c_ft u, with the force that has acted until the sample

A model of a stray capacitance between drive and sense electrodes, with a drive voltage in proportion to the force.
"""

from gyro_model.anatomy import Limit, Map
from gyro_model.quantities import size
from gyro_model.symbols import u_x, u_y, v_x, v_y

FEEDTHROUGH = size("feedthrough", "V/N", "voltage at the amplifier's input for each newton of drive", nominal=1e3)
c_ft = FEEDTHROUGH.symbol

EFFECT = Map(
    id="drive_feedthrough",
    parameters=(FEEDTHROUGH,),
    slot="amplifier feedthrough",
    output=(v_x + c_ft * u_x, v_y + c_ft * u_y),
    signature="the output follows the drive at all frequencies, with no resonance",
    host_experiment="off-resonance drive",
    limits=(
        Limit(
            why="8 V/N · 50 µN = 0.4 mV",
            at={"feedthrough": 8.0, "u_x": 5e-5, "u_y": -5e-5, "v_x": 0.1, "v_y": 0.0},
            gives={"v_x": 0.1004, "v_y": -4e-4},
        ),
    ),
)
