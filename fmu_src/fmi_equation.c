/* Model exchange, events and derivatives, for both FMI layers. */

#include "continuous.h"
#include "fmi_common.h"
#include "gyro_math.h"

/* FMI_ERROR where the call is not allowed now, or the FMU shows no equation. */
static fmi_status allow(const fmi_instance *f, const char *call, unsigned allowed)
{
    fmi_status status = f == NULL ? FMI_ERROR : FMI_OK;
    if (status == FMI_OK && gyro_no_equation() != NULL) {
        status = fmi_fail(f, call, "%s", gyro_no_equation());
    }
    return status == FMI_OK ? fmi_allow(f, call, allowed) : status;
}

fmi_status fmi_allow_exchange(const fmi_instance *f, const char *call, unsigned allowed)
{
    fmi_status status = allow(f, call, allowed);
    if (status == FMI_OK && f->purpose != MODEL_EXCHANGE) {
        status = fmi_fail(f, call, "the instance is made for co-simulation; instantiate it for model exchange");
    }
    return status;
}

static fmi_status relay(const fmi_instance *f, const char *call, gyro_status status)
{
    return status == GYRO_OK ? FMI_OK : fmi_fail(f, call, "%s", gyro_message(f->core));
}

fmi_status fmi_enter_event_mode(fmi_instance *f, const char *call)
{
    const unsigned from = f != NULL && f->purpose == MODEL_EXCHANGE ? CONTINUOUS : STEPPING;
    fmi_status status = allow(f, call, from);
    if (status == FMI_OK && f->purpose == CO_SIMULATION) {
        status = fmi_fail(f, call, "the instance is made without event mode; pass eventModeUsed = true");
    } else if (status == FMI_OK && f->purpose == MODEL_EXCHANGE) {
        status = relay(f, call, gyro_enter_event(f->core));
    } else if (status == FMI_OK) {
        gyro_latch(f->core);
    }
    if (status == FMI_OK) {
        f->state = EVENT;
    }
    return status;
}

fmi_status fmi_leave_event_mode(fmi_instance *f, const char *call, unsigned mode)
{
    fmi_status status = allow(f, call, EVENT);
    if (status == FMI_OK && (mode == CONTINUOUS) != (f->purpose == MODEL_EXCHANGE)) {
        status = fmi_fail(f, call, "the instance is made for another purpose");
    }
    if (status == FMI_OK) {
        f->state = mode;
    }
    return status;
}

fmi_status fmi_update(fmi_instance *f, const char *call, int *jumped, double *next)
{
    fmi_status status = allow(f, call, CAN_UPDATE);
    if (status == FMI_OK && f->purpose == MODEL_EXCHANGE) {
        status = relay(f, call, gyro_update(f->core, jumped, next));
    } else if (status == FMI_OK) {
        f->ticking = 0;
        *jumped = 0;
        *next = gyro_next_sample(f->core);
    }
    return status;
}

fmi_status fmi_set_time(fmi_instance *f, const char *call, double time)
{
    fmi_status status = fmi_allow_exchange(f, call, CAN_SET_TIME);
    if (status == FMI_OK && !(gyro_finite(time) && time >= f->start_time)) {
        status = fmi_fail(f, call, "time is %g s; give a finite time, not before the start at %g s", time, f->start_time);
    }
    if (status == FMI_OK) {
        gyro_set_time(f->core, time);
    }
    return status;
}

static fmi_status check_states(const fmi_instance *f, const char *call, const double states[], size_t n)
{
    fmi_status status = FMI_OK;
    if (n != GYRO_N_CONTINUOUS || states == NULL) {
        status = fmi_fail(f, call, "an array of %d continuous states is due, not %lu", (int)GYRO_N_CONTINUOUS, (unsigned long)n);
    }
    return status;
}

fmi_status fmi_set_states(fmi_instance *f, const char *call, const double states[], size_t n)
{
    fmi_status status = fmi_allow_exchange(f, call, CAN_SET_STATES);
    status = status == FMI_OK ? check_states(f, call, states, n) : status;
    return status == FMI_OK ? relay(f, call, gyro_set_continuous(f->core, states)) : status;
}

/* States and rates exist once the instance has started. */
static fmi_status ready(fmi_instance *f, const char *call, const double array[], size_t n)
{
    fmi_status status = fmi_allow_exchange(f, call, CAN_DERIVE);
    status = status == FMI_OK ? check_states(f, call, array, n) : status;
    return status == FMI_OK ? fmi_refresh(f, call) : status;
}

fmi_status fmi_get_states(fmi_instance *f, const char *call, double states[], size_t n)
{
    fmi_status status = ready(f, call, states, n);
    if (status == FMI_OK) {
        gyro_get_continuous(f->core, states);
    }
    return status;
}

fmi_status fmi_get_rates(fmi_instance *f, const char *call, double rates[], size_t n)
{
    fmi_status status = ready(f, call, rates, n);
    if (status == FMI_OK) {
        gyro_get_rates(f->core, rates);
    }
    return status;
}

fmi_status fmi_get_nominals(fmi_instance *f, const char *call, double nominals[], size_t n)
{
    fmi_status status = ready(f, call, nominals, n);
    for (size_t i = 0; i < n && status == FMI_OK; i++) {
        nominals[i] = gyro_states[i].nominal;
    }
    return status;
}

fmi_status fmi_no_indicators(fmi_instance *f, const char *call, size_t n)
{
    fmi_status status = fmi_allow_exchange(f, call, CAN_DERIVE);
    if (status == FMI_OK && n != 0) {
        status = fmi_fail(f, call, "there are no event indicators, not %lu: every event comes at a time known before", (unsigned long)n);
    }
    return status;
}

fmi_status fmi_completed_step(fmi_instance *f, const char *call) { return fmi_allow_exchange(f, call, CONTINUOUS); }

double fmi_local(fmi_instance *f, uint32_t vr)
{
    double states[GYRO_N_CONTINUOUS], rates[GYRO_N_CONTINUOUS], value = 0.0;
    gyro_get_continuous(f->core, states);
    gyro_get_rates(f->core, rates);
    for (int i = 0; i < GYRO_N_CONTINUOUS; i++) {
        value = gyro_states[i].vr == vr ? states[i] : gyro_states[i].rate_vr == vr ? rates[i] : value;
    }
    return value;
}

/* Adds `seed` to the direction of a known; 0 where it is none. */
static int move_along(gyro_direction *along, uint32_t vr, double seed)
{
    int found = vr < GYRO_N_INPUTS;
    if (found) {
        along->input[vr] += seed;
    }
    for (int i = 0; i < GYRO_N_CONTINUOUS && !found; i++) {
        found = gyro_states[i].vr == vr;
        along->state[i] += found ? seed : 0.0;
    }
    return found;
}

/* How an unknown responds; NULL where `vr` is none. */
static const double *response_of(const gyro_direction *along, const gyro_response *response, uint32_t vr)
{
    const double *value = NULL;
    const int shown = vr < GYRO_N_VARIABLES && gyro_variables[vr].kind == GYRO_OUTPUT && !gyro_is_sample(vr);
    if (shown) {
        value = &response->output[vr];
    }
    for (int i = 0; i < GYRO_N_CONTINUOUS && value == NULL; i++) {
        value = gyro_states[i].rate_vr == vr ? &response->rate[i] : gyro_states[i].vr == vr ? &along->state[i] : NULL;
    }
    return value;
}

static fmi_status check_derivative(fmi_instance *f, const char *call, const fmi_derivative *of, size_t n_seed, size_t n_sensitivity)
{
    static const gyro_direction still;
    static const gyro_response none;
    gyro_direction along = still;
    fmi_status status = allow(f, call, CAN_DERIVE);
    const int arrays = (of->n_knowns == 0 || of->knowns != NULL) && (of->n_unknowns == 0 || of->unknowns != NULL) &&
                       (n_seed == 0 || of->seed != NULL) && (n_sensitivity == 0 || of->sensitivity != NULL);
    if (status == FMI_OK && (of->n_seed != n_seed || of->n_sensitivity != n_sensitivity || !arrays)) {
        status = fmi_fail(f, call, "pass %lu seeds and room for %lu sensitivities", (unsigned long)n_seed, (unsigned long)n_sensitivity);
    }
    for (size_t i = 0; i < of->n_knowns && status == FMI_OK; i++) {
        if (!move_along(&along, of->knowns[i], 0.0)) {
            status = fmi_fail(f, call, "the known %lu is neither an input nor a continuous state", (unsigned long)of->knowns[i]);
        }
    }
    for (size_t i = 0; i < of->n_unknowns && status == FMI_OK; i++) {
        if (response_of(&still, &none, of->unknowns[i]) == NULL) {
            status = fmi_fail(f, call, "the unknown %lu is neither the rate of a state nor a continuous output", (unsigned long)of->unknowns[i]);
        }
    }
    return status == FMI_OK ? fmi_refresh(f, call) : status;
}

fmi_status fmi_derive(fmi_instance *f, const char *call, const fmi_derivative *of)
{
    fmi_status status = check_derivative(f, call, of, of->n_knowns, of->n_unknowns);
    if (status == FMI_OK) {
        gyro_direction along = {{0.0}, {0.0}};
        gyro_response response;
        for (size_t i = 0; i < of->n_knowns; i++) {
            move_along(&along, of->knowns[i], of->seed[i]);
        }
        gyro_respond(f->core, &along, &response);
        for (size_t i = 0; i < of->n_unknowns; i++) {
            of->sensitivity[i] = *response_of(&along, &response, of->unknowns[i]);
        }
    }
    return status;
}

fmi_status fmi_derive_adjoint(fmi_instance *f, const char *call, const fmi_derivative *of)
{
    fmi_status status = check_derivative(f, call, of, of->n_unknowns, of->n_knowns);
    for (size_t k = 0; k < of->n_knowns && status == FMI_OK; k++) {
        /* A column of the Jacobian for each known: there are few. */
        gyro_direction along = {{0.0}, {0.0}};
        gyro_response response;
        double sum = 0.0;
        move_along(&along, of->knowns[k], 1.0);
        gyro_respond(f->core, &along, &response);
        for (size_t i = 0; i < of->n_unknowns; i++) {
            sum += of->seed[i] * *response_of(&along, &response, of->unknowns[i]);
        }
        of->sensitivity[k] = sum;
    }
    return status;
}
