#include "core.h"

#include <float.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plant.h"

/* A step or time counts as a multiple of the internal step within this fraction of one. */
static const double ON_GRID = 1e-6;

gyro_status gyro_refuse(gyro_instance *g, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(g->message, sizeof g->message, format, args);
    va_end(args);
    return GYRO_ERROR;
}

static void drop_delay_line(gyro_instance *g)
{
    free(g->delay_line);
    g->delay_line = NULL;
    g->delay_length = 0;
}

gyro_instance *gyro_new(void)
{
    gyro_instance *g = calloc(1, sizeof *g);
    if (g != NULL) {
        gyro_reset(g);
    }
    return g;
}

void gyro_free(gyro_instance *g)
{
    if (g != NULL) {
        drop_delay_line(g);
        free(g);
    }
}

void gyro_reset(gyro_instance *g)
{
    drop_delay_line(g);
    memset(g, 0, sizeof *g);
    for (int vr = 0; vr < GYRO_N_VARIABLES; vr++) {
        g->value[vr] = gyro_variables[vr].start;
    }
}

const char *gyro_message(const gyro_instance *g) { return g->message; }

gyro_status gyro_set(gyro_instance *g, uint32_t vr, double value)
{
    gyro_status status = GYRO_OK;
    if (!isfinite(value)) {
        status = gyro_refuse(g, "%s = %g: give a finite number", gyro_variables[vr].name, value);
    } else {
        g->value[vr] = value;
    }
    return status;
}

double gyro_get(const gyro_instance *g, uint32_t vr) { return g->value[vr]; }

double gyro_time(const gyro_instance *g) { return g->memory.start_time + (double)g->memory.tick * g->value[GYRO_INTERNAL_STEP]; }

int gyro_whole_steps(double time, double step, double slack, int64_t *count)
{
    const double steps = time / step;
    /* Beyond 2^62 the count would not fit; so far NaN does not compare. */
    const int countable = fabs(steps) < 4.6e18;
    *count = countable ? (int64_t)floor(steps + 0.5) : 0;
    return countable && fabs(steps - (double)*count) <= slack;
}

static gyro_status check_bounds(gyro_instance *g)
{
    gyro_status status = GYRO_OK;
    for (int vr = 0; vr < GYRO_N_VARIABLES && status == GYRO_OK; vr++) {
        const gyro_variable *variable = &gyro_variables[vr];
        const double value = g->value[vr];
        if (variable->kind != GYRO_OUTPUT && !(value >= variable->min && value <= variable->max)) {
            status = gyro_refuse(g, "%s = %.9g: give a value from %.9g to %.9g", variable->name, value, variable->min, variable->max);
        }
    }
    return status;
}

static gyro_status check_matrices(gyro_instance *g)
{
    const double *p = g->value;
    gyro_status status = GYRO_OK;
    if (!(p[GYRO_KXX] > 0.0 && p[GYRO_KXX] * p[GYRO_KYY] > p[GYRO_KXY] * p[GYRO_KXY])) {
        status = gyro_refuse(g, "stiffness kxx = %.9g, kyy = %.9g, kxy = %.9g N/m is not positive definite: make kxx*kyy > kxy^2", p[GYRO_KXX],
                             p[GYRO_KYY], p[GYRO_KXY]);
    } else if (p[GYRO_DXX] * p[GYRO_DYY] < p[GYRO_DXY] * p[GYRO_DXY]) {
        status = gyro_refuse(g, "damping dxx = %.9g, dyy = %.9g, dxy = %.9g N.s/m feeds energy: make dxx*dyy >= dxy^2", p[GYRO_DXX],
                             p[GYRO_DYY], p[GYRO_DXY]);
    }
    return status;
}

static gyro_status plan_samples(gyro_instance *g)
{
    const double step = g->value[GYRO_INTERNAL_STEP], period = g->value[GYRO_SAMPLE_PERIOD];
    gyro_status status = GYRO_OK;
    int64_t ticks;
    g->plan.step = step;
    if (!gyro_whole_steps(period, step, ON_GRID, &ticks) || ticks < 1) {
        const double below = floor(period / step) > 1.0 ? floor(period / step) : 1.0;
        status = gyro_refuse(g, "sample_period = %.9g s is no multiple of internal_step = %.9g s: nearest are %.9g s and %.9g s", period, step,
                             below * step, (below + 1.0) * step);
    }
    g->plan.sample_ticks = ticks;
    return status;
}

static void plan_events(gyro_instance *g)
{
    double time[GYRO_N_EFFECTS];
    g->plan.any_event = 0;
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        time[effect] = INFINITY;
    }
    event_times(&g->view, time);
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        const double steps = (time[effect] - g->memory.start_time) / g->plan.step;
        const double nearest = floor(steps + 0.5);
        g->plan.event_tick[effect] = INT64_MAX;
        g->plan.event_fraction[effect] = 0.0;
        if (fabs(steps) < 4.6e18) {
            const double whole = fabs(steps - nearest) <= ON_GRID ? nearest : floor(steps);
            g->plan.event_tick[effect] = (int64_t)whole;
            g->plan.event_fraction[effect] = whole == nearest && steps <= nearest ? 0.0 : steps - whole;
            g->plan.any_event = 1;
        }
    }
}

static gyro_status plan_delay(gyro_instance *g)
{
    gyro_status status = GYRO_OK;
    const double steps = force_delay(&g->view) / g->plan.step;
    const double nearest = floor(steps + 0.5);
    const double whole = fabs(steps - nearest) <= ON_GRID ? nearest : floor(steps);
    g->plan.any_delay = steps > 0.0;
    g->plan.delay_ticks = (int64_t)whole;
    g->plan.delay_fraction = larger(0.0, steps - whole);
    drop_delay_line(g);
    if (g->plan.any_delay) {
        const size_t length = (size_t)g->plan.delay_ticks + 2;
        g->delay_line = calloc(length, sizeof *g->delay_line);
        g->delay_length = g->delay_line != NULL ? length : 0;
        if (g->delay_line == NULL) {
            status = gyro_refuse(g, "no memory for a delay of %.9g internal steps: make internal_step longer", steps);
        }
    }
    return status;
}

gyro_status gyro_prepare(gyro_instance *g)
{
    gyro_view *view = &g->view;
    gyro_status status = check_bounds(g);
    if (status == GYRO_OK) {
        status = check_matrices(g);
    }
    if (status == GYRO_OK) {
        status = plan_samples(g);
    }
    if (status == GYRO_OK) {
        memcpy(view->p, g->value, sizeof view->p);
        view->inverse_mass = 1.0 / g->value[GYRO_M];
        view->t = gyro_time(g);
        view->step_start = view->t;
        find_active(view);
        plan_events(g);
        gyro_pass_events(g, g->memory.tick, 0.0);
        g->plan.any_draw = 0;
        for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
            g->plan.any_draw |= (unsigned char)(streams[effect] != 0u && view->active[effect]);
        }
        g->plan.any_lag = (unsigned char)lag_acts(view);
        status = plan_delay(g);
    }
    return status;
}

gyro_status gyro_start(gyro_instance *g, double start_time)
{
    gyro_status status = GYRO_OK;
    if (g->memory.calls > 0) {
        status = gyro_refuse(g, "already at time %.9g s: reset before starting again", gyro_time(g));
    } else if (!isfinite(start_time)) {
        status = gyro_refuse(g, "start time %g: give a finite number", start_time);
    } else {
        memset(&g->memory, 0, sizeof g->memory);
        memset(&g->view, 0, sizeof g->view);
        g->memory.start_time = start_time;
        g->memory.next_time = start_time;
        status = gyro_prepare(g);
    }
    if (status == GYRO_OK) {
        g->memory.started = 1;
        g->memory.ticks_to_sample = g->plan.sample_ticks;
        g->view.s[GYRO_STATE_X] = g->value[GYRO_X_START];
        g->view.s[GYRO_STATE_X_DOT] = g->value[GYRO_X_DOT_START];
        g->view.s[GYRO_STATE_Y] = g->value[GYRO_Y_START];
        g->view.s[GYRO_STATE_Y_DOT] = g->value[GYRO_Y_DOT_START];
        gyro_first_sample(g);
    }
    return status;
}

static gyro_status check_finite(gyro_instance *g)
{
    static const char *const names[] = {"x", "x_dot", "y", "y_dot"};
    gyro_status status = GYRO_OK;
    for (int i = 0; i < GYRO_N_STATES && status == GYRO_OK; i++) {
        if (!isfinite(g->view.s[i])) {
            const char *name = i <= GYRO_STATE_Y_DOT ? names[i] : "a state of an effect";
            status = gyro_refuse(g, "diverged at %.9g s: %s is not finite; check forces and effect sizes, or shorten internal_step", gyro_time(g), name);
        }
    }
    return status;
}

static gyro_status check_step(gyro_instance *g, double from, double step, int64_t *ticks)
{
    const double h = g->plan.step;
    const double now = gyro_time(g);
    /* An importer may subtract or multiply times: a few units in the last place. One that adds them up strays further with every call,
       so that its own last sum counts as the present time too. */
    const double rounding = 4.0 * DBL_EPSILON * (fabs(from) + fabs(step));
    const double slack = ON_GRID + rounding / h;
    gyro_status status = GYRO_OK;
    int64_t at;
    if (!g->memory.started) {
        status = gyro_refuse(g, "step before the start: initialise first");
    } else if (!isfinite(from) || !isfinite(step)) {
        status = gyro_refuse(g, "communication point %g s, step %g s: give finite numbers", from, step);
    } else if (!(fabs(from - g->memory.next_time) <= rounding) &&
               (!gyro_whole_steps(from - g->memory.start_time, h, slack, &at) || at != g->memory.tick)) {
        status = gyro_refuse(g, "communication point %.15g s is not the present time %.15g s: go on from there", from, now);
    } else if (!(step > 0.0) || !gyro_whole_steps(step, h, slack, ticks) || *ticks < 1) {
        const double below = floor(step / h);
        status = step > h ? gyro_refuse(g, "communication step %.15g s is no multiple of internal_step = %.9g s: nearest are %.15g s and %.15g s",
                                        step, h, below * h, (below + 1.0) * h)
                          : gyro_refuse(g, "communication step %.15g s is no positive multiple of internal_step = %.9g s: nearest is %.15g s",
                                        step, h, h);
    }
    return status;
}

gyro_status gyro_advance(gyro_instance *g, double from, double step)
{
    int64_t ticks = 0;
    gyro_status status = check_step(g, from, step, &ticks);
    if (status == GYRO_OK) {
        g->memory.calls++;
        g->memory.next_time = from + step;
        gyro_tick(g, ticks);
        status = check_finite(g);
    }
    return status;
}
