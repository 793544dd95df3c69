#include "straight.h"

#include "block.h"
#include "linear.h"
#include "prediction.h"

#define ROUNDS 4      /* of Gauss and Newton at most; the way is short, two are usual */
#define CLOSE 1e-12   /* of the design's deviation, change of a constant where they end */

/* Deviations of the design by which constants move before what the voltages see is followed. Within one deviation others move by hundreds of what they
   are known by, as its square: within this by 1e-4. */
#define STRAIGHT 5e-4

#define LATEST 5         /* commands under way that count: no more than a radian of an oscillation that is sampled thirty times a period */

#define FREQUENCIES 4
#define SEEN (8 * FREQUENCIES)
static const double AT[FREQUENCIES] = {0.16, 0.73, 1.0, 1.3}; /* of the oscillation's frequency: about where the tones are, and the pattern */
/* How sure a start is of what is seen there, one over its deviation, in units of look_from: tones of 0.4 um in 20 pm of noise are known to 5e-7 of
   themselves after 8192 samples. Ten times as much at the frequency of the pattern, a hundred or a thousand do the same. */
static const double SURE[FREQUENCIES] = {1e6, 1e6, 1e7, 1e6};

/* Where p is, and what the voltages see there. */
typedef struct {
    linear at, by[NP];
    double seen[SEEN], by_p[SEEN][NP]; /* in units of look_from */
} view;

/* What is to be solved by least squares, column by column: what is known of p, upper triangular and 1 before, above what is seen. */
typedef struct {
    double known[NP], seen[SEEN];
} column;

/* Reflects `of` as the reflection along (first, rest) does, `size` being 2 over its square; its row `k` is what that changes beside the rest. */
static void reflect(column *of, int k, double first, const double rest[SEEN], double size)
{
    double along = first * of->known[k];
    for (int a = 0; a < SEEN; a++) {
        along += rest[a] * of->seen[a];
    }
    along *= size;
    of->known[k] -= along * first;
    for (int a = 0; a < SEEN; a++) {
        of->seen[a] -= along * rest[a];
    }
}

/* Makes the columns R [NP] upper triangular, by reflections, which the right-hand sides, `count` of them, take part in. */
static void make_triangular(column R[NP], column *sides, int count)
{
    for (int k = 0; k < NP; k++) {
        double rest[SEEN], squared = 0.0;
        memcpy(rest, R[k].seen, sizeof rest);
        for (int a = 0; a < SEEN; a++) {
            squared += rest[a] * rest[a];
        }
        /* Its own entry is 1 until here: the root is added, so that nothing cancels. */
        const double root = sqrt(1.0 + squared), first = 1.0 + root, size = 2.0 / (first * first + squared);
        R[k].known[k] = -root;
        for (int j = k + 1; j < NP; j++) {
            reflect(&R[j], k, first, rest, size);
        }
        for (int n = 0; n < count; n++) {
            reflect(&sides[n], k, first, rest, size);
        }
    }
}

/* The most likely changes of p, but for what is `held`, where what is seen at `v` is found to have changed by the columns of `by` [SEEN * count]; out
   [NP * count]. By reflections, p in units of its prior: in J' J what is seen least would be lost. */
static void likely_change(const filter *f, const view *v, const int held[NP], const double *by, int count, double *out)
{
    column R[NP], sides[NP];
    memset(R, 0, sizeof R);
    memset(sides, 0, sizeof sides);
    for (int a = 0; a < SEEN; a++) {
        for (int q = 0; q < NP; q++) {
            R[q].seen[a] = held[q] ? 0.0 : v->by_p[a][q] * f->prior[q] * SURE[a / 8];
        }
        for (int n = 0; n < count; n++) {
            sides[n].seen[a] = by[a * count + n] * SURE[a / 8];
        }
    }
    make_triangular(R, sides, count);
    for (int n = 0; n < count; n++) {
        double *x = sides[n].known;
        for (int q = NP - 1; q >= 0; q--) {
            x[q] /= R[q].known[q];
            for (int i = 0; i < q; i++) {
                x[i] -= R[q].known[i] * x[q];
            }
            out[q * count + n] = f->prior[q] * x[q];
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

/* How the voltages will see the motion of a device. A delay of more periods than LATEST is taken for none: what is uncertain of it is a small part. */
static void form_sight(const filter *f, const linear *at, sight *s)
{
    double commands[2 * LATEST];
    const double periods = larger(at->delay, 0.0) / f->m.period, whole = floor(periods);
    const int count = whole < LATEST ? (int)whole + 1 : 1;
    for (int i = 0; i < count; i++) {
        memcpy(commands + 2 * i, filter_command(f, f->sample - 1 - i), 2 * sizeof *commands);
    }
    sight_form(s, at, commands, count, whole < LATEST ? (periods - whole) * f->m.period : 0.0, f->m.period);
}

/* Motion and slopes at `now` are those that the voltages see as they would have seen them at `was`, p being `change` away by a straight line.
   `back` [NP * NP] takes changes of p as they are now to what they were, less themselves. */
static void carry_motion(filter *f, const view *was, const view *now, const double change[NP], const double *back)
{
    moving *n = &f->now;
    sight before, after;
    double z[MOTION], y[MOTION], slopes[MOTION][NP], own[MOTION][NP], unused[MOTION];
    form_sight(f, &was->at, &before);
    form_sight(f, &now->at, &after);
    for (int i = 0; i < MOTION; i++) {
        z[i] = n->z[i];
        for (int p = 0; p < NP; p++) {
            z[i] -= n->Y[i][p] * change[p];
        }
    }
    sight_see(&before, was->by, z, y, slopes);
    for (int p = 0; p < NP; p++) {
        double moved[MOTION], seen[MOTION];
        for (int i = 0; i < MOTION; i++) {
            moved[i] = n->Y[i][p];
        }
        sight_change(&before, moved, seen);
        for (int i = 0; i < MOTION; i++) {
            slopes[i][p] += seen[i];
            y[i] += slopes[i][p] * change[p];
        }
    }
    sight_back(&after, y, n->z);
    sight_see(&after, now->by, n->z, unused, own);
    for (int i = 0; i < NZ; i++) {
        add_times(i < MOTION ? slopes[i] : n->Y[i], back);
    }
    for (int p = 0; p < NP; p++) {
        double seen[MOTION], moved[MOTION];
        for (int i = 0; i < MOTION; i++) {
            seen[i] = slopes[i][p] - own[i][p];
        }
        sight_change_back(&after, seen, moved);
        for (int i = 0; i < MOTION; i++) {
            n->Y[i][p] = moved[i];
        }
    }
}

/* What is seen, in units of `unit` [SEEN]. */
static void scale(view *v, const double unit[SEEN])
{
    for (int i = 0; i < SEEN; i++) {
        v->seen[i] /= unit[i];
        for (int q = 0; q < NP; q++) {
            v->by_p[i][q] /= unit[i];
        }
    }
}

/* The device of `k`, seen at frequencies about that of the oscillation [SI]. */
static void look(const filter *f, const known *k, view *v)
{
    const double pace = sqrt(f->first.P[1][1] / f->first.P[0][0]);
    linear_of(k, &v->at, v->by);
    for (int j = 0; j < FREQUENCIES; j++) {
        linear_command(&v->at, v->by, AT[j] * pace, v->seen + 8 * j, v->by_p + 8 * j);
    }
}

/* Looks at `from`. The unit becomes the deviation that the design leaves to the largest entry at its frequency, or that entry where it is more. */
static void look_from(const filter *f, const known *from, double unit[SEEN], view *v)
{
    double size[FREQUENCIES] = {0.0};
    look(f, from, v);
    for (int i = 0; i < SEEN; i++) {
        double variance = 0.0;
        for (int q = 0; q < NP; q++) {
            variance += v->by_p[i][q] * v->by_p[i][q] * f->prior[q] * f->prior[q];
        }
        size[i / 8] = larger(size[i / 8], larger(fabs(v->seen[i]), sqrt(variance)));
    }
    for (int i = 0; i < SEEN; i++) {
        unit[i] = size[i / 8];
    }
    scale(v, unit);
}

/* Moves `to`, which stands `change` away from where `was` was seen, to the most likely p where what is seen has moved along a straight line, none
   being below its lowest value; `now`: what is seen there. */
static void go(const filter *f, const view *was, const double *unit, const double change[NP], known *to, view *now)
{
    double bent[NP] = {0.0};
    int held[NP] = {0};
    for (int round = 0, ends = 0;; round++) {
        double missing[SEEN], bend[NP];
        look(f, to, now);
        scale(now, unit);
        if (ends || round >= ROUNDS) {
            break;
        }
        for (int i = 0; i < SEEN; i++) {
            missing[i] = was->seen[i] - now->seen[i];
            for (int q = 0; q < NP; q++) {
                missing[i] += was->by_p[i][q] * change[q] + now->by_p[i][q] * bent[q];
            }
        }
        likely_change(f, now, held, missing, 1, bend);
        ends = 1;
        for (int q = 0; q < NP; q++) {
            if (held[q]) {
                continue;
            }
            ends &= fabs(bend[q] - bent[q]) <= CLOSE * f->prior[q];
            to->p[q] += bend[q] - bent[q];
            bent[q] = bend[q];
            if (to->p[q] < f->lowest[q]) {
                to->p[q] = f->lowest[q];
                bent[q] = 0.0;
                held[q] = 1;
                ends = 0;
            }
        }
    }
}

/* back = (1 + along)^-1 - 1, both [NP * NP], by elimination in units of the prior. */
static void turn_back(const filter *f, const double *along, double *back)
{
    double A[NP][NP], B[NP][NP];
    for (int i = 0; i < NP; i++) {
        for (int j = 0; j < NP; j++) {
            A[i][j] = along[i * NP + j] * f->prior[j] / f->prior[i] + (i == j ? 1.0 : 0.0);
            B[i][j] = i == j ? 1.0 : 0.0;
        }
    }
    for (int k = 0; k < NP; k++) {
        int pivot = k;
        for (int i = k + 1; i < NP; i++) {
            pivot = fabs(A[i][k]) > fabs(A[pivot][k]) ? i : pivot;
        }
        for (int j = 0; j < NP; j++) {
            const double a = A[k][j], b = B[k][j];
            A[k][j] = A[pivot][j];
            B[k][j] = B[pivot][j];
            A[pivot][j] = a;
            B[pivot][j] = b;
        }
        for (int i = 0; i < NP; i++) {
            const double factor = i == k ? 0.0 : A[i][k] / A[k][k];
            for (int j = 0; j < NP && factor != 0.0; j++) {
                A[i][j] -= factor * A[k][j];
                B[i][j] -= factor * B[k][j];
            }
        }
    }
    for (int i = 0; i < NP; i++) {
        for (int j = 0; j < NP; j++) {
            back[i * NP + j] = (B[i][j] / A[i][i] - (i == j ? 1.0 : 0.0)) * f->prior[i] / f->prior[j];
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
    look_from(f, &from, unit, &was);
    go(f, &was, unit, change, &to, &now);
    for (int i = 0; i < NP; i++) {
        change[i] = to.p[i] - f->p_begun[i];
    }
    block_scale(f, change, trial);
}

void straight_begin(filter *f) { memcpy(f->followed, f->k.p, sizeof f->followed); }

/* Whether p has moved so far that what the voltages see may have bent. */
static int has_bent(const filter *f)
{
    int bent = 0;
    for (int q = 0; q < NP; q++) {
        bent |= fabs(f->k.p[q] - f->followed[q]) > STRAIGHT * f->prior[q];
    }
    return READS && bent;
}

void straight_follow(filter *f)
{
    view was, now;
    known begun = f->k;
    double change[NP], unit[SEEN], differ[SEEN * NP], along[NP * NP], back[NP * NP];
    const int none_held[NP] = {0};
    if (!has_bent(f)) {
        return;
    }
    memcpy(begun.p, f->followed, sizeof begun.p);
    look_from(f, &begun, unit, &was);
    for (int q = 0; q < NP; q++) {
        change[q] = f->k.p[q] - f->followed[q];
    }
    go(f, &was, unit, change, &f->k, &now);
    for (int i = 0; i < SEEN; i++) {
        for (int q = 0; q < NP; q++) {
            differ[i * NP + q] = was.by_p[i][q] - now.by_p[i][q];
        }
    }
    likely_change(f, &now, none_held, differ, NP, along);
    turn_back(f, along, back);
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
    block_make_triangular(f->W);
    straight_begin(f);
}
