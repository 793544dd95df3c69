#include "core.h"

#include <float.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gyro_math.h"
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

void gyro_set(gyro_instance *g, uint32_t vr, double value)
{
    g->value[vr] = value;
    if (vr >= GYRO_N_INPUTS) {
        g->memory.clock.tuned = 1;
    }
}

double gyro_get(const gyro_instance *g, uint32_t vr) { return g->value[vr]; }

static gyro_status check_bounds(gyro_instance *g, const double values[GYRO_N_VARIABLES])
{
    gyro_status status = GYRO_OK;
    for (int vr = 0; vr < GYRO_N_VARIABLES && status == GYRO_OK; vr++) {
        const gyro_variable *variable = &gyro_variables[vr];
        const double value = values[vr];
        if (variable->kind != GYRO_OUTPUT && !(value >= variable->min && value <= variable->max)) {
            status = gyro_refuse(g, "%s = %.9g: give a value from %.9g to %.9g", variable->name, value, variable->min, variable->max);
        }
    }
    return status;
}

gyro_status gyro_check(gyro_instance *g)
{
    gyro_status status = check_bounds(g, g->value);
    if (status == GYRO_OK) {
        status = check_bounds(g, g->memory.clock.held);
    }
    if (status == GYRO_OK) {
        status = gyro_check_device(g);
    }
    return status;
}

/* Where the steps of the importer have come to [s]. */
double gyro_time(const gyro_instance *g) { return g->plan.cuts.time; }

int gyro_started(const gyro_instance *g) { return g->memory.clock.started != 0; }

void gyro_unstart(gyro_instance *g)
{
    /* What follows from parameters that may have changed is not kept: a saved state would hold one beside the other. */
    gyro_drop(g);
    memset(&g->memory, 0, sizeof g->memory);
    memset(&g->plan, 0, sizeof g->plan);
}

gyro_status gyro_start(gyro_instance *g, double start_time)
{
    gyro_status status = GYRO_OK;
    if (g->memory.clock.now > 0) {
        status = gyro_refuse(g, "already at time %.9g s: reset before starting again", gyro_time(g));
    } else if (!gyro_finite(start_time)) {
        status = gyro_refuse(g, "start time %g: give a finite number", start_time);
    } else {
        gyro_unstart(g);
        memset(&g->view, 0, sizeof g->view);
        g->memory.clock.start_time = start_time;
        g->memory.clock.next_time = start_time;
        memcpy(g->memory.clock.held, g->value, sizeof g->memory.clock.held);
        status = gyro_prepare(g);
    }
    if (status == GYRO_OK) {
        g->memory.clock.started = 1;
        gyro_first_sample(g);
    }
    return status;
}

int64_t gyro_nearest_tick(const gyro_instance *g, int64_t from, double ticks)
{
    int64_t tick = g->plan.cuts.next_sample;
    /* Most steps end at a sample. */
    if (ticks != (double)(tick - from)) {
        const gyro_beat beat = g->plan.cuts.sample;
        const double period = (double)beat.whole + beat.part;
        const double slack = 1e-6 * period > 1.0 ? 1e-6 * period : 1.0;
        const double whole = gyro_floor(ticks + 0.5);
        /* A time of model exchange may be any; so far NaN does not compare. */
        tick = !(whole > 0.0) ? from : whole < (double)(GYRO_LAST_TICK - from) ? from + (int64_t)whole : GYRO_LAST_TICK;
        int64_t sample = g->plan.cuts.next_sample;
        if (tick != sample) {
            sample = gyro_tick_of(beat, (int64_t)gyro_floor((double)tick / period + 0.5));
        }
        /* Never back, never a step that is long enough to be meant lost. */
        tick = fabs((double)(tick - sample)) <= slack && sample > from ? sample : tick;
    }
    return tick;
}

static gyro_status refuse_diverged(gyro_instance *g)
{
    const char *name = gyro_infinite_state(g);
    return gyro_refuse(g, "diverged at %.9g s: %s is not finite; check forces and effect sizes, or shorten internal_step", gyro_time(g),
                       name != NULL ? name : "a state");
}

static double step_in_ticks(gyro_instance *g, double step)
{
    gyro_cuts *cuts = &g->plan.cuts;
    if (step != cuts->latest_step) {
        cuts->latest_step = step;
        cuts->latest_ticks = gyro_ticks(step);
    }
    return cuts->latest_ticks;
}

static gyro_status check_step(gyro_instance *g, double from, double step)
{
    const gyro_clock *clock = &g->memory.clock;
    const double now = gyro_time(g);
    /* Time goes on by the steps; `from` is only checked, to the rounding of the numbers that it comes from and a tick. An importer that adds
       up its times strays further with every step, so that its own last sum counts as the present time too. */
    const double rounding = DBL_EPSILON * (fabs(from) + fabs(clock->start_time) + fabs(step)) + 1.0 / GYRO_TICKS_A_SECOND;
    gyro_status status = GYRO_OK;
    if (!clock->started) {
        status = gyro_refuse(g, "step before the start: initialise first");
    } else if (!gyro_finite(from) || !gyro_finite(step)) {
        status = gyro_refuse(g, "communication point %g s, step %g s: give finite numbers", from, step);
    } else if (clock->diverged) {
        status = refuse_diverged(g);
    } else if (!(fabs(from - clock->next_time) <= rounding) && !(fabs(from - now) <= rounding)) {
        status = gyro_refuse(g, "communication point %.15g s is not the present time %.15g s: go on from there", from, now);
    } else if (!(step > 0.0)) {
        status = gyro_refuse(g, "communication step %.15g s: give a positive number", step);
    } else if (!(step_in_ticks(g, step) + clock->rest + (double)clock->now < (double)GYRO_LAST_TICK)) {
        status = gyro_refuse(g, "communication step %.15g s ends later than %.9g s after the start, the end of what the FMU counts: step less",
                             step, (double)GYRO_LAST_TICK / GYRO_TICKS_A_SECOND);
    }
    return status;
}

void gyro_swap_values(gyro_instance *g, int end)
{
    double *held = g->memory.clock.held;
    for (int vr = 0; vr < end; vr++) {
        if (gyro_variables[vr].kind != GYRO_OUTPUT) {
            const double value = g->value[vr];
            g->value[vr] = held[vr];
            held[vr] = value;
        }
    }
}

gyro_status gyro_take_values(gyro_instance *g)
{
    gyro_clock *clock = &g->memory.clock;
    gyro_status status = GYRO_OK;
    int changed = clock->now == 0, tuned = 0;
    for (int vr = 0; vr < GYRO_N_INPUTS && !changed; vr++) {
        changed = g->value[vr] != clock->held[vr];
    }
    for (int vr = GYRO_N_INPUTS; clock->tuned && vr < GYRO_N_VARIABLES; vr++) {
        tuned |= gyro_variables[vr].kind == GYRO_TUNABLE && g->value[vr] != clock->held[vr];
    }
    if ((changed || tuned) && gyro_before(clock->settled, (gyro_instant){clock->now, 0.0})) {
        const int end = tuned ? GYRO_N_VARIABLES : GYRO_N_INPUTS;
        gyro_swap_values(g, end);
        gyro_move(g, (gyro_instant){clock->now, 0.0});
        gyro_swap_values(g, end);
    }
    if (tuned) {
        gyro_tune(g);
    }
    if (changed || tuned) {
        status = gyro_take_inputs(g);
    }
    changed |= tuned;
    if (changed && status == GYRO_OK) {
        /* Parameters seldom change, inputs at most steps. */
        for (int vr = 0; vr < (tuned ? GYRO_N_VARIABLES : GYRO_N_INPUTS); vr++) {
            if (g->value[vr] != clock->held[vr]) {
                clock->held[vr] = g->value[vr];
            }
        }
        clock->tuned = 0;
    }
    return status;
}

static gyro_instant next_cut(const gyro_instance *g)
{
    const gyro_instant cut = gyro_next_cut(g), own = gyro_next_own_cut(g);
    return gyro_before(own, cut) ? own : cut;
}

/* A diverged instance stays at the instant that showed it, and puts out nothing that could be taken for a number. */
static gyro_status diverge(gyro_instance *g, int64_t tick)
{
    gyro_come_to(g, tick, 0.0);
    g->memory.clock.diverged = 1;
    for (int vr = 0; vr < GYRO_N_VARIABLES; vr++) {
        if (gyro_variables[vr].kind == GYRO_OUTPUT) {
            /* An integer has no NaN. */
            g->value[vr] = gyro_variables[vr].type == GYRO_INTEGER ? 0.0 : NAN;
        }
    }
    return refuse_diverged(g);
}

/* Time and outputs at `end`, which lies at `settled` or before the next cut, `rest` ticks before where the importer has come to. */
static gyro_status put_out_at(gyro_instance *g, gyro_instant end, double rest)
{
    gyro_status status = GYRO_OK;
    gyro_come_to(g, end.tick, rest);
    if (!gyro_before(g->memory.clock.settled, end)) {
        gyro_put_out(g);
    } else {
        gyro_look_ahead(g, end);
        if (gyro_infinite_state(g) != NULL) {
            status = diverge(g, end.tick);
        }
    }
    return status;
}

/* The tick at which the watcher wants to end, the present one at the earliest. */
static int64_t wanted_end(const gyro_instance *g, double time)
{
    const double ticks = gyro_ticks(time - g->memory.clock.start_time) + 0.5;
    const double now = (double)g->memory.clock.now;
    /* So far NaN does not compare. */
    return !(ticks < (double)GYRO_LAST_TICK) ? GYRO_LAST_TICK : ticks > now ? (int64_t)gyro_floor(ticks) : g->memory.clock.now;
}

/* How far the time that an importer is told at `end`, a number of seconds, lies from it [ticks]: Unix times are 238 ns apart. The importer goes
   on from what it is told. */
static double told_rest(const gyro_instance *g, gyro_instant end)
{
    return gyro_ticks(gyro_time_of(g, end) - g->memory.clock.start_time) - (double)end.tick;
}

/* Whether `end` comes before the end of the step, `rest` ticks behind `tick`, for an importer too. Where both are the same number of seconds
   the step is done, and what is left of it is carried on. */
static int told_apart(const gyro_instance *g, gyro_instant end, int64_t tick, double rest)
{
    return end.tick < tick && gyro_time_of(g, end) < gyro_time_of(g, (gyro_instant){tick, rest});
}

/* From `settled` to the tick `tick`, which no cut need be and lies `rest` ticks before where the importer has come to, or less far. */
static gyro_status move_to(gyro_instance *g, int64_t tick, double rest, int to_sample, gyro_watch watch, void *watcher)
{
    const gyro_clock *clock = &g->memory.clock;
    const int64_t most = (int64_t)g->value[GYRO_STEP_LIMIT], first = clock->grid;
    gyro_status status = GYRO_OK;
    gyro_instant end = {tick, 0.0};
    for (gyro_instant cut = next_cut(g); !gyro_before(end, cut) && status == GYRO_OK; cut = next_cut(g)) {
        const int64_t before = clock->grid, sample = clock->sample;
        gyro_move(g, cut);
        if (gyro_infinite_state(g) != NULL) {
            status = diverge(g, cut.tick);
        } else if (clock->grid > before && gyro_before(cut, end)) {
            if (watch != NULL) {
                status = put_out_at(g, cut, 0.0);
                const int64_t wanted = wanted_end(g, watch(watcher));
                end.tick = wanted < end.tick ? wanted : end.tick;
            }
            if (most > 0 && clock->grid - first >= most) {
                end = cut;
            }
        }
        if (to_sample && clock->sample > sample && gyro_before(cut, end)) {
            end = cut;
        }
    }
    if (status == GYRO_OK) {
        const int early = told_apart(g, end, tick, rest);
        status = put_out_at(g, end, early ? told_rest(g, end) : rest + (double)(tick - end.tick));
        if (status == GYRO_OK && early) {
            g->memory.clock.next_time = gyro_time(g);
            status = GYRO_EARLY;
        }
    }
    return status;
}

int64_t gyro_samples(const gyro_instance *g) { return g->memory.clock.sample; }

double gyro_next_sample(const gyro_instance *g) { return gyro_time_of(g, (gyro_instant){g->plan.cuts.next_sample, 0.0}); }

gyro_status gyro_advance(gyro_instance *g, double from, double step, int to_sample, gyro_watch watch, void *watcher)
{
    gyro_clock *clock = &g->memory.clock;
    gyro_status status = check_step(g, from, step);
    if (status == GYRO_OK) {
        status = gyro_take_values(g);
    }
    if (status == GYRO_OK) {
        const double ticks = step_in_ticks(g, step) + clock->rest;
        const int64_t end = gyro_nearest_tick(g, clock->now, ticks);
        clock->next_time = from + step;
        status = move_to(g, end, ticks - (double)(end - clock->now), to_sample, watch, watcher);
    }
    return status;
}
