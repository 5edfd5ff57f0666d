/* Newton's method for the equations of one step, as a SUNNonlinearSolver of IDA.
 *
 * It decides as IDA with SUNDIALS' own Newton solver does (when an iteration has converged, when it is given
 * up, when a new Jacobian is tried), but knows our vectors and factors: the first residual is taken at the
 * prediction where it lies, a correction is applied and measured in one loop, and a residual that is not
 * finite is recognised by the correction it leads to. For some 30 unknowns SUNDIALS spends more time on
 * handing vectors from function to function than on the equations. */
#ifndef GUSTFORM_NEWTON_H
#define GUSTFORM_NEWTON_H

#include <stdbool.h>
#include <stdint.h>

#include "linear.h"
#include "sundials_compat.h"

typedef struct gust_newton {
    gust_factors *factors;
    /* F(t, y, y') into r: 0, or negative if it cannot be evaluated at all. Values need not be finite. */
    int (*residual)(double t, N_Vector y, N_Vector yp, N_Vector r, void *user_data);
    /* Whether r, which the last residual wrote, is finite; keeps what is needed to tell why not. */
    bool (*finite)(double t, N_Vector r, void *user_data);
    N_Vector delta; /* A^-1 r */
    SUNNonlinSolLSetupFn setup;
    int most_iterations;
    double setup_cj;    /* of the Jacobian the factors are of, 1/s */
    double last_cj;     /* of the attempt before */
    double contraction; /* rate / (1 - rate) of the convergence, to bound what is left by the last correction */
    long iterations;    /* of the last attempt */
    long failures;
} gust_newton;

/* The solver over `newton`, whose first three members are set and which must outlive it; `like` is a vector
 * of the right length. NULL without memory. Free with SUNNonlinSolFree. */
SUNNonlinearSolver gust_newton_new(gust_newton *newton, N_Vector like, SUNContext context);

#endif
