"""The force of a comb drive depends on where the comb stands: fringe field and overlap change with the displacement.

    u_q → u_q (1 + c q),  q = x, y

First order of what the field at the fingers' ends does to the force (W. A. Johnson, L. K. Warne, Electrophysics of
micromechanical comb actuators, Journal of Microelectromechanical Systems 4, 1995). It acts on the force at the mass,
after curve, gain and misalignment; what feeds through to the amplifier is the drive voltage, which knows no
displacement.
"""

from gyro_model.anatomy import Force, Limit
from gyro_model.quantities import size
from gyro_model.symbols import u_x, u_y, x, y

FRINGE = size("comb_fringe", "1/m", "change of the force with displacement, relative", nominal=100.0)
c = FRINGE.symbol

EFFECT = Force(
    id="comb_fringe",
    parameters=(FRINGE,),
    force=(c * u_x * x, c * u_y * y),
    energy=None,
    signature="drive at twice a resonance swings it; at a resonance the mean moves and a second harmonic appears",
    host_experiment="drive at twice the resonance, drive level step",
    limits=(
        Limit(
            why="2e4 1/m at 1 µm: 2 % of 1e-4 N more, at -3 µm 6 % less",
            at={"comb_fringe": 2e4, "u_x": 1e-4, "x": 1e-6, "u_y": 1e-4, "y": -3e-6},
            gives={"force_x": 2e-6, "force_y": -6e-6},
        ),
    ),
)
