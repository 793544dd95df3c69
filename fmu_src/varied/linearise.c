/* What lies along a run whose motion is known: its pieces, and how they pass differences on. variation.c says what for.

   A piece is a step, or where a force bends the motion in a place, the part of it that a series of the plant goes: a friction that turns round within a
   tenth of a step is even in none of the nodes of that step. */

#include "hermite.h"
#include "taylor.h"
#include "traveller.h"

/* Size of the first term that the passage of a piece leaves out: over a million steps all of them make 1e-5. */
static const double PASSAGE_LEAVES = 1e-11;

/* What a run is linearised by; of matrices the states are those that move. */
typedef struct {
    const gyro_instance *g;
    const gyro_run *run;
    traveller *at;
    int alike;                  /* the slopes of a whole step would be those of the latest */
    int64_t pieces, parts;      /* found so far */
    gyro_tangent along;         /* zero, which takes as long to make */
    double unit[GYRO_N_STATES]; /* in which the states move alike */
    matrix exponents, passage;  /* of the latest whole step with slopes of its own */
    matrix sum;                 /* of the exponents of whole steps */
    int64_t whole;              /* number of these */
} linearising;

/* A piece of a step, from and to which part of it, and the states at its ends. */
typedef struct {
    int64_t step;
    int bent; /* a force may bend the motion in the step in a place */
    double from, to;
    const double *state[2];
    double rate[2][GYRO_N_STATES];
    double second[2][GYRO_N_STATES]; /* of those that effects add */
} piece;

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
    if (end % run->stride == 0 && (!run->even || end == 0)) {
        double *slope = run->slope + end / run->stride * 2 * n;
        matrix all_slopes;
        find_slope(&at->view, &at->moving, &all->along, &all_slopes);
        for (int k = 0; k < n; k++) {
            slope[2 * k] = all_slopes.of[GYRO_STATE_X_DOT][k];
            slope[2 * k + 1] = run->axes > 1 ? all_slopes.of[GYRO_STATE_Y_DOT][k] : 0.0;
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

/* Finds the rates at the ends of a piece. */
static void find_ends(linearising *all, piece *of)
{
    const double place[2] = {of->from, of->to};
    for (int end = 0; end < 2; end++) {
        find_rates(all->at, all->run, of->step, place[end], of->state[end], of->rate[end]);
        if (all->at->moving.n > motion_of(all->run)) {
            find_second(all, of->rate[end], of->second[end]);
        }
    }
}

static double length_of(const linearising *all, const piece *of) { return (of->to - of->from) * all->run->step; }

/* The states at a node of a piece from its ends: speeds by cubics, all else by quintics. */
static void find_within(const linearising *all, const piece *of, int node, double state[GYRO_N_STATES])
{
    const chosen *moving = &all->at->moving;
    const double h = length_of(all, of), *a = of->state[0], *b = of->state[1], *a_rate = of->rate[0], *b_rate = of->rate[1];
    memset(state, 0, GYRO_N_STATES * sizeof *state);
    for (int x = GYRO_STATE_X; x < motion_of(all->run); x += GYRO_STATE_Y - GYRO_STATE_X) {
        const int v = x + 1;
        const gyro_jet from = {a[x], a[v], a_rate[v]}, to = {b[x], b[v], b_rate[v]};
        state[x] = quintic(from, to, h, PLACE[node]);
        state[v] = cubic(a[v], a_rate[v], b[v], b_rate[v], h, PLACE[node]);
    }
    for (int k = motion_of(all->run); k < moving->n; k++) {
        const int i = moving->place[k];
        const gyro_jet from = {a[i], a_rate[i], of->second[0][i]}, to = {b[i], b_rate[i], of->second[1][i]};
        state[i] = quintic(from, to, h, PLACE[node]);
    }
}

/* Terms of a series of the exponents that count. */
static int terms_of(const linearising *all, int n, const matrix *exponents)
{
    const double size = norm_of(n, exponents, all->unit);
    int terms = 1;
    for (double left = 0.5 * size * size; left > PASSAGE_LEAVES && terms < TERMS; left *= size / (terms + 1)) {
        terms++;
    }
    return terms;
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

static void put_passage(const linearising *all, const matrix *passage, int64_t place)
{
    const int n = all->at->moving.n;
    put_columns(n, passage, all->run->passage + place * n * all->run->room);
}

static void put_weight(const linearising *all, const matrix weight[NODES], int64_t part)
{
    const int n = all->at->moving.n;
    for (int node = 0; node < NODES; node++) {
        put_columns(n, &weight[node], all->run->weight + (part * NODES + node) * n * all->run->room);
    }
}

/* The exponents of a piece, by the slopes at its nodes. */
static void find_exponents(linearising *all, const piece *of, const matrix slope[NODES], matrix *found)
{
    const int n = all->at->moving.n;
    find_exponent(n, slope, length_of(all, of), found);
    if (all->pieces == 0) {
        balance(n, found, all->unit);
    }
}

/* How a part of a step passes differences on, and what rates at its nodes add. */
static void pass_part_on(linearising *all, const piece *of, const matrix slope[NODES])
{
    const int n = all->at->moving.n;
    const int64_t part = all->parts + 1;
    matrix exponents;
    passing made;
    find_exponents(all, of, slope, &exponents);
    find_short_passing(n, slope, &exponents, terms_of(all, n, &exponents), length_of(all, of), &made);
    put_passage(all, &made.passage, all->run->shared ? part : all->pieces);
    put_weight(all, made.weight, part);
}

/* The same of a whole step; slope: NULL where they are those of the latest. Weights are found of all whole steps together. */
static void pass_step_on(linearising *all, const piece *of, const matrix *slope)
{
    const int n = all->at->moving.n;
    if (slope) {
        find_exponents(all, of, slope, &all->exponents);
        find_exponential(n, &all->exponents, terms_of(all, n, &all->exponents), &all->passage);
    }
    add_scaled(n, 1.0, &all->exponents, &all->sum);
    all->whole++;
    if (slope || !all->run->shared) {
        put_passage(all, &all->passage, all->run->shared ? 0 : all->pieces);
    }
}

/* Adds a piece of which the ends are known; alike: its slopes are those of the latest whole step, which it is one of. */
static void add_piece(linearising *all, const piece *of, int alike)
{
    const gyro_run *run = all->run;
    matrix slope[NODES];
    for (int node = 0; node < NODES; node++) {
        const int64_t i = all->pieces * NODES + node;
        double *state = run->within + i * GYRO_N_STATES;
        run->place[i] = of->from + PLACE[node] * (of->to - of->from);
        find_within(all, of, node, state);
        find_rates(all->at, run, of->step, run->place[i], state, run->rate + i * GYRO_N_STATES);
        if (!alike) {
            find_slope(&all->at->view, &all->at->moving, &all->along, &slope[node]);
        }
    }
    if (of->bent) {
        pass_part_on(all, of, slope);
        all->parts++;
    } else {
        pass_step_on(all, of, alike ? NULL : slope);
    }
    run->lies[all->pieces] = of->step;
    run->part[all->pieces] = of->bent ? all->parts : 0;
    run->length[all->pieces] = of->to - of->from;
    all->pieces++;
}

/* Whether a force may bend the motion of a step in a place, by its ends. */
static int is_bent(const linearising *all, const piece *of)
{
    traveller *at = all->at;
    double room[GYRO_N_STATES][2];
    look_from(at, all->run, of->step, of->from, of->state[0]);
    int level = find_room(&at->view, room);
    for (int k = 0; k < at->moving.n && level; k++) {
        const int i = at->moving.place[k];
        const double change = of->state[1][i] - of->state[0][i], rate[2] = {of->rate[0][i], of->rate[1][i]};
        level = goes_within(room[i], change, beside_line(all->run->step, change, rate));
    }
    return !level;
}

/* Adds a step by the parts that the plant's series go; gives 0 where there is no room for them. */
static int add_parts(linearising *all, const piece *whole)
{
    const gyro_run *run = all->run;
    const double from = run->start + (double)whole->step * run->step;
    gyro_course course;
    gyro_passage along;
    look_from(all->at, run, whole->step, 0.0, whole->state[0]);
    gyro_view view = all->at->view;
    find_course(&view, all->at->value, from, from + run->step, run->step, &course);
    begin_passage(&along, &all->g->plan.series, &course);
    const int pairs = view.any_state ? GYRO_STATE_PAIRS : GYRO_MOTION_PAIRS;
    int fits = 1;
    while (along.done < 1.0 && fits) {
        double before[GYRO_N_STATES];
        piece part = {.step = whole->step, .bent = 1, .from = along.done, .state = {before, view.s}};
        memcpy(before, view.s, sizeof before);
        /* Where no series serves, the shortest part alone, as cubics have to follow the speed in it. */
        along.stages = 1;
        advance_next(&view, all->at->value, &course, from, run->step, pairs, &along);
        part.to = along.done;
        fits = all->parts < run->parts;
        if (fits) {
            find_ends(all, &part);
            add_piece(all, &part, 0);
        }
    }
    return fits;
}

/* The pieces of a step; gives 0 where there is no room for them. */
static int add_step(linearising *all, int64_t step)
{
    const gyro_run *run = all->run;
    const double *state = run->state + step * GYRO_N_STATES;
    piece whole = {.step = step, .from = 0.0, .to = 1.0, .state = {state, state + GYRO_N_STATES}};
    int fits = 1;
    all->alike = all->alike && is_alike(run, step);
    come_to(all->at, run, step);
    find_ends(all, &whole);
    if (run->acceleration) {
        if (step == 0) {
            find_accelerations(all, step, 0);
        }
        find_accelerations(all, step, 1);
    }
    if (run->parts > 0 && is_bent(all, &whole)) {
        fits = add_parts(all, &whole);
    } else {
        add_piece(all, &whole, all->alike);
        all->alike = is_straight_between(&all->at->view);
    }
    return fits;
}

int gyro_linearise(void *instance, const gyro_run *run)
{
    const gyro_instance *g = ((fmi_instance *)instance)->core;
    linearising all = {.g = g, .run = run, .at = run->base};
    const int n = all.at->moving.n;
    int fits = 1;
    run->until[0] = 0;
    for (int64_t step = 0; step < run->steps && fits; step++) {
        fits = add_step(&all, step);
        if ((step + 1) % run->stride == 0) {
            run->until[(step + 1) / run->stride] = all.pieces;
        }
    }
    passing step;
    matrix mean = {{{0.0}}};
    add_scaled(n, 1.0 / (run->step * (double)(all.whole > 0 ? all.whole : 1)), &all.sum, &mean);
    find_passing(n, &mean, run->step, 1.0, &step);
    put_weight(&all, step.weight, 0);
    come_to(all.at, run, 0);
    return fits;
}
