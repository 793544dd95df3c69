"""What voltages see of the linear device at rest (cosim/core/linear.c), against scipy and differences."""

import ctypes

import numpy as np
import pytest
from plant import GAIN, MEASURED, PERIOD, REFERENCE, device_with, matrix, told
from scipy.linalg import expm

from cosim.core.library import FOLDER, library, pointer
from cosim.running import known_values, prior
from gyro_model.compiling import compile_library

CHAIN = {
    "actuator_delay": 8.3e-6,
    "amplifier_time_constant": 1.1e-6,
    "feedthrough": 6.0,
    "actuator_gain_mismatch": 0.04,
    "pickoff_gain_mismatch": -0.03,
    "actuator_misalignment": 0.015,
    "pickoff_misalignment": -0.02,
}
PACE = np.sqrt(REFERENCE[0] / REFERENCE[-1])
"""Angular frequency of x alone [rad/s]."""
COMMANDS = np.array([[3e-5, -1e-5], [-2e-5, 4e-5]])
"""Under way in 1.66 periods, the latest first [N]."""
Z = np.array([4e-7, 8e-3, -3e-7, 5e-3])

DRIVER = """
#include "linear.h"

static void place(known *k, const double *p, const double *c, const double *in)
{
    memset(k, 0, sizeof *k);
    memcpy(k->p, p, sizeof k->p);
    memcpy(k->c, c, sizeof k->c);
    memcpy(k->in, in, sizeof k->in);
}

/* The device in `entries`; the command at w and its slopes; what is seen of z and its slopes; z found again. */
void try_linear(const double *p, const double *c, const double *in, double w, const double *commands,
                const double *times, const double *z, double *entries, double *seen, double *seen_by_p,
                double *y, double *y_by_p, double *again)
{
    known k;
    linear at, by[NP];
    sight s;
    place(&k, p, c, in);
    linear_of(&k, &at, by);
    memcpy(entries, &at, sizeof at);
    linear_command(&at, by, w, seen, (double (*)[NP])seen_by_p);
    sight_form(&s, &at, commands, 2, times[0], times[1]);
    sight_see(&s, by, z, y, (double (*)[NP])y_by_p);
    sight_back(&s, y, again);
}
"""


class Device:
    """The reference device with ``CHAIN``, all of it uncertain, through the C."""

    def __init__(self, folder):
        design = told(device_with(**CHAIN), {name: 0.1 * abs(value) for name, value in CHAIN.items()})
        known = design.known_model
        lib = library(known)
        self.delay = known.value_names.index("actuator_delay") - 1  # 1/m comes last
        self.c = known_values(design, lib, PERIOD)
        self.p, root = prior(design, lib)
        self.deviations = np.linalg.norm(root, axis=1)
        names = ("linear.c", "linear.h", "known.h", "wide.h")
        texts = {name: (FOLDER / name).read_text(encoding="utf-8") for name in names}
        texts |= {"known_model.h": known.header(), "sizes.h": known.sizes_header(), "driver.c": DRIVER}
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        compile_library(folder, ["linear.c", "driver.c"], folder / "linear.so", ("-fvisibility=default",))
        self.call = ctypes.CDLL(str(folder / "linear.so")).try_linear

    def look(self, p, w=PACE):
        """Entries of the device, the command at ``w`` and its slopes, what is seen of Z and its slopes, Z again."""
        sizes = ((22,), (8,), (8, len(p)), (4,), (4, len(p)), (4,))
        out = [np.zeros(size) for size in sizes]
        times = [p[self.delay] - PERIOD, PERIOD]
        given = [np.ascontiguousarray(a, dtype=float) for a in (p, self.c, MEASURED)]
        rest = [np.ascontiguousarray(a, dtype=float) for a in (COMMANDS, times, Z)]
        self.call(*map(pointer, given), ctypes.c_double(w), *map(pointer, rest), *map(pointer, out))
        return out

    def matrices(self, p):
        """c, d, b, kappa, delta, the delay and the lag."""
        entries = self.look(p)[0]
        return (*entries[:20].reshape(5, 2, 2), *entries[20:])

    def differences(self, which, w=PACE):
        """Central differences of an output of ``look`` by p, in deviations of the design."""
        steps = np.diag(1e-4 * self.deviations)
        columns = [(self.look(self.p + s, w)[which] - self.look(self.p - s, w)[which]) / 2e-4 for s in steps]
        return np.array(columns).T


@pytest.fixture(scope="module")
def device(tmp_path_factory):
    return Device(tmp_path_factory.mktemp("linear"))


def test_the_device_at_rest_is_that_of_its_parameters(device):
    c, d, b, kappa, delta, delay, lag = device.matrices(device.p)
    a, _ = matrix(REFERENCE, 0.0)
    np.testing.assert_allclose(kappa, -a[1::2, ::2], rtol=1e-12)
    np.testing.assert_allclose(delta, -a[1::2, 1::2], rtol=1e-12)
    # The mass moves by b, and voltages by d at the same command: the feedthrough is of the force at the mass.
    force = REFERENCE[-1] * b
    np.testing.assert_allclose(d, CHAIN["feedthrough"] * force, rtol=1e-12, atol=1e-15)
    assert (delay, lag) == (CHAIN["actuator_delay"], CHAIN["amplifier_time_constant"])
    assert abs(np.linalg.det(c)) == pytest.approx(GAIN**2, rel=0.1)


@pytest.mark.parametrize("share", [0.16, 0.73, 1.0, 1.3])
def test_a_command_that_goes_with_a_voltage_makes_it(device, share):
    c, d, b, kappa, delta, delay, lag = device.matrices(device.p)
    s = 1j * share * PACE
    moved = np.linalg.solve(s**2 * np.eye(2) + s * delta + kappa, b)
    makes = np.exp(-s * delay) / (1 + s * lag) * (c @ moved + d)
    seen = device.look(device.p, share * PACE)[1]
    command = (seen[:4] + 1j * seen[4:]).reshape(2, 2)
    np.testing.assert_allclose(makes @ command, np.eye(2), atol=1e-12)


@pytest.mark.parametrize(("which", "slopes"), [(1, 2), (3, 4)])
def test_slopes_are_those_of_differences(device, which, slopes):
    found = device.look(device.p)[slopes] * device.deviations
    differences = device.differences(which)
    size = np.abs(differences).max(axis=1, keepdims=True)
    # Differences of 1e-4 deviations leave the square of that, times slopes that turn by a tenth of a deviation or less.
    np.testing.assert_allclose(found / size, differences / size, atol=1e-6)


def test_voltages_go_on_as_they_are_seen(device):
    """The motion under the commands under way, then under none, followed by scipy: once the lag has settled, voltages
    are what (c, c) exp(A t) w says from the start."""
    c, _, b, kappa, delta, delay, lag = device.matrices(device.p)
    a = np.zeros((4, 4))
    a[0, 1] = a[2, 3] = 1.0
    a[1::2, ::2], a[1::2, 1::2] = -kappa, -delta
    into = np.zeros((4, 2))
    into[1::2] = b
    reads = np.zeros((2, 4))
    reads[:, ::2] = c
    whole = np.zeros((8, 8))
    whole[:4, :4], whole[:4, 6:] = a, into
    whole[4:6, :4], whole[4:6, 4:6] = reads / lag, -np.eye(2) / lag
    state = np.concatenate([Z, [0.3, -0.2]])
    for command, span in ((COMMANDS[1], delay - PERIOD), (COMMANDS[0], PERIOD), (np.zeros(2), 60 * lag)):
        state = (expm(whole * span) @ np.concatenate([state, command]))[:6]
    y = device.look(device.p)[3]
    voltage_and_slope = np.zeros((4, 4))
    voltage_and_slope[::2, ::2] = voltage_and_slope[1::2, 1::2] = c
    w = np.linalg.solve(voltage_and_slope, y)
    seen = reads @ expm(a * (delay + 60 * lag)) @ w
    # Seven moments leave (omega tau_d)^7/7! of what the commands add, 1e-9.
    np.testing.assert_allclose(state[4:], seen, rtol=1e-9)


def test_the_motion_is_found_again_of_what_is_seen(device):
    np.testing.assert_allclose(device.look(device.p)[5], Z, rtol=1e-12)
