"""Writes the C of a model: ``model.h`` (variables by index), ``model.c`` (their table) and ``names.h``
(symbols of its own); ``effects.h`` is ``generate_effects``'s."""

import re
from collections.abc import Iterable

from gyro_model.c_printing import STAMP, c_double, macro
from gyro_model.continuous_states import continuous_states, first_clock, first_local, hidden_states
from gyro_model.form import Form

_KINDS = {"input": "GYRO_INPUT", "output": "GYRO_OUTPUT"}


def header(model: Form) -> str:
    """``model.h``: the indexes of variables."""
    kinds = "\n".join(
        f"    {macro(q.name)} = {index}, /* [{q.unit}] {q.role}: {q.description} */"
        for index, q in enumerate(model.quantities)
    )
    inputs = sum(q.role == "input" for q in model.quantities)
    continuous = len(continuous_states(model))
    return f"""{STAMP}
#ifndef GYRO_MODEL_H
#define GYRO_MODEL_H

#include <stdint.h>

#include "names.h"

/* Stands for "no bound" in gyro_variables. */
#define GYRO_UNBOUNDED 1e308

/* Variables by value reference. */
enum {{
{kinds}
    GYRO_N_INPUTS = {inputs}, /* which come first */
    GYRO_N_VARIABLES = {len(model.quantities)}
}};

/* The motion as a differential equation: continuous states, the voltages behind the amplifier's lag, what lags, what
   flows. Variables beyond those above and `time` show the states that are no outputs, and all rates. */
enum {{
    GYRO_N_CONTINUOUS = {max(continuous, 1)},
    GYRO_FIRST_LOCAL = {first_local(model)}, /* value reference */
    GYRO_N_LOCALS = {len(hidden_states(model)) + continuous}
}};

/* Output clocks, which tick at samples; value references beyond all other variables. */
enum {{ GYRO_FIRST_CLOCK = {first_clock(model)}, GYRO_N_CLOCKS = {len(model.CLOCKS)} }};

typedef enum {{
    GYRO_INPUT,
    GYRO_PARAMETER, /* fixed once it runs */
    GYRO_TUNABLE,   /* a parameter that may change while it runs */
    GYRO_OUTPUT
}} gyro_kind;
typedef enum {{ GYRO_REAL, GYRO_INTEGER }} gyro_type;

typedef struct {{
    const char *name;
    gyro_kind kind;
    gyro_type type;
    double start; /* SI */
    double min;   /* inclusive */
    double max;   /* inclusive */
}} gyro_variable;

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Names this model, effects, bounds and start values included; an FMU of another model has another token. */
extern const char gyro_token[];

/* Shape (GYRO_N_VARIABLES), by value reference. */
extern const gyro_variable gyro_variables[GYRO_N_VARIABLES];

/* Of each continuous state. */
typedef struct {{
    uint32_t vr;      /* value reference of the variable that shows it */
    uint32_t rate_vr; /* and its rate */
    double nominal;   /* SI */
}} gyro_state;

/* Shape (GYRO_N_CONTINUOUS), or one of zeros where the FMU shows none. */
extern const gyro_state gyro_states[GYRO_N_CONTINUOUS];

/* Names of the variables from GYRO_FIRST_LOCAL on, NULL at the end. */
extern const char *const gyro_local_names[GYRO_N_LOCALS + 1];

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
"""


def table(model: Form, token: str) -> str:
    """``model.c``: the table of variables, and the token that names this model. It alone knows start values, so that
    the rest of a library serves every device."""
    kinds = {q.name: _KINDS.get(q.role, "GYRO_PARAMETER") for q in model.quantities}
    kinds |= dict.fromkeys(model.tunable, "GYRO_TUNABLE")
    rows = "\n".join(
        f'    {{"{q.name}", {kinds[q.name]}, {"GYRO_INTEGER" if q.integer else "GYRO_REAL"}, '
        f"{c_double(model.start(q))}, {c_double(q.low)}, {c_double(q.high)}}},"
        for q in model.quantities
    )
    states = continuous_states(model)
    shown = "\n".join(f"    {{{s.reference}u, {s.rate_reference}u, {c_double(s.nominal)}}}," for s in states)
    names = [*(s.name for s in hidden_states(model)), *(s.rate_name for s in states)]
    local = "".join(f'    "{name}",\n' for name in names)
    return f"""{STAMP}
#include "model.h"

const char gyro_token[] = "{token}";

const gyro_state gyro_states[GYRO_N_CONTINUOUS] = {{
{shown or "    {0u, 0u, 0.0},"}
}};

const char *const gyro_local_names[GYRO_N_LOCALS + 1] = {{
{local}    0,
}};

const gyro_variable gyro_variables[GYRO_N_VARIABLES] = {{
{rows}
}};
"""


# A function or array that one file shares with others, as its header declares it, at the beginning of a line.
_SHARED = re.compile(r"^(?!static )(?:extern )?(?:const )?\w+ \*?((?:gyro|fmi)_\w+)[(\[]", re.MULTILINE)


def names(model: Form, headers: Iterable[str]) -> str:
    """``names.h``: what the FMU's files share, as the texts of their headers declare it, under names that carry the
    FMU's: two FMUs can then be linked into one program."""
    declared = {name for text in headers for name in _SHARED.findall(text)}
    lines = "\n".join(
        f"#define {name} {model.NAME}_{name}"
        for name in sorted(declared | {"gyro_token", "gyro_variables", "gyro_states", "gyro_local_names"})
    )
    return f"""{STAMP}
/* What the files of this FMU share carries its name, so that it can be linked with others into one program; define
   FMI2_FUNCTION_PREFIX or FMI3_FUNCTION_PREFIX for the functions of the standard. */

#ifndef GYRO_NAMES_H
#define GYRO_NAMES_H

{lines}

#endif
"""
