/* Parameters that change while the device runs. */

#include <string.h>

#include "plant.h"

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
}
