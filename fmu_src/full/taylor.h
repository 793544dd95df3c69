/* The motion while forces bend it, or laws change them within the step: its Taylor series in time, of so many terms that what is left out is some
   1e-14 of a state, which is 1e-9 rad a second. Where so many don't do, near a singularity in the complex plane, the same terms hold for a
   shorter step, and the rest of the step follows from there.

   Where a force has a corner (friction that turns round, a stop that is met) the step ends at the corner, found on the polynomial, so that
   every series is of one branch. What has no series, or corners closer than a thousandth of a step, is left to the stages of integrator.h.

   Where laws change parameters within the step, the linear forces change along a line, and what else depends on them is that of the middle of
   the step: the error of that is a commutator, which turns with the motion and does not add up. */

#ifndef GYRO_TAYLOR_H
#define GYRO_TAYLOR_H

#include <stddef.h>
#include <string.h>

#include "bouc_wen.h"
#include "generated/expansions.h"
#include "integrator.h"
#include "linear.h"
#include "rest.h"

/* Largest last term, over the size of a state, of which those left out are a tenth or less; the one before may be GYRO_BEFORE_LAST times as
   large. */
static const double GYRO_LAST_TERM = 3e-13, GYRO_BEFORE_LAST = 100.0;

/* The same of a state that an effect brings, over that: what it does to the motion within the step is in the terms of the motion. What it keeps
   for later ones is off by 1e-8 rad a second where its force is a twentieth of the spring's. */
static const double GYRO_OWN_LAST_TERM = 300.0;

/* So many terms are not asked whether they are the last. The first that are not zero are the size of a state: near a singularity higher ones are
   no measure. */
enum { GYRO_SIZE_TERMS = 5 };

/* What is zero beside the sum of a corner's terms. */
static const double GYRO_CORNER_ZERO = 1e-13;

/* Corners that one part of a step may be cut at before the stages take over. */
enum { GYRO_MOST_TURNS = 2 * GYRO_SERIES_CORNERS };

/* By what part a step may end before where the states were found that are given, which changes them less than their moments are off. */
static const double GYRO_AIM = 1.0 - 1e-6;

/* So often states are given before the step goes on without: each time they are 1e-3 or less as far off. */
enum { GYRO_MOST_GIVEN = 4 };

/* Series in a step that go less than a part of GYRO_WHOLE of it, as to a corner or through a friction that turns round at once, which takes some
   fifteen; then the stages take over there too. */
enum { GYRO_MOST_CLOSE = 32 };

/* The part of a step that is left to the stages at once, where they estimate no larger error than this, over the size of a state, squared:
   1e-10. Elsewhere it is 1/GYRO_WHOLE. */
static const double GYRO_LONG_STAGES = 1.0 / 128, GYRO_LONG_ERROR = 1e-20;

/* Powers of time up to which laws change the linear forces. */
enum { GYRO_COURSE_POWERS = 3 };

/* What laws leave at an instant. */
typedef struct {
    double changed[GYRO_N_LAW_TARGETS]; /* SI */
    double lagging[GYRO_N_LAGGING + 1]; /* SI */
    double remembered[GYRO_N_MEMORIES];
} gyro_laws;

/* What laws do in a step: the linear forces by so many powers of the time, in steps; by what all else that a force reads changes; and where
   laws move, each thing that they change, by powers of the time from the middle, and what they leave at the end. */
typedef struct {
    gyro_linear power[GYRO_COURSE_POWERS];
    int powers;
    double read[GYRO_SERIES_READ];
    double changed[GYRO_N_LAW_TARGETS][GYRO_COURSE_POWERS];
    int smooth; /* 1: `changed` holds for all of them */
    gyro_laws end;
} gyro_course;

static inline void plan_series(gyro_series_plan *plan, const gyro_view *view)
{
    gyro_series_place end = {0, 0, 0, 0};
    memset(plan, 0, sizeof *plan);
    plan->holds = 1;
    for (int i = 0; i < view->n_acting; i++) {
        const int effect = view->acting[i];
        const gyro_series_size size = series_sizes[effect];
        if (size.rows < 0) {
            plan->holds = 0;
        } else if (size.rows + size.constants + size.corners + size.bounds > 0) {
            plan->effect[plan->n] = effect;
            plan->shared |= size.shared;
            plan->place[plan->n++] = end;
            end = (gyro_series_place){end.row + size.rows, end.constant + size.constants, end.corner + size.corners, end.bound + size.bounds};
        }
    }
    lay_curves(plan->curve, view);
    plan->corners = end.corner;
    plan->bounds = end.bound;
    plan->holds = plan->holds && end.row <= GYRO_SERIES_ROWS;
}

/* a + f b */
static inline gyro_linear sum_of_linear(const gyro_linear *a, double f, const gyro_linear *b)
{
    gyro_linear sum;
    for (int axis = 0; axis < 2; axis++) {
        sum.still[axis] = a->still[axis] + f * b->still[axis];
        for (int i = 0; i < 4; i++) {
            sum.slope[axis][i] = a->slope[axis][i] + f * b->slope[axis][i];
        }
    }
    return sum;
}

/* The linear forces from the part `begin` of a step on, in units of what is left of it. */
static inline void shift_course(const gyro_course *course, double begin, gyro_linear from[GYRO_COURSE_POWERS])
{
    static const gyro_linear none = {{{0.0}}, {0.0}};
    const double rest = 1.0 - begin;
    const gyro_linear *p = course->power;
    const gyro_linear *bend = course->powers > 2 ? &p[2] : &none;
    const gyro_linear value = sum_of_linear(&p[1], begin, bend), rate = sum_of_linear(&p[1], 2.0 * begin, bend);
    from[0] = sum_of_linear(&p[0], begin, &value);
    from[1] = sum_of_linear(&none, rest, &rate);
    from[2] = sum_of_linear(&none, rest * rest, bend);
}

/* Coefficient k of the linear force, where it does not change. */
static inline gyro_pair linear_force(const gyro_linear_pair *linear, const gyro_series *s, int k)
{
    const gyro_pair place = s->of[GYRO_PAIR_X_AND_Y][k], speed = s->of[GYRO_PAIR_X_DOT_AND_Y_DOT][k];
    const gyro_pair by_place = pair_sum(pair_product(linear->place[0], place), pair_product(linear->place[1], pair_exchanged(place)));
    const gyro_pair by_speed = pair_sum(pair_product(linear->speed[0], speed), pair_product(linear->speed[1], pair_exchanged(speed)));
    return pair_sum(k == 0 ? pair_sum(by_place, linear->still) : by_place, by_speed);
}

/* The coefficients k + 1 of so many pairs of states. */
static inline void expand_once(const gyro_view *g, gyro_series *s, const gyro_linear_pair *from, int powers, int k, int pairs)
{
    const double h = s->step * GYRO_PART[k + 1];
    gyro_pair force = linear_force(&from[0], s, k);
    for (int j = 1; j < powers && j <= k; j++) {
        force = pair_sum(force, linear_force(&from[j], s, k - j));
    }
    for (int i = GYRO_MOTION_PAIRS; i < pairs; i++) {
        s->of[i][k + 1] = both(0.0);
    }
    pair_states(s, k);
    force = k == 0 ? with_first(g, s, h, force) : with_later(g, s, k, h, force);
    s->of[GYRO_PAIR_X_AND_Y][k + 1] = pair_scaled(h, s->of[GYRO_PAIR_X_DOT_AND_Y_DOT][k]);
    s->of[GYRO_PAIR_X_DOT_AND_Y_DOT][k + 1] = pair_scaled(h * g->inverse_mass, force);
    if (pairs > GYRO_MOTION_PAIRS) {
        give_coefficient(s, k + 1);
    }
}

/* The part of the step for which the term of GYRO_MOST_POWER is the last that counts, being `left` > 1 times as large as that: four square roots
   are the sixteenth. */
static inline double reach_of(double left) { return 1.0 / sqrt(sqrt(sqrt(sqrt(left)))); }

static inline gyro_pair larger_pair(gyro_pair a, gyro_pair b)
{
    return pair_of(larger(lane_of(a, 0), lane_of(b, 0)), larger(lane_of(a, 1), lane_of(b, 1)));
}

/* 1 over the largest last term of a pair of states of this size. */
static inline double last_weight(double size, double last) { return size > 0.0 ? 1.0 / (last * size) : 1e300; }

/* The linear forces from the part `begin` of a step on; gives by how many powers of what is left of it. */
static inline int linear_from(const gyro_course *course, double begin, gyro_linear_pair from[GYRO_COURSE_POWERS])
{
    const int powers = course->powers, later = powers > 1 && begin > 0.0;
    gyro_linear shifted[GYRO_COURSE_POWERS];
    if (later) {
        shift_course(course, begin, shifted);
    }
    for (int j = 0; j < powers; j++) {
        from[j] = pairs_of(later ? &shifted[j] : &course->power[j]);
    }
    return powers;
}

/* The first coefficients of so many pairs of states from the view on. */
static inline void expand_first(const gyro_view *g, gyro_series *s, const gyro_linear_pair *from, int powers, int pairs)
{
    take_states(g, s, pairs);
    if (pairs > GYRO_MOTION_PAIRS) {
        give_coefficient(s, 0);
    }
    for (int i = 0; i < s->plan->bounds; i++) {
        s->bounded[i].row = NULL;
    }
    expand_once(g, s, from, powers, 0, pairs);
    for (int power = 1; power < GYRO_SIZE_TERMS; power++) {
        expand_once(g, s, from, powers, power, pairs);
    }
}

/* The coefficients of the motion of so many pairs of states from the view on, in units of the step of the series, `pairs` a constant at each
   call; `size` shape (GYRO_STATE_PAIRS) grows to that of each state. Gives the last power; `reach` is the part of the step that it holds for. */
static inline int expand(const gyro_view *g, gyro_series *s, const gyro_linear_pair *from, int powers, int pairs, gyro_pair size[GYRO_STATE_PAIRS],
                         double *reach)
{
    double left = INFINITY, before = INFINITY;
    gyro_pair weight[GYRO_STATE_PAIRS];
    int power = GYRO_SIZE_TERMS;
    expand_first(g, s, from, powers, pairs);
    for (int i = 0; i < pairs; i++) {
        const gyro_pair *c = s->of[i];
        const double last = i >= GYRO_MOTION_PAIRS ? GYRO_OWN_LAST_TERM * GYRO_LAST_TERM : GYRO_LAST_TERM;
        size[i] = larger_pair(size[i], pair_sum(pair_size(c[0]), pair_size(c[1])));
        for (int j = 2; j < GYRO_SIZE_TERMS && !(lane_of(size[i], 0) > 0.0 && lane_of(size[i], 1) > 0.0); j++) {
            const gyro_pair first = pair_size(c[j]);
            size[i] = pair_of(lane_of(size[i], 0) > 0.0 ? lane_of(size[i], 0) : lane_of(first, 0),
                              lane_of(size[i], 1) > 0.0 ? lane_of(size[i], 1) : lane_of(first, 1));
        }
        weight[i] = pair_of(last_weight(lane_of(size[i], 0), last), last_weight(lane_of(size[i], 1), last));
    }
    /* A sum, in which what is no number stays: then no further term helps. */
    while (power < GYRO_MOST_POWER && left == left && !(left <= 1.0 && before <= GYRO_BEFORE_LAST)) {
        gyro_pair sum = both(0.0);
        expand_once(g, s, from, powers, power++, pairs);
        for (int i = 0; i < pairs; i++) {
            sum = pair_sum(sum, pair_product(pair_size(s->of[i][power]), weight[i]));
        }
        before = left;
        left = lane_of(sum, 0) + lane_of(sum, 1);
    }
    *reach = 1.0;
    if (!(left <= 1.0 && before <= GYRO_BEFORE_LAST)) {
        *reach = gyro_finite(left + before) ? reach_of(larger(left, before / GYRO_BEFORE_LAST)) : 0.0;
    }
    return power;
}

/* Where side c, above zero at 0, comes down to `zero` before `end`; 2 where it does not. Each step goes as far as the largest second
   derivative lets it, so that no zero is passed by, and doubles the digits of the first. */
static inline double first_zero(const double *c, int n, double side, double zero, double end)
{
    double bend = 0.0, t = 0.0, found = 2.0;
    for (int j = n; j > 1; j--) {
        bend = bend * end + j * (j - 1) * fabs(c[j]);
    }
    for (int i = 0; i < 64 && t < end && found > 1.0; i++) {
        const double value = side * value_at(c, n, t), rate = n > 0 ? side * rate_at(c, n, t) : 0.0;
        const double root = sqrt(rate * rate + 2.0 * bend * value);
        if (value <= zero) {
            found = t;
        } else {
            t += rate < 0.0 ? 2.0 * value / (root - rate) : bend > 0.0 ? (rate + root) / bend : end;
        }
    }
    return found;
}

/* Coefficient j. A lane that a compiler knows is read where it lies. */
static inline double coefficient(const gyro_lane *of, int j) { return of->lane == 0 ? lane_of(of->row[j], 0) : lane_of(of->row[j], 1); }

/* By how much both lanes of a row change in the whole step of the series at most. */
static inline gyro_pair most_change(const gyro_pair *row, int power)
{
    gyro_pair odd = pair_size(row[1]), even = both(0.0);
    for (int j = 2; j < power; j += 2) {
        even = pair_sum(even, pair_size(row[j]));
        odd = pair_sum(odd, pair_size(row[j + 1]));
    }
    return pair_sum(odd, power % 2 ? even : pair_sum(even, pair_size(row[power])));
}

/* The sum of |c_j| reach^j from j = 1 on, a lane of a row. */
static inline double change_within(const gyro_lane *c, int power, double reach)
{
    double sum = 0.0;
    for (int j = power; j > 0; j--) {
        sum = (sum + fabs(coefficient(c, j))) * reach;
    }
    return sum;
}

/* By how much it may change one way there, 0: both. */
static inline double change_towards(const gyro_lane *c, double way, int power, double reach)
{
    double sum = 0.0;
    for (int j = power; j > 0; j--) {
        const double own = coefficient(c, j);
        sum = (sum + (own * way < 0.0 ? 0.0 : fabs(own))) * reach;
    }
    return sum;
}

/* The part of `reach` in which every row that is bounded changes by no more than its room. A saturated function says nothing of where it turns
   over. */
static inline double within_bounds(const gyro_series *s, int power, double reach)
{
    const gyro_pair *row = NULL;
    gyro_pair most = both(0.0);
    for (int bound = 0; bound < s->plan->bounds; bound++) {
        const gyro_lane *c = &s->bounded[bound];
        if (c->row != row) {
            row = c->row;
            most = row != NULL ? most_change(row, power) : most;
        }
        if (row != NULL && lane_of(most, c->lane) > s->room[bound]) {
            const double change = change_towards(c, s->way[bound], power, reach);
            /* Without a constant the sum falls at least as fast as the reach. */
            reach = change > s->room[bound] ? reach * (s->room[bound] / change) : reach;
        }
    }
    return reach;
}

/* Whether the side of a corner is that to which the motion goes; else turns it. Where it is, shortens `reach` to the next corner and puts which in
   `met`. */
static inline int side_holds(gyro_series *s, int corner, int power, double *reach, int *met)
{
    const gyro_lane *of = &s->corner[corner];
    const double side = s->side[corner], first = coefficient(of, 0), sum = change_within(of, power, *reach);
    int holds = 1, low = 0;
    if (side * first <= sum && (sum > 0.0 || first != 0.0)) {
        double c[GYRO_TERMS] = {0.0};
        for (int j = 0; j <= power; j++) {
            c[j] = coefficient(of, j);
        }
        /* At the corner, the first term that is not zero says where it goes; that zero is not the next one. */
        low = fabs(c[0]) <= GYRO_CORNER_ZERO * sum;
        while (low > 0 && low < power && c[low] == 0.0) {
            low++;
        }
        holds = side * c[low] > 0.0;
        if (holds) {
            const double at = first_zero(c + low, power - low, side, GYRO_CORNER_ZERO * sum, *reach);
            if (at < *reach) {
                *reach = at;
                *met = corner;
            }
        } else {
            s->side[corner] = -side;
        }
    }
    return holds;
}

/* The same of all corners. Most are further away than the motion goes in a step. */
static inline int sides_hold(gyro_series *s, int power, double *reach, int *met)
{
    const gyro_pair *row = NULL;
    gyro_pair most = both(0.0);
    int hold = 1;
    for (int corner = 0; corner < s->plan->corners && *reach > 0.0; corner++) {
        const gyro_lane *of = &s->corner[corner];
        if (of->row != row) {
            row = of->row;
            most = most_change(row, power);
        }
        if (!(s->side[corner] * lane_of(row[0], of->lane) > lane_of(most, of->lane)) && !is_given(s, of)) {
            hold = side_holds(s, corner, power, reach, met) && hold;
        }
    }
    return hold;
}

/* What was given may have passed its zero. */
static inline void forget_sides(gyro_series *s)
{
    for (int corner = 0; corner < s->plan->corners; corner++) {
        s->side[corner] = is_given(s, &s->corner[corner]) ? 0.0 : s->side[corner];
    }
}

/* The states at a part of the step of the series: even and odd powers apart, so that a processor need not wait for each. */
static inline void set_states(const gyro_series *s, int power, double part, int pairs, gyro_view *g)
{
    const gyro_pair once = both(part), square = both(part * part);
    const int last = power / 2;
    gyro_pair value[GYRO_STATE_PAIRS] = {{0.0}};
    for (int i = 0; i < pairs; i++) {
        const gyro_pair *c = s->of[i];
        gyro_pair even = c[2 * last], odd = power % 2 ? c[power] : both(0.0);
        for (int j = last - 1; j > 0; j--) {
            even = pair_sum(pair_product(even, square), c[2 * j]);
            odd = pair_sum(pair_product(odd, square), c[2 * j + 1]);
        }
        odd = pair_sum(pair_product(odd, square), c[1]);
        value[i] = pair_sum(c[0], pair_sum(pair_product(once, odd), pair_product(square, even)));
    }
    give_states(value, g, pairs);
}

/* By what laws may bend the course of the linear forces off a line in a step, over the stiffness: what bends a parabola is less again. */
static const double GYRO_COURSE_BEND = 1e-9;

/* Below this a line does: of the frequency's square a sixth of it is left, 3e-11 rad a second at 3 kHz. */
static const double GYRO_COURSE_STRAIGHT = 1e-14;

/* By what part they may change in a step what else a force reads: that which a series holds at the middle, and that which it follows along a
   line. */
static const double GYRO_READ_CHANGE[2] = {1e-7, 1e-4};

/* By what part they may bend what they change in a step off a line, so that a parabola does: it is off by less than a thirtieth of that, and where
   it has a kink by no more. */
static const double GYRO_CHANGED_BEND = 1e-9;

/* Keeps what laws have left in the view, and brings it back. */
static inline void keep_laws(const gyro_view *g, gyro_laws *laws)
{
    for (int i = 0; i < GYRO_N_LAW_TARGETS; i++) {
        laws->changed[i] = g->p[law_targets[i]];
    }
    memcpy(laws->lagging, g->lagging_now, sizeof g->lagging_now);
    memcpy(laws->remembered, g->remembered_now, sizeof g->remembered_now);
}

static inline void bring_laws(gyro_view *g, const gyro_laws *laws)
{
    for (int i = 0; i < GYRO_N_LAW_TARGETS; i++) {
        g->p[law_targets[i]] = laws->changed[i];
    }
    memcpy(g->lagging_now, laws->lagging, sizeof g->lagging_now);
    memcpy(g->remembered_now, laws->remembered, sizeof g->remembered_now);
}

/* The laws at the part `at` of a step h [s] from time t; `value` shape (GYRO_N_VARIABLES), as set. */
static inline void apply_laws_at(gyro_view *g, const double *value, double t, double h, double at)
{
    g->t = t + at * h;
    g->since = at * h;
    apply_laws(g, value);
}

/* The parabola through start, middle and end of a step, or where it hardly bends the line; gives whether the course is as smooth as that. */
static inline int lay_course(gyro_course *course, const gyro_linear *start, gyro_linear *middle, const gyro_linear *end, double inverse_mass)
{
    const double frequency = bound_of(middle->slope, inverse_mass), stiffness = frequency * frequency;
    const gyro_linear bend = sum_of_linear(start, -1.0, middle), back = sum_of_linear(end, -1.0, middle), twice = sum_of_linear(&bend, 1.0, &back);
    const gyro_linear whole = sum_of_linear(end, -1.0, start);
    double most = 0.0;
    course->power[2] = sum_of_linear(&twice, 1.0, &twice);
    for (int axis = 0; axis < 2; axis++) {
        const double *a = course->power[2].slope[axis];
        most = larger(most, fabs(a[0]) + fabs(a[2]) + frequency * (fabs(a[1]) + fabs(a[3])));
    }
    const int straight = most * inverse_mass <= GYRO_COURSE_STRAIGHT * stiffness && twice.still[0] == 0.0 && twice.still[1] == 0.0;
    course->powers = straight ? 2 : GYRO_COURSE_POWERS;
    course->power[0] = *start;
    course->power[1] = straight ? whole : sum_of_linear(&whole, -2.0, &twice);
    return most * inverse_mass <= GYRO_COURSE_BEND * stiffness;
}

/* Parabolas through what laws change, by start, middle and end of a step, the last in the view; gives whether they follow the laws. */
static inline int lay_changed(gyro_course *course, double value[3][GYRO_N_LAW_TARGETS])
{
    int smooth = 1;
    for (int i = 0; i < GYRO_N_LAW_TARGETS; i++) {
        const double start = value[0][i], middle = value[1][i], end = value[2][i], bend = (start - middle) + (end - middle);
        course->changed[i][0] = middle;
        course->changed[i][1] = end - start;
        course->changed[i][2] = 2.0 * bend;
        smooth = smooth && fabs(bend) <= GYRO_CHANGED_BEND * fabs(middle);
    }
    return smooth;
}

static inline void read_changed(const gyro_view *g, double value[GYRO_N_LAW_TARGETS])
{
    for (int i = 0; i < GYRO_N_LAW_TARGETS; i++) {
        value[i] = g->p[law_targets[i]];
    }
}

/* What laws change, at the part `at` of a smooth course. */
static inline void set_changed(gyro_view *g, const gyro_course *course, double at)
{
    const double c = at - 0.5;
    for (int i = 0; i < GYRO_N_LAW_TARGETS; i++) {
        const double *p = course->changed[i];
        g->p[law_targets[i]] = p[0] + c * (p[1] + c * p[2]);
    }
}

/* Finds how the linear forces change in a step h [s] from time t to `end_time`, and leaves the laws of its middle; gives 0 where laws bend too much,
   and leaves those of the start. */
static inline int find_course(gyro_view *g, const double *value, double t, double end_time, double h, gyro_course *course)
{
    int even = 1;
    double *change = course->read;
    memset(change, 0, sizeof course->read);
    course->power[0] = linear_of(g);
    course->powers = 1;
    if (g->moving) {
        const gyro_linear start = course->power[0];
        double first[GYRO_SERIES_READ], last[GYRO_SERIES_READ], changed[3][GYRO_N_LAW_TARGETS];
        read_by_series(g, first);
        read_changed(g, changed[0]);
        g->t = end_time;
        g->since = h;
        apply_laws(g, value);
        keep_laws(g, &course->end);
        read_by_series(g, last);
        read_changed(g, changed[2]);
        const gyro_linear end = linear_of(g);
        apply_laws_at(g, value, t, h, 0.5);
        read_changed(g, changed[1]);
        gyro_linear middle = linear_of(g);
        course->smooth = lay_changed(course, changed);
        even = lay_course(course, &start, &middle, &end, g->inverse_mass);
        for (int i = 0; g->any_curved && i < GYRO_SERIES_READ; i++) {
            change[i] = last[i] - first[i];
            even = even && fabs(change[i]) <= GYRO_READ_CHANGE[series_follows[i]] * fabs(first[i]);
        }
        if (!even) {
            apply_laws_at(g, value, t, h, 0.0);
        }
    }
    return even;
}

/* How far a step has come, and what its parts share. */
typedef struct {
    double done;               /* 1: all of it */
    gyro_pair size[GYRO_STATE_PAIRS]; /* of each state, SI */
    int close;                  /* series that went less than a part of GYRO_WHOLE */
    int rests;                  /* series after which it is looked whether a mass rests */
    int count;                  /* of series so far */
    int rested;                 /* 1: a steep force held the mass at the end */
    int stages;                 /* parts of GYRO_WHOLE that are left to the stages where the next series does not do */
    int power;                  /* the last of the latest series; 0: the latest part was left to the stages */
    double reach;               /* of what was left, the part that it has gone */
    gyro_series series;
} gyro_passage;

static inline void begin_passage(gyro_passage *at, const gyro_series_plan *plan, const gyro_course *course)
{
    memcpy(at->series.change, course->read, sizeof at->series.change);
    at->done = 0.0;
    at->close = 0;
    at->rests = GYRO_REST_AFTER;
    at->count = 0;
    at->rested = 0;
    at->stages = 1;
    at->series.plan = plan;
    memset(at->size, 0, sizeof at->size);
    memset(at->series.side, 0, sizeof at->series.side);
}

/* The series of so many pairs of states, on the sides of corners to which the motion goes; gives its last power and how far it holds, up to the
   corner `met` if that is not -1. The reach is 0 where no sides do. */
static inline int expand_to_corner(const gyro_view *g, gyro_series *s, const gyro_linear_pair *from, int powers, int pairs, gyro_pair *size,
                                   double *reach, int *met)
{
    int power = 0, settled = 0;
    for (int turns = 0; !settled && turns <= GYRO_MOST_TURNS; turns++) {
        power = pairs > GYRO_MOTION_PAIRS ? expand(g, s, from, powers, GYRO_STATE_PAIRS, size, reach)
                                          : expand(g, s, from, powers, GYRO_MOTION_PAIRS, size, reach);
        *met = -1;
        *reach = within_bounds(s, power - 1, *reach);
        settled = sides_hold(s, power - 1, reach, met);
    }
    *reach = settled ? *reach : 0.0;
    return power;
}

/* The same where states are near zero that follow the displacement: that is known better with each series, and so are they. */
static inline int expand_near_zero(const gyro_view *g, gyro_series *s, const gyro_linear_pair *from, int powers, gyro_pair *size, double *reach,
                                   int *met)
{
    int power = GYRO_SIZE_TERMS, again = 1;
    double aim = 1.0;
    expand_first(g, s, from, powers, GYRO_STATE_PAIRS);
    for (int i = 0; again; i++) {
        if (i == GYRO_MOST_GIVEN || !(aim * GYRO_WHOLE >= 1.0) || !give_by_displacement(g, s, power, aim)) {
            s->n_given = 0;
        }
        power = expand_to_corner(g, s, from, powers, GYRO_STATE_PAIRS, size, reach, met);
        if (s->n_given > 0 && *reach > aim / GYRO_AIM) {
            *reach = aim;
            *met = -1;
        }
        again = s->n_given > 0 && (*reach < GYRO_AIM * aim || !went_as_given(s, power, *reach));
        aim = *reach;
    }
    return power;
}

/* Moves so many pairs of states of the view on as far as one series does; gives 0 where none does. */
static inline int advance_by_series(gyro_view *g, const gyro_course *course, double h, int pairs, gyro_passage *at)
{
    gyro_series *s = &at->series;
    gyro_linear_pair from[GYRO_COURSE_POWERS];
    const int powers = linear_from(course, at->done, from);
    double reach = 0.0;
    int met = -1;
    s->step = h * (1.0 - at->done);
    s->begin = at->done;
    s->n_given = 0;
    if (pairs > GYRO_MOTION_PAIRS) {
        give_near_zero(g, s);
    }
    const int power = s->n_given > 0 ? expand_near_zero(g, s, from, powers, at->size, &reach, &met)
                                     : expand_to_corner(g, s, from, powers, pairs, at->size, &reach, &met);
    /* Part of the rest of the step, and so of the whole. */
    const double part = reach * (1.0 - at->done);
    const int close = part * GYRO_WHOLE < 1.0 && reach < 1.0, moves = reach > 0.0 && (!close || at->close < GYRO_MOST_CLOSE);
    if (moves) {
        at->close += close;
        at->power = power;
        at->reach = reach;
        set_states(s, power, reach, pairs, g);
        if (s->n_given > 0) {
            set_given(g, s);
            forget_sides(s);
        }
        at->done = reach < 1.0 ? at->done + part : 1.0;
        if (met >= 0) {
            s->side[met] = -s->side[met];
        }
    }
    return moves;
}

/* Moves the states of the view on by stages from time t, `from` [s] into the step h [s] of which `left` is left; gives which part. */
static inline double integrate_some(gyro_view *g, const double *value, double t, double from, double h, double left)
{
    double part = left > 1.5 * GYRO_LONG_STAGES ? GYRO_LONG_STAGES : left;
    double before[GYRO_N_STATES];
    memcpy(before, g->s, sizeof before);
    if (!(integrate_part(g, value, t, from, part * h) <= GYRO_LONG_ERROR) && part * GYRO_WHOLE > 1.5) {
        part = 1.0 / GYRO_WHOLE;
        memcpy(g->s, before, sizeof before);
        integrate_part(g, value, t, from, part * h);
    }
    return part;
}

/* Moves the view on where it is time to look whether a mass rests in what is left of the step h [s], and one does; gives whether it has. Where all of
   that is too much, as the other axis turns round in it, some is not. */
static inline int rest_some(gyro_view *g, double h, gyro_passage *at)
{
    double part = 0.0;
    if (at->count >= at->rests && !g->moving) {
        for (double tried = 1.0; part == 0.0 && tried >= GYRO_REST_LEAST; tried *= GYRO_REST_SHORTER) {
            part = move_at_rest(g, tried * h * (1.0 - at->done)) ? tried : 0.0;
        }
        at->rested = part == 1.0;
        at->done = at->rested ? 1.0 : at->done + part * (1.0 - at->done);
        at->rests = at->count + (part > 0.0 ? 0 : GYRO_REST_AGAIN);
    }
    return part > 0.0;
}

/* Moves so many pairs of states of the view on by the next part of the step h [s] from time t: as far as a mass rests, by one series, or else by
   stages. */
static inline void advance_next(gyro_view *g, const double *value, const gyro_course *course, double t, double h, int pairs, gyro_passage *at)
{
    g->t = t + at->done * h;
    g->since = at->done * h;
    if (rest_some(g, h, at)) {
        at->power = 0;
        at->stages = 1;
        memset(at->series.side, 0, sizeof at->series.side);
    } else if (advance_by_series(g, course, h, pairs, at)) {
        at->count++;
        at->stages = 1;
    } else {
        at->count++;
        at->power = 0;
        for (int i = 0; i < at->stages && at->done < 1.0; i++) {
            at->done += integrate_some(g, value, t + at->done * h, at->done * h, h, 1.0 - at->done);
        }
        if (g->moving) {
            apply_laws_at(g, value, t, h, 0.5);
        }
        memset(at->series.side, 0, sizeof at->series.side);
        at->stages *= 2;
    }
}

#endif
