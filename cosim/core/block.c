#include "block.h"

#include "unseen.h"

/* Share of a variance that two bounds must not have in common. A delay and a lag at zero are known by their sum to 3 ps and each to 0.5 us: a share of
   4e-11, of which the elimination keeps five digits. */
#define PARALLEL 1e-13
#define BOUNDS 4 /* lowest values that may be reached at once */
#define TOGETHER 4 /* rows of a product that are added up before their sum is stored */
#define ROWS 32    /* of a block that are taken at once */

void block_row_in_eta(const filter *f, const double row[NP], double g[NP])
{
    double sum[NP] = {0.0};
    int i = 0;
    /* Over whole rows, zeros too: loops of one length run several numbers at a time. */
    for (; i + TOGETHER <= NP; i += TOGETHER) {
        for (int j = 0; j < NP; j++) {
            sum[j] += f->W[i][j] * row[i] + f->W[i + 1][j] * row[i + 1] + f->W[i + 2][j] * row[i + 2] + f->W[i + 3][j] * row[i + 3];
        }
    }
    for (; i < NP; i++) {
        for (int j = 0; j < NP; j++) {
            sum[j] += f->W[i][j] * row[i];
        }
    }
    memcpy(g, sum, sizeof sum);
    unseen_leave_out(f, g);
}

/* out [ROWS][NW] = rows W, the rows of the block from `first` on, less what no sample shows; zero from its end on. */
static void rows_in_eta(const filter *f, double (*W)[NW], int64_t first, double out[ROWS][NW])
{
    const int64_t count = f->rows - first < ROWS ? f->rows - first : ROWS;
    for (int64_t r = 0; r < ROWS; r++) {
        wide sum[NB] = {{0.0}};
        for (int i = 0; i < NP && r < count; i++) {
            for (int b = 0; b < NB; b++) {
                sum[b] += f->H[first + r][i] * wide_of(W[i])[b];
            }
        }
        for (int b = 0; b < NB; b++) {
            wide_row(out[r])[b] = sum[b];
        }
        if (f->unseen_count > 0) {
            unseen_leave_out(f, out[r]);
        }
    }
}

/* Adds g g' of the rows g to M, of which the upper half is filled in, a tile at a time, so that its sums stay in registers. */
static void add_products(double M[NW][NW], double (*g)[NW])
{
    for (int i = 0; i < NB; i++) {
        for (int j = i; j < NB; j++) {
            wide sum[WIDE];
            for (int p = 0; p < WIDE; p++) {
                sum[p] = wide_of(M[WIDE * i + p])[j];
            }
            for (int r = 0; r < ROWS; r++) {
                const wide own = wide_of(g[r])[j];
                for (int p = 0; p < WIDE; p++) {
                    sum[p] += g[r][WIDE * i + p] * own;
                }
            }
            for (int p = 0; p < WIDE; p++) {
                wide_row(M[WIDE * i + p])[j] = sum[p];
            }
        }
    }
}

/* J = I + the rows' information in eta, and b; returns the trace of what is added. */
static double sum_in_eta(const filter *f, double J[NP][NP], double b[NP])
{
    double M[NW][NW] = {{0.0}}, W[NP][NW] = {{0.0}}, g[ROWS][NW], sum[NW] = {0.0}, trace = 0.0;
    for (int i = 0; i < NP; i++) {
        memcpy(W[i], f->W[i], sizeof f->W[i]);
    }
    for (int64_t first = 0; first < f->rows; first += ROWS) {
        rows_in_eta(f, W, first, g);
        add_products(M, g);
        for (int r = 0; r < ROWS && first + r < f->rows; r++) {
            for (int q = 0; q < NW; q++) {
                sum[q] += g[r][q] * f->r[first + r];
            }
        }
    }
    memcpy(b, sum, NP * sizeof *b);
    for (int i = 0; i < NP; i++) {
        for (int j = 0; j < NP; j++) {
            J[i][j] = j < i ? M[j][i] : M[i][j];
        }
        trace += J[i][i];
        J[i][i] += 1.0;
    }
    return trace;
}

/* L of J + g g' where it was that of J, by rotations. A start is told 1e13 times more of k/m than it knew; in a sum of g g' the rounding of
   that would pass for knowledge of what nothing has been told of. Changes g. */
static void rotate_in(double L[NP][NP], double g[NP])
{
    for (int k = 0; k < NP; k++) {
        const double r = sqrt(L[k][k] * L[k][k] + g[k] * g[k]), c = L[k][k] / r, s = g[k] / r;
        L[k][k] = r;
        for (int i = k + 1; i < NP; i++) {
            const double l = L[i][k];
            L[i][k] = c * l + s * g[i];
            g[i] = c * g[i] - s * l;
        }
    }
}

/* The Cholesky factor of J, in its place. */
static void factor(double J[NP][NP])
{
    for (int j = 0; j < NP; j++) {
        for (int k = 0; k < j; k++) {
            J[j][j] -= J[j][k] * J[j][k];
        }
        J[j][j] = sqrt(larger(J[j][j], 1.0)); /* J is at least the identity */
        for (int i = j + 1; i < NP; i++) {
            J[j][i] = 0.0;
            for (int k = 0; k < j; k++) {
                J[i][j] -= J[i][k] * J[j][k];
            }
            J[i][j] /= J[j][j];
        }
    }
}

/* The same row by row, which keeps what hardly anything is told of apart from what much is told of. */
static double rotate_in_eta(const filter *f, double L[NP][NP], double b[NP])
{
    double trace = 0.0, own[NP];
    for (int i = 0; i < NP; i++) {
        b[i] = 0.0;
        for (int j = 0; j < NP; j++) {
            L[i][j] = i == j ? 1.0 : 0.0;
        }
    }
    for (int64_t r = 0; r < f->rows; r++) {
        block_row_in_eta(f, f->H[r], own);
        for (int i = 0; i < NP; i++) {
            b[i] += own[i] * f->r[r];
            trace += own[i] * own[i];
        }
        rotate_in(L, own);
    }
    return trace;
}

double block_information(const filter *f, double L[NP][NP], double b[NP])
{
    if (f->growing) {
        return rotate_in_eta(f, L, b);
    }
    const double trace = sum_in_eta(f, L, b);
    factor(L);
    return trace;
}

void block_halve(double L[NP][NP], const double b[NP], double half[NP])
{
    for (int i = 0; i < NP; i++) {
        half[i] = b[i];
        for (int k = 0; k < i; k++) {
            half[i] -= L[i][k] * half[k];
        }
        half[i] /= L[i][i];
    }
}

void block_solve(double L[NP][NP], const double b[NP], double x[NP], double half[NP])
{
    block_halve(L, b, half);
    for (int i = NP - 1; i >= 0; i--) {
        x[i] = half[i];
        for (int k = i + 1; k < NP; k++) {
            x[i] -= L[k][i] * x[k];
        }
        x[i] /= L[i][i];
    }
}

void block_scale(const filter *f, const double p[NP], double d[NP])
{
    int last = NP - 1;
    for (; last >= 0 && p[last] == 0.0; last--) {
        d[last] = 0.0;
    }
    for (int j = last; j >= 0; j--) {
        d[j] = p[j];
        for (int k = j + 1; k <= last; k++) {
            d[j] -= f->W[j][k] * d[k];
        }
        d[j] /= f->W[j][j];
    }
}

void block_widen(filter *f, const double wide[NP])
{
    double v[NP];
    memcpy(v, wide, sizeof v);
    for (int k = NP - 1; k >= 0; k--) {
        if (v[k] == 0.0) {
            continue;
        }
        const double r = sqrt(f->W[k][k] * f->W[k][k] + v[k] * v[k]), c = f->W[k][k] / r, s = v[k] / r;
        for (int j = 0; j <= k; j++) {
            const double w = f->W[j][k];
            f->W[j][k] = c * w + s * v[j];
            v[j] = c * v[j] - s * w;
        }
    }
}

void block_make_triangular(double W[NP][NP])
{
    double column[NP][NW];
    wide_clear(column[0], NP * NB);
    for (int i = 0; i < NP; i++) {
        for (int j = 0; j < NP; j++) {
            column[j][i] = W[i][j];
        }
    }
    for (int i = NP - 1; i > 0; i--) {
        for (int j = 0; j < i; j++) {
            const double size = sqrt(column[i][i] * column[i][i] + column[j][i] * column[j][i]);
            const double c = size > 0.0 ? column[i][i] / size : 1.0, t = size > 0.0 ? column[j][i] / size : 0.0;
            wide *left = wide_row(column[i]), *right = wide_row(column[j]);
            for (int b = 0; b <= i / WIDE; b++) {
                const wide own = left[b], other = right[b];
                left[b] = c * own + t * other;
                right[b] = c * other - t * own;
            }
        }
    }
    for (int i = 0; i < NP; i++) {
        for (int j = 0; j < NP; j++) {
            W[i][j] = column[j][i];
        }
    }
}

void block_shrink(filter *f, double L[NP][NP])
{
    for (int i = 0; i < NP; i++) {
        for (int j = i; j < NP; j++) {
            double value = f->W[i][j];
            for (int k = i; k < j; k++) {
                value -= f->W[i][k] * L[j][k];
            }
            f->W[i][j] = value / L[j][j];
        }
    }
}

double block_squared(const double x[NP])
{
    double total = 0.0;
    for (int i = 0; i < NP; i++) {
        total += x[i] * x[i];
    }
    return total;
}

double block_constant_at(const filter *f, const double eta[NP], int i)
{
    double p = f->p_begun[i];
    for (int j = i; j < NP; j++) {
        p += f->W[i][j] * eta[j];
    }
    return p;
}

void block_set_constants(filter *f, const double eta[NP], double change[NP])
{
    for (int i = 0; i < NP; i++) {
        const double p = block_constant_at(f, eta, i);
        change[i] = p - f->k.p[i];
        f->k.p[i] = p;
    }
}

void block_keep_in_bounds(const filter *f, double L[NP][NP], double eta[NP])
{
    double along[BOUNDS][NP], free_eta[NP];
    int at[BOUNDS], count = 0;
    memcpy(free_eta, eta, sizeof free_eta);
    for (int grown = 1; grown;) {
        grown = 0;
        for (int i = 0; i < NP && count < BOUNDS; i++) {
            const double hair = 1e-12 * f->prior[i];
            if (block_constant_at(f, eta, i) < f->lowest[i] - hair) {
                double w[NP], half[NP];
                for (int j = 0; j < NP; j++) {
                    w[j] = j >= i ? f->W[i][j] : 0.0;
                }
                block_solve(L, w, along[count], half);
                unseen_leave_from_bounds(f, along[count]);
                at[count++] = i;
                grown = 1;
            }
        }
        if (grown) {
            /* (W_A J^-1 W_A') lambda = what is missing, by elimination; symmetric and positive. */
            double S[BOUNDS][BOUNDS + 1];
            for (int a = 0; a < count; a++) {
                for (int b = 0; b < count; b++) {
                    S[a][b] = 0.0;
                    for (int j = at[a]; j < NP; j++) {
                        S[a][b] += f->W[at[a]][j] * along[b][j];
                    }
                }
                S[a][count] = f->lowest[at[a]] - block_constant_at(f, free_eta, at[a]);
            }
            double own[BOUNDS];
            for (int a = 0; a < count; a++) {
                own[a] = S[a][a];
            }
            for (int a = 0; a < count; a++) {
                for (int b = a + 1; b < count && S[a][a] > PARALLEL * own[a]; b++) {
                    const double factor = S[b][a] / S[a][a];
                    for (int c = a; c <= count; c++) {
                        S[b][c] -= factor * S[a][c];
                    }
                }
            }
            memcpy(eta, free_eta, sizeof free_eta);
            for (int a = count - 1; a >= 0; a--) {
                double lambda = S[a][count];
                for (int b = a + 1; b < count; b++) {
                    lambda -= S[a][b] * S[b][count];
                }
                /* A bound that the others reach already, as far as numbers tell, is left as it is. */
                lambda = S[a][a] > PARALLEL * own[a] ? lambda / S[a][a] : 0.0;
                S[a][count] = lambda;
                for (int j = 0; j < NP; j++) {
                    eta[j] += lambda * along[a][j];
                }
            }
        }
    }
}

double block_distance(double L[NP][NP], const double a[NP], const double b[NP])
{
    double total = 0.0;
    for (int j = 0; j < NP; j++) {
        double sum = 0.0;
        for (int i = j; i < NP; i++) {
            sum += L[i][j] * (a[i] - b[i]);
        }
        total += sum * sum;
    }
    return sqrt(total);
}

double block_variance(const filter *f, int i)
{
    double total = 0.0;
    for (int j = i; j < NP; j++) {
        total += f->W[i][j] * f->W[i][j];
    }
    return total;
}
