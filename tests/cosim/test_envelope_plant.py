"""The envelope plant as a slow loop drives it."""

from math import pi

import numpy as np
import pytest

from cosim.envelope import INPUT_NAMES, OUTPUT_NAMES, envelope_parameters, open_envelope
from cosim.exchange import exchange
from gyro_model.device import load_device
from gyro_model.errors import InputError
from gyro_model.quantities import PARAMETERS

# One axis of 3000 Hz, Q 1885.
DEVICE = dict(load_device("reference").parameters) | {"kxy": 0.0, "dxy": 0.0, "sense_noise": 0.0}
OWN = np.sqrt(DEVICE["kxx"] / DEVICE["m"])


def test_start_is_that_of_the_full_plant():
    own = envelope_parameters({"m": 1e-7, "x_start": 1e-6, "y_dot_start": 0.02, "internal_step": 1e-6}, 1e-3, 3000.0)
    full = {q.name: q.start for q in PARAMETERS}
    assert own == {
        **{name: full[name] for name in ("kxx", "kyy", "kxy", "dxx", "dyy", "dxy", "sense_gain_x", "sense_gain_y")},
        **{name: full[name] for name in ("sample_period", "seed")},
        "m": 1e-7,
        "internal_step": 1e-3,
        "x_start_i": 1e-6,
        "x_start_q": 0.0,
        "y_start_i": 0.0,
        "y_start_q": -0.02 / (2 * pi * 3000.0),
    }


def test_exchange_rings_down_as_the_linear_plant():
    with open_envelope(DEVICE | {"x_start": 1e-6}) as plant:
        u, v, flags = np.zeros(len(INPUT_NAMES)), np.zeros(len(OUTPUT_NAMES)), np.zeros(4)
        u[INPUT_NAMES.index("carrier_frequency")] = OWN / (2 * pi)
        u[INPUT_NAMES.index("temperature")] = 298.15
        for k in range(20):
            assert exchange(plant.handle, plant.inputs, u, plant.outputs, v, flags, k * 1e-3, 1e-3) == 0
        decay = DEVICE["dxx"] / (2 * DEVICE["m"])
        turn = np.sqrt(OWN**2 - decay**2) - OWN
        found = dict(zip(OUTPUT_NAMES, v, strict=True))
        # 2 Q roundings, as in the tests of the plant.
        assert complex(found["x_i"], found["x_q"]) == pytest.approx(
            1e-6 * np.exp((-decay + 1j * turn) * 0.02), rel=1e-11
        )
        assert found["v_x_i"] == pytest.approx(1e6 * found["x_i"], rel=1e-15)


def test_carrier_is_at_first_the_x_axis():
    with open_envelope(DEVICE) as plant:
        assert plant.get(["carrier_frequency"])[0] == pytest.approx(OWN / (2 * pi), rel=1e-15)


def test_wrong_parameters_are_named():
    with pytest.raises(InputError, match=r"parameter 'k3x' is unknown to the FMU; did you mean 'k3_x'"):
        open_envelope(DEVICE | {"k3x": 1.0})
    with pytest.raises(InputError, match=r"internal_step = 20: give a value from 1e-06 to 10"):
        open_envelope(DEVICE, internal_step=20.0)


def test_states_of_effects_start_at_rest() -> None:
    with pytest.raises(InputError, match=r"parasitic_dot_start = 0\.02: the envelope form .* give 0"):
        open_envelope(DEVICE | {"parasitic_dot_start": 0.02})
    open_envelope(DEVICE | {"parasitic_start": 0.0, "parasitic_dot_start": 0.0}).close()
