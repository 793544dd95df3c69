#include "carried.h"

#include "block.h"
#include "known_model.h"
#include "linear.h"

/* Where other sizes are looked at: deviations of the design from the one that it expects. */
static const double ELSEWHERE[CARRIED_EACH] = {-1.0, 0.0, 1.5};

/* Whether the axes move the states of effects otherwise where constant i is `other`. */
static int carries(const known *at, int i, double other)
{
    const double rest[NS] = {0}, none[2] = {0.0, 0.0};
    double here[NS * NS], there[NS * NS];
    known k = *at;
    known_rate_by_state(&k, rest, none, 0.0, here);
    k.p[i] = other;
    known_rate_by_state(&k, rest, none, 0.0, there);
    int found = 0;
    for (int r = MOTION; r < NS; r++) {
        for (int c = 0; c < MOTION; c++) {
            found |= here[r * NS + c] != there[r * NS + c];
        }
    }
    return found;
}

int carried_other(const filter *f, int which, double step[NP])
{
    const int i = which / CARRIED_EACH;
    double change[NP] = {0.0};
    const double other = larger(f->first_p[i] + ELSEWHERE[which % CARRIED_EACH] * f->prior[i], f->first_lowest[i]);
    change[i] = other - f->k.p[i];
    if (i == INVERSE_MASS || fabs(change[i]) < APART * f->prior[i] || !carries(&f->k, i, other)) {
        return 0;
    }
    block_scale(f, change, step);
    return 1;
}
