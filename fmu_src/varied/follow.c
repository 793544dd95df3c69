/* A run whose columns are wanted: its motion, and how that passes differences on. variation.c says what for. */

#include "hermite.h"
#include "traveller.h"

/* Times h^2 the commutator's weight, sqrt(3)/12. */
static const double TURNED = 0.14433756729740643;

/* Size of the first term that a passage leaves out: over a million steps all of them make 1e-5. */
static const double PASSAGE_LEAVES = 1e-11;

/* What a run is linearised by; of matrices the states are those that move. */
typedef struct {
    const gyro_run *run;
    traveller *at;
    gyro_tangent along;         /* zero, which takes as long to make */
    double unit[GYRO_N_STATES]; /* in which the states move alike */
    matrix slope[NODES];        /* of the latest step with slopes of its own */
    matrix exponents, passage;
    matrix mean; /* of the exponents, 1/s */
} linearising;

/* The rates of the states at a part of a step. */
static void find_rates(traveller *at, const gyro_run *run, int64_t step, double part, const double state[], double rate[GYRO_N_STATES])
{
    look_from(at, run, step, part, state);
    state_rate(&at->view, rate);
}

/* The accelerations a number of steps after the start, `part` of `step`, and where wanted how they go with the states that move. */
static void find_accelerations(linearising *all, int64_t step, int part)
{
    const gyro_run *run = all->run;
    traveller *at = all->at;
    const int64_t end = step + part;
    const int n = at->moving.n;
    look_from(at, run, step, part, run->state + end * GYRO_N_STATES);
    find_acceleration(&at->view, command_after(run, end), run->acceleration + 2 * end);
    if (end % run->stride == 0 && (run->passages > 1 || end == 0)) {
        double *slope = run->slope + end / run->stride * 2 * n;
        matrix all_slopes;
        find_slope(&at->view, &at->moving, &all->along, &all_slopes);
        for (int k = 0; k < n; k++) {
            slope[2 * k] = all_slopes.of[GYRO_STATE_X_DOT][k];
            slope[2 * k + 1] = all_slopes.of[GYRO_STATE_Y_DOT][k];
        }
    }
    come_to(at, run, step);
}

/* How the rates of states that effects add change along the run, in the view as it is: by `rate` of all states. */
static void find_second(linearising *all, const double rate[GYRO_N_STATES], double second[GYRO_N_STATES])
{
    memcpy(all->along.s, rate, sizeof all->along.s);
    tangent_rate(&all->at->view, &all->along, second);
    memset(all->along.s, 0, sizeof all->along.s);
}

/* The states at both ends of a step. */
typedef struct {
    const double *state[2];
    double rate[2][GYRO_N_STATES];
    double second[2][GYRO_N_STATES]; /* of those that effects add */
} ends;

static ends find_ends(linearising *all, int64_t step)
{
    const gyro_run *run = all->run;
    ends found;
    for (int end = 0; end < 2; end++) {
        found.state[end] = run->state + (step + end) * GYRO_N_STATES;
        find_rates(all->at, run, step, end, found.state[end], found.rate[end]);
        if (all->at->moving.n > MOTION) {
            find_second(all, found.rate[end], found.second[end]);
        }
    }
    return found;
}

/* The states at a node of a step from its ends: speeds by cubics, all else by quintics. */
static void find_within(const linearising *all, const ends *of, int node, double state[GYRO_N_STATES])
{
    const chosen *moving = &all->at->moving;
    const double h = all->run->step, *a = of->state[0], *b = of->state[1], *a_rate = of->rate[0], *b_rate = of->rate[1];
    memset(state, 0, GYRO_N_STATES * sizeof *state);
    for (int x = GYRO_STATE_X; x <= GYRO_STATE_Y; x += GYRO_STATE_Y - GYRO_STATE_X) {
        const int v = x + 1;
        const gyro_jet from = {a[x], a[v], a_rate[v]}, to = {b[x], b[v], b_rate[v]};
        state[x] = quintic(from, to, h, PLACE[node]);
        state[v] = cubic(a[v], a_rate[v], b[v], b_rate[v], h, PLACE[node]);
    }
    for (int k = MOTION; k < moving->n; k++) {
        const int i = moving->place[k];
        const gyro_jet from = {a[i], a_rate[i], of->second[0][i]}, to = {b[i], b_rate[i], of->second[1][i]};
        state[i] = quintic(from, to, h, PLACE[node]);
    }
}

/* The exponent by which a step h [s] passes differences on, by the slopes at its nodes. */
static void find_exponent(int n, const matrix slope[NODES], double h, matrix *found)
{
    matrix product;
    set_diagonal(n, 0.0, found);
    add_scaled(n, 0.5 * h, &slope[0], found);
    add_scaled(n, 0.5 * h, &slope[1], found);
    find_product(n, -TURNED * h * h, &slope[0], &slope[1], &product);
    add_scaled(n, 1.0, &product, found);
    find_product(n, TURNED * h * h, &slope[1], &slope[0], &product);
    add_scaled(n, 1.0, &product, found);
}

static void find_passage(linearising *all, int64_t step)
{
    const int n = all->at->moving.n;
    find_exponent(n, all->slope, all->run->step, &all->exponents);
    if (step == 0) {
        balance(n, &all->exponents, all->unit);
    }
    const double size = norm_of(n, &all->exponents, all->unit);
    int terms = 1;
    for (double left = 0.5 * size * size; left > PASSAGE_LEAVES && terms < TERMS; left *= size / (terms + 1)) {
        terms++;
    }
    find_exponential(n, &all->exponents, terms, &all->passage);
}

/* A matrix by columns, with zeros behind each. */
static void put_columns(int n, const matrix *from, double *to)
{
    const int room = column_room(n);
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < room; i++) {
            to[j * room + i] = i < n ? from->of[i][j] : 0.0;
        }
    }
}

/* Whether nothing bends the motion, so that its slopes go with the inputs beside the force alone. */
static int is_straight(const gyro_view *view)
{
    int straight = !view->any_law;
    for (int i = 0; i < GYRO_N_BENDING; i++) {
        straight &= !view->active[gyro_bending[i]];
    }
    return straight;
}

/* Whether no input but the force is another in a step than in the one before. */
static int is_alike(const gyro_run *run, int64_t step)
{
    int alike = step > 0;
    const double *now = run->values + step * run->n_inputs;
    for (int64_t i = 0; i < run->n_inputs && alike; i++) {
        const uint32_t vr = run->inputs[i];
        alike = vr == GYRO_U_X || vr == GYRO_U_Y || now[i] == now[i - run->n_inputs];
    }
    return alike;
}

/* Rates, slopes and passages of a run whose states are known. */
static void linearise(linearising *all)
{
    const gyro_run *run = all->run;
    traveller *at = all->at;
    const int n = at->moving.n, straight = is_straight(&at->view);
    for (int64_t step = 0; step < run->steps; step++) {
        const int alike = straight && is_alike(run, step);
        come_to(at, run, step);
        const ends of = find_ends(all, step);
        if (run->acceleration) {
            if (step == 0) {
                find_accelerations(all, step, 0);
            }
            find_accelerations(all, step, 1);
        }
        for (int node = 0; node < NODES; node++) {
            double *state = run->within + (step * NODES + node) * GYRO_N_STATES;
            find_within(all, &of, node, state);
            find_rates(at, run, step, PLACE[node], state, run->rate + (step * NODES + node) * GYRO_N_STATES);
            if (!alike) {
                find_slope(&at->view, &at->moving, &all->along, &all->slope[node]);
            }
        }
        if (!alike) {
            find_passage(all, step);
        }
        add_scaled(n, 1.0 / (run->step * (double)run->steps), &all->exponents, &all->mean);
        if (step < run->passages) {
            put_columns(n, &all->passage, run->passage + step * n * run->room);
        }
    }
    passing whole;
    find_passing(n, &all->mean, run->step, 1.0, &whole);
    for (int node = 0; node < NODES; node++) {
        put_columns(n, &whole.weight[node], run->weight + node * n * run->room);
    }
}

int32_t gyro_acceleration(void *instance, const double *command, double found[2])
{
    gyro_view view = ((fmi_instance *)instance)->core->view;
    find_acceleration(&view, command, found);
    return 0;
}

int gyro_measure(void *instance, gyro_run *run)
{
    const gyro_instance *g = ((fmi_instance *)instance)->core;
    const int followed = is_run(run) && is_followed(g);
    int alike = followed && is_straight(&g->view);
    for (int64_t step = 1; step < run->steps && alike; step++) {
        alike = is_alike(run, step);
    }
    run->states = GYRO_N_STATES;
    run->moving = states_of(&g->view, NULL).n;
    run->room = column_room((int)run->moving);
    run->passages = alike && run->steps > 0 ? 1 : run->steps;
    run->size = (int64_t)sizeof(traveller);
    return followed;
}

/* Keeps the states of an instance that move, and its sample. */
static void keep(const gyro_instance *g, const chosen *moving, const gyro_run *run, int64_t step)
{
    double *state = run->state + step * GYRO_N_STATES;
    memset(state, 0, GYRO_N_STATES * sizeof *state);
    for (int k = 0; k < moving->n; k++) {
        state[moving->place[k]] = g->view.s[moving->place[k]];
    }
    memcpy(run->voltage + 2 * step, g->memory.sample, sizeof g->memory.sample);
}

int gyro_follow(void *instance, const gyro_run *run)
{
    fmi_instance *f = instance;
    gyro_instance *g = f->core;
    linearising all = {.run = run, .at = run->base};
    const size_t n = (size_t)run->n_inputs;
    int followed = 1;
    all.at->moving = states_of(&g->view, NULL);
    keep(g, &all.at->moving, run, 0);
    for (int64_t step = 0; step < run->steps && followed; step++) {
        const double *values = run->values + step * run->n_inputs, from = run->start + (double)step * run->step;
        followed = fmi_set(f, "gyro_follow", GYRO_REAL, run->inputs, n, values, n) == FMI_OK && fmi_step(f, "gyro_follow", from, run->step) == FMI_OK;
        keep(g, &all.at->moving, run, step + 1);
    }
    if (followed) {
        set_off(g, all.at);
        linearise(&all);
        come_to(all.at, run, 0);
    }
    return followed;
}
