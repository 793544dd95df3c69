/* The motion while nothing bends it but states that follow a displacement (Bouc-Wen), by values of their force at Gauss' nodes. What is linear
   is a Taylor series, driven by that force as it begins: to the third power of time. At the nodes of that motion the force is read from
   the curves of bouc_wen_table.h. What it is off there moves the nodes, and by its slope itself, once; and then the motion, exactly as far as that is
   linear.

   A step is cut where such a state turns round or passes zero, so that each part is of one branch. What does not fit, for which the
   estimates below are, is left to taylor.h. */

#ifndef GYRO_COLLOCATION_H
#define GYRO_COLLOCATION_H

#include <string.h>

#include "bouc_wen_table.h"
#include "generated/expansions.h"
#include "linear.h"

enum {
    GYRO_NODES = 5,
    GYRO_MOTION_TERMS = 13, /* powers of time, to that which counts at the end of a part */
    GYRO_SLOW_POWERS = 10,  /* to this one where the motion turns little within it, as most does; a compiler is told which, to unroll */
    GYRO_NODE_POWERS = 10,  /* and at the nodes, from the first on: for the force of a displacement, two less count */
    GYRO_MOMENTS = 7        /* of the force that is left, which is smaller still: five less than of the motion count */
};

/* Nodes c; c^2/2; c^3/6; c^k/k!; 1/k!; integrals twice from 0 to each node of the polynomials that are 1 at one node; weights w times
   (1 - c)^k/k!; what makes of values the
   coefficient of their Legendre polynomial of degree 4, and what they say of the end. */
static const gyro_pair GYRO_NODE[GYRO_NODES] = {
    GYRO_BOTH(0.046910077030668004), GYRO_BOTH(0.23076534494715845), GYRO_BOTH(0.5), GYRO_BOTH(0.7692346550528415), GYRO_BOTH(0.953089922969332)};
static const gyro_pair GYRO_HALF_SQUARE[GYRO_NODES] = {
    GYRO_BOTH(0.0011002776635116028), GYRO_BOTH(0.026626322214290513), GYRO_BOTH(0.125), GYRO_BOTH(0.295860977267132), GYRO_BOTH(0.45419020063284365)};
static const gyro_pair GYRO_SIXTH_CUBE[GYRO_NODES] = {
    GYRO_BOTH(1.7204703316817566e-05), GYRO_BOTH(0.0020481441434849795), GYRO_BOTH(0.020833333333333332), GYRO_BOTH(0.07586217226389297), GYRO_BOTH(0.14429470111152745)};
static const gyro_pair GYRO_AT_NODE[GYRO_NODES][GYRO_NODE_POWERS] = {
    {GYRO_BOTH(0.046910077030668004), GYRO_BOTH(0.0011002776635116028), GYRO_BOTH(1.7204703316817566e-05), GYRO_BOTH(2.0176848947042535e-07), GYRO_BOTH(1.892995076683836e-09), GYRO_BOTH(1.480009081098567e-11), GYRO_BOTH(9.918191428631707e-14), GYRO_BOTH(5.815789049025306e-16), GYRO_BOTH(3.031323469821028e-18), GYRO_BOTH(1.4219961747417625e-20)},
    {GYRO_BOTH(0.23076534494715845), GYRO_BOTH(0.026626322214290513), GYRO_BOTH(0.0020481441434849795), GYRO_BOTH(0.00011816017244320343), GYRO_BOTH(5.453454590574313e-06), GYRO_BOTH(2.0974472162459103e-07), GYRO_BOTH(6.914544719506353e-09), GYRO_BOTH(1.9945466216867958e-10), GYRO_BOTH(5.114135990741588e-12), GYRO_BOTH(1.1801653560101607e-13)},
    {GYRO_BOTH(0.5), GYRO_BOTH(0.125), GYRO_BOTH(0.020833333333333332), GYRO_BOTH(0.0026041666666666665), GYRO_BOTH(0.00026041666666666666), GYRO_BOTH(2.170138888888889e-05), GYRO_BOTH(1.5500992063492063e-06), GYRO_BOTH(9.68812003968254e-08), GYRO_BOTH(5.382288910934745e-09), GYRO_BOTH(2.691144455467372e-10)},
    {GYRO_BOTH(0.7692346550528415), GYRO_BOTH(0.29586097726713206), GYRO_BOTH(0.07586217226389297), GYRO_BOTH(0.014588952978243738), GYRO_BOTH(0.0022444656423602897), GYRO_BOTH(0.00028775345902982865), GYRO_BOTH(3.162141897101031e-05), GYRO_BOTH(3.0405364143058125e-06), GYRO_BOTH(2.598762199815706e-07), GYRO_BOTH(1.999057944339598e-08)},
    {GYRO_BOTH(0.953089922969332), GYRO_BOTH(0.4541902006328436), GYRO_BOTH(0.14429470111152745), GYRO_BOTH(0.03438145639181712), GYRO_BOTH(0.006553723924810085), GYRO_BOTH(0.001041048038443252), GYRO_BOTH(0.00014174462782389331), GYRO_BOTH(1.688692205174889e-05), GYRO_BOTH(1.7883061374989403e-06), GYRO_BOTH(1.7044165588344489e-07)}};
static const gyro_pair GYRO_AT_END[GYRO_MOTION_TERMS] = {
    GYRO_BOTH(1.0), GYRO_BOTH(1.0), GYRO_BOTH(0.5), GYRO_BOTH(0.16666666666666666), GYRO_BOTH(0.041666666666666664), GYRO_BOTH(0.008333333333333333), GYRO_BOTH(0.001388888888888889), GYRO_BOTH(0.0001984126984126984), GYRO_BOTH(2.48015873015873e-05), GYRO_BOTH(2.7557319223985893e-06), GYRO_BOTH(2.755731922398589e-07), GYRO_BOTH(2.505210838544172e-08), GYRO_BOTH(2.08767569878681e-09)};
static const gyro_pair GYRO_TWICE[GYRO_NODES][GYRO_NODES] = {
    {GYRO_BOTH(0.0014903173901214932), GYRO_BOTH(-0.0006225967976036992), GYRO_BOTH(0.0003615323799020099), GYRO_BOTH(-0.00018017673447568924), GYRO_BOTH(5.1201425567488265e-05)},
    {GYRO_BOTH(0.0214719351438777), GYRO_BOTH(0.005917090017285914), GYRO_BOTH(-0.0010345258632201892), GYRO_BOTH(0.0003610125430662417), GYRO_BOTH(-8.918962671914914e-05)},
    {GYRO_BOTH(0.0538251605391023), GYRO_BOTH(0.06356132506917343), GYRO_BOTH(0.008333333333333333), GYRO_BOTH(-0.0008703874309751167), GYRO_BOTH(0.00015056848936605583)},
    {GYRO_BOTH(0.08547986650844075), GYRO_BOTH(0.12922443754336332), GYRO_BOTH(0.07554777601847697), GYRO_BOTH(0.005917090017285914), GYRO_BOTH(-0.0003081928204348935)},
    {GYRO_BOTH(0.10740038552503998), GYRO_BOTH(0.17268244948940872), GYRO_BOTH(0.12924044380228977), GYRO_BOTH(0.04337660442598363), GYRO_BOTH(0.0014903173901214932)}};
static const gyro_pair GYRO_MOMENT[GYRO_MOMENTS][GYRO_NODES] = {
    {GYRO_BOTH(0.11846344252809454), GYRO_BOTH(0.23931433524968324), GYRO_BOTH(0.28444444444444444), GYRO_BOTH(0.23931433524968324), GYRO_BOTH(0.11846344252809454)},
    {GYRO_BOTH(0.11290631331378352), GYRO_BOTH(0.18408888012499017), GYRO_BOTH(0.14222222222222222), GYRO_BOTH(0.055225455124693075), GYRO_BOTH(0.005557129214311027)},
    {GYRO_BOTH(0.0538049347294926), GYRO_BOTH(0.07080377310100536), GYRO_BOTH(0.035555555555555556), GYRO_BOTH(0.0063720606008568085), GYRO_BOTH(0.0001303426797563529)},
    {GYRO_BOTH(0.01709364703223401), GYRO_BOTH(0.018154905325930504), GYRO_BOTH(0.005925925925925926), GYRO_BOTH(0.0004901502541936397), GYRO_BOTH(2.0381283825847355e-06)},
    {GYRO_BOTH(0.004072945683304216), GYRO_BOTH(0.003491345583977287), GYRO_BOTH(0.0007407407407407407), GYRO_BOTH(2.8277423121233167e-05), GYRO_BOTH(2.390218985636018e-08)},
    {GYRO_BOTH(0.0007763766975117378), GYRO_BOTH(0.000537132803192206), GYRO_BOTH(7.407407407407407e-05), GYRO_BOTH(1.3050898601576253e-06), GYRO_BOTH(2.242507134727015e-10)},
    {GYRO_BOTH(0.00012332613447110774), GYRO_BOTH(6.88635277635204e-05), GYRO_BOTH(6.172839506172839e-06), GYRO_BOTH(5.019491862771886e-08), GYRO_BOTH(1.753269707197781e-12)}};
static const gyro_pair GYRO_ROUGH[2][GYRO_NODES] = {
    {GYRO_BOTH(0.2619960159204453), GYRO_BOTH(-0.7419960159204453), GYRO_BOTH(0.96), GYRO_BOTH(-0.7419960159204453), GYRO_BOTH(0.2619960159204453)},
    {GYRO_BOTH(0.0763586617958129), GYRO_BOTH(-0.2679416522233875), GYRO_BOTH(0.5333333333333333), GYRO_BOTH(-0.8931583920000717), GYRO_BOTH(1.551408049094313)}};

/* How large the frequency times a part may be, which is the last but two of gyro_reach that GYRO_MOTION_TERMS do for. */
static const double GYRO_MOST_TURNED = 0.27;

/* By how much the force at the end may be off what the nodes say of it, as a displacement in a step over the size of the motion, times the square
   of its ratio to the last coefficient: so do further ones fall, of which the rule of Gauss leaves those from degree 10 on. Where
   the force has all but a corner, they hardly fall and leave a hundredth. */
static const double GYRO_MOST_ROUGH = 1e-10;

/* A speed of so little, over the acceleration of the part, has just turned round, or is about to: it moves z by its square. */
static const double GYRO_TURNED_NOW = 1e-5;

/* By how much the place on a curve may be off in its third power: where that counts, the next may too. */
static const double GYRO_PLACE_OFF = 1e-10;

/* By how much forces at the nodes may move with those, as above, and be left to their slopes: these are right to some parts in a hundred. */
static const double GYRO_MOST_MOVED = 1e-11;

/* So near below zero, in lengths, a state has passed it. */
static const double GYRO_PASSED_ZERO = 1e-8;

/* Two states turn and pass zero each at most twice in what is short against a period. */
enum { GYRO_MOST_CUTS = 8 };

/* So often forces are found at nodes: each time what they move is a hundredth or less. */
enum { GYRO_MOST_ROUNDS = 3 };

/* One of them on one side of zero: z = scale (curve(at + along u) + off), u being the displacement from where the part begins. */
typedef struct {
    const gyro_curve_piece *curve;
    double way; /* of the motion: 1 or -1 */
    int away;   /* 1: from zero */
    double at, along, scale, off;
    double rate, bend, third; /* derivatives of the curve */
} gyro_branch;

/* A part of a step, in units of its own length: the pairs are the axes, forces are what they would add to the displacement. */
typedef struct {
    double step; /* s */
    int powers;  /* of the motion */
    gyro_pair place[2], speed[2];         /* linear forces by displacement and speed, of the own axis and of the other */
    gyro_pair x[GYRO_MOTION_TERMS];       /* derivatives of the displacement */
    gyro_branch branch[2];
    gyro_pair at, along, off, force;      /* force: over the value of the curve */
    gyro_pair slope, bend, third;         /* derivatives of the force by displacement */
    gyro_pair driven[4];                  /* derivatives of the force by time */
    gyro_pair way, end_speed;             /* how far it goes, and the speed there */
} gyro_part_of_step;

/* Finds whether such states are all that bends the motion, and how they do. */
static inline void find_followers(gyro_followers *all, const gyro_series_plan *plan, const gyro_view *g)
{
    double slope[GYRO_BOUC_WENS + 1];
    int bend = 0;
    memset(all, 0, sizeof *all);
    bouc_wen_slopes(g, slope);
    all->holds = plan->holds && plan->n > 0;
    for (int i = 0; i < GYRO_BOUC_WENS; i++) {
        const gyro_bouc_wen *of = &bouc_wens[i];
        gyro_follower *axis = &all->axis[of->axis];
        if (g->active[of->effect]) {
            const double beta = g->p[of->beta], gamma = g->p[of->gamma];
            /* Of its force nothing else is known, another follows the same displacement, or the other follows another curve. */
            all->holds = all->holds && gyro_finite(slope[i]) && axis->of == NULL && (all->n == 0.0 || all->n == g->p[of->n]);
            axis->of = of;
            axis->slope = slope[i];
            axis->per_length = 1.0 / g->p[of->length];
            all->n = g->p[of->n];
            for (int away = 0; away < 2; away++) {
                const double c = away ? gamma + beta : gamma - beta;
                /* Without a bend z is as s, as it is near zero. */
                axis->scale[away] = larger(gyro_power(larger(fabs(c), 1e-300), 1.0 / all->n), 1e-30);
                axis->back[away] = 1.0 / axis->scale[away];
                axis->curve[away] = c < 0.0;
            }
        }
    }
    for (int i = 0; i < plan->n; i++) {
        int follows = 0;
        for (int j = 0; j < GYRO_BOUC_WENS; j++) {
            follows |= bouc_wens[j].effect == plan->effect[i];
        }
        bend |= !follows;
    }
    all->holds = all->holds && !bend;
}

/* The branch of a state z, the motion going `way`. */
static inline void lay_branch(gyro_branch *branch, const gyro_follower *axis, const gyro_bouc_wen_table *table, double z, double way)
{
    const double along = z * way;
    const int away = along > -GYRO_PASSED_ZERO;
    const double sign = away ? way : -way, w = axis->scale[away] * (away ? along : -along);
    const gyro_curve_piece *curve = table->curve[axis->curve[away]];
    const double s = place_on(table, axis->curve[away], w);
    const gyro_curve_piece *of = curve_piece(curve, s);
    const double t = s - of->centre;
    double value = of->c[GYRO_CURVE_POWER], rate = 0.0, bend = 0.0, third = 0.0;
    for (int k = GYRO_CURVE_POWER - 1; k >= 0; k--) {
        third = third * t + bend;
        bend = bend * t + rate;
        rate = rate * t + value;
        value = value * t + of->c[k];
    }
    /* A step of Newton's, of which the rest is known to the third power; where the curve hardly rises, there is nothing to add. */
    const double left = w - value, move = rate > 1e-6 ? left / rate : 0.0, cubic = third * move * move * move;
    branch->curve = curve;
    branch->way = way;
    branch->away = away;
    branch->at = fabs(cubic) <= GYRO_PLACE_OFF ? s + move : NAN;
    branch->off = left - move * (rate + move * bend) - cubic;
    branch->along = axis->per_length * axis->scale[away] * sign;
    branch->scale = sign * axis->back[away];
    branch->rate = rate + 2.0 * bend * move;
    branch->bend = 2.0 * bend + 6.0 * third * move;
    branch->third = 6.0 * third;
}

static GYRO_INLINE gyro_pair curves_at(const gyro_part_of_step *part, gyro_pair at)
{
    const double x = curve_at(part->branch[0].curve, lane_of(at, 0)), y = curve_at(part->branch[1].curve, lane_of(at, 1));
    return pair_sum(pair_of(x, y), part->off);
}

/* The linear force that a displacement and a speed bring. */
static GYRO_INLINE gyro_pair linear_of_part(const gyro_part_of_step *part, gyro_pair place, gyro_pair speed)
{
    const gyro_pair by_place = pair_sum(pair_product(part->place[0], place), pair_product(part->place[1], pair_exchanged(place)));
    return pair_sum(pair_sum(by_place, pair_product(part->speed[1], pair_exchanged(speed))), pair_product(part->speed[0], speed));
}

static inline double state_of(const gyro_view *g, const gyro_follower *axis) { return axis->of != NULL ? g->s[axis->of->state] : 0.0; }

/* The part of `step` [s] from the view on, as the motion begins. */
static GYRO_INLINE void begin_part(gyro_part_of_step *part, const gyro_view *g, const gyro_followers *all, const gyro_bouc_wen_table *table,
                              const gyro_linear_pair *linear, double step)
{
    const double by_mass = step * g->inverse_mass, force = step * by_mass;
    const gyro_pair of_z = pair_scaled(force, pair_of(all->axis[0].slope, all->axis[1].slope));
    part->step = step;
    part->x[0] = pair_of(g->s[GYRO_STATE_X], g->s[GYRO_STATE_Y]);
    part->x[1] = pair_scaled(step, pair_of(g->s[GYRO_STATE_X_DOT], g->s[GYRO_STATE_Y_DOT]));
    for (int i = 0; i < 2; i++) {
        part->place[i] = pair_scaled(force, linear->place[i]);
        part->speed[i] = pair_scaled(by_mass, linear->speed[i]);
    }
    const gyro_pair z = pair_of(state_of(g, &all->axis[0]), state_of(g, &all->axis[1]));
    part->driven[0] = pair_product(of_z, z);
    part->x[2] = pair_sum(pair_sum(linear_of_part(part, part->x[0], part->x[1]), pair_scaled(force, linear->still)), part->driven[0]);
    for (int axis = 0; axis < 2; axis++) {
        const double speed = lane_of(part->x[1], axis), faster = lane_of(part->x[2], axis);
        const double sign = fabs(speed) > GYRO_TURNED_NOW * fabs(faster) ? speed : faster;
        lay_branch(&part->branch[axis], &all->axis[axis], table, lane_of(z, axis), sign > 0.0 ? 1.0 : -1.0);
    }
    const gyro_branch *x = &part->branch[0], *y = &part->branch[1];
    part->at = pair_of(x->at, y->at);
    part->along = pair_of(x->along, y->along);
    part->off = pair_of(x->off, y->off);
    part->force = pair_product(of_z, pair_of(x->scale, y->scale));
    part->slope = pair_product(pair_product(part->force, part->along), pair_of(x->rate, y->rate));
    part->bend = pair_product(pair_product(pair_product(part->force, part->along), part->along), pair_of(x->bend, y->bend));
    part->third = pair_product(pair_product(pair_product(pair_product(part->force, part->along), part->along), part->along), pair_of(x->third, y->third));
    part->driven[1] = pair_product(part->slope, part->x[1]);
    part->driven[2] = pair_sum(pair_product(part->slope, part->x[2]), pair_product(part->bend, pair_product(part->x[1], part->x[1])));
}

/* How far the part goes. */
static GYRO_INLINE void find_end(gyro_part_of_step *part, int powers)
{
    part->way = part->end_speed = both(0.0);
    for (int k = powers; k > 0; k--) {
        part->way = pair_sum(part->way, pair_product(GYRO_AT_END[k], part->x[k]));
        part->end_speed = pair_sum(part->end_speed, pair_product(GYRO_AT_END[k - 1], part->x[k]));
    }
}

/* The motion under the force as it begins. */
static GYRO_INLINE void drive(gyro_part_of_step *part, int powers)
{
    const gyro_pair speed = part->x[1], faster = part->x[2], square = pair_product(speed, speed);
    for (int k = 1; k + 2 <= powers; k++) {
        const gyro_pair force = linear_of_part(part, part->x[k], part->x[k + 1]);
        part->x[k + 2] = k < 4 ? pair_sum(part->driven[k], force) : force;
        if (k == 1) {
            const gyro_pair bent = pair_sum(pair_product(pair_scaled(3.0, part->bend), faster), pair_product(part->third, square));
            part->driven[3] = pair_sum(pair_product(part->slope, part->x[3]), pair_product(bent, speed));
        }
    }
    find_end(part, powers);
}

/* Derivative `order` of the displacement of an axis at the time t. */
static inline double derivative_at(const gyro_part_of_step *part, int axis, int order, double t)
{
    double sum = 0.0;
    for (int k = part->powers; k > order; k--) {
        sum = (sum + lane_of(GYRO_AT_END[k - order], 0) * lane_of(part->x[k], axis)) * t;
    }
    return sum + (order > 0 ? lane_of(part->x[order], axis) : 0.0);
}

/* When that comes to `aim`, from a guess on. Three steps of Newton's double the digits of two. */
static inline double when(const gyro_part_of_step *part, int axis, int order, double aim, double t)
{
    for (int i = 0; i < 4; i++) {
        t -= (derivative_at(part, axis, order, t) - aim) / derivative_at(part, axis, order + 1, t);
    }
    return t;
}

/* Where in the part an axis turns round or its state passes zero first: 1 where neither happens, 0 where that is not sure. */
static inline double cut_of(const gyro_part_of_step *part, int axis)
{
    const gyro_branch *branch = &part->branch[axis];
    const double way = branch->way, start = way * lane_of(part->x[1], axis), end = way * lane_of(part->end_speed, axis);
    const double faster = lane_of(part->x[2], axis), later = faster + lane_of(part->x[3], axis) + 0.5 * lane_of(part->x[4], axis);
    double cut = 1.0, gone = lane_of(part->way, axis);
    if (end < 0.0) {
        cut = when(part, axis, 1, 0.0, start / (start - end));
        cut = cut > GYRO_TURNED_NOW && cut < 1.0 ? cut : 0.0;
        gone = derivative_at(part, axis, 0, cut);
    } else if ((faster > 0.0) != (later > 0.0) && smaller(start, end) < 0.25 * larger(fabs(faster), fabs(later))) {
        /* It might turn twice. */
        cut = 0.0;
    }
    if (cut > 0.0 && !branch->away && branch->at + branch->along * gone < 0.0) {
        const double zero = when(part, axis, 0, -branch->at / branch->along, -cut * branch->at / (branch->along * gone));
        cut = zero > 0.0 && zero < cut ? zero : 0.0;
    }
    return cut;
}

/* The part ends at `cut` of it. */
static inline void shorten(gyro_part_of_step *part, double cut)
{
    const gyro_pair once = both(cut), twice = both(cut * cut);
    gyro_pair scale = once;
    for (int i = 0; i < 2; i++) {
        part->place[i] = pair_product(part->place[i], twice);
        part->speed[i] = pair_product(part->speed[i], once);
    }
    for (int k = 1; k <= part->powers; k++) {
        part->x[k] = pair_product(part->x[k], scale);
        scale = pair_product(scale, once);
    }
    part->force = pair_product(part->force, twice);
    part->slope = pair_product(part->slope, twice);
    part->bend = pair_product(part->bend, twice);
    part->third = pair_product(part->third, twice);
    part->driven[0] = pair_product(part->driven[0], twice);
    part->driven[1] = pair_product(pair_product(part->driven[1], twice), once);
    part->driven[2] = pair_product(pair_product(part->driven[2], twice), twice);
    part->driven[3] = pair_product(pair_product(part->driven[3], twice), pair_product(twice, once));
    part->step *= cut;
    find_end(part, part->powers);
}

/* The nodes of the motion, the force there as it begins, and how that changes with the displacement. */
typedef struct {
    gyro_pair x[GYRO_NODES], driven[GYRO_NODES], slope[GYRO_NODES];
} gyro_node_values;

static GYRO_INLINE void find_nodes(const gyro_part_of_step *part, int powers, gyro_node_values *node)
{
    for (int i = 0; i < GYRO_NODES; i++) {
        gyro_pair x = both(0.0);
        for (int k = powers - 2; k > 0; k--) {
            x = pair_sum(x, pair_product(GYRO_AT_NODE[i][k - 1], part->x[k]));
        }
        const gyro_pair later = pair_sum(pair_product(GYRO_HALF_SQUARE[i], part->driven[2]), pair_product(GYRO_SIXTH_CUBE[i], part->driven[3]));
        node->x[i] = x;
        node->driven[i] = pair_sum(part->driven[0], pair_sum(pair_product(GYRO_NODE[i], part->driven[1]), later));
        node->slope[i] = pair_sum(part->slope, pair_product(x, pair_sum(part->bend, pair_product(pair_scaled(0.5, part->third), x))));
    }
}

/* Over the size of the motion. */
static GYRO_INLINE double over_size(const gyro_part_of_step *part, gyro_pair force)
{
    const gyro_pair size = pair_sum(pair_size(part->x[0]), pair_size(part->x[1]));
    return (fabs(lane_of(force, 0)) + fabs(lane_of(force, 1))) / larger(lane_of(size, 0), lane_of(size, 1));
}

/* What the force at each node is off that which has driven the motion, after the nodes have moved by it: by its slope, or where that says too
   much, by its value there. */
static GYRO_INLINE void find_left(const gyro_part_of_step *part, int powers, gyro_pair left[GYRO_NODES])
{
    gyro_node_values node;
    double large = INFINITY;
    find_nodes(part, powers, &node);
    for (int round = 0; round < GYRO_MOST_ROUNDS && large > GYRO_MOST_MOVED; round++) {
        gyro_pair more[GYRO_NODES], most = both(0.0);
        for (int i = 0; i < GYRO_NODES; i++) {
            const gyro_pair at = pair_sum(part->at, pair_product(part->along, node.x[i]));
            more[i] = left[i];
            left[i] = pair_difference(pair_product(part->force, curves_at(part, at)), node.driven[i]);
            more[i] = round > 0 ? pair_difference(left[i], more[i]) : left[i];
        }
        for (int i = 0; i < GYRO_NODES; i++) {
            gyro_pair moved = pair_product(GYRO_TWICE[i][0], more[0]);
            for (int j = 1; j < GYRO_NODES; j++) {
                moved = pair_sum(moved, pair_product(GYRO_TWICE[i][j], more[j]));
            }
            const gyro_pair change = pair_product(node.slope[i], moved);
            node.x[i] = pair_sum(node.x[i], moved);
            left[i] = pair_sum(left[i], change);
            most = pair_sum(most, pair_size(change));
        }
        large = over_size(part, most);
    }
}

/* How rough the force is within the part, `end` being its value there. */
static GYRO_INLINE double roughness(const gyro_part_of_step *part, const gyro_pair left[GYRO_NODES], gyro_pair end)
{
    const gyro_pair later = pair_sum(pair_scaled(0.5, part->driven[2]), pair_scaled(1.0 / 6.0, part->driven[3]));
    gyro_pair last = both(0.0), beyond = pair_difference(end, pair_sum(part->driven[0], pair_sum(part->driven[1], later)));
    for (int i = 0; i < GYRO_NODES; i++) {
        last = pair_sum(last, pair_product(GYRO_ROUGH[0][i], left[i]));
        beyond = pair_difference(beyond, pair_product(GYRO_ROUGH[1][i], left[i]));
    }
    const double before = over_size(part, last), size = over_size(part, beyond), falls = size < before ? size / before : 1.0;
    return size * falls * falls;
}

/* Adds what such forces do to the motion. */
static GYRO_INLINE void add_left(gyro_part_of_step *part, int powers, const gyro_pair left[GYRO_NODES])
{
    gyro_pair place = both(0.0), speed = both(0.0);
    for (int k = powers - 6; k >= 0; k--) {
        gyro_pair moment = pair_product(GYRO_MOMENT[k][0], left[0]);
        for (int i = 1; i < GYRO_NODES; i++) {
            moment = pair_sum(moment, pair_product(GYRO_MOMENT[k][i], left[i]));
        }
        const gyro_pair faster = pair_sum(moment, linear_of_part(part, place, speed));
        place = speed;
        speed = faster;
    }
    part->way = pair_sum(part->way, place);
    part->end_speed = pair_sum(part->end_speed, speed);
}

/* The view at the end of the part; gives 0 where the force is too rough for that, or a curve does not go so far. */
static GYRO_INLINE int end_part(const gyro_part_of_step *part, const gyro_followers *all, const gyro_pair left[GYRO_NODES], gyro_view *g)
{
    const gyro_pair value = curves_at(part, pair_sum(part->at, pair_product(part->along, part->way)));
    const gyro_pair z = pair_product(value, pair_of(part->branch[0].scale, part->branch[1].scale));
    const gyro_pair place = pair_sum(part->x[0], part->way), speed = pair_ratio(part->end_speed, both(part->step));
    /* Not where it is no number. */
    const int holds = roughness(part, left, pair_product(part->force, value)) <= GYRO_MOST_ROUGH;
    g->s[GYRO_STATE_X] = lane_of(place, 0);
    g->s[GYRO_STATE_Y] = lane_of(place, 1);
    g->s[GYRO_STATE_X_DOT] = lane_of(speed, 0);
    g->s[GYRO_STATE_Y_DOT] = lane_of(speed, 1);
    for (int axis = 0; axis < 2; axis++) {
        if (all->axis[axis].of != NULL) {
            g->s[all->axis[axis].of->state] = lane_of(z, axis);
        }
    }
    return holds && gyro_finite(lane_of(z, 0) + lane_of(z, 1));
}

/* Moves the view on by `step` [s] or to where a branch ends; gives how far [s], 0 where values don't do. */
static GYRO_INLINE double advance_by_values(gyro_view *g, const gyro_followers *all, const gyro_bouc_wen_table *table, const gyro_linear_pair *linear,
                                       int powers, double step)
{
    gyro_part_of_step part;
    gyro_pair left[GYRO_NODES];
    part.powers = powers;
    begin_part(&part, g, all, table, linear, step);
    drive(&part, powers);
    const double cut = smaller(cut_of(&part, 0), cut_of(&part, 1));
    double moved = 0.0;
    if (cut > 0.0) {
        if (cut < 1.0) {
            shorten(&part, cut);
        }
        find_left(&part, powers, left);
        add_left(&part, powers, left);
        moved = !end_part(&part, all, left, g) ? 0.0 : cut < 1.0 ? part.step : step;
    }
    return moved;
}

/* Moves the states of the view by h [s]; gives 0 where values don't do, and then has moved nothing. */
static inline int move_by_values(gyro_view *g, const gyro_followers *all, const gyro_bouc_wen_table *table, double h)
{
    gyro_linear linear = linear_of(g);
    const double frequency = bound_of(linear.slope, g->inverse_mass);
    const double stiffer = larger(fabs(all->axis[0].slope * all->axis[0].per_length), fabs(all->axis[1].slope * all->axis[1].per_length));
    const double turned = h * sqrt(frequency * frequency + stiffer * g->inverse_mass);
    int moves = turned <= GYRO_MOST_TURNED;
    if (moves) {
        const gyro_linear_pair pairs = pairs_of(&linear);
        const int slow = turned <= gyro_reach[GYRO_SLOW_POWERS - GYRO_FIRST_POWER];
        double before[GYRO_N_STATES], left = h;
        memcpy(before, g->s, sizeof before);
        for (int i = 0; moves && left > 0.0; i++) {
            double moved = 0.0;
            if (i < GYRO_MOST_CUTS) {
                moved = slow ? advance_by_values(g, all, table, &pairs, GYRO_SLOW_POWERS, left)
                             : advance_by_values(g, all, table, &pairs, GYRO_MOTION_TERMS - 1, left);
            }
            left -= moved;
            moves = moved > 0.0;
        }
        if (!moves) {
            memcpy(g->s, before, sizeof before);
        }
    }
    return moves;
}

#endif
