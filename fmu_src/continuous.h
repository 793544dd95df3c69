/* The motion as a differential equation, s' = f(s, inputs, t): for importers that integrate themselves, and for derivatives.

   The states are those of the view, then the voltages behind the amplifier's lag, then what lags. What can't be told from present inputs
   alone, the delayed force and the jump of a turning frame, changes in events only. */

#ifndef GYRO_CONTINUOUS_H
#define GYRO_CONTINUOUS_H

#include "core.h"

/* Also where an importer compiles the sources without -fvisibility=hidden, two FMUs in one process keep to their own. */
#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif

/* Why this FMU has none of this; NULL where it has. */
const char *gyro_no_equation(void);

/* SI, shape (GYRO_N_CONTINUOUS), at the communication point. */
void gyro_get_continuous(gyro_instance *g, double states[GYRO_N_CONTINUOUS]);
void gyro_get_rates(gyro_instance *g, double rates[GYRO_N_CONTINUOUS]);

/* Sets the states, or the time [s]; only while no step is taken. */
gyro_status gyro_set_continuous(gyro_instance *g, const double states[GYRO_N_CONTINUOUS]);
void gyro_set_time(gyro_instance *g, double time);

/* After a state is restored: the time is the latest that was set. */
void gyro_resume_time(gyro_instance *g);

/* Brings the outputs to states, inputs and time as they are set; samples stay. */
void gyro_put_out_continuous(gyro_instance *g);

/* The id of an effect that acts, for which the input `vr` may change in events only; NULL where it may change at any time. */
const char *gyro_jumping(const gyro_instance *g, uint32_t vr);

/* An event begins at the present time: what is set from now on jumps. GYRO_ERROR where the time is beyond an event that was due. */
gyro_status gyro_enter_event(gyro_instance *g);

/* Takes the sample that is due, then inputs and parameters as they are; GYRO_ERROR as by gyro_enter_event. *jumped: 1 where states have; *next: time of the next event [s]. */
gyro_status gyro_update(gyro_instance *g, int *jumped, double *next);

/* Whether the output `vr` is a sample, which changes in events only. */
int gyro_is_sample(uint32_t vr);

/* A direction in which inputs and states move, and how rates and outputs move with them, noise held. */
typedef struct {
    double input[GYRO_N_INPUTS];
    double state[GYRO_N_CONTINUOUS];
} gyro_direction;

typedef struct {
    double rate[GYRO_N_CONTINUOUS];
    double output[GYRO_N_VARIABLES]; /* by value reference; of samples nothing */
} gyro_response;

void gyro_respond(gyro_instance *g, const gyro_direction *along, gyro_response *response);

#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

#endif
