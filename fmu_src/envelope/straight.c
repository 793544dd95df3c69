#include "straight.h"

#include <string.h>

/* Solves (iω - A) s = b for the states that effects bring, n of them, by elimination; A real, `s` enters as b. */
static void solve_states(double a[GYRO_N_STATES][GYRO_N_STATES], double carrier, number s[GYRO_N_STATES])
{
    enum { FIRST = GYRO_STATE_Y_DOT + 1 };
    number system[GYRO_N_STATES][GYRO_N_STATES];
    for (int i = FIRST; i < GYRO_N_STATES; i++) {
        for (int j = FIRST; j < GYRO_N_STATES; j++) {
            system[i][j] = number_of(-a[i][j], i == j ? carrier : 0.0);
        }
    }
    for (int k = FIRST; k < GYRO_N_STATES; k++) {
        int best = k;
        for (int i = k + 1; i < GYRO_N_STATES; i++) {
            best = square(system[i][k]) > square(system[best][k]) ? i : best;
        }
        for (int j = k; j < GYRO_N_STATES; j++) {
            const number kept = system[k][j];
            system[k][j] = system[best][j];
            system[best][j] = kept;
        }
        const number moved = s[k];
        s[k] = s[best];
        s[best] = moved;
        for (int i = k + 1; i < GYRO_N_STATES; i++) {
            const number ratio = over(system[i][k], system[k][k]);
            for (int j = k; j < GYRO_N_STATES; j++) {
                system[i][j] = minus(system[i][j], times(ratio, system[k][j]));
            }
            s[i] = minus(s[i], times(ratio, s[k]));
        }
    }
    for (int k = GYRO_N_STATES - 1; k >= FIRST; k--) {
        for (int j = k + 1; j < GYRO_N_STATES; j++) {
            s[k] = minus(s[k], times(system[k][j], s[j]));
        }
        s[k] = over(s[k], system[k][k]);
    }
}

gyro_motion gyro_straight_motion(gyro_instance *g)
{
    static const int place[2] = {GYRO_STATE_X, GYRO_STATE_Y}, speed[2] = {GYRO_STATE_X_DOT, GYRO_STATE_Y_DOT};
    gyro_view *view = &g->view;
    const int stateful = any_stateful_force(view);
    const int n = stateful ? GYRO_N_STATES : GYRO_STATE_Y_DOT + 1;
    double at_rest[GYRO_N_STATES], column[GYRO_N_STATES], a[GYRO_N_STATES][GYRO_N_STATES];
    gyro_motion result;
    memset(view->s, 0, sizeof view->s);
    straight_rate(view, at_rest);
    for (int j = 0; j < n; j++) {
        view->s[j] = 1.0;
        straight_rate(view, column);
        view->s[j] = 0.0;
        for (int i = 0; i < n; i++) {
            a[i][j] = column[i] - at_rest[i];
        }
    }
    for (int i = 0; i < 2; i++) {
        result.mean[i] = at_rest[speed[i]];
        for (int j = 0; j < 2; j++) {
            result.stiffness.e[i][j] = number_of(-a[speed[i]][place[j]], 0.0);
            result.damping.e[i][j] = number_of(-a[speed[i]][speed[j]], 0.0);
        }
    }
    for (int j = 0; stateful && j < 2; j++) {
        const double carrier = gyro_carrier(g);
        number s[GYRO_N_STATES];
        for (int k = GYRO_STATE_Y_DOT + 1; k < GYRO_N_STATES; k++) {
            s[k] = number_of(a[k][place[j]], carrier * a[k][speed[j]]);
        }
        solve_states(a, carrier, s);
        for (int i = 0; i < 2; i++) {
            for (int k = GYRO_STATE_Y_DOT + 1; k < GYRO_N_STATES; k++) {
                result.stiffness.e[i][j] = minus(result.stiffness.e[i][j], scaled(s[k], a[speed[i]][k]));
            }
        }
    }
    return result;
}

/* The dynamic stiffness at the rate `w` [rad/s], over the mass. */
static matrix dynamic_stiffness(const gyro_motion *m, double w)
{
    matrix dynamic = matrix_plus(m->stiffness, diagonal(number_of(-w * w, 0.0)));
    for (int i = 0; i < 2; i++) {
        for (int j = 0; j < 2; j++) {
            dynamic.e[i][j] = plus(dynamic.e[i][j], times(number_of(0.0, w), m->damping.e[i][j]));
        }
    }
    return dynamic;
}

/* How much of a harmonic is followed where the force that makes it changes with it: all, unless the force is as steep as the inertia that
   it works against, `ratio` the one over the other. The answer of the mass would then come back larger than it went, at every round; and the
   mass, which rebounds, has no harmonics that follow the force at once. At most 0.29 comes back: r/(1 + 16 r⁴), largest at r⁴ = 1/48. */
static double followed(double ratio)
{
    const double square_of = 4.0 * ratio * ratio;
    return 1.0 / (1.0 + square_of * square_of);
}

void gyro_follow_force(gyro_instance *g, const gyro_motion *m, const gyro_harmonics *force, const double steepness[2], gyro_harmonics *q)
{
    const double carrier = gyro_carrier(g), inverse_mass = g->view.inverse_mass;
    for (int h = 2; h <= GYRO_HARMONICS; h++) {
        const matrix dynamic = dynamic_stiffness(m, h * carrier);
        const pair load = {{scaled(force->part[h - 1].e[0], inverse_mass), scaled(force->part[h - 1].e[1], inverse_mass)}};
        const pair answer = apply(inverse(dynamic), load);
        for (int i = 0; i < 2; i++) {
            const double ratio = steepness[i] * inverse_mass / sqrt(square(dynamic.e[i][i]));
            q->part[h - 1].e[i] = scaled(answer.e[i], followed(ratio));
        }
    }
    /* The mean by Newton's rule: it meets a stop from inside, where the force alone would throw it across. */
    matrix resistance = m->stiffness;
    pair load;
    for (int i = 0; i < 2; i++) {
        const double held = m->stiffness.e[i][0].re * q->mean[0] + m->stiffness.e[i][1].re * q->mean[1];
        load.e[i] = number_of(force->mean[i] * inverse_mass + m->mean[i] - held, 0.0);
        resistance.e[i][i].re += steepness[i] * inverse_mass;
    }
    const pair change = apply(inverse(resistance), load);
    for (int i = 0; i < 2; i++) {
        q->mean[i] += change.e[i].re;
    }
}
