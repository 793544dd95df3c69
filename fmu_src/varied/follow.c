/* A run whose columns are wanted: its motion, and how that passes differences on. variation.c says what for. */

#include "hermite.h"
#include "linear.h"
#include "traveller.h"

/* Times h^2 the commutator's weight, sqrt(3)/12. */
static const double TURNED = 0.14433756729740643;

/* Size of the first term that a passage leaves out: over a million steps all of them make 1e-5. */
static const double PASSAGE_LEAVES = 1e-11;

/* The rates of both speeds at a part of a step. */
static void find_rates(traveller *at, const gyro_run *run, int64_t step, double part, const double state[MOTION], double found[2])
{
    double rate[GYRO_N_STATES];
    look_from(at, run, step, part, state);
    state_rate(&at->view, rate);
    found[0] = rate[GYRO_STATE_X_DOT];
    found[1] = rate[GYRO_STATE_Y_DOT];
}

/* The accelerations at the end of a step, and at the start of the first; the view is at its end, and comes back there. */
static void find_accelerations(traveller *at, const gyro_run *run, int64_t step)
{
    if (step == 0) {
        look_from(at, run, step, 0.0, run->state);
        find_acceleration(&at->view, command_after(run, 0), run->acceleration);
        come_to(at, run, step);
    }
    look_from(at, run, step, 1.0, run->state + (step + 1) * MOTION);
    find_acceleration(&at->view, command_after(run, step + 1), run->acceleration + 2 * (step + 1));
    come_to(at, run, step);
}

/* The motion at the nodes of a step from its ends, shape (2, 4): displacements by quintics, speeds by cubics. rate shape (2, 2): of the speeds, by
   end and axis. */
static void find_motion(const gyro_run *run, int64_t step, double rate[2][2])
{
    const double *a = run->state + step * MOTION, *b = a + MOTION, h = run->step;
    double *motion = run->motion + step * NODES * MOTION;
    for (int node = 0; node < NODES; node++) {
        for (int axis = 0; axis < 2; axis++) {
            const int x = 2 * axis, v = x + 1;
            const gyro_jet from = {a[x], a[v], rate[0][axis]}, to = {b[x], b[v], rate[1][axis]};
            motion[node * MOTION + x] = quintic(from, to, h, PLACE[node]);
            motion[node * MOTION + v] = cubic(a[v], rate[0][axis], b[v], rate[1][axis], h, PLACE[node]);
        }
    }
}

/* How the rates of the motion go with its states, in the view as it is; `along` is zero, which takes as long to make. */
static void find_slope(const gyro_view *view, gyro_tangent *along, matrix *slope)
{
    double rate[GYRO_N_STATES];
    for (int j = 0; j < MOTION; j++) {
        along->s[j] = 1.0;
        tangent_rate(view, along, rate);
        along->s[j] = 0.0;
        for (int i = 0; i < MOTION; i++) {
            slope->of[i][j] = rate[i];
        }
    }
}

/* The exponent by which a step h [s] passes differences on, and its exponential. */
static matrix exponent(const matrix slope[NODES], double h)
{
    matrix sum = matrix_of(MOTION, 0.0);
    add_scaled(MOTION, 0.5 * h, &slope[0], &sum);
    add_scaled(MOTION, 0.5 * h, &slope[1], &sum);
    const matrix forth = matrix_product(MOTION, &slope[0], &slope[1]), back = matrix_product(MOTION, &slope[1], &slope[0]);
    add_scaled(MOTION, -TURNED * h * h, &forth, &sum);
    add_scaled(MOTION, TURNED * h * h, &back, &sum);
    return sum;
}

static matrix passage_of(const matrix *exponents, double h)
{
    double slopes[2][4];
    for (int axis = 0; axis < 2; axis++) {
        for (int j = 0; j < 4; j++) {
            slopes[axis][j] = exponents->of[2 * axis + 1][j] / h;
        }
    }
    const double size = h * bound_of(slopes, 1.0);
    int terms = 1;
    for (double left = 0.5 * size * size; left > PASSAGE_LEAVES && terms < TERMS; left *= size / (terms + 1)) {
        terms++;
    }
    return matrix_exponential(MOTION, exponents, terms);
}

/* Whether a step has the slopes of the one before, wherever the motion is: nothing bends it and no input but the force is new. */
static int is_alike(const gyro_view *view, const gyro_run *run, int64_t step)
{
    int alike = step > 0 && !view->any_curved && !view->any_law;
    const double *now = run->values + step * run->n_inputs;
    for (int64_t i = 0; i < run->n_inputs && alike; i++) {
        const uint32_t vr = run->inputs[i];
        alike = vr == GYRO_U_X || vr == GYRO_U_Y || now[i] == now[i - run->n_inputs];
    }
    return alike;
}

/* Rates, slopes and passages of a run whose states are known. */
static void linearise(const gyro_instance *g, const gyro_run *run)
{
    traveller *at = run->base;
    matrix mean = matrix_of(MOTION, 0.0), exponents = mean, passage = mean;
    gyro_tangent along;
    memset(&along, 0, sizeof along);
    set_off(g, at);
    for (int64_t step = 0; step < run->steps; step++) {
        const double *start = run->state + step * MOTION, *motion = run->motion + step * NODES * MOTION;
        const int alike = is_alike(&at->view, run, step);
        double rate[2][2];
        matrix slope[NODES];
        come_to(at, run, step);
        find_rates(at, run, step, 0.0, start, rate[0]);
        find_rates(at, run, step, 1.0, start + MOTION, rate[1]);
        if (run->acceleration) {
            find_accelerations(at, run, step);
        }
        find_motion(run, step, rate);
        for (int node = 0; node < NODES; node++) {
            find_rates(at, run, step, PLACE[node], motion + node * MOTION, run->rate + (step * NODES + node) * 2);
            if (!alike) {
                find_slope(&at->view, &along, &slope[node]);
            }
        }
        if (!alike) {
            exponents = exponent(slope, run->step);
            passage = passage_of(&exponents, run->step);
        }
        add_scaled(MOTION, 1.0 / (run->step * (double)run->steps), &exponents, &mean);
        for (int i = 0; i < MOTION; i++) {
            memcpy(run->passage + (step * MOTION + i) * MOTION, passage.of[i], MOTION * sizeof(double));
        }
    }
    const passing whole = passing_of(MOTION, &mean, run->step, 1.0);
    for (int node = 0; node < NODES; node++) {
        for (int i = 0; i < MOTION; i++) {
            run->weight[(node * MOTION + i) * 2] = whole.weight[node].of[i][GYRO_STATE_X_DOT];
            run->weight[(node * MOTION + i) * 2 + 1] = whole.weight[node].of[i][GYRO_STATE_Y_DOT];
        }
    }
}

int32_t gyro_acceleration(void *instance, const double *command, double found[2])
{
    gyro_view view = ((fmi_instance *)instance)->core->view;
    find_acceleration(&view, command, found);
    return 0;
}

int gyro_follow(void *instance, const gyro_run *run)
{
    fmi_instance *f = instance;
    gyro_instance *g = f->core;
    const size_t n = (size_t)run->n_inputs;
    int followed = is_run(run) && is_followed(g) && !g->view.any_state;
    if (followed) {
        memcpy(run->state, g->view.s, MOTION * sizeof(double));
        memcpy(run->voltage, g->memory.sample, sizeof g->memory.sample);
    }
    for (int64_t step = 0; step < run->steps && followed; step++) {
        const double *values = run->values + step * run->n_inputs, from = run->start + (double)step * run->step;
        followed = fmi_set(f, "gyro_follow", GYRO_REAL, run->inputs, n, values, n) == FMI_OK && fmi_step(f, "gyro_follow", from, run->step) == FMI_OK;
        memcpy(run->state + (step + 1) * MOTION, g->view.s, MOTION * sizeof(double));
        memcpy(run->voltage + 2 * (step + 1), g->memory.sample, sizeof g->memory.sample);
    }
    if (followed) {
        linearise(g, run);
    }
    return followed;
}
