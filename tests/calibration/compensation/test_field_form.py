"""The C that runs in the field, compiled and fed a record sample by sample, against the blocks that were fitted."""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cycle_records import STEP, course, record
from calibration.compensation.export import to_c_header
from calibration.compensation.methods import history
from calibration.compensation.record import joined, make_blocks
from gyro_model.compiling import find_compiler
from gyro_model.errors import InputError

SIZES = {"play": 4e-5, "slow": 2e-5}
DRIVER = """#include <stdio.h>
#include "compensation.h"
int main(void)
{
    struct gyro_compensation_state state;
    double sensor[2], rate;
    gyro_compensation_start(&state);
    while (scanf("%lf %lf %lf", &sensor[0], &sensor[1], &rate) == 3) {
        double out = 0.0;
        int beyond = gyro_compensation_sample(&state, 1.0, sensor, rate, &out);
        printf("%.17g %d\\n", out, beyond);
    }
    return 0;
}
"""


def test_sample_by_sample_it_leaves_what_the_blocks_leave(tmp_path: Path) -> None:
    try:
        compiler = find_compiler()
    except InputError as error:
        pytest.skip(str(error))
    fitted = joined([make_blocks(record(course(), seed, **SIZES), 10.0, 0.0) for seed in (1, 2)])
    *_, names = (names for names in history.sets(fitted) if names[0] == "structure")
    compensation = history.fit(fitted, 10.0, names, 1e-6, 1e-5, True)
    (tmp_path / "compensation.h").write_text(to_c_header(compensation, "clamp"))
    (tmp_path / "main.c").write_text(DRIVER)
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run([*compiler, *strict, "-o", str(tmp_path / "a"), str(tmp_path / "main.c"), "-lm"], check=True)

    test = record(course(((55.0, 4.0), (-15.0, 1.0))), 9, **SIZES)
    columns = np.stack([test.signals["structure"], test.signals["circuit"], test.rate], axis=1).tolist()
    text = "\n".join(f"{a!r} {b!r} {c!r}" for a, b, c in columns)
    shown = subprocess.run([str(tmp_path / "a")], input=text, capture_output=True, text=True, check=True).stdout
    left = np.array([float(row.split()[0]) for row in shown.splitlines()])
    assert len(left) == len(test.t)

    blocks = make_blocks(test, 10.0, 0.0)
    applied = compensation.at(blocks, "clamp")
    of_blocks = blocks.rate / applied.scale - applied.bias
    of_field = left[: len(left) // 10 * 10].reshape(-1, 10).mean(axis=1)[1:]
    before, after, field = (float(np.sqrt(np.mean(v**2))) for v in (test.rate - test.rate.mean(), of_blocks, of_field))
    assert after < before / 50
    # Level and slope at the present instant bring noise of the sensors, and what the filter lags behind where a ramp
    # begins; measured 1.2.
    assert field < 1.6 * after
    assert STEP == 1.0
