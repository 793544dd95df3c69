/* The Taylor series of linear.h, with every number a polynomial in the rate. */

#include "propagator.h"

#include <string.h>

#include "linear.h"

enum { POWERS = GYRO_RATE_POWERS, RATES = 3 };

/* A velocity's rate over the states: by power of the rate, axis, state [1/s2, 1/s]. */
typedef struct {
    double power[RATES][2][4];
} gyro_slopes;

/* The slopes are quadratic in the rate: what they are at 0, 1 and -1 rad/s is all of them. */
static gyro_slopes slopes_of(const gyro_view *view)
{
    static const double rates[RATES] = {0.0, 1.0, -1.0};
    double at[RATES][2][4];
    gyro_view turned = *view;
    gyro_slopes slopes;
    for (int i = 0; i < RATES; i++) {
        turned.p[GYRO_OMEGA_Z] = rates[i];
        find_slopes(&turned, at[i]);
    }
    for (int axis = 0; axis < 2; axis++) {
        for (int state = 0; state < 4; state++) {
            const double rest = at[0][axis][state], up = at[1][axis][state], down = at[2][axis][state];
            slopes.power[0][axis][state] = rest * view->inverse_mass;
            slopes.power[1][axis][state] = 0.5 * (up - down) * view->inverse_mass;
            slopes.power[2][axis][state] = (0.5 * (up + down) - rest) * view->inverse_mass;
        }
    }
    return slopes;
}

/* The rate of a motion whose states are polynomials in the rate; powers from POWERS on are left out. */
static void derive(const gyro_slopes *slopes, double s[4][POWERS], double rate[4][POWERS])
{
    memset(rate, 0, 4 * sizeof *rate);
    for (int axis = 0; axis < 2; axis++) {
        const int place = 2 * axis, speed = place + 1;
        memcpy(rate[place], s[speed], sizeof rate[place]);
        for (int power = 0; power < RATES; power++) {
            for (int state = 0; state < 4; state++) {
                for (int k = power; k < POWERS; k++) {
                    rate[speed][k] += slopes->power[power][axis][state] * s[state][k - power];
                }
            }
        }
    }
}

/* h (r + h/2 A (r + h/3 A (r + ...))), by which a step h moves what has the rate r at its start. */
static void move_unit(const gyro_slopes *slopes, double step, int power, double first[4][POWERS], double change[4][POWERS])
{
    double sum[4][POWERS], rate[4][POWERS];
    memcpy(sum, first, sizeof sum);
    for (int k = power; k > 1; k--) {
        derive(slopes, sum, rate);
        for (int i = 0; i < 4 * POWERS; i++) {
            sum[i / POWERS][i % POWERS] = first[i / POWERS][i % POWERS] + step / k * rate[i / POWERS][i % POWERS];
        }
    }
    for (int i = 0; i < 4 * POWERS; i++) {
        change[i / POWERS][i % POWERS] = step * sum[i / POWERS][i % POWERS];
    }
}

/* What one unit of a state, or of a constant force after them, does in a step. */
static void tabulate_column(const gyro_slopes *slopes, double step, int power, int column, double inverse_mass, gyro_propagator *table)
{
    double unit[4][POWERS] = {{0.0}}, first[4][POWERS] = {{0.0}}, change[4][POWERS];
    if (column < GYRO_MOVED) {
        unit[column][0] = 1.0;
        derive(slopes, unit, first);
    } else {
        first[2 * (column - GYRO_MOVED) + 1][0] = inverse_mass;
    }
    move_unit(slopes, step, power, first, change);
    for (int i = 0; i < GYRO_MOVED; i++) {
        for (int k = 0; k < POWERS; k++) {
            table->part[k][column][i] = change[i][k];
        }
    }
}

/* By the same norm as in bound_of. */
static double largest_rate(const gyro_slopes *slopes, double step, double frequency)
{
    double turning = 0.0, flung = 0.0;
    for (int axis = 0; axis < 2; axis++) {
        const double *first = slopes->power[1][axis], *second = slopes->power[2][axis];
        turning = larger(turning, size_of(first[1]) + size_of(first[3]) + (size_of(first[0]) + size_of(first[2])) / frequency);
        flung = larger(flung, size_of(second[1]) + size_of(second[3]) + (size_of(second[0]) + size_of(second[2])) / frequency);
    }
    return gyro_largest_rate(step, turning, flung);
}

void gyro_tabulate(gyro_propagator *table, const gyro_view *view, double step)
{
    const gyro_slopes slopes = slopes_of(view);
    const double *x = slopes.power[0][0], *y = slopes.power[0][1];
    const double frequency = sqrt(larger(size_of(x[0]) + size_of(x[2]), size_of(y[0]) + size_of(y[2])));
    double fastest[2][4];
    gyro_view turned = *view;
    memset(table, 0, sizeof *table);
    table->most = largest_rate(&slopes, step, frequency);
    turned.p[GYRO_OMEGA_Z] = table->most;
    find_slopes(&turned, fastest);
    const double size = step * bound_of(fastest, view->inverse_mass);
    if (size <= gyro_reach[GYRO_HIGHEST_POWER - GYRO_FIRST_POWER]) {
        const int power = power_for(size);
        table->step = step;
        for (int j = 0; j < GYRO_MOVING; j++) {
            tabulate_column(&slopes, step, power, j, view->inverse_mass, table);
        }
    }
}
