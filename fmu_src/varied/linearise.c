/* What lies along a run whose motion is known: its pieces, and how they pass differences on. variation.c says what for.

   A piece is a step, or its part before or after a late force comes, or where a force bends the motion in a place, the part of these that a series of
   the plant goes: a friction that turns round within a tenth of a step is even in none of the nodes of that step. */

#include "hermite.h"
#include "taylor.h"
#include "traveller.h"

/* Size of the first term that the passage of a piece leaves out: over a million steps all of them make 1e-5. */
static const double PASSAGE_LEAVES = 1e-11;

/* Size of an exponent from which a part is one at rest: a series goes a part of some three. */
static const double STEEP = 20.0;

/* What a run is linearised by; of matrices the states are those that move. */
typedef struct {
    const gyro_instance *g;
    const gyro_run *run;
    traveller *at;
    int64_t pieces, parts;      /* found so far */
    gyro_tangent along;         /* zero, which takes as long to make */
    double unit[GYRO_N_STATES]; /* in which the states move alike */
    int alike[KINDS];           /* the slopes of a piece of that kind would be those of the latest */
    matrix exponents[KINDS];    /* of that */
    matrix passage[KINDS];      /* of that */
    matrix sum;                 /* of the exponents of all */
    double length;              /* of these together, steps */
} linearising;

/* A piece of a step, from and to which part of it, and the states at its ends. */
typedef struct {
    int64_t step;
    int kind; /* KINDS: a part in which a force may bend the motion in a place */
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
    come_to(at, run, step, part);
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

/* How a part of no kind passes differences on, and what rates at its nodes add. */
static void pass_part_on(linearising *all, const piece *of, const matrix slope[NODES])
{
    const int n = all->at->moving.n;
    const int64_t part = all->run->kinds + all->parts;
    matrix exponents;
    passing made;
    find_exponents(all, of, slope, &exponents);
    const double norm = norm_of(n, &exponents, all->unit);
    if (norm > STEEP) {
        find_steep_passing(n, &exponents, length_of(all, of), norm, &made);
    } else {
        find_short_passing(n, slope, &exponents, terms_of(all, n, &exponents), length_of(all, of), &made);
    }
    put_passage(all, &made.passage, all->run->shared ? part : all->pieces);
    put_weight(all, made.weight, part);
}

/* The same of a kind; slope: NULL where they are those of the latest. Weights are found of all kinds together. */
static void pass_kind_on(linearising *all, const piece *of, const matrix *slope)
{
    const int n = all->at->moving.n;
    matrix *exponents = &all->exponents[of->kind], *passage = &all->passage[of->kind];
    if (slope) {
        find_exponents(all, of, slope, exponents);
        find_exponential(n, exponents, terms_of(all, n, exponents), passage);
    }
    add_scaled(n, 1.0, exponents, &all->sum);
    all->length += of->to - of->from;
    if (slope || !all->run->shared) {
        put_passage(all, passage, all->run->shared ? of->kind : all->pieces);
    }
}

/* Adds a piece of which the ends are known. */
static void add_piece(linearising *all, const piece *of)
{
    const gyro_run *run = all->run;
    const int bent = of->kind == KINDS, alike = !bent && all->alike[of->kind];
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
    run->lies[all->pieces] = of->step;
    run->part[all->pieces] = bent ? run->kinds + all->parts : of->kind;
    if (bent) {
        pass_part_on(all, of, slope);
        all->parts++;
    } else {
        pass_kind_on(all, of, alike ? NULL : slope);
        all->alike[of->kind] = is_straight_between(&all->at->view);
    }
    run->length[all->pieces] = of->to - of->from;
    all->pieces++;
}

/* Whether a force may bend the motion of a piece in a place, by its ends. */
static int is_bent(const linearising *all, const piece *of)
{
    traveller *at = all->at;
    double room[GYRO_N_STATES][2];
    look_from(at, all->run, of->step, of->from, of->state[0]);
    int level = find_room(&at->view, room);
    for (int k = 0; k < at->moving.n && level; k++) {
        const int i = at->moving.place[k];
        const double change = of->state[1][i] - of->state[0][i], rate[2] = {of->rate[0][i], of->rate[1][i]};
        level = goes_within(room[i], change, beside_line(length_of(all, of), change, rate));
    }
    return !level;
}

/* The motion over a piece as the plant's series go it. */
typedef struct {
    gyro_view view;
    gyro_course course;
    gyro_passage along;
    double begin, length; /* s */
    int pairs;            /* of states */
} by_series;

static void begin_series(linearising *all, const piece *of, by_series *motion)
{
    const gyro_run *run = all->run;
    look_from(all->at, run, of->step, of->from, of->state[0]);
    motion->view = all->at->view;
    motion->begin = motion->view.t;
    motion->length = length_of(all, of);
    motion->pairs = motion->view.any_state ? GYRO_STATE_PAIRS : GYRO_MOTION_PAIRS;
    find_course(&motion->view, all->at->value, motion->begin, motion->begin + motion->length, motion->length, &motion->course);
    begin_passage(&motion->along, &all->g->plan.series, &motion->course);
}

static void go_on(const linearising *all, by_series *motion)
{
    advance_next(&motion->view, all->at->value, &motion->course, motion->begin, motion->length, motion->pairs, &motion->along);
}

/* The states at the end of a piece. */
static void find_last(linearising *all, const piece *of, double state[GYRO_N_STATES])
{
    by_series motion;
    begin_series(all, of, &motion);
    while (motion.along.done < 1.0) {
        go_on(all, &motion);
    }
    memcpy(state, motion.view.s, sizeof motion.view.s);
}

/* Whether steep forces hold the mass all through a piece, on every axis that moves. */
static int stays_at_rest(linearising *all, const piece *of)
{
    const int wanted = all->run->axes > 1 ? 3 : 1;
    by_series motion;
    chosen moving;
    matrix slope;
    begin_series(all, of, &motion);
    const int begins = (find_steep(&motion.view, motion.length, &moving, &slope) & wanted) == wanted;
    while (begins && motion.along.done < 1.0) {
        go_on(all, &motion);
    }
    return begins && motion.along.rested && (find_steep(&motion.view, motion.length, &moving, &slope) & wanted) == wanted;
}

/* Adds a piece at rest as one part: what a jump of the force sets going in it has settled before it has gone anywhere. */
static int add_rest(linearising *all, const piece *of)
{
    const int fits = all->parts < all->run->parts;
    double begin[GYRO_N_STATES];
    piece part = *of;
    part.kind = KINDS;
    part.state[0] = begin;
    memcpy(begin, of->state[0], sizeof begin);
    memcpy(begin, of->state[1], MOTION * sizeof *begin);
    memcpy(part.rate[0], of->rate[1], MOTION * sizeof *part.rate[0]);
    if (fits) {
        add_piece(all, &part);
    }
    return fits;
}

/* Adds a piece by the parts that the plant's series go; gives 0 where there is no room for them. */
static int add_parts(linearising *all, const piece *of)
{
    by_series motion;
    int fits = 1;
    begin_series(all, of, &motion);
    while (motion.along.done < 1.0 && fits) {
        double before[GYRO_N_STATES];
        piece part = {.step = of->step, .kind = KINDS, .state = {before, motion.view.s}};
        part.from = of->from + motion.along.done * (of->to - of->from);
        memcpy(before, motion.view.s, sizeof before);
        /* Where no series serves, the shortest part alone, as cubics have to follow the speed in it. */
        motion.along.stages = 1;
        go_on(all, &motion);
        part.to = of->from + motion.along.done * (of->to - of->from);
        fits = all->parts < all->run->parts;
        if (fits) {
            find_ends(all, &part);
            add_piece(all, &part);
        }
    }
    return fits;
}

/* Adds a piece, or the parts that it needs; gives 0 where there is no room for them. */
static int add_pieces(linearising *all, piece *of)
{
    const gyro_run *run = all->run;
    int fits = 1;
    come_to(all->at, run, of->step, of->from);
    find_ends(all, of);
    if (run->parts > 0 && is_bent(all, of)) {
        fits = stays_at_rest(all, of) ? add_rest(all, of) : add_parts(all, of);
    } else {
        add_piece(all, of);
    }
    return fits;
}

/* Whether another command comes within a step. */
static int is_cut(const gyro_run *run, int64_t step)
{
    const double *before = run->values + acting_step(run, step, 0.0) * run->n_inputs, *after = run->values + acting_step(run, step, 1.0) * run->n_inputs;
    int cut = 0;
    for (int64_t i = 0; i < run->n_inputs; i++) {
        cut = cut || (is_command(run->inputs[i]) && before[i] != after[i]);
    }
    return cut;
}

/* The pieces of a step; gives 0 where there is no room for them. */
static int add_step(linearising *all, int64_t step)
{
    const gyro_run *run = all->run;
    const double *state = run->state + step * GYRO_N_STATES, cut = late_part(run);
    int fits = 1;
    for (int kind = 0; kind < run->kinds; kind++) {
        all->alike[kind] = all->alike[kind] && is_alike(run, step);
    }
    if (run->acceleration) {
        if (step == 0) {
            find_accelerations(all, step, 0);
        }
        find_accelerations(all, step, 1);
    }
    if (run->late > 0.0) {
        /* As travellers find it: a force that comes at a sample may do so a picosecond earlier in the plant. */
        find_voltage(all->at, run, step, 1.0, state + GYRO_N_STATES, run->voltage + 2 * (step + 1));
    }
    if (is_cut(run, step)) {
        double middle[GYRO_N_STATES];
        piece before = {.step = step, .kind = KIND_BEFORE, .from = 0.0, .to = cut, .state = {state, middle}};
        piece after = {.step = step, .kind = KIND_AFTER, .from = cut, .to = 1.0, .state = {middle, state + GYRO_N_STATES}};
        come_to(all->at, run, step, 0.0);
        find_last(all, &before, middle);
        fits = add_pieces(all, &before) && add_pieces(all, &after);
    } else {
        piece whole = {.step = step, .kind = KIND_WHOLE, .from = 0.0, .to = 1.0, .state = {state, state + GYRO_N_STATES}};
        fits = add_pieces(all, &whole);
    }
    return fits;
}

/* What rates add over pieces of the kinds, by the mean of all slopes. */
static void weigh_kinds(linearising *all)
{
    const gyro_run *run = all->run;
    const int n = all->at->moving.n;
    matrix mean = {{{0.0}}};
    add_scaled(n, all->length > 0.0 ? 1.0 / (run->step * all->length) : 0.0, &all->sum, &mean);
    for (int kind = 0; kind < run->kinds; kind++) {
        passing over;
        find_passing(n, &mean, run->step * length_of_kind(run, kind), 1.0, &over);
        put_weight(all, over.weight, kind);
    }
}

int gyro_linearise(void *instance, const gyro_run *run)
{
    const gyro_instance *g = ((fmi_instance *)instance)->core;
    linearising all = {.g = g, .run = run, .at = run->base};
    int fits = 1;
    run->until[0] = 0;
    for (int64_t step = 0; step < run->steps && fits; step++) {
        fits = add_step(&all, step);
        if ((step + 1) % run->stride == 0) {
            run->until[(step + 1) / run->stride] = all.pieces;
        }
    }
    weigh_kinds(&all);
    come_to(all.at, run, 0, 0.0);
    return fits;
}
