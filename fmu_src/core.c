#include "core.h"

#include <float.h>
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "plant.h"

gyro_status gyro_refuse(gyro_instance *g, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(g->message, sizeof g->message, format, args);
    va_end(args);
    return GYRO_ERROR;
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
        gyro_drop(g);
        free(g);
    }
}

void gyro_reset(gyro_instance *g)
{
    gyro_drop(g);
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

gyro_status gyro_check(gyro_instance *g)
{
    gyro_status status = check_bounds(g);
    if (status == GYRO_OK) {
        status = check_matrices(g);
    }
    return status;
}

int gyro_started(const gyro_instance *g) { return g->memory.started != 0; }

void gyro_unstart(gyro_instance *g)
{
    /* What follows from parameters that may have changed is not kept: a saved state would hold one beside the other. */
    gyro_drop(g);
    g->memory.started = 0;
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
        status = gyro_make_room(g);
    }
    if (status == GYRO_OK) {
        g->memory.started = 1;
        gyro_first_sample(g);
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
    const double slack = GYRO_ON_GRID + rounding / h;
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
        const char *infinite = gyro_infinite_state(g);
        if (infinite != NULL) {
            status = gyro_refuse(g, "diverged at %.9g s: %s is not finite; check forces and effect sizes, or shorten internal_step", gyro_time(g),
                                 infinite);
        }
    }
    return status;
}
