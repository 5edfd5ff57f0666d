/* Consistent values: for given differential unknowns, the algebraic unknowns and the derivatives with
 * F(t, y, y') = 0, at the start and after events.
 *
 * Newton's method on z = (y_i for algebraic i, y'_i for differential i). Its matrix has the columns dF/dy_i
 * and dF/dy'_i, the latter as the difference of the Jacobian for cj = 1 and cj = 0. Steps are damped by the
 * natural monotonicity test (the next simplified correction must be smaller), which does not depend on how
 * equations are scaled. Source: P. Deuflhard, Newton Methods for Nonlinear Problems, Springer 2004, ch. 3. */
#ifndef GUSTFORM_INITIAL_H
#define GUSTFORM_INITIAL_H

#include "linear.h"
#include "options.h"
#include "system.h"

typedef struct gust_initial {
    gust_system *system;
    const gust_options *options;
    gust_factors factors;
    double *residual;
    double *values;   /* [n_nonzeros] matrix of the Newton step */
    double *values_1; /* [n_nonzeros] Jacobian for cj = 1 */
    double *correction;
    double *next_correction;
    double *weight; /* 1 / tolerance of each z */
    double *trial_y;
    double *trial_yp;
    int64_t iterations;
} gust_initial;

/* Arrays for the system; `symbolic` stays the caller's. Free with gust_initial_free, also after an error. */
gust_status gust_initial_create(gust_initial *initial, gust_system *system, const gust_options *options,
                                klu_symbolic *symbolic, const klu_common *common);
void gust_initial_free(gust_initial *initial);

/* Makes y, yp consistent at t. On an error the message says which equations and unknowns it is about;
 * `thorough` allows it to allocate for that. */
gust_status gust_initial_solve(gust_initial *initial, double t, double *y, double *yp, bool thorough,
                               char *message, size_t size);

/* After a successful solve: fills in the derivatives of the algebraic unknowns, and returns the first step
 * for a BDF of order 1, s, from the second derivatives of the differential unknowns; at most `longest`. */
double gust_initial_step(gust_initial *initial, double t, const double *y, double *yp, double longest);

#endif
