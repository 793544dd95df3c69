/* What a hold does to the feedback of the isotropic oscillator (TW 201137310, eqs. 5-7), and how to undo it.

   The force is K q + D q' - k q, held over a period T. Held, it acts T/2 late and shrunk by sin(omega T/2)/(omega T/2). So it is computed from
   the state half a period ahead, which depends on the force itself (a 2 x 2 solve), and divided by that factor. What is left of order
   (omega T)^2 is taken from the sampled loop itself, whose slow dynamics are made exactly isotropic. */

#ifndef HOLD_H
#define HOLD_H

#include "motion.h"

typedef struct {
    double phi[16];   /* 4 x 4: the plant over a period */
    double gamma[8];  /* 4 x 2: its response to a held force */
    double gain[8];   /* 2 x 4: force on the state */
    double mix[4];    /* 2 x 2: force on what is added to the feedback, at mid-hold */
} held_loop;

/* Forms the loop for the plant a [16], b [8] with feedback `rate` [2 x 4] = [K - k, D] by axis, towards the stiffness per mass
   `omega_squared`; the pattern shall turn by -omega_z. Without `compensate` a plain hold. */
void hold_form(held_loop *h, const double *a, const double *b, const double *rate, double omega_squared, double omega_z, double period,
               int compensate);

/* Writes the steady response of the loop to amplitude sin(2 pi frequency (t + lead)) added along `axis` into phasor [8]: state i is
   phasor[2i] sin + phasor[2i + 1] cos of 2 pi frequency t. */
void hold_respond(const held_loop *h, double frequency, int axis, double amplitude, double period, double lead, double *phasor);

/* What such a response is a part of a period later, in the phase of its beginning: phi [16] and gamma [8] are those of the part. A held force makes
   other curves than sines between the instants at which it changes. */
void hold_respond_within(const held_loop *h, const double *phi, const double *gamma, double frequency, int axis, double amplitude, double lead,
                         const double *phasor, double *within);

/* Writes the 4 x 4 matrix that makes of the loop's free motion, between two changes of its force, what an oscillator of angular frequency w [rad/s] would
   be there that is as the loop at the second of them, `rest` [s] later: phi [16] and gamma [8] are those since the first. Held forces bend the motion in
   between, each axis by as much as of its stiffness is cancelled. */
void hold_straighten(const held_loop *h, const double *phi, const double *gamma, double w, double rest, double straight[16]);

#endif
