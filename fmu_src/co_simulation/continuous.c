/* An FMU for co-simulation only shows no differential equation. */

#include "continuous.h"

const char *gyro_no_equation(void) { return "this FMU is for co-simulation only"; }

void gyro_get_continuous(gyro_instance *g, double states[GYRO_N_CONTINUOUS]) { (void)g, (void)states; }

void gyro_get_rates(gyro_instance *g, double rates[GYRO_N_CONTINUOUS]) { (void)g, (void)rates; }

gyro_status gyro_set_continuous(gyro_instance *g, const double states[GYRO_N_CONTINUOUS])
{
    (void)g, (void)states;
    return GYRO_ERROR;
}

void gyro_set_time(gyro_instance *g, double time) { (void)g, (void)time; }

void gyro_resume_time(gyro_instance *g) { (void)g; }

void gyro_put_out_continuous(gyro_instance *g) { (void)g; }

int gyro_is_sample(uint32_t vr)
{
    (void)vr;
    return 1;
}

const char *gyro_jumping(const gyro_instance *g, uint32_t vr)
{
    (void)g, (void)vr;
    return 0;
}

gyro_status gyro_enter_event(gyro_instance *g)
{
    (void)g;
    return GYRO_ERROR;
}

gyro_status gyro_update(gyro_instance *g, int *jumped, double *next)
{
    (void)g, (void)jumped, (void)next;
    return GYRO_ERROR;
}

void gyro_respond(gyro_instance *g, const gyro_direction *along, gyro_response *response) { (void)g, (void)along, (void)response; }
