#include "ridge.h"

#include "block.h"
#include "drift.h"
#include "unseen.h"

void ridge_begin_step(filter *f)
{
    memcpy(f->H_begun, f->H, (size_t)f->rows * sizeof *f->H);
    memcpy(f->r_begun, f->r, (size_t)f->rows * sizeof *f->r);
}

/* Least squares: the change, in units of W, that takes back what the innovations bend by, less its part along `d`. */
static void answer(const filter *f, double L[NP][NP], const double *bent, const double d[NP], double bend[NP])
{
    double b[NP] = {0.0}, half[NP], g[NP];
    for (int64_t r = 0; r < f->rows; r++) {
        block_row_in_eta(f, f->H_begun[r], g);
        for (int i = 0; i < NP; i++) {
            b[i] += g[i] * bent[r];
        }
    }
    block_solve(L, b, bend, half);
    unseen_leave_out(f, bend);
    double along = 0.0, length = 0.0;
    for (int j = 0; j < NP; j++) {
        double mine = 0.0, other = 0.0;
        for (int i = j; i < NP; i++) {
            mine += L[i][j] * d[i];
            other += L[i][j] * bend[i];
        }
        along += mine * other;
        length += mine * mine;
    }
    for (int i = 0; i < NP; i++) {
        bend[i] -= along / length * d[i];
    }
}

void ridge_bend_step(filter *f, double L[NP][NP], const double step[NP], double bend[NP])
{
    double moved[NP];
    for (int i = 0; i < NP; i++) {
        moved[i] = 0.0;
        for (int j = i; j < NP; j++) {
            moved[i] += f->W[i][j] * step[j];
        }
    }
    /* To second order the innovations at the end are r - G step + bent/2. */
    for (int64_t r = 0; r < f->rows; r++) {
        double line = f->r_begun[r];
        for (int i = 0; i < NP; i++) {
            line -= f->H_begun[r][i] * moved[i];
        }
        f->r[r] = 2.0 * (f->r[r] - line);
    }
    answer(f, L, f->r, step, bend);
}

void ridge_set(filter *f, double L[NP][NP], const double d[NP], const double *bent)
{
    double bend[NP], unit[NP];
    answer(f, L, bent, d, bend);
    const double length = block_squared(d);
    double along = 0.0;
    for (int j = 0; j < NP; j++) {
        unit[j] = d[j] / length;
        along += unit[j] * bend[j];
    }
    ridge *own = &f->ridge;
    own->bends = 1;
    for (int i = 0; i < NP; i++) {
        own->bend[i] = 0.0;
        for (int j = i; j < NP; j++) {
            own->bend[i] += f->W[i][j] * (bend[j] - along * d[j]);
        }
    }
    /* normal = W'^-1 d/|d|^2. */
    for (int j = 0; j < NP; j++) {
        double rest = unit[j];
        for (int i = 0; i < j; i++) {
            rest -= f->W[i][j] * own->normal[i];
        }
        own->normal[j] = rest / f->W[j][j];
    }
}

static double went(const ridge *of, const double change[NP])
{
    double s = 0.0;
    for (int i = 0; i < NP; i++) {
        s += of->normal[i] * change[i];
    }
    return s;
}

void ridge_follow(filter *f, double change[NP])
{
    if (f->ridge.bends) {
        const double s = went(&f->ridge, change);
        for (int i = 0; i < NP; i++) {
            change[i] += 0.5 * s * s * f->ridge.bend[i];
            f->k.p[i] += 0.5 * s * s * f->ridge.bend[i];
        }
    }
}

void ridge_turn(filter *f, const double change[NP])
{
    if (!f->ridge.bends) {
        return;
    }
    const double s = went(&f->ridge, change);
    double row[NP];
    for (int j = 0; j < NP; j++) {
        row[j] = 0.0;
        for (int i = 0; i <= j; i++) {
            row[j] += f->ridge.normal[i] * f->W[i][j];
        }
    }
    for (int i = 0; i < NP; i++) {
        for (int j = 0; j < NP; j++) {
            f->W[i][j] += s * f->ridge.bend[i] * row[j];
        }
    }
    /* Upper triangular again, by rotations of its columns. */
    for (int i = NP - 1; i > 0; i--) {
        for (int j = 0; j < i; j++) {
            const double size = hypot(f->W[i][i], f->W[i][j]);
            const double c = f->W[i][i] / size, t = f->W[i][j] / size;
            for (int k = 0; k <= i; k++) {
                const double own = f->W[k][i], other = f->W[k][j];
                f->W[k][i] = c * own + t * other;
                f->W[k][j] = c * other - t * own;
            }
        }
    }
}

double ridge_turning(const filter *f)
{
    double columns[NP][NP];
    memset(columns, 0, sizeof columns);
    for (int i = 0; i < NP; i++) {
        columns[i][0] = 0.5 * f->ridge.bend[i];
    }
    return drift_deviation(&f->k, columns, f->k.p[0] / f->k.p[INVERSE_MASS], 0.0).turning;
}

double ridge_turning_left(const filter *f)
{
    const double start = (double)f->whole, age = (double)(f->sample - f->since);
    return f->turns * start / larger(age, start);
}
