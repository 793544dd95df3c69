/* The instants at which a parameter law switches: where they fall between internal steps, and what has passed. */

#include "plant.h"

void gyro_plan_events(gyro_instance *g)
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
            const double whole = fabs(steps - nearest) <= GYRO_ON_GRID ? nearest : floor(steps);
            g->plan.event_tick[effect] = (int64_t)whole;
            g->plan.event_fraction[effect] = whole == nearest && steps <= nearest ? 0.0 : steps - whole;
            g->plan.any_event = 1;
        }
    }
}

void gyro_pass_events(gyro_instance *g, int64_t tick, double fraction)
{
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        const int64_t event = g->plan.event_tick[effect];
        const int passed = tick > event || (tick == event && fraction >= g->plan.event_fraction[effect]);
        g->view.after[effect] = passed ? 1.0 : 0.0;
    }
}

double gyro_next_event(const gyro_instance *g, double fraction)
{
    double next = 1.0;
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        const double event = g->plan.event_fraction[effect];
        if (g->plan.event_tick[effect] == g->memory.tick && event > fraction) {
            next = smaller(next, event);
        }
    }
    return next;
}
