/* A state z that follows a displacement x alone (Bouc-Wen), beside z = 0, where |z|^n has no power series unless n is whole:

       L dz/dx = 1 - c |z|^n,  c = beta sgn(z x') + gamma.

   With u = x/L from where z is zero, z is u times a power series in c |u|^n, whatever n is. A step past the zero takes, instead of that z, the
   polynomial of degree 4 in time with the same moments: z moves the mass by its integral with a smooth function, of which the next degree, the
   first that misses, has (omega h)^5/30240. */

#ifndef GYRO_BOUC_WEN_H
#define GYRO_BOUC_WEN_H

#include <string.h>

#include "generated/expansions.h"

/* A zero that the state may reach within so many steps, at its present speed, is near: beyond, its own series holds for a step. */
static const double GYRO_NEAR_ZERO = 1.0;

/* What the last term of z/u may be. */
static const double GYRO_LAST_OF_Z = 1e-11;

/* By how much z may be off within a step because the displacement was. It moves the mass by a thousandth of that. */
static const double GYRO_Z_OFF = 1e-9;

/* Gauss' quadrature on each side of the zero: right to 1e-8 of the moments for n = 1.6. */
enum { GYRO_Z_NODES = 6 };
static const double GYRO_Z_NODE[GYRO_Z_NODES] = {0.033765242898423975, 0.16939530676686776, 0.3806904069584015,
                                                 0.6193095930415985,   0.8306046932331322,  0.966234757101576};
static const double GYRO_Z_WEIGHT[GYRO_Z_NODES] = {0.08566224618958525, 0.1803807865240693,  0.23395696728634546,
                                                   0.23395696728634546, 0.1803807865240693,  0.08566224618958525};

/* Of Legendre's polynomials on 0 .. 1 the coefficients by powers. */
static const double GYRO_LEGENDRE[GYRO_GIVEN_TERMS][GYRO_GIVEN_TERMS] = {
    {1.0}, {-1.0, 2.0}, {1.0, -6.0, 6.0}, {-1.0, 12.0, -30.0, 20.0}, {1.0, -20.0, 90.0, -140.0, 70.0}};

/* How large u may be for the last power to be no more than it may. */
static inline double room_of(const gyro_view *g, const gyro_bouc_wen *state, const gyro_bouc_wen_curve *curve)
{
    const double c = fabs(g->p[state->beta]) + fabs(g->p[state->gamma]), last = fabs(curve->z[GYRO_Z_TERMS - 1]);
    return c > 0.0 ? gyro_power(gyro_power(GYRO_LAST_OF_Z / last, 1.0 / (GYRO_Z_TERMS - 1)) / c, 1.0 / curve->n) : INFINITY;
}

/* With G = z/u by w = c |u|^n: d(u G)/du = 1 - w G^n, and G^n by its recurrence (series.h). The other way du/dz = 1/(1 - c |z|^n). */
static inline void lay_curves(gyro_bouc_wen_curve curve[GYRO_N_STATES], const gyro_view *g)
{
    for (int i = 0; i < GYRO_BOUC_WENS; i++) {
        const double n = g->p[bouc_wens[i].n];
        gyro_bouc_wen_curve *of = &curve[bouc_wens[i].state];
        double power[GYRO_Z_TERMS] = {1.0};
        of->n = n;
        of->z[0] = of->u[0] = 1.0;
        for (int k = 1; k < GYRO_Z_TERMS; k++) {
            double sum = 0.0;
            of->u[k] = 1.0 / (n * k + 1.0);
            of->z[k] = -power[k - 1] * of->u[k];
            for (int j = 1; j <= k; j++) {
                sum += (n * j - (k - j)) * of->z[j] * power[k - j];
            }
            power[k] = sum * GYRO_PART[k];
        }
        of->room = gyro_floor(n) == n ? 0.0 : room_of(g, &bouc_wens[i], of);
    }
}

/* c |u|^n, or c |z|^n. */
static inline double bend_at(const gyro_given *given, double u)
{
    return u == 0.0 ? 0.0 : given->c[u > 0.0] * gyro_power(fabs(u), given->curve->n);
}

static inline double z_at(const gyro_given *given, double u) { return u * value_at(given->curve->z, GYRO_Z_TERMS - 1, bend_at(given, u)); }

static inline gyro_pair z_at_pair(const gyro_given *given, gyro_pair u)
{
    const gyro_pair c = pair_of(given->c[lane_of(u, 0) > 0.0], given->c[lane_of(u, 1) > 0.0]);
    const gyro_pair bend = pair_product(c, power_of_pair(pair_size(u), both(given->curve->n)));
    return pair_product(u, pair_value_at(given->curve->z, GYRO_Z_TERMS - 1, bend));
}

/* By the powers of c |z|^n, and a step of Newton's. */
static inline double u_at(const gyro_given *given, double z)
{
    const double bend = bend_at(given, z), u = z * value_at(given->curve->u, GYRO_Z_TERMS - 1, bend);
    return u + (z - z_at(given, u)) / (1.0 - bend);
}

/* Gives the states near zero, at first as if they followed the displacement in proportion. */
static inline void give_near_zero(const gyro_view *g, gyro_series *s)
{
    s->n_given = 0;
    for (int i = 0; i < GYRO_BOUC_WENS; i++) {
        const gyro_bouc_wen *state = &bouc_wens[i];
        const double z = g->s[state->state], per_length = 1.0 / g->p[state->length];
        const double way = fabs(s->step * g->s[state->speed] * per_length);
        if (g->active[state->effect] && fabs(z) < GYRO_NEAR_ZERO * way && fabs(z) + way < s->plan->curve[state->state].room) {
            gyro_given *given = &s->given[s->n_given++];
            memset(given, 0, sizeof *given);
            given->of = state;
            given->curve = &s->plan->curve[state->state];
            given->per_length = per_length;
            given->z = z;
        }
    }
}

/* Coefficient k of what is given. */
static inline void give_coefficient(gyro_series *s, int k)
{
    for (int i = 0; i < s->n_given; i++) {
        const gyro_given *given = &s->given[i];
        gyro_pair *z = &s->of[given->of->pair][k];
        const double x = given->per_length * lane_of(s->of[GYRO_PAIR_X_AND_Y][k], given->of->axis);
        const double value = k < GYRO_GIVEN_TERMS ? (k > 0 ? x : given->z) + given->less[k] : x;
        *z = given->of->lane == 0 ? pair_of(value, lane_of(*z, 1)) : pair_of(lane_of(*z, 0), value);
    }
}

/* Adds the moments of z - u, in Legendre's polynomials, from `begin` to `end` of a step that holds to `reach`. x shape (power + 1): u by powers
   of time. */
static inline void add_moments(const gyro_given *given, const double *x, int power, double begin, double end, double reach,
                               double moment[GYRO_GIVEN_TERMS])
{
    for (int i = 0; i < GYRO_Z_NODES; i += 2) {
        const gyro_pair node = pair_of(GYRO_Z_NODE[i], GYRO_Z_NODE[i + 1]), weight = pair_of(GYRO_Z_WEIGHT[i], GYRO_Z_WEIGHT[i + 1]);
        const gyro_pair t = pair_sum(both(begin), pair_scaled(end - begin, node)), u = pair_value_at(x, power, t);
        const gyro_pair part = pair_product(pair_ratio(pair_scaled(end - begin, weight), both(reach)), pair_difference(z_at_pair(given, u), u));
        for (int j = 0; j < GYRO_GIVEN_TERMS; j++) {
            const gyro_pair moments = pair_product(part, pair_value_at(GYRO_LEGENDRE[j], j, pair_ratio(t, both(reach))));
            moment[j] = (moment[j] + lane_of(moments, 0)) + lane_of(moments, 1);
        }
    }
}

/* Where u = x(t) is zero before `reach`; 0 where it is not. */
static inline double zero_of(const double *x, int power, double reach)
{
    const double end = value_at(x, power, reach);
    double t = 0.0;
    if ((x[0] < 0.0) != (end < 0.0)) {
        t = reach * x[0] / (x[0] - end);
        /* The speed hardly changes beside it, and what t is off counts by its power n + 1. */
        for (int i = 0; i < 3; i++) {
            const double next = t - value_at(x, power, t) / rate_at(x, power, t);
            t = next > 0.0 && next < reach ? next : t;
        }
    }
    return t;
}

/* How the state bends where u goes `way` from the state z; gives 0 where that is too far for the powers. */
static inline int lay_bend(const gyro_view *g, gyro_given *given, double z, double way)
{
    const double beta = way < 0.0 ? -g->p[given->of->beta] : g->p[given->of->beta], gamma = g->p[given->of->gamma];
    given->way = way;
    given->c[0] = gamma - beta;
    given->c[1] = gamma + beta;
    given->most_bend = larger(fabs(given->c[0]), fabs(given->c[1])) * gyro_power(fabs(z) + fabs(way), given->curve->n);
    return fabs(z) + fabs(way) <= given->curve->room;
}

/* Gives the states by the displacement as a series of this power has it, which holds to `reach`; gives 0 where one goes too far. */
static inline int give_by_displacement(const gyro_view *g, gyro_series *s, int power, double reach)
{
    int holds = 1;
    for (int i = 0; i < s->n_given && holds; i++) {
        gyro_given *given = &s->given[i];
        const double z = g->s[given->of->state];
        double x[GYRO_TERMS] = {0.0}, moment[GYRO_GIVEN_TERMS] = {0.0};
        for (int j = 0; j <= power; j++) {
            x[j] = given->per_length * lane_of(s->of[GYRO_PAIR_X_AND_Y][j], given->of->axis);
        }
        given->from = x[0];
        holds = lay_bend(g, given, z, value_at(x, power, reach) - x[0]);
        given->z = x[0] = u_at(given, z);
        const double zero = zero_of(x, power, reach);
        if (zero > 0.0) {
            add_moments(given, x, power, 0.0, zero, reach, moment);
        }
        add_moments(given, x, power, zero, reach, reach, moment);
        memset(given->less, 0, sizeof given->less);
        for (int j = 0; j < GYRO_GIVEN_TERMS; j++) {
            double scale = (2 * j + 1) * moment[j];
            for (int k = 0; k <= j; k++) {
                given->less[k] += scale * GYRO_LEGENDRE[j][k];
                scale /= reach;
            }
        }
    }
    return holds;
}

/* Whether the motion has gone so as it was when the states were given. */
static inline int went_as_given(const gyro_series *s, int power, double reach)
{
    int as_given = 1;
    for (int i = 0; i < s->n_given; i++) {
        const gyro_given *given = &s->given[i];
        double way = 0.0;
        for (int j = power; j > 0; j--) {
            way = (way + lane_of(s->of[GYRO_PAIR_X_AND_Y][j], given->of->axis)) * reach;
        }
        as_given = as_given && given->most_bend * fabs(given->per_length * way - given->way) <= GYRO_Z_OFF;
    }
    return as_given;
}

/* Sets what is given to its value where the displacement has come to. */
static inline void set_given(gyro_view *g, const gyro_series *s)
{
    for (int i = 0; i < s->n_given; i++) {
        const gyro_given *given = &s->given[i];
        const double way = given->per_length * g->s[given->of->place] - given->from;
        g->s[given->of->state] = z_at(given, given->z + way);
    }
}

/* Whether a lane is of a state that is given. */
static inline int is_given(const gyro_series *s, const gyro_lane *lane)
{
    int is = 0;
    for (int i = 0; i < s->n_given; i++) {
        is |= lane->row == s->of[s->given[i].of->pair] && lane->lane == s->given[i].of->lane;
    }
    return is;
}

#endif
