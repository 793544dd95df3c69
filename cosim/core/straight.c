#include "straight.h"

#include "block.h"
#include "known_model.h"

#define SEEN 8        /* entries of c kappa c^-1 and c b */
#define INDEPENDENT 1e-6 /* share of its squared length that an entry must not have in common with others */
#define ROUNDS 4      /* of Newton at most; the way is short, two are usual */
#define CLOSE 1e-12   /* of an entry, where they end */

/* Where p is, what the voltages see there, and how they see the position. */
typedef struct {
    double seen[SEEN], by_p[SEEN][NP]; /* in units of what was seen where the block began */
    double c[2][2], c_by_p[4][NP];     /* [V/m] */
} view;

static void look(const known *k, const double *unit, view *v)
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    double out[12 + 12 * NP];
    known_seen(k, rest, none, 0.0, out);
    for (int i = 0; i < SEEN; i++) {
        const double scale = unit ? unit[i] : 1.0;
        v->seen[i] = out[i] / scale;
        for (int q = 0; q < NP; q++) {
            v->by_p[i][q] = out[12 + i * NP + q] / scale;
        }
    }
    for (int i = 0; i < 4; i++) {
        v->c[i / 2][i % 2] = out[SEEN + i];
        memcpy(v->c_by_p[i], out + 12 + (SEEN + i) * NP, sizeof v->c_by_p[i]);
    }
}

/* A Cholesky factor of J P J', its entries in the order in which they count most; those that follow from others are left out. */
typedef struct {
    double L[SEEN][SEEN];
    int order[SEEN], rank;
} factor;

/* J P J' at a view, P being the variances of the design. */
static void variance_seen(const filter *f, const view *v, double A[SEEN][SEEN])
{
    for (int a = 0; a < SEEN; a++) {
        for (int b = 0; b < SEEN; b++) {
            A[a][b] = 0.0;
            for (int q = 0; q < NP; q++) {
                A[a][b] += v->by_p[a][q] * v->by_p[b][q] * f->prior[q] * f->prior[q];
            }
        }
    }
}

static void factor_variance(double A[SEEN][SEEN], factor *c)
{
    double rest[SEEN];
    for (int a = 0; a < SEEN; a++) {
        rest[a] = A[a][a];
        c->order[a] = a;
    }
    for (c->rank = 0; c->rank < SEEN; c->rank++) {
        const int r = c->rank;
        int best = r;
        for (int a = r; a < SEEN; a++) {
            best = rest[c->order[a]] > rest[c->order[best]] ? a : best;
        }
        const int pivot = c->order[best];
        if (!(rest[pivot] > INDEPENDENT * A[pivot][pivot])) {
            break;
        }
        c->order[best] = c->order[r];
        c->order[r] = pivot;
        for (int i = r; i < SEEN; i++) {
            const int a = c->order[i];
            double total = A[a][pivot];
            for (int s = 0; s < r; s++) {
                total -= c->L[a][s] * c->L[pivot][s];
            }
            c->L[a][r] = i == r ? sqrt(rest[pivot]) : total / c->L[pivot][r];
            rest[a] -= i == r ? 0.0 : c->L[a][r] * c->L[a][r];
        }
    }
}

/* x = (L L')^-1 x, in the order of the factor. */
static void solve_factor(const factor *c, double x[SEEN])
{
    for (int r = 0; r < c->rank; r++) {
        for (int s = 0; s < r; s++) {
            x[r] -= c->L[c->order[r]][s] * x[s];
        }
        x[r] /= c->L[c->order[r]][r];
    }
    for (int r = c->rank - 1; r >= 0; r--) {
        for (int s = r + 1; s < c->rank; s++) {
            x[r] -= c->L[c->order[s]][r] * x[s];
        }
        x[r] /= c->L[c->order[r]][r];
    }
}

/* The least changes of p, in units of its prior, by which what is seen at `v` changes by the columns of `by` [SEEN * count]; out [NP * count]. */
static void least_change(const filter *f, const view *v, const double *by, int count, double *out)
{
    double A[SEEN][SEEN], x[SEEN];
    factor c;
    variance_seen(f, v, A);
    factor_variance(A, &c);
    for (int n = 0; n < count; n++) {
        for (int r = 0; r < c.rank; r++) {
            x[r] = by[c.order[r] * count + n];
        }
        solve_factor(&c, x);
        for (int q = 0; q < NP; q++) {
            double total = 0.0;
            for (int r = 0; r < c.rank; r++) {
                total += f->prior[q] * f->prior[q] * v->by_p[c.order[r]][q] * x[r];
            }
            out[q * count + n] = total;
        }
    }
}

/* W is upper triangular again, by rotations of its columns. */
static void make_triangular(double W[NP][NP])
{
    for (int i = NP - 1; i > 0; i--) {
        for (int j = 0; j < i; j++) {
            const double size = hypot(W[i][i], W[i][j]);
            const double c = size > 0.0 ? W[i][i] / size : 1.0, t = size > 0.0 ? W[i][j] / size : 0.0;
            for (int k = 0; k <= i; k++) {
                const double own = W[k][i], other = W[k][j];
                W[k][i] = c * own + t * other;
                W[k][j] = c * other - t * own;
            }
        }
    }
}

/* row += row M, M [NP * NP]. */
static void add_times(double row[NP], const double *M)
{
    double sum[NP];
    for (int q = 0; q < NP; q++) {
        sum[q] = row[q];
        for (int r = 0; r < NP; r++) {
            sum[q] += row[r] * M[r * NP + q];
        }
    }
    memcpy(row, sum, sizeof sum);
}

/* x += M x. */
static void add_of(const double *M, double *x, int stride)
{
    double sum[NP];
    for (int q = 0; q < NP; q++) {
        sum[q] = x[q * stride];
        for (int r = 0; r < NP; r++) {
            sum[q] += M[q * NP + r] * x[r * stride];
        }
    }
    for (int q = 0; q < NP; q++) {
        x[q * stride] = sum[q];
    }
}

/* Motion and slopes at `now` are those that the voltages see as they would have seen them at `was`, p being `change` away by a straight line.
   `back` [NP * NP] takes changes of p as they are now to what they were, less themselves. */
static void carry_motion(filter *f, const view *was, const view *now, const double change[NP], const double *back)
{
    moving *n = &f->now;
    const double det = now->c[0][0] * now->c[1][1] - now->c[0][1] * now->c[1][0];
    const double inverse[2][2] = {{now->c[1][1] / det, -now->c[0][1] / det}, {-now->c[1][0] / det, now->c[0][0] / det}};
    for (int part = 0; part < 2; part++) {
        /* Positions x, y, then velocities. */
        const int at[2] = {part, 2 + part};
        double q[2], volts[2], slopes[2][NP], fresh[2];
        for (int a = 0; a < 2; a++) {
            q[a] = n->z[at[a]];
            for (int p = 0; p < NP; p++) {
                q[a] -= n->Y[at[a]][p] * change[p];
            }
        }
        for (int a = 0; a < 2; a++) {
            volts[a] = was->c[a][0] * n->z[at[0]] + was->c[a][1] * n->z[at[1]];
            for (int p = 0; p < NP; p++) {
                const double by = was->c_by_p[2 * a][p] * q[0] + was->c_by_p[2 * a + 1][p] * q[1];
                volts[a] += by * change[p];
                slopes[a][p] = was->c[a][0] * n->Y[at[0]][p] + was->c[a][1] * n->Y[at[1]][p] + by;
            }
            add_times(slopes[a], back);
        }
        for (int a = 0; a < 2; a++) {
            fresh[a] = inverse[a][0] * volts[0] + inverse[a][1] * volts[1];
        }
        for (int p = 0; p < NP; p++) {
            for (int a = 0; a < 2; a++) {
                slopes[a][p] -= now->c_by_p[2 * a][p] * fresh[0] + now->c_by_p[2 * a + 1][p] * fresh[1];
            }
            for (int a = 0; a < 2; a++) {
                n->Y[at[a]][p] = inverse[a][0] * slopes[0][p] + inverse[a][1] * slopes[1][p];
            }
        }
        for (int a = 0; a < 2; a++) {
            n->z[at[a]] = fresh[a];
        }
    }
    for (int i = 4; i < NZ; i++) {
        add_times(n->Y[i], back);
    }
}

/* What was seen at `from`, in units of its largest entry of either kind. */
static void look_from(const known *from, double unit[SEEN], view *v)
{
    look(from, NULL, v);
    for (int i = 0; i < SEEN; i++) {
        unit[i] = 0.0;
        for (int j = i / 4 * 4; j < i / 4 * 4 + 4; j++) {
            unit[i] = larger(unit[i], fabs(v->seen[j]));
        }
    }
    look(from, unit, v);
}

/* Moves `to`, which stands `change` away from where `was` was seen, to the nearest p where what is seen has moved along a straight line; `now`:
   what is seen there. */
static void go(const filter *f, const view *was, const double *unit, const double change[NP], known *to, view *now)
{
    double missing[SEEN], step[NP];
    for (int round = 0;; round++) {
        double most = 0.0;
        look(to, unit, now);
        for (int i = 0; i < SEEN; i++) {
            missing[i] = was->seen[i] - now->seen[i];
            for (int q = 0; q < NP; q++) {
                missing[i] += was->by_p[i][q] * change[q];
            }
            most = larger(most, fabs(missing[i]));
        }
        if (!(most > CLOSE) || round >= ROUNDS) {
            break;
        }
        least_change(f, now, missing, 1, step);
        for (int q = 0; q < NP; q++) {
            to->p[q] += step[q];
        }
    }
}

void straight_step(const filter *f, const double eta[NP], const double step[NP], double trial[NP])
{
    view was, now;
    known from = f->k, to = f->k;
    double change[NP], unit[SEEN];
    for (int i = 0; i < NP; i++) {
        trial[i] = eta[i] + step[i];
    }
    if (!READS) {
        return;
    }
    for (int i = 0; i < NP; i++) {
        from.p[i] = block_constant_at(f, eta, i);
        to.p[i] = block_constant_at(f, trial, i);
        change[i] = to.p[i] - from.p[i];
    }
    look_from(&from, unit, &was);
    go(f, &was, unit, change, &to, &now);
    for (int i = 0; i < NP; i++) {
        change[i] = to.p[i] - f->p_begun[i];
    }
    block_scale(f, change, trial);
}

void straight_follow(filter *f)
{
    view was, now;
    known begun = f->k;
    double change[NP], unit[SEEN], differ[SEEN * NP], along[NP * NP], back[NP * NP];
    if (!READS) {
        return;
    }
    memcpy(begun.p, f->p_begun, sizeof begun.p);
    look_from(&begun, unit, &was);
    for (int q = 0; q < NP; q++) {
        change[q] = f->k.p[q] - f->p_begun[q];
    }
    go(f, &was, unit, change, &f->k, &now);
    for (int i = 0; i < SEEN; i++) {
        for (int q = 0; q < NP; q++) {
            differ[i * NP + q] = was.by_p[i][q] - now.by_p[i][q];
        }
    }
    least_change(f, &now, differ, NP, along);
    for (int i = 0; i < SEEN * NP; i++) {
        differ[i] = -differ[i];
    }
    least_change(f, &was, differ, NP, back);
    carry_motion(f, &was, &now, change, back);
    for (int64_t r = f->rows; r < f->rows + f->kept; r++) {
        add_times(f->H[r], back);
    }
    for (int m = 0; m < f->unseen_count; m++) {
        add_of(along, f->unseen[m], 1);
    }
    for (int j = 0; j < NP; j++) {
        add_of(along, &f->W[0][j], NP);
    }
    make_triangular(f->W);
}
