/* The variation of a motion: what other parameters add to a run, to first order in what they add to its states.

   With the motion s of the run, its rates f and those f* of the other parameters, the difference d obeys

       d' = J d + f*(s) - f(s),   J = df/ds,

   so that no other motion need be found: a step is s, f and J at two nodes of Gauss. J passes d on by the exponential of Magnus' series with two
   terms; the difference of the rates is the line through the nodes, whose exponential integral is tabulated for the mean of J. Both are of fourth
   order (A. Iserles, H. Z. Munthe-Kaas, S. P. Norsett, A. Zanna, Lie-group methods, Acta Numerica 9, 2000, sections 4 and 5). Voltages follow from
   s + d as those of the FMU do. */

#include "traveller.h"

/* Steps that all columns go before the next, so that what is found at their nodes stays near the processor. */
enum { TOGETHER = 128 };

/* A part of a run along which a traveller is taken. */
typedef struct {
    double force[TOGETHER * NODES][2], left[TOGETHER * NODES][2]; /* at nodes, N; then what they add to the rates of the speeds, m/s^2 */
    double rate[TOGETHER * NODES][GYRO_N_STATES];                 /* SI/s */
    double own[TOGETHER * NODES][MOST];                           /* states that effects add, SI */
    double own_after[TOGETHER][MOST];                             /* these after each step, SI */
    double state[TOGETHER][MOTION];                               /* the motion there, SI */
} part_of_run;

static void set_own(gyro_view *view, const double own[])
{
    for (int i = 0; i < OWN; i++) {
        view->s[MOTION + i] = own[i];
    }
}

static void begin_own(traveller *at, const gyro_run *run)
{
    driven *own = &at->own;
    double rest[GYRO_N_STATES], rate[GYRO_N_STATES], none[MOST] = {0.0};
    own->n = 0;
    for (int i = 0; i < OWN; i++) {
        own->place[own->n] = MOTION + i;
        own->state[own->n] = at->view.s[MOTION + i];
        own->n += at->view.active[gyro_owners[i]];
    }
    matrix slope = matrix_of(own->n, 0.0);
    come_to(at, run, 0);
    look_from(at, run, 0, 0.0, run->state);
    set_own(&at->view, none);
    state_rate(&at->view, rest);
    for (int j = 0; j < own->n; j++) {
        double *state = &at->view.s[own->place[j]];
        *state = 1.0;
        state_rate(&at->view, rate);
        *state = 0.0;
        for (int i = 0; i < own->n; i++) {
            slope.of[i][j] = rate[own->place[i]] - rest[own->place[i]];
        }
    }
    for (int node = 0; node < NODES; node++) {
        own->to[node] = passing_of(own->n, &slope, run->step, PLACE[node]);
    }
    own->whole = passing_of(own->n, &slope, run->step, 1.0);
}

/* Own states after a part of a step, by their rates at its nodes. */
static void pass_own(const driven *own, const passing *over, double rate[NODES][MOST], double after[])
{
    for (int i = 0; i < own->n; i++) {
        double sum = 0.0;
        for (int j = 0; j < own->n; j++) {
            sum += over->passage.of[i][j] * own->state[j];
            for (int node = 0; node < NODES; node++) {
                sum += over->weight[node].of[i][j] * rate[node][j];
            }
        }
        after[i] = sum;
    }
}

/* What the forces and the mass of a traveller add to the rates of the speeds at nodes, and the rates of its own states. */
static void find_forcing(traveller *at, gyro_view *base, const gyro_nodes *nodes, part_of_run *part)
{
    const double *rate = nodes->run->rate + nodes->first * NODES * 2;
    memset(part->force, 0, (size_t)nodes->n * sizeof *part->force);
    memset(part->left, 0, (size_t)nodes->n * sizeof *part->left);
    if (at->view.any_state) {
        memset(part->rate, 0, (size_t)nodes->n * sizeof *part->rate);
    }
    for (int i = 0; i < at->n_added; i++) {
        add_force(&at->view, nodes, at->added[i], part->force, part->rate);
    }
    for (int i = 0; i < at->n_left; i++) {
        add_force(base, nodes, at->left[i], part->left, part->rate);
    }
    for (int64_t i = 0; i < nodes->n && at->maps; i++) {
        if (i % NODES == 0) {
            bring_all(&at->view, nodes, i);
            bring_all(base, nodes, i);
        }
        for (int axis = 0; axis < 2; axis++) {
            part->force[i][axis] += at->view.u[axis] - base->u[axis];
        }
    }
    for (int64_t i = 0; i < nodes->n; i++) {
        for (int axis = 0; axis < 2; axis++) {
            const double added = (part->force[i][axis] - part->left[i][axis]) * at->view.inverse_mass;
            part->force[i][axis] = added + at->lighter * rate[2 * i + axis];
        }
    }
}

/* Likewise where laws act. */
static void find_lawful_forcing(traveller *at, const gyro_nodes *nodes, part_of_run *part)
{
    const gyro_run *run = nodes->run;
    for (int64_t i = 0; i < nodes->n; i++) {
        const int64_t step = nodes->first + i / NODES;
        const double *base = run->rate + (nodes->first * NODES + i) * 2;
        if (i % NODES == 0) {
            come_to(at, run, step);
        }
        look_from(at, run, step, PLACE[i % NODES], nodes->motion[i]);
        if (nodes->own) {
            set_own(&at->view, nodes->own[i]);
        }
        state_rate(&at->view, part->rate[i]);
        part->force[i][0] = part->rate[i][GYRO_STATE_X_DOT] - base[0];
        part->force[i][1] = part->rate[i][GYRO_STATE_Y_DOT] - base[1];
    }
}

static void find_forces(traveller *at, gyro_view *base, const gyro_nodes *nodes, part_of_run *part)
{
    if (at->lawful) {
        find_lawful_forcing(at, nodes, part);
    } else {
        find_forcing(at, base, nodes, part);
    }
}

/* Puts own states where those of all effects stand. */
static void put_own(const driven *own, const double states[], double all[MOST])
{
    for (int j = 0; j < own->n; j++) {
        all[own->place[j] - MOTION] = states[j];
    }
}

/* Own states at the nodes of a part of a run, from what drives them there, and at its end, which stay. */
static void drive_own(traveller *at, gyro_view *base, gyro_nodes *nodes, part_of_run *part)
{
    driven *own = &at->own;
    memset(part->own, 0, sizeof part->own);
    memset(part->own_after, 0, sizeof part->own_after);
    find_forces(at, base, nodes, part);
    for (int64_t i = 0; i < nodes->n; i += NODES) {
        double rate[NODES][MOST], found[MOST];
        for (int node = 0; node < NODES; node++) {
            for (int j = 0; j < own->n; j++) {
                rate[node][j] = part->rate[i + node][own->place[j]];
            }
        }
        for (int node = 0; node < NODES; node++) {
            pass_own(own, &own->to[node], rate, found);
            put_own(own, found, part->own[i + node]);
        }
        pass_own(own, &own->whole, rate, found);
        memcpy(own->state, found, (size_t)own->n * sizeof *found);
        put_own(own, found, part->own_after[i / NODES]);
    }
}

/* The difference after each of some steps. */
static void pass_on(traveller *at, const gyro_run *run, int64_t first, int64_t last, part_of_run *part)
{
    const double *w = run->weight;
    double d[MOTION];
    memcpy(d, at->difference, sizeof d);
    for (int64_t step = first; step < last; step++) {
        const double *p = run->passage + step * MOTION * MOTION;
        double (*const f)[2] = part->force + (step - first) * NODES, *after = part->state[step - first];
        for (int i = 0; i < MOTION; i++) {
            const double *q = p + MOTION * i, *v = w + 2 * i, *late = v + 2 * MOTION;
            after[i] = (q[0] * d[0] + q[1] * d[1]) + (q[2] * d[2] + q[3] * d[3]) +
                       ((v[0] * f[0][0] + v[1] * f[0][1]) + (late[0] * f[1][0] + late[1] * f[1][1]));
        }
        for (int i = 0; i < MOTION; i++) {
            d[i] = after[i];
        }
    }
    memcpy(at->difference, d, sizeof d);
}

/* Takes a traveller along some steps. */
static void go_along(traveller *at, gyro_view *base, const gyro_run *run, int64_t first, int64_t last, part_of_run *part)
{
    gyro_nodes nodes = {run, first, (last - first) * NODES, (const double (*)[MOTION])run->motion + first * NODES, NULL};
    if (at->view.any_state) {
        nodes.own = (const double (*)[MOST])part->own;
        drive_own(at, base, &nodes, part);
    }
    find_forces(at, base, &nodes, part);
    pass_on(at, run, first, last, part);
}

/* The view of a traveller at a sample, `step` steps after the start, by the difference there. */
static void look_at_sample(traveller *at, const gyro_run *run, int64_t step, const double difference[MOTION], int forced)
{
    /* The inputs are those of the step before. */
    const int64_t before = step > 0 ? step - 1 : 0;
    double state[MOTION];
    for (int i = 0; i < MOTION; i++) {
        state[i] = run->state[step * MOTION + i] + difference[i];
    }
    if (forced) {
        come_to(at, run, before);
    }
    look_from(at, run, before, (double)(step - before), state);
}

static void take_voltage(traveller *at, const gyro_run *run, int64_t step, const double difference[MOTION], double out[2])
{
    gyro_view *view = &at->view;
    const double *base = run->voltage + 2 * step;
    look_at_sample(at, run, step, difference, view->any_law || view->any_map);
    pick_off(view);
    amplify(view);
    convert(view);
    out[0] = view->v[0] - base[0];
    out[1] = view->v[1] - base[1];
}

/* own: the traveller's own states there, where it has such. */
static void take_acceleration(traveller *at, const gyro_run *run, int64_t step, const double difference[MOTION], const double own[], double out[2])
{
    const double *base = run->acceleration + 2 * step;
    look_at_sample(at, run, step, difference, 1);
    if (at->view.any_state) {
        set_own(&at->view, own);
    }
    find_acceleration(&at->view, command_after(run, step), out);
    out[0] -= base[0];
    out[1] -= base[1];
}

/* A sample's part of the column, likewise. */
static void take_difference(traveller *at, const gyro_run *run, int64_t step, const double difference[MOTION], const double own[], int of,
                            double out[2])
{
    if (of == GYRO_OF_VOLTAGE) {
        take_voltage(at, run, step, difference, out);
    } else if (of == GYRO_OF_ACCELERATIONS) {
        take_acceleration(at, run, step, difference, own, out);
    } else {
        out[0] = difference[GYRO_STATE_X_DOT];
        out[1] = difference[GYRO_STATE_Y_DOT];
    }
}

int64_t gyro_traveller_size(void) { return (int64_t)sizeof(traveller); }

/* Finds which forces are others than those of the run. */
static void compare_forces(traveller *at, const gyro_view *base)
{
    const gyro_view *view = &at->view;
    unsigned char other[GYRO_N_EFFECTS] = {0};
    for (int i = 0; i < GYRO_N_READS; i++) {
        const int effect = gyro_reads[i][0], vr = gyro_reads[i][1], command = vr == GYRO_U_X || vr == GYRO_U_Y;
        if (view->p[vr] != base->p[vr] || (command && at->maps)) {
            other[effect] = 1;
        }
    }
    at->n_added = at->n_left = 0;
    for (int i = 0; i < GYRO_N_FORCES; i++) {
        const int effect = gyro_forces[i];
        if (other[effect] || view->active[effect] != base->active[effect]) {
            at->added[at->n_added] = at->left[at->n_left] = effect;
            at->n_added += view->active[effect];
            at->n_left += base->active[effect];
        }
    }
}

int gyro_depart(void *instance, const gyro_run *run, void *made)
{
    const gyro_instance *g = ((fmi_instance *)instance)->core;
    const gyro_view *base = &((const traveller *)run->base)->view;
    const int followed = is_run(run) && is_followed(g);
    if (followed) {
        traveller *at = made;
        set_off(g, at);
        at->lighter = at->view.inverse_mass / base->inverse_mass - 1.0;
        at->lawful = at->view.any_law || base->any_law;
        at->maps = at->view.any_map || base->any_map;
        compare_forces(at, base);
        for (int i = 0; i < MOTION; i++) {
            at->difference[i] = at->view.s[i] - run->state[i];
        }
        if (at->view.any_state) {
            begin_own(at, run);
        }
        come_to(at, run, 0);
    }
    return followed;
}

void gyro_vary(const gyro_run *run, int64_t n, void *const travellers[], int of, double *const columns[])
{
    gyro_view base = ((const traveller *)run->base)->view;
    part_of_run part;
    for (int64_t i = 0; i < n; i++) {
        traveller *at = travellers[i];
        double own[MOST] = {0.0};
        if (at->view.any_state) {
            put_own(&at->own, at->own.state, own);
        }
        take_difference(at, run, 0, at->difference, own, of, columns[i]);
    }
    /* All along a part of the run before any goes on, so that it stays near the processor. */
    for (int64_t first = 0; first < run->steps; first += TOGETHER) {
        const int64_t last = first + TOGETHER < run->steps ? first + TOGETHER : run->steps;
        for (int64_t i = 0; i < n; i++) {
            traveller *at = travellers[i];
            go_along(at, &base, run, first, last, &part);
            for (int64_t sample = first / run->stride + 1; sample * run->stride <= last; sample++) {
                const int64_t step = sample * run->stride, place = step - first - 1;
                take_difference(at, run, step, part.state[place], part.own_after[place], of, columns[i] + 2 * sample);
            }
        }
    }
}
