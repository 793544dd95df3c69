/* The instance that both FMI layers hold: life cycle, variables, steps, in this order.
   Nothing on the way of a set, step or get that succeeds writes to the log. */

#include "continuous.h"
#include "fmi_common.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

#include "gyro_math.h"

enum { STATES_SIZE = 192 };

/* Both indexed by gyro_kind. */
static const unsigned can_set[] = {[GYRO_INPUT] = CAN_SET_INPUT, [GYRO_PARAMETER] = CAN_SET_PARAMETER, [GYRO_TUNABLE] = CAN_TUNE, [GYRO_OUTPUT] = 0};
static const unsigned can_get[] = {
    [GYRO_INPUT] = CAN_GET_INPUT, [GYRO_PARAMETER] = CAN_GET_PARAMETER, [GYRO_TUNABLE] = CAN_GET_PARAMETER, [GYRO_OUTPUT] = CAN_GET_OUTPUT};

double fmi_time(const fmi_instance *f)
{
    return gyro_started(f->core) ? gyro_time(f->core) : f->start_time;
}

static fmi_status fail_with_core_message(const fmi_instance *f, const char *call)
{
    return fmi_fail(f, call, "%s", gyro_message(f->core));
}

/* "a or b or c" of the states in `states`. */
static void name_states(unsigned states, char text[STATES_SIZE])
{
    static const char *const names[] = {"instantiated", "initialization mode", "step mode", "terminated", "intermediate update",
                                        "event mode", "continuous-time mode"};
    text[0] = '\0';
    for (unsigned i = 0; i < sizeof names / sizeof *names; i++) {
        if ((states & (1u << i)) != 0) {
            if (text[0] != '\0') {
                strcat(text, " or ");
            }
            strcat(text, names[i]);
        }
    }
}

/* `what` is the call, or a variable's name within it. */
static fmi_status refuse_state(const fmi_instance *f, const char *call, const char *what, unsigned allowed)
{
    char present[STATES_SIZE], wanted[STATES_SIZE];
    name_states(f->state, present);
    name_states(allowed, wanted);
    return fmi_fail(f, call, "%s is not allowed now: the instance is in state %s; allowed in %s", what, present, wanted);
}

fmi_status fmi_allow(const fmi_instance *f, const char *call, unsigned allowed)
{
    fmi_status status = FMI_OK;
    if (f == NULL) {
        status = FMI_ERROR;
    } else if ((f->state & allowed) == 0) {
        status = refuse_state(f, call, "the call", allowed);
    }
    return status;
}

static void begin_life(fmi_instance *f)
{
    f->state = INSTANTIATED;
    f->last_step = FMI_OK;
    f->ticking = 0;
    f->start_time = 0.0;
    f->stop_time = INFINITY;
    f->latest_time = INFINITY;
}

static void take_starts(fmi_instance *f)
{
    for (uint32_t vr = 0; f->has_starts && vr < GYRO_N_VARIABLES; vr++) {
        gyro_set(f->core, vr, f->start[vr]);
    }
}

fmi_instance *fmi_new(const fmi_request *r)
{
    const char *name = r->name != NULL ? r->name : "";
    size_t name_size = strlen(name) + 1;
    fmi_status status = FMI_OK;
    fmi_instance *f = calloc(1, sizeof *f + name_size);
    if (f != NULL) {
        begin_life(f);
        f->purpose = r->purpose;
        f->logging = LOG_ERRORS | (r->logging_on ? LOG_EVENTS : 0);
        f->emit = r->emit;
        f->callback = r->callback;
        f->environment = r->environment;
        f->watch = r->update != NULL ? r->watch : NULL;
        f->update = r->update;
        f->may_end_early = r->may_end_early;
        memcpy(f->name, name, name_size);
        const char *refusal = r->refusal != NULL ? r->refusal : r->purpose != CO_SIMULATION ? gyro_no_equation() : NULL;
        if (refusal != NULL) {
            status = fmi_fail(f, r->call, "%s", refusal);
        } else if ((status = fmi_check_token(f, r)) == FMI_OK && (f->core = gyro_new()) == NULL) {
            status = fmi_fail(f, r->call, "out of memory");
        }
        if (status != FMI_OK) {
            fmi_free(f);
            f = NULL;
        } else {
            take_starts(f);
            fmi_report(f, r->call, "instantiated");
        }
    }
    return f;
}

void fmi_free(fmi_instance *f)
{
    if (f != NULL && f->state == INTERMEDIATE) {
        /* The step that called the importer still needs the instance. */
        fmi_fail(f, "FreeInstance", "not allowed within a step; return from the update function first");
    } else if (f != NULL) {
        if (f->core != NULL) {
            gyro_free(f->core);
        }
        free(f);
    }
}

fmi_status fmi_set_times(fmi_instance *f, const char *call, double start_time, int stop_defined, double stop_time)
{
    fmi_status status = fmi_allow(f, call, CAN_SETUP);
    if (status == FMI_OK && !gyro_finite(start_time)) {
        status = fmi_fail(f, call, "startTime is %g; give a finite time in s", start_time);
    } else if (status == FMI_OK && stop_defined && !(stop_time >= start_time)) {
        status = fmi_fail(f, call, "stopTime is %g s; it must not be before startTime %g s", stop_time, start_time);
    }
    if (status == FMI_OK) {
        f->start_time = start_time;
        f->stop_time = stop_defined ? stop_time : INFINITY;
    }
    return status;
}

fmi_status fmi_enter_initialization(fmi_instance *f, const char *call)
{
    fmi_status status = fmi_allow(f, call, CAN_ENTER_INITIALIZATION);
    if (status == FMI_OK) {
        f->state = INITIALIZATION;
        fmi_report(f, call, "initialization begins");
    }
    return status;
}

fmi_status fmi_refresh(fmi_instance *f, const char *call)
{
    fmi_status status = FMI_OK;
    if (!gyro_started(f->core) && gyro_start(f->core, f->start_time) != GYRO_OK) {
        status = fail_with_core_message(f, call);
    }
    return status;
}

void fmi_find_latest_time(fmi_instance *f)
{
    /* What is left of two sums of times in doubles, and the tick that the core rounds to. */
    f->latest_time = f->stop_time + 4.0 * DBL_EPSILON * (fabs(f->stop_time) + fabs(f->start_time)) + 1e-12;
}

fmi_status fmi_exit_initialization(fmi_instance *f, const char *call)
{
    fmi_status status = fmi_allow(f, call, CAN_EXIT_INITIALIZATION);
    if (status == FMI_OK) {
        status = fmi_refresh(f, call);
    }
    if (status == FMI_OK) {
        fmi_find_latest_time(f);
        f->state = f->purpose == CO_SIMULATION ? STEPPING : EVENT;
        f->ticking = 1; /* the start is a sample */
        gyro_hold_samples(f->core, f->purpose == CO_SIMULATION_WITH_EVENTS);
        fmi_report(f, call, "initialized");
    }
    return status;
}

fmi_status fmi_terminate(fmi_instance *f, const char *call)
{
    fmi_status status = fmi_allow(f, call, CAN_TERMINATE);
    if (status == FMI_OK) {
        f->state = TERMINATED;
        fmi_report(f, call, "terminated");
    }
    return status;
}

fmi_status fmi_reset(fmi_instance *f, const char *call)
{
    fmi_status status = fmi_allow(f, call, CAN_RESET);
    if (status == FMI_OK) {
        gyro_reset(f->core);
        take_starts(f);
        begin_life(f);
        fmi_report(f, call, "reset");
    }
    return status;
}

static const char *const type_names[] = {[GYRO_REAL] = "real (Float64)", [GYRO_INTEGER] = "integer (Int32)"};

/* Value references below this exist: the variables, `time`, then states and rates. */
enum { N_READABLE = GYRO_FIRST_LOCAL + GYRO_N_LOCALS };

static const char *name_of(uint32_t vr)
{
    return vr < GYRO_N_VARIABLES ? gyro_variables[vr].name : vr < GYRO_FIRST_LOCAL ? "time" : gyro_local_names[vr - GYRO_FIRST_LOCAL];
}

static gyro_type type_of(uint32_t vr)
{
    return vr < GYRO_N_VARIABLES ? gyro_variables[vr].type : GYRO_REAL;
}

static double element(gyro_type type, const void *values, size_t i)
{
    return type == GYRO_REAL ? ((const double *)values)[i] : (double)((const int32_t *)values)[i];
}

static fmi_status check_arrays(const fmi_instance *f, const char *call, const void *vr, size_t n, const void *values, size_t n_values)
{
    fmi_status status = FMI_OK;
    if (f == NULL) {
        status = FMI_ERROR;
    } else if (n_values != n) {
        status = fmi_fail(f, call, "%lu values for %lu value references; every variable is a scalar: pass as many values as references",
                          (unsigned long)n_values, (unsigned long)n);
    } else if (n > 0 && (vr == NULL || values == NULL)) {
        status = fmi_fail(f, call, "%s is NULL; pass an array of %lu", vr == NULL ? "the value references" : "the values",
                          (unsigned long)n);
    }
    return status;
}

static fmi_status check_type(const fmi_instance *f, const char *call, gyro_type type, uint32_t vr)
{
    fmi_status status = FMI_OK;
    if (vr >= N_READABLE) {
        status = fmi_fail(f, call, "no variable has the value reference %lu; they go from 0 to %lu", (unsigned long)vr,
                          (unsigned long)N_READABLE - 1);
    } else if (type_of(vr) != type) {
        status = fmi_fail(f, call, "%s is %s, not %s", name_of(vr), type_names[type_of(vr)], type_names[type]);
    }
    return status;
}

static fmi_status check_set(const fmi_instance *f, const char *call, gyro_type type, uint32_t vr, double value)
{
    fmi_status status = check_type(f, call, type, vr);
    unsigned allowed = vr < GYRO_N_VARIABLES ? can_set[gyro_variables[vr].kind] : 0;
    if (status == FMI_OK && allowed == 0) {
        status = fmi_fail(f, call, "%s is computed by the FMU; only inputs and parameters can be set", name_of(vr));
    } else if (status == FMI_OK && (f->state & allowed) == 0) {
        status = refuse_state(f, call, name_of(vr), allowed);
    } else if (status == FMI_OK && !gyro_finite(value)) {
        status = fmi_fail(f, call, "%s is %g; give a finite value", name_of(vr), value);
    } else if (status == FMI_OK && (gyro_variables[vr].kind == GYRO_INPUT || (f->state & RUNNING) != 0)) {
        /* Parameters are checked at the start, together. */
        const gyro_variable *input = &gyro_variables[vr];
        const char *jumping = f->state == CONTINUOUS && value != gyro_get(f->core, vr) ? gyro_jumping(f->core, vr) : NULL;
        const char *foreign = input->kind == GYRO_TUNABLE ? gyro_foreign_effect(f->core, vr, value) : NULL;
        if (value < input->min || value > input->max) {
            status = fmi_fail(f, call, "%s is %g; give a value from %g to %g", input->name, value, input->min, input->max);
        } else if (jumping != NULL) {
            status = fmi_fail(f, call, "%s may change in event mode only while the effect %s acts", input->name, jumping);
        } else if (foreign != NULL) {
            status = fmi_fail(f, call, "%s is %g, with which the effect %s would act, which this FMU can't follow: use the full FMU", input->name,
                              value, foreign);
        }
    }
    return status;
}

/* How many values go the short way, past the checks one by one: the first ones, as long as they are inputs within their bounds. */
static size_t count_inputs(const fmi_instance *f, gyro_type type, const uint32_t vr[], size_t n, const void *values)
{
    size_t i = 0;
    if (f->state == STEPPING && type == GYRO_REAL) {
        const double *value = values;
        while (i < n && vr[i] < GYRO_N_INPUTS && value[i] >= gyro_variables[vr[i]].min && value[i] <= gyro_variables[vr[i]].max) {
            i++;
        }
    }
    return i;
}

fmi_status fmi_set(fmi_instance *f, const char *call, gyro_type type, const uint32_t vr[], size_t n, const void *values, size_t n_values)
{
    fmi_status status = check_arrays(f, call, vr, n, values, n_values);
    if (status == FMI_OK) {
        for (size_t i = count_inputs(f, type, vr, n, values); i < n && status == FMI_OK; i++) {
            status = check_set(f, call, type, vr[i], element(type, values, i));
        }
    }
    for (size_t i = 0; i < n && status == FMI_OK; i++) {
        gyro_set(f->core, vr[i], element(type, values, i));
    }
    if (status == FMI_OK && n > 0 && (f->state & CAN_SET_PARAMETER) != 0) {
        gyro_unstart(f->core);
    }
    return status;
}

static fmi_status check_get(fmi_instance *f, const char *call, gyro_type type, uint32_t vr)
{
    fmi_status status = check_type(f, call, type, vr);
    const gyro_kind kind = vr < GYRO_N_VARIABLES ? gyro_variables[vr].kind : GYRO_OUTPUT;
    if (status == FMI_OK && vr != GYRO_N_VARIABLES && !gyro_started(f->core)) {
        if ((f->state & can_get[kind]) == 0) {
            status = refuse_state(f, call, name_of(vr), can_get[kind]);
        } else if (kind == GYRO_OUTPUT) {
            status = fmi_refresh(f, call);
        }
    }
    if (status == FMI_OK && kind == GYRO_OUTPUT && f->purpose == MODEL_EXCHANGE && (f->state & (EVENT | CONTINUOUS)) != 0) {
        gyro_put_out_continuous(f->core);
    }
    return status;
}

/* Gets the first values, as long as they stand as they are, as most do: the short way past the checks; gives how many. */
static size_t get_standing(const fmi_instance *f, gyro_type type, const uint32_t vr[], size_t n, void *values)
{
    size_t i = 0;
    if (f->state == STEPPING && type == GYRO_REAL) {
        const gyro_instance *core = f->core;
        double *value = values;
        while (i < n && vr[i] < GYRO_N_VARIABLES && gyro_variables[vr[i]].type == GYRO_REAL) {
            value[i] = gyro_get(core, vr[i]);
            i++;
        }
    }
    return i;
}

fmi_status fmi_get(fmi_instance *f, const char *call, gyro_type type, const uint32_t vr[], size_t n, void *values, size_t n_values)
{
    fmi_status status = check_arrays(f, call, vr, n, values, n_values);
    for (size_t i = status == FMI_OK ? get_standing(f, type, vr, n, values) : n; i < n && status == FMI_OK; i++) {
        status = check_get(f, call, type, vr[i]);
        if (status == FMI_OK && type == GYRO_INTEGER) {
            ((int32_t *)values)[i] = (int32_t)gyro_get(f->core, vr[i]);
        } else if (status == FMI_OK) {
            ((double *)values)[i] = vr[i] < GYRO_N_VARIABLES   ? gyro_get(f->core, vr[i])
                                    : vr[i] < GYRO_FIRST_LOCAL ? fmi_time(f)
                                                               : fmi_local(f, vr[i]);
        }
    }
    return status;
}

fmi_status fmi_no_such_type(const fmi_instance *f, const char *call, const uint32_t vr[], size_t n)
{
    fmi_status status = check_arrays(f, call, vr, n, vr, n);
    if (status == FMI_OK && n > 0) {
        status = vr[0] < N_READABLE
                     ? fmi_fail(f, call, "%s is %s; no variable has the type of this function", name_of(vr[0]), type_names[type_of(vr[0])])
                     : fmi_fail(f, call, "no variable has the value reference %lu", (unsigned long)vr[0]);
    }
    return status;
}

fmi_status fmi_get_clocks(fmi_instance *f, const char *call, const uint32_t vr[], size_t n, _Bool value[])
{
    fmi_status status = check_arrays(f, call, vr, n, value, n);
    for (size_t i = 0; i < n && status == FMI_OK; i++) {
        const int64_t clock = (int64_t)vr[i] - GYRO_FIRST_CLOCK;
        if (clock < 0) {
            status = fmi_fail(f, call, "%s is %s, not a clock", name_of(vr[i]), type_names[type_of(vr[i])]);
        } else if (clock >= GYRO_N_CLOCKS) {
            status = fmi_fail(f, call, "no variable has the value reference %lu", (unsigned long)vr[i]);
        }
    }
    status = status == FMI_OK ? fmi_allow(f, call, CAN_GET_OUTPUT) : status;
    for (size_t i = 0; i < n && status == FMI_OK; i++) {
        value[i] = f->state == EVENT && f->ticking;
    }
    return status;
}

static double watch(void *watcher)
{
    fmi_instance *f = watcher;
    f->state = INTERMEDIATE;
    const double end = f->watch(f);
    f->state = STEPPING;
    return end;
}

fmi_status fmi_step(fmi_instance *f, const char *call, double from, double step)
{
    fmi_status status = fmi_allow(f, call, CAN_STEP);
    if (status == FMI_OK) {
        double end = gyro_time(f->core) + step;
        if (end > f->latest_time) {
            status = fmi_fail(f, call, "the step to %.9g s passes the stop time %.9g s; step less, or set a later stop time at the start",
                              end, f->stop_time);
        } else {
            const int64_t samples = gyro_samples(f->core);
            const int to_sample = f->purpose == CO_SIMULATION_WITH_EVENTS && f->may_end_early;
            const gyro_status moved = gyro_advance(f->core, from, step, to_sample, f->watch != NULL ? watch : NULL, f);
            f->sampled = gyro_samples(f->core) != samples;
            f->ticking |= f->sampled;
            if (moved == GYRO_ERROR) {
                status = fail_with_core_message(f, call);
            } else if (moved == GYRO_EARLY) {
                status = FMI_DISCARD;
                fmi_report(f, call, "the step ended early");
            }
        }
        f->last_step = status;
    }
    return status;
}
