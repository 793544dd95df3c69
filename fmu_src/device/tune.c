/* Parameters that change while the device runs, and what effects remember from when they begin to act. */

#include <string.h>

#include "noise.h"
#include "plant.h"

void gyro_begin_memories(gyro_instance *g, const double value[GYRO_N_VARIABLES], const unsigned char acted[GYRO_N_EFFECTS])
{
    gyro_view *view = &g->view;
    if (view->any_memory) {
        for (int effect = 0; effect < GYRO_N_EFFECTS; effect++) {
            if (start_streams[effect] != 0u && view->active[effect] && !acted[effect]) {
                gyro_normal_pair((uint32_t)g->value[GYRO_SEED], start_streams[effect], 0u, 0u, view->drawn[effect]);
            }
        }
        begin_memories(view, value, acted);
    }
}

void gyro_tune(gyro_instance *g)
{
    gyro_view *view = &g->view;
    unsigned char acted[GYRO_N_EFFECTS];
    gyro_before_tuning(g);
    memcpy(acted, view->active, sizeof acted);
    for (int vr = 0; vr < GYRO_N_VARIABLES; vr++) {
        /* All, for a law that acts no more has left its mark on others. */
        if (gyro_variables[vr].kind != GYRO_OUTPUT) {
            view->p[vr] = g->value[vr];
        }
    }
    take_made(view, g->value);
    find_active(view);
    gyro_plan_cuts(g);
    begin_acting(view, acted, g->memory.clock.held);
    gyro_after_tuning(g, acted);
    gyro_begin_memories(g, g->memory.clock.held, acted);
}
