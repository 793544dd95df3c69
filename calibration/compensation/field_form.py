"""The compensation as it runs in the field: C that takes every sample of the sensors and of the rate as it comes.

Each signal goes through a fading-memory filter of two equal poles (N. Morrison, Introduction to Sequential Smoothing
and Prediction, 1969, degree 1), which gives level and slope at the present instant: no lag on a ramp, where a mean over
the time before lags by half of it. With time constant τ = T/2 its slope is as noisy as the difference of two means over
the sampling time T: variances σ² dt/(4τ³) and 2σ² dt/T³.
"""

from calibration.compensation.derived import Derived, derived
from calibration.compensation.model import Compensation


def field_form(compensation: Compensation) -> str:
    """The struct, gyro_compensation_start() and gyro_compensation_sample()."""
    wanted = [derived(i.name) for i in compensation.inputs]
    signals = list(dict.fromkeys(w.signal for w in wanted))
    listing = "\n".join(f" *   sensor[{k}] {name}" for k, name in enumerate(signals))
    steps = "\n".join(_step(k, w, signals.index(w.signal)) for k, w in enumerate(wanted))
    return f"""\
/* What the compensation remembers between two samples: level [unit of the sensor], slope [1/s of it], and lags and
 * plays [unit of the sensor], one an input. */
struct gyro_compensation_state {{
    double level[{len(signals)}];
    double slope[{len(signals)}];
    double memory[GYRO_COMPENSATION_INPUTS];
    int started;
}};

#define GYRO_COMPENSATION_SENSORS {len(signals)}

/* To be called once, at power on. */
static inline void gyro_compensation_start(struct gyro_compensation_state *state)
{{
    state->started = 0;
}}

/* One sample: dt [s] since the one before, the sensors, and the rate. Returns as gyro_compensate() does.
{listing}
 */
static inline int gyro_compensation_sample(struct gyro_compensation_state *state, double dt, const double sensor[],
                                           double rate, double *compensated)
{{
    const double keep = exp(-dt / {compensation.sampling_time / 2!r});
{_if_lags("    double before[GYRO_COMPENSATION_SENSORS];", wanted)}    double x[GYRO_COMPENSATION_INPUTS];
    for (int i = 0; i < GYRO_COMPENSATION_SENSORS; i++) {{
        if (!state->started) {{
            state->level[i] = sensor[i];
            state->slope[i] = 0;
        }}
{_if_lags("        before[i] = state->level[i];", wanted)}\
        const double ahead = state->level[i] + dt * state->slope[i];
        const double error = sensor[i] - ahead;
        state->level[i] = ahead + (1 - keep * keep) * error;
        state->slope[i] += (1 - keep) * (1 - keep) / dt * error;
    }}
{steps}
    state->started = 1;
    return gyro_compensate(x, rate, compensated);
}}
"""


def _if_lags(line: str, wanted: list[Derived]) -> str:
    """The line where there is a lag, which needs the level before."""
    return f"{line}\n" if any(w.kind == "lag" for w in wanted) else ""


def _step(k: int, wanted: Derived, signal: int) -> str:
    """C that sets x[k]."""
    level = f"state->level[{signal}]"
    if wanted.kind == "":
        return f"    x[{k}] = {level};"
    if wanted.kind == "rate":
        return f"    x[{k}] = state->slope[{signal}];"
    start = f"    if (!state->started)\n        state->memory[{k}] = {level};\n"
    if wanted.kind == "lag":
        step = (
            f"    state->memory[{k}] += (1 - exp(-dt / {wanted.size!r}))\n"
            f"        * (0.5 * (before[{signal}] + {level}) - state->memory[{k}]);\n"
        )
    else:
        reach = f"{level} - {wanted.size!r}), {level} + {wanted.size!r}"
        step = f"    state->memory[{k}] = fmin(fmax(state->memory[{k}], {reach});\n"
    return f"{start}{step}    x[{k}] = state->memory[{k}] - {level};"
