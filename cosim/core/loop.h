/* The loop: plant, observer and controller, sample by sample.

   At t_k: sample k is there, taken just before the force changes; the observer predicts with the force held until now and corrects with the
   sample; the controller sets u_k; the plant moves to t_k+1 with u_k and the other inputs held. */

#ifndef LOOP_H
#define LOOP_H

#include "edge.h"
#include "filter.h"
#include "foucault.h"

#define PLANT_INPUTS 7  /* u_x, u_y, omega_z, temperature, a_x, a_y, v_bias */
#define PLANT_OUTPUTS 6 /* v_x, v_y, x, x_dot, y, y_dot */
#define CONTROL_SIZE 15 /* u_x, u_y, forced x, x', y, y', omega squared, turned, near x, x', y, y', lacking, own rate, behind */

typedef int (*set_function)(void *, const uint32_t *, size_t, const double *, size_t);
typedef int (*get_function)(void *, const uint32_t *, size_t, double *, size_t);
typedef int (*step_function)(void *, double, double, _Bool, _Bool *, _Bool *, _Bool *, double *);

/* The plant as an FMI 3.0 co-simulation instance. */
typedef struct {
    void *instance;
    set_function set;
    step_function step;
    get_function get;
    uint32_t inputs[PLANT_INPUTS], outputs[PLANT_OUTPUTS];
} plant;

/* An observer: at t_k, with the command held until now and the measured inputs. */
typedef void (*observer_function)(void *memory, const double u[2], const double v[2], const double in[IN], double *estimate, double *deviation);
/* A controller: at t_k; writes CONTROL_SIZE numbers. */
typedef void (*controller_function)(void *memory, double t, const double *estimate, const double *deviation, const double in[IN], double *control);

typedef struct {
    plant plant;
    observer_function observer;
    void *observer_memory;
    controller_function controller;
    void *controller_memory;
    double period;        /* [s] */
    double lag[2];        /* time constants of the temperatures of structure and circuit [s] */
    double made[2];       /* these temperatures [K] */
    double input[PLANT_INPUTS], output[PLANT_OUTPUTS]; /* at the border between two blocks */
    double estimate[ESTIMATE_SIZE], deviation[ESTIMATE_SIZE];
    edge edge;
} loop;

/* An observer of springs, dampers and a held force, with what the loop knows beyond them taken out before it looks (plain.c). */
size_t plain_size(void);
void plain_start(void *memory, void *inner, void *inner_memory, const double *known_values, double period);
void plain_step(void *memory, const double u[2], const double v[2], const double in[IN], double *estimate, double *deviation);
void plain_found(const void *memory, double *chi2, double white[2]);

#endif
