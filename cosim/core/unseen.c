#include "unseen.h"

#include "block.h"
#include "linear.h"

#define LEFT 0.1       /* share of the variance along a direction that a start must leave for it to count */
#define PART 0.005     /* share from which on a start tells a direction but a little */
#define CANCELLED 3e-5 /* of large terms that cancel; rounding, and constants that move by their deviation, leave up to 1.2e-5, a rate that begins to
                          change by 1 rad/s in a second 4e-5 */
#define CANCEL 1e-3    /* of its terms: what a start shows at most of a direction along which they cancel */
#define TOLD 0.15      /* squared deviations along a direction of what comes late that a start must tell for blocks to tell more */
#define READS_ON 0.05  /* share of what the design leaves open of the reading that a direction of the gauge moves at least */
#define BLOCKS 10      /* in a row that must show something: what the motion still owes to constants before the last fit dies away in fewer */
#define SWEEPS 20      /* of rotations at most; 6 to 8 are usual */
#define DIAGONAL 1e-24 /* sum of squares off the diagonal at which rotations end */

/* A rotation of rows or columns p and q of A: `row` and `column` are the strides. */
static void rotate(double *A, int p, int q, int along, int across, double c, double s)
{
    for (int k = 0; k < NP; k++) {
        const double a = A[p * along + k * across], b = A[q * along + k * across];
        A[p * along + k * across] = c * a - s * b;
        A[q * along + k * across] = s * a + c * b;
    }
}

/* Eigenvectors of the symmetric K as rows of V, eigenvalues on the diagonal of K: cyclic Jacobi rotations (G. Golub and C. Van Loan, Matrix
   Computations, 8.5). */
static void eigenvectors(double K[NP][NP], double V[NP][NP])
{
    double off = 1.0;
    for (int i = 0; i < NP; i++) {
        for (int j = 0; j < NP; j++) {
            V[i][j] = i == j ? 1.0 : 0.0;
        }
    }
    for (int sweep = 0; sweep < SWEEPS && off > DIAGONAL; sweep++) {
        off = 0.0;
        for (int p = 0; p < NP - 1; p++) {
            for (int q = p + 1; q < NP; q++) {
                if (fabs(K[p][q]) > 1e-300) {
                    const double theta = (K[q][q] - K[p][p]) / (2.0 * K[p][q]);
                    const double t = copysign(1.0, theta) / (fabs(theta) + sqrt(theta * theta + 1.0));
                    const double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
                    off += K[p][q] * K[p][q];
                    rotate(&K[0][0], p, q, 1, NP, c, s);
                    rotate(&K[0][0], p, q, NP, 1, c, s);
                    rotate(&V[0][0], p, q, NP, 1, c, s);
                }
            }
        }
    }
}

/* (L L')^-1: its largest eigenvalues, near 1, belong to what has not been seen. They would be lost in L L' beside its largest. */
static void left_variance(double L[NP][NP], double K[NP][NP])
{
    double inverse[NP][NP];
    for (int j = 0; j < NP; j++) {
        double unit[NP] = {0.0};
        unit[j] = 1.0;
        block_halve(L, unit, inverse[j]);
    }
    for (int i = 0; i < NP; i++) {
        for (int j = 0; j < NP; j++) {
            K[i][j] = 0.0;
            for (int k = 0; k < NP; k++) {
                K[i][j] += inverse[i][k] * inverse[j][k];
            }
        }
    }
}

/* Reduced echelon form of the directions, each p_i in units of its prior, so that of a mixture each becomes one by itself. */
static void separate(filter *f)
{
    int taken[NP] = {0};
    for (int m = 0; m < f->unseen_count; m++) {
        int row = m, pivot = 0;
        double most = 0.0;
        for (int r = m; r < f->unseen_count; r++) {
            for (int i = 0; i < NP; i++) {
                const double size = f->prior[i] > 0.0 && !taken[i] ? fabs(f->unseen[r][i]) / f->prior[i] : 0.0;
                if (size > most) {
                    most = size;
                    row = r;
                    pivot = i;
                }
            }
        }
        taken[pivot] = 1;
        for (int i = 0; i < NP; i++) {
            const double swap = f->unseen[m][i];
            f->unseen[m][i] = f->unseen[row][i];
            f->unseen[row][i] = swap;
        }
        for (int r = 0; r < f->unseen_count; r++) {
            const double factor = r != m && most > 0.0 ? f->unseen[r][pivot] / f->unseen[m][pivot] : 0.0;
            for (int i = 0; i < NP; i++) {
                f->unseen[r][i] -= factor * f->unseen[m][i];
            }
        }
    }
}

static double dot(const double a[NP], const double b[NP])
{
    double sum = 0.0;
    for (int i = 0; i < NP; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/* a += factor b. */
static void add(double a[NP], double factor, const double b[NP])
{
    for (int i = 0; i < NP; i++) {
        a[i] += factor * b[i];
    }
}

/* p = W x: a change of p given in units of W. */
static void change_of(const filter *f, const double x[NP], double p[NP])
{
    for (int i = 0; i < NP; i++) {
        p[i] = 0.0;
        for (int j = i; j < NP; j++) {
            p[i] += f->W[i][j] * x[j];
        }
    }
}

/* What the block's rows show of direction n, and the terms that it is the sum of, both in squared deviations. */
static double shown(const filter *f, const double n[NP], double *terms)
{
    double net = 0.0;
    *terms = 0.0;
    for (int64_t r = 0; r < f->rows; r++) {
        double sum = 0.0, sizes = 0.0;
        for (int i = 0; i < NP; i++) {
            const double term = f->H[r][i] * n[i];
            sum += term;
            sizes += fabs(term);
        }
        net += sum * sum;
        *terms += sizes * sizes;
    }
    return net;
}

/* Whether the block shows nothing of direction n. */
static int cancels(const filter *f, const double n[NP])
{
    double terms;
    const double net = shown(f, n, &terms);
    return net <= CANCELLED * CANCELLED * terms;
}

/* Whether a direction changes how voltages read the position, beside what the design leaves open of that: a rate that changes tells it, and a start in
   which none did shows nothing. A delay, a lag and a feedthrough that stand for each other are told by the tones instead, by what goes with the square
   of the lag, at any time as well as in the start. */
static int moves_reading(const filter *f, const double n[NP])
{
    linear at, by[NP];
    double most = 0.0;
    linear_of(&f->k, &at, by);
    for (int c = 0; c < 4; c++) {
        double change = 0.0, open = 0.0;
        for (int i = 0; i < NP; i++) {
            change += by[i].c[c] * n[i];
            open += by[i].c[c] * by[i].c[c] * f->prior[i] * f->prior[i];
        }
        most = larger(most, open > 0.0 ? change * change / open : 0.0);
    }
    return most > READS_ON * READS_ON;
}

/* Keeps those whose terms cancel. What merely does little pretends nothing, and may do more later. */
static void keep_cancelling(filter *f)
{
    int kept = 0;
    for (int m = 0; m < f->unseen_count; m++) {
        double terms;
        const double net = shown(f, f->unseen[m], &terms);
        if (net < CANCEL * CANCEL * terms && (net < TOLD || moves_reading(f, f->unseen[m]))) {
            memmove(f->unseen[kept++], f->unseen[m], sizeof f->unseen[m]);
        }
    }
    f->unseen_count = kept;
}

void unseen_find(filter *f, double L[NP][NP])
{
    double K[NP][NP], V[NP][NP];
    left_variance(L, K);
    eigenvectors(K, V);
    f->unseen_count = f->hardly_told = 0;
    memset(f->shown, 0, sizeof f->shown);
    for (int m = 0; m < NP; m++) {
        double n[NP];
        change_of(f, V[m], n);
        if (K[m][m] > LEFT) {
            memcpy(f->unseen[f->unseen_count++], n, sizeof n);
        } else if (K[m][m] > PART && moves_reading(f, n)) {
            f->hardly_told = 1;
        }
    }
    separate(f);
    keep_cancelling(f);
    f->hidden = f->unseen_count;
    unseen_scale(f);
}

void unseen_scale(filter *f)
{
    for (int m = 0; m < f->unseen_count; m++) {
        double *d = f->unseen_eta[m];
        block_scale(f, f->unseen[m], d);
        for (int b = 0; b < m; b++) {
            add(d, -dot(d, f->unseen_eta[b]), f->unseen_eta[b]);
        }
        const double size = sqrt(block_squared(d));
        for (int j = 0; j < NP; j++) {
            d[j] = size > 0.0 ? d[j] / size : 0.0;
        }
    }
}

/* Leaves out of x what is along the directions of which nothing is shown: all of them, or those that the last block showed. */
static void leave_out(const filter *f, int all, double x[NP])
{
    for (int m = 0; m < f->hidden; m++) {
        if (all || f->shown[m] > 0) {
            add(x, -dot(x, f->unseen_eta[m]), f->unseen_eta[m]);
        }
    }
}

void unseen_leave_out(const filter *f, double x[NP])
{
    leave_out(f, 1, x);
}

void unseen_leave_from_bounds(const filter *f, double x[NP])
{
    leave_out(f, f->growing, x);
}

static void swap(filter *f, int a, int b)
{
    for (int i = 0; i < NP; i++) {
        const double kept = f->unseen[a][i];
        f->unseen[a][i] = f->unseen[b][i];
        f->unseen[b][i] = kept;
    }
    const int kept = f->shown[a];
    f->shown[a] = f->shown[b];
    f->shown[b] = kept;
}

void unseen_look(filter *f)
{
    int hidden = 0;
    for (int m = 0; m < f->unseen_count; m++) {
        const int shows = !cancels(f, f->unseen[m]) && moves_reading(f, f->unseen[m]);
        f->shown[m] = shows ? f->shown[m] + 1 : 0;
    }
    for (int m = 0; m < f->unseen_count; m++) {
        if (f->shown[m] < BLOCKS) {
            swap(f, hidden++, m);
        }
    }
    f->hidden = hidden;
    unseen_scale(f);
}

/* What is missing for the rows of the block and of those before it to cancel along W d: the least change, in units of what is known of the other
   constants. None where the block shows something of it. */
static void find_turn(const filter *f, const double d[NP], double turn[NP])
{
    double n[NP], sum[NP] = {0.0}, x[NP];
    change_of(f, d, n);
    const int follows = cancels(f, n);
    for (int64_t r = 0; r < f->rows && follows; r++) {
        add(sum, -dot(f->H[r], n), f->H[r]);
    }
    block_row_in_eta(f, sum, x);
    change_of(f, x, turn);
}

void unseen_follow(filter *f)
{
    double turn[NP][NP];
    unseen_scale(f);
    for (int m = 0; m < f->hidden; m++) {
        find_turn(f, f->unseen_eta[m], turn[m]);
    }
    for (int k = 0; k < f->hidden; k++) {
        double d[NP];
        block_scale(f, f->unseen[k], d);
        for (int m = 0; m < f->hidden; m++) {
            add(f->unseen[k], dot(d, f->unseen_eta[m]), turn[m]);
        }
    }
    for (int m = 0; m < f->hidden; m++) {
        for (int i = 0; i < NP; i++) {
            add(f->W[i], turn[m][i], f->unseen_eta[m]);
        }
    }
    if (f->hidden > 0) {
        block_make_triangular(f->W);
    }
}

void unseen_columns(const filter *f, double columns[NP][NP])
{
    memset(columns, 0, NP * sizeof *columns);
    for (int m = 0; m < f->unseen_count; m++) {
        double n[NP];
        change_of(f, f->unseen_eta[m], n);
        for (int i = 0; i < NP; i++) {
            columns[i][m] = n[i];
        }
    }
}
