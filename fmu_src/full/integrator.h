/* The explicit Runge-Kutta method of order 8 in 12 stages by Dormand and Prince, DOP853: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary
   Differential Equations I, 2nd edition 1993, sections II.5 and II.10 and appendix. benchmarks/work_precision.py compares it with others.

   Its error estimate halves a step in which a force changes fast (a stop that is met, dry friction that changes its sign) and joins halves again
   after it. All that follows from the state at a cut, so that no bit depends on how an importer divides time. */

#ifndef GYRO_INTEGRATOR_H
#define GYRO_INTEGRATOR_H

#include <string.h>

#include "generated/effects.h"

/* The rate k[stage] of the states at `sum` of the earlier rates, at the fraction `node` of the step. */
#define STAGE(stage, node, sum)         \
    for (int i = 0; i < n; i++) {       \
        g->s[i] = start[i] + h * (sum); \
    }                                   \
    g->t = t + (node) * h;              \
    g->since = from + (node) * h;       \
    if (g->moving) {                    \
        apply_laws(g, value);           \
    }                                   \
    state_rate(g, k[stage])

/* Largest estimate of a step's error, over the size of each state, squared: of 1e-12. The estimate is of order 7, the step of order 8: where a
   step is smooth, the error lies orders of magnitude below. */
static const double GYRO_STEP_ERROR = 1e-24;

/* What half a step makes of that square, by its order: 2^-16. */
static const double GYRO_HALF_ERROR = 1.0 / 65536.0;

/* Below this share of it the step may be twice as long: that, and a margin. */
static const double GYRO_LONGER = 1e-6;

/* A step is halved so many times at most. What a force does within 1/1024 of internal_step is left to the last halves. */
enum { GYRO_HALVINGS = 10 };

/* Moves the states of the view from time t by h [s], the force of the view held, what lags being that of `from` [s] before t. `value` shape
   (GYRO_N_VARIABLES), as set; n states, a constant at each call, so that the loops unroll. Gives the largest estimate of the error over the
   size of a state, squared. */
static inline double integrate_states(gyro_view *g, const double *value, double t, double from, double h, int n)
{
    double worst = 0.0;
    double start[GYRO_N_STATES];
    double k[12][GYRO_N_STATES];
    for (int i = 0; i < n; i++) {
        start[i] = g->s[i];
    }
    STAGE(0, 0.0, 0.0);
    STAGE(1, 0.05260015195876773,
          0.05260015195876773 * k[0][i]);
    STAGE(2, 0.0789002279381516,
          0.0197250569845379 * k[0][i] + 0.0591751709536137 * k[1][i]);
    STAGE(3, 0.1183503419072274,
          0.02958758547680685 * k[0][i] + 0.08876275643042054 * k[2][i]);
    STAGE(4, 0.2816496580927726,
          0.2413651341592667 * k[0][i] + -0.8845494793282861 * k[2][i] + 0.924834003261792 * k[3][i]);
    STAGE(5, 0.3333333333333333,
          0.037037037037037035 * k[0][i] + 0.17082860872947386 * k[3][i] + 0.12546768756682242 * k[4][i]);
    STAGE(6, 0.25,
          0.037109375 * k[0][i] + 0.17025221101954405 * k[3][i] + 0.06021653898045596 * k[4][i] +
          -0.017578125 * k[5][i]);
    STAGE(7, 0.3076923076923077,
          0.03709200011850479 * k[0][i] + 0.17038392571223998 * k[3][i] + 0.10726203044637328 * k[4][i] +
          -0.015319437748624402 * k[5][i] + 0.008273789163814023 * k[6][i]);
    STAGE(8, 0.6512820512820513,
          0.6241109587160757 * k[0][i] + -3.3608926294469414 * k[3][i] + -0.868219346841726 * k[4][i] +
          27.59209969944671 * k[5][i] + 20.154067550477894 * k[6][i] + -43.48988418106996 * k[7][i]);
    STAGE(9, 0.6,
          0.47766253643826434 * k[0][i] + -2.4881146199716677 * k[3][i] + -0.590290826836843 * k[4][i] +
          21.230051448181193 * k[5][i] + 15.279233632882423 * k[6][i] + -33.28821096898486 * k[7][i] +
          -0.020331201708508627 * k[8][i]);
    STAGE(10, 0.8571428571428571,
          -0.9371424300859873 * k[0][i] + 5.186372428844064 * k[3][i] + 1.0914373489967295 * k[4][i] +
          -8.149787010746927 * k[5][i] + -18.52006565999696 * k[6][i] + 22.739487099350505 * k[7][i] +
          2.4936055526796523 * k[8][i] + -3.0467644718982196 * k[9][i]);
    STAGE(11, 1.0,
          2.273310147516538 * k[0][i] + -10.53449546673725 * k[3][i] + -2.0008720582248625 * k[4][i] +
          -17.9589318631188 * k[5][i] + 27.94888452941996 * k[6][i] + -2.8589982771350235 * k[7][i] +
          -8.87285693353063 * k[8][i] + 12.360567175794303 * k[9][i] + 0.6433927460157636 * k[10][i]);
    for (int i = 0; i < n; i++) {
        g->s[i] = start[i] + h * (0.054293734116568765 * k[0][i] + 4.450312892752409 * k[5][i] + 1.8915178993145003 * k[6][i] +
                              -5.801203960010585 * k[7][i] + 0.3111643669578199 * k[8][i] + -0.1521609496625161 * k[9][i] +
                              0.20136540080403034 * k[10][i] + 0.04471061572777259 * k[11][i]);
    }
    g->t = t + h;
    for (int i = 0; i < n; i++) {
        const double size = larger(fabs(start[i]), fabs(g->s[i])) + fabs(h * k[0][i]) + fabs(h * k[11][i]);
        const double fifth = 0.01312004499419488 * k[0][i] + -1.2251564463762044 * k[5][i] + -0.4957589496572502 * k[6][i] + 1.6643771824549864 * k[7][i] +
                             -0.35032884874997366 * k[8][i] + 0.3341791187130175 * k[9][i] + 0.08192320648511571 * k[10][i] + -0.022355307863886294 * k[11][i];
        const double third = -0.18980075407240762 * k[0][i] + 4.450312892752409 * k[5][i] + 1.8915178993145003 * k[6][i] + -5.801203960010585 * k[7][i] +
                             -0.4226823213237919 * k[8][i] + -0.1521609496625161 * k[9][i] + 0.20136540080403034 * k[10][i] + 0.02265179219836082 * k[11][i];
        /* h |fifth|^2/sqrt(fifth^2 + third^2/100) over the size, squared. */
        const double both = (fifth * fifth + 0.01 * third * third) * (size * size), whole = h * fifth * fifth;
        const double error = both > 0.0 ? whole * whole / both : 0.0;
        /* What is no number stays the worst. */
        worst = error <= worst || worst != worst ? worst : error;
    }
    return worst;
}

#undef STAGE

/* The same, leaving out the states of effects when none that has states acts: they are zero and stay so. */
static inline double integrate_part(gyro_view *g, const double *value, double t, double from, double h)
{
    return g->any_state ? integrate_states(g, value, t, from, h, GYRO_N_STATES) : integrate_states(g, value, t, from, h, GYRO_STATE_Y_DOT + 1);
}

/* How far a step has come, in parts of GYRO_WHOLE, and how long its next part is. Begins as {0, GYRO_WHOLE}. */
enum { GYRO_WHOLE = 1 << GYRO_HALVINGS };
typedef struct {
    int done;
    int part;
} gyro_progress;

/* Moves the states of the view on by the next part of the step of h [s] from time t: all of it, or a half of halves where that does not do. */
static inline void integrate_next(gyro_view *g, const double *value, double t, double h, gyro_progress *at)
{
    const double from = h * at->done / GYRO_WHOLE;
    double before[GYRO_N_STATES];
    memcpy(before, g->s, sizeof before);
    double error = integrate_part(g, value, t + from, from, h * at->part / GYRO_WHOLE);
    while (at->part > 1 && !(error <= GYRO_STEP_ERROR)) {
        /* As often as that says it takes; where the motion has a corner, a half makes less of it, and so it is asked again. */
        do {
            at->part /= 2;
            error *= GYRO_HALF_ERROR;
        } while (at->part > 1 && error > GYRO_STEP_ERROR);
        memcpy(g->s, before, sizeof before);
        error = integrate_part(g, value, t + from, from, h * at->part / GYRO_WHOLE);
    }
    at->done += at->part;
    if (error < GYRO_LONGER * GYRO_STEP_ERROR && at->done % (2 * at->part) == 0) {
        at->part *= 2;
    }
}

#endif
