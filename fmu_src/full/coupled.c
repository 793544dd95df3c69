/* The Taylor series of linear.h for all states that move, with every number a polynomial in the rate. */

#include "coupled.h"

#include <string.h>

#include "linear.h"

enum { SLOPES = 3, POWERS_KEPT = GYRO_RATE_POWERS };

/* Halvings of a step, at most, until the series of its parts converges fast: each doubling after it is exact but for rounding. */
enum { HALVINGS = 14 };

/* A matrix by powers of the rate; powers from POWERS_KEPT on are left out. */
typedef struct {
    matrix power[POWERS_KEPT];
} turning_matrix;

/* The slopes are quadratic in the rate: what they are at 0, 1 and -1 rad/s is all of them. */
static void find_turning_slopes(const chosen *moving, const gyro_view *view, turning_matrix *slopes)
{
    static const double rates[SLOPES] = {0.0, 1.0, -1.0};
    gyro_view turned = *view;
    gyro_tangent along;
    matrix *const at = slopes->power;
    memset(&along, 0, sizeof along);
    for (int i = 0; i < SLOPES; i++) {
        turned.p[GYRO_OMEGA_Z] = rates[i];
        find_slope(&turned, moving, &along, &at[i]);
    }
    for (int i = 0; i < moving->n; i++) {
        for (int j = 0; j < moving->n; j++) {
            const double rest = at[0].of[i][j], up = at[1].of[i][j], down = at[2].of[i][j];
            at[1].of[i][j] = 0.5 * (up - down);
            at[2].of[i][j] = 0.5 * (up + down) - rest;
        }
    }
}

/* c = factor a b, of which a has the powers of slopes; c is another than both. */
static void find_turning_product(int n, double factor, const turning_matrix *a, int powers, const turning_matrix *b, turning_matrix *c)
{
    for (int k = 0; k < POWERS_KEPT; k++) {
        set_diagonal(n, 0.0, &c->power[k]);
        for (int i = 0; i <= k && i < powers; i++) {
            matrix product;
            find_product(n, factor, &a->power[i], &b->power[k - i], &product);
            add_scaled(n, 1.0, &product, &c->power[k]);
        }
    }
}

/* h (1 + h/2 A (1 + h/3 A (1 + ...))), by which a step h moves what has the rate 1 at its start. */
static void find_change(int n, const turning_matrix *slopes, double h, int power, turning_matrix *change)
{
    turning_matrix product;
    for (int k = 0; k < POWERS_KEPT; k++) {
        set_diagonal(n, k == 0 ? 1.0 : 0.0, &change->power[k]);
    }
    for (int term = power; term > 1; term--) {
        find_turning_product(n, h / term, slopes, SLOPES, change, &product);
        *change = product;
        for (int i = 0; i < n; i++) {
            change->power[0].of[i][i] += 1.0;
        }
    }
    for (int i = 0; i < n * POWERS_KEPT; i++) {
        for (int j = 0; j < n; j++) {
            change->power[i / n].of[i % n][j] *= h;
        }
    }
}

/* That of twice the step: the rates after the first are 1 + A D, where D is its change. */
static void double_change(int n, const turning_matrix *slopes, turning_matrix *change)
{
    turning_matrix faster, further;
    find_turning_product(n, 1.0, slopes, SLOPES, change, &faster);
    find_turning_product(n, 1.0, change, POWERS_KEPT, &faster, &further);
    for (int k = 0; k < POWERS_KEPT; k++) {
        add_scaled(n, 1.0, &change->power[k], &change->power[k]);
        add_scaled(n, 1.0, &further.power[k], &change->power[k]);
    }
}

void gyro_tabulate_coupled(gyro_coupled *table, const gyro_view *view, double step)
{
    turning_matrix slopes, change;
    double *const unit = table->unit;
    int halvings = 0;
    memset(table, 0, sizeof *table);
    table->moving = states_of(view, NULL);
    const int n = table->moving.n;
    find_turning_slopes(&table->moving, view, &slopes);
    balance(n, &slopes.power[0], unit);
    table->most = gyro_largest_rate(step, norm_of(n, &slopes.power[1], unit), norm_of(n, &slopes.power[2], unit));
    matrix fastest = slopes.power[0];
    add_scaled(n, table->most, &slopes.power[1], &fastest);
    add_scaled(n, table->most * table->most, &slopes.power[2], &fastest);
    double size = step * norm_of(n, &fastest, unit), part = step;
    /* No rate grows faster. The fourth derivative makes step^4/384 of it, and is a rate by a matrix of which the third power is bounded by this. */
    table->within = step * gyro_exp(size);
    table->beside = table->within * size * size * size / 384.0;
    for (; size > 1.0 && halvings <= HALVINGS; halvings++) {
        size *= 0.5;
        part *= 0.5;
    }
    if (halvings <= HALVINGS) {
        table->step = step;
        find_change(n, &slopes, part, power_for(size), &change);
        for (int i = 0; i < halvings; i++) {
            double_change(n, &slopes, &change);
        }
        for (int k = 0; k < POWERS_KEPT; k++) {
            for (int j = 0; j < n; j++) {
                for (int i = 0; i < n; i++) {
                    table->part[k][j][i] = change.power[k].of[i][j];
                }
            }
        }
    }
}
