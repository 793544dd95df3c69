/* Time in ticks, and the instants at which the integration is cut: its own grid, samples, events. None of them knows communication points,
   so that no bit depends on how an importer divides time. */

#include <float.h>

#include "gyro_math.h"
#include "plant.h"

double gyro_ticks(double seconds)
{
    const double ticks = seconds * GYRO_TICKS_A_SECOND;
    const double nearest = gyro_floor(ticks + 0.5);
    /* 5e-6 s is 5 000 000 ticks, though neither the number nor the product is exact. */
    return fabs(ticks - nearest) <= 4.0 * DBL_EPSILON * fabs(ticks) ? nearest : ticks;
}

gyro_instant gyro_instant_of(double ticks)
{
    gyro_instant at = {ticks > 0.0 ? GYRO_NEVER : -1, 0.0};
    if (fabs(ticks) < (double)GYRO_LAST_TICK) {
        at.tick = (int64_t)gyro_floor(ticks);
        at.part = ticks - gyro_floor(ticks);
    }
    return at;
}

void gyro_come_to(gyro_instance *g, int64_t tick, double rest)
{
    g->memory.clock.now = tick;
    g->memory.clock.rest = rest;
    g->plan.cuts.time = g->memory.clock.start_time + ((double)tick + rest) / GYRO_TICKS_A_SECOND;
}

double gyro_time_of(const gyro_instance *g, gyro_instant at)
{
    return g->memory.clock.start_time + ((double)at.tick + at.part) / GYRO_TICKS_A_SECOND;
}

gyro_beat gyro_beat_of(double period)
{
    const double ticks = gyro_ticks(period);
    const double whole = gyro_floor(ticks);
    return (gyro_beat){(int64_t)whole, ticks - whole};
}

int64_t gyro_tick_of(gyro_beat beat, int64_t k)
{
    return k * beat.whole + (beat.part > 0.0 ? (int64_t)gyro_floor((double)k * beat.part + 0.5) : 0);
}

int64_t gyro_beats_until(gyro_beat beat, int64_t tick)
{
    /* The k-th lies within half a tick of its place: the quotient is off by one at most. */
    int64_t k = (int64_t)gyro_floor((double)tick / ((double)beat.whole + beat.part));
    while (gyro_tick_of(beat, k) > tick) {
        k--;
    }
    while (gyro_tick_of(beat, k + 1) <= tick) {
        k++;
    }
    return k;
}

void gyro_plan_cuts(gyro_instance *g)
{
    gyro_cuts *cuts = &g->plan.cuts;
    const gyro_clock *clock = &g->memory.clock;
    cuts->next_grid = gyro_tick_of(cuts->grid, clock->grid + 1);
    cuts->next_sample = gyro_tick_of(cuts->sample, clock->sample + 1);
    gyro_find_events(g);
    gyro_come_to(g, clock->now, clock->rest);
}

gyro_instant gyro_next_cut(const gyro_instance *g)
{
    const gyro_cuts *cuts = &g->plan.cuts;
    const gyro_instant regular = {cuts->next_grid < cuts->next_sample ? cuts->next_grid : cuts->next_sample, 0.0};
    return gyro_before(cuts->next_event, regular) ? cuts->next_event : regular;
}

int gyro_settle(gyro_instance *g, gyro_instant to)
{
    gyro_cuts *cuts = &g->plan.cuts;
    gyro_clock *clock = &g->memory.clock;
    int at = 0;
    /* An instant within a tick comes after the grid's and the sample's, which are whole ticks: those have been passed by then. */
    clock->settled = to;
    if (to.tick == cuts->next_grid) {
        clock->grid++;
        cuts->next_grid = gyro_tick_of(cuts->grid, clock->grid + 1);
    }
    if (to.tick == cuts->next_sample) {
        clock->sample++;
        cuts->next_sample = gyro_tick_of(cuts->sample, clock->sample + 1);
        at |= GYRO_AT_SAMPLE;
    }
    if (!gyro_before(to, cuts->next_event)) {
        gyro_pass_events(g);
        at |= GYRO_AT_EVENT;
    }
    return at;
}

/* Whether a tick lies from the beat number `k` on and before the next. */
static int beat_fits(gyro_beat beat, int64_t k, int64_t tick)
{
    return k >= 0 && k <= tick / beat.whole && gyro_tick_of(beat, k) <= tick && tick < gyro_tick_of(beat, k + 1);
}

const char *gyro_impossible_clock(const gyro_instance *g)
{
    const gyro_clock *clock = &g->memory.clock;
    const gyro_instant now = {clock->now, 0.0}, settled = clock->settled;
    const char *why = NULL;
    if (clock->now < 0 || clock->now > GYRO_LAST_TICK || !(fabs(clock->rest) <= (double)GYRO_LAST_TICK)) {
        why = "its time is none";
    } else if (settled.tick < 0 || !(settled.part >= 0.0 && settled.part < 1.0) || gyro_before(now, settled)) {
        why = "its motion is ahead of its time";
    } else if (!beat_fits(g->plan.cuts.grid, clock->grid, settled.tick) || !beat_fits(g->plan.cuts.sample, clock->sample, settled.tick)) {
        why = "its count of steps or samples does not fit its time";
    } else if (!beat_fits(g->plan.cuts.grid, clock->grid, now.tick) || !beat_fits(g->plan.cuts.sample, clock->sample, now.tick)) {
        why = "its motion is behind its time";
    }
    return why;
}
