/* The instants at which effects switch. */

#include "events.h"

#include "gyro_math.h"
#include "plant.h"

void gyro_pass_events(gyro_instance *g)
{
    gyro_cuts *cuts = &g->plan.cuts;
    cuts->next_event = (gyro_instant){GYRO_NEVER, 0.0};
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        const gyro_instant event = g->plan.events.of[effect];
        const int ahead = gyro_before(g->memory.clock.settled, event);
        g->view.after[effect] = ahead ? 0.0 : 1.0;
        if (ahead && gyro_before(event, cuts->next_event)) {
            cuts->next_event = event;
        }
    }
}

void gyro_find_events(gyro_instance *g)
{
    double time[GYRO_N_EFFECTS];
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        time[effect] = INFINITY;
    }
    event_times(&g->view, time);
    for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
        g->plan.events.of[effect] = gyro_instant_of(gyro_ticks(time[effect] - g->memory.clock.start_time));
    }
    gyro_pass_events(g);
}
